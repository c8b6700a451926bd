"""The step of a linear filter that all runs share: NumPy's and the compiled one are the same."""

import numpy as np
import pytest

from trackhelpers.ensemble import shared

RNG = np.random.default_rng(11)
N, M, RUNS = 4, 2, 40


def covariance(n):
    A = RNG.normal(size=(n, n))
    return A @ A.T + np.eye(n)


def both(monkeypatch, function, *arguments):
    """What NumPy makes of it, and what is compiled."""
    pytest.importorskip("numba")
    found = []
    for least in (RUNS + 1, RUNS):
        monkeypatch.setattr(shared, "LEAST_RUNS", least)
        found.append(function(*arguments))
    return found


def test_a_compiled_prediction_is_that_of_numpy(monkeypatch):
    F, x = RNG.normal(size=(N, N)), RNG.normal(size=(N, RUNS))
    numpy, compiled = both(monkeypatch, shared.predict, x, covariance(N), F, covariance(N))
    for one, other in zip(numpy, compiled, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.parametrize("layout", ["C", "F"])
def test_a_compiled_correction_is_that_of_numpy(monkeypatch, layout):
    x, z, H = RNG.normal(size=(N, RUNS)), RNG.normal(size=(M, RUNS)), RNG.normal(size=(M, N))
    numpy, compiled = both(monkeypatch, shared.correct, x.copy(layout), covariance(N), z.copy(layout), H, covariance(M))
    for one, other in zip(numpy, compiled, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_an_indefinite_innovation_covariance_is_left_to_numpy(monkeypatch):
    x, z, H, R = np.zeros((N, RUNS)), np.ones((M, RUNS)), np.eye(M, N), np.diag([-5.0, 1.0])
    numpy, compiled = both(monkeypatch, shared.correct, x, np.eye(N), z, H, R)
    for one, other in zip(numpy, compiled, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(numpy[4], np.eye(N, M) @ np.diag([-0.25, 0.5]))

"""The compiled covariance algebra equals NumPy's, also in the last, incomplete block and beside a run that has broken down."""

import numpy as np
import pytest

from trackhelpers import arrays, compiled
from trackhelpers.ensemble import covariance
from trackhelpers.motion import CA, CTRA, CTRV
from trackhelpers.sensors import Lidar, Radar

pytestmark = pytest.mark.skipif(compiled.njit is None, reason="numba is not installed")
M, BROKEN = 2 * compiled.BLOCK + 7, 3


def state_and_covariance(model):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(model.n, model.n, M))
    P = arrays.congruence(A, np.eye(model.n)) + np.eye(model.n)[..., None]
    P[0, 0, BROKEN] = -50.0
    return rng.normal(size=(model.n, M)) + 3, P


def both(monkeypatch, call):
    """Results with the compiled loops and without them."""
    assert compiled.serves(np.empty((2, 2, M)))
    fast = call()
    monkeypatch.setattr(compiled, "serves", lambda P: False)
    with np.errstate(invalid="ignore"):
        return fast, call()


@pytest.mark.parametrize("model", [CTRV(2.0, 0.3), CTRA(1.0, 0.3), CA(0.5)], ids=lambda m: type(m).__name__)
def test_propagation_equals_numpys(monkeypatch, model):
    x, P = state_and_covariance(model)
    _, transition, noise = model.linearised(x, 0.3)
    fast, plain = both(monkeypatch, lambda: covariance.propagate(P, transition, noise))
    np.testing.assert_allclose(fast, plain, atol=1e-11)
    assert np.array_equal(fast, np.swapaxes(fast, 0, 1))


@pytest.mark.parametrize("sensor", [Lidar(), Radar()], ids=lambda s: type(s).__name__)
def test_correction_equals_numpys_and_only_the_broken_run_is_nan(monkeypatch, sensor):
    x, P = state_and_covariance(CTRV())
    fast, plain = both(monkeypatch, lambda: covariance.correct(P, sensor.entries(x), sensor.R))
    for a, b in zip(fast, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(fast[2]).any(axis=(0, 1))), [BROKEN])


def test_mahalanobis_equals_numpys(monkeypatch):
    x, P = state_and_covariance(CTRV())
    fast, plain = both(monkeypatch, lambda: arrays.mahalanobis(x, P))
    np.testing.assert_allclose(fast, plain, rtol=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(fast)), [BROKEN])

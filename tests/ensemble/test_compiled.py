"""The compiled covariance algebra equals NumPy's, also in the last, incomplete block and beside a run that has broken down."""

import numpy as np
import pytest

from trackhelpers import arrays, compiled
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, covariance
from trackhelpers.motion import CA, CTRA, CTRV, CV
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
    fast, plain = both(monkeypatch, lambda: covariance.correct(P, sensor.linearised(x)[1], sensor.R))
    for a, b in zip(fast, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(fast[2]).any(axis=(0, 1))), [BROKEN])


def test_mahalanobis_equals_numpys(monkeypatch):
    x, P = state_and_covariance(CTRV())
    fast, plain = both(monkeypatch, lambda: arrays.mahalanobis(x, P))
    np.testing.assert_allclose(fast, plain, rtol=1e-9)
    assert np.array_equal(np.flatnonzero(np.isnan(fast)), [BROKEN])


def test_a_run_that_breaks_down_leaves_its_neighbours_bit_for_bit():
    model, rng = CTRV(2.0, 0.3), np.random.default_rng(1)
    x0, zs = rng.normal(size=(5, M)) + 3, rng.normal(size=(4, 3, M)) + 3
    clean, spoilt = (EnsembleEKF(model, x0, np.eye(5)) for _ in range(2))
    spoilt.P[0, 0, BROKEN] = -50.0
    for z in zs:
        for ens in (clean, spoilt):
            ens.predict(0.05)
            ens.update(z, Radar())
    others = np.arange(M) != BROKEN
    assert np.array_equal(np.flatnonzero(spoilt.failed), [BROKEN])
    assert np.array_equal(spoilt.x[:, others], clean.x[:, others]) and np.array_equal(spoilt.P[..., others], clean.P[..., others])


@pytest.mark.parametrize("runs", [compiled.LEAST_RUNS, M])
def test_a_run_does_not_depend_on_how_many_stand_beside_it(runs):
    x, P = state_and_covariance(CTRV())
    entries = Radar().linearised(x)[1]
    whole = covariance.correct(P, entries, Radar().R)
    part = covariance.correct(P[..., :runs], {place: value[:runs] for place, value in entries.items()}, Radar().R)
    for a, b in zip(whole, part, strict=True):
        assert np.array_equal(a[..., :runs], b, equal_nan=True)


def test_a_step_of_a_linear_filter_equals_numpys(monkeypatch):
    model, rng = CV(0.5), np.random.default_rng(2)
    x0, zs, sensor = rng.normal(size=(4, M)), rng.normal(size=(20, 2, M)), Lidar(state=model.state)

    def run():
        ens = EnsembleKF(model, x0, np.eye(4))
        for z in zs:
            ens.predict(0.1)
            ens.update(z, sensor)
        return ens.x, ens.P, ens.y, ens.S, ens.K

    for a, b in zip(*both(monkeypatch, run), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-13)


def test_a_linear_filter_whose_innovation_covariance_is_singular_turns_nan(monkeypatch):
    model = CV(0.5)

    def run():
        ens = EnsembleKF(model, np.zeros((4, M)), np.zeros((4, 4)))
        ens.update(np.ones((2, M)), Lidar(0.0, model.state))
        return ens.failed

    fast, plain = both(monkeypatch, run)
    assert fast.all() and plain.all()

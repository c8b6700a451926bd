import warnings

import numpy as np
import pytest

from trackhelpers.angles import residual
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, EnsembleUKF, exact_error, unscented_compiled
from trackhelpers.filters import MotionEKF, MotionKF, MotionUKF
from trackhelpers.motion import CA, CCA, CSAV, CTRA, CTRV, CV
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, Position, Radar

M, STEPS = 3, 500
RNGS = [np.random.default_rng(child) for child in np.random.SeedSequence(1).spawn(M)]
ZS = lidar_radar.measurements(RNGS)


def start(model):
    """A sensible estimate of the first point, heading and speed, in the model's own components."""
    x0 = np.zeros((model.n, M))
    known = {"x": ZS[0][0], "y": ZS[0][1], "v": 5.0, "θ": 0.7, "vx": 3.6, "vy": 3.6}
    for i, name in enumerate(model.state):
        x0[i] = known.get(name, 0)
    return x0


def largest_difference(model, Ensemble, Single, sensors):
    P0 = 0.1 * np.eye(model.n)
    x0 = start(model)
    ensemble, singles = Ensemble(model, x0, P0), {i: Single(model, x0[:, i], P0) for i in (0, M - 1)}
    worst = 0.0
    for k in range(1, STEPS + 1):
        sensor = sensors[(k - 1) % 2]
        mask = np.ones(M, dtype=bool)
        mask[k % M] = k % 7 != 0  # now this run misses one, now that
        z = ZS[k - 1] if sensor.m == len(ZS[k - 1]) else lidar_radar.truth()[:2, k - 1 : k] + 0.1 * ZS[k - 1][:2]
        ensemble.predict(lidar_radar.T)
        ensemble.update(z, sensor, mask=mask)
        for i, kf in singles.items():
            kf.predict(lidar_radar.T)
            kf.update(z[:, i] if mask[i] else None, sensor)
            worst = max(worst, np.abs(residual(ensemble.x[:, i], kf.x, model.angles)).max(), np.abs(ensemble.P[..., i] - kf.P).max())
    assert not ensemble.failed.any()
    return worst


@pytest.mark.parametrize("Ensemble, Single", [(EnsembleEKF, MotionEKF), (EnsembleUKF, MotionUKF)])
@pytest.mark.parametrize(
    "model",
    [
        CTRV(2.0, 0.3),
        CTRV(2.0, 0.3, noise="exact"),
        CTRA(1.0, 0.3),
        CV(2.0),
        CA(1.0),
        CSAV(2.7, 2.0, 0.3),
        CCA(1.0, 0.05),
        CTRV(Q=0.01 * np.eye(5)),
    ],
    ids=lambda m: f"{type(m).__name__}-{m.noise}-{m._constant is None}",
)
def test_ensemble_equals_filterpys_subclass_over_500_steps(model, Ensemble, Single):
    assert largest_difference(model, Ensemble, Single, (Lidar(state=model.state), Radar(state=model.state))) < 1e-9


@pytest.mark.parametrize("model", [CV(2.0), CA(1.0)], ids=lambda m: type(m).__name__)
def test_linear_ensemble_equals_filterpys_kalman_filter(model):
    sensors = Lidar(0.15, model.state), Position(0.4, model.state)
    assert largest_difference(model, EnsembleKF, MotionKF, sensors) < 1e-9


def test_gain_is_computed_once_until_a_run_misses_a_measurement():
    model = CV(2.0)
    ens = EnsembleKF(model, start(model), np.eye(4))
    ens.predict(0.1)
    ens.update(ZS[0], Lidar(state=model.state))
    assert ens._P.ndim == 2 and ens.P.shape == (4, 4, M) and ens.K.shape == (4, 2, M)
    ens.update(ZS[0], Lidar(state=model.state), mask=np.arange(M) > 0)
    assert ens._P.ndim == 3
    assert np.isnan(ens.y[:, 0]).all() and np.isfinite(ens.y[:, 1:]).all()
    assert (ens.P[0, 0, 0] > ens.P[0, 0, 1:]).all()


@pytest.mark.parametrize("runs", [M, 40])  # with NumPy, and compiled where numba is there
def test_what_a_linear_filter_keeps_follows_a_changed_step_sensor_model_and_covariance(runs):
    model, other = CV(2.0), CV(0.3)
    sensors = Lidar(0.15, model.state), Position((0.4, 0.1), model.state)
    rng, x0 = np.random.default_rng(3), np.zeros((4, runs))
    kept, single = EnsembleKF(model, x0, np.eye(4)), MotionKF(model, x0[:, 0], np.eye(4))

    def step(dt, sensor):
        z = rng.normal(size=(2, runs))
        for kf, seen in ((kept, z), (single, z[:, 0])):
            kf.predict(dt)
            kf.update(seen, sensor)
        for name in ("x", "P", "y", "S", "K"):
            np.testing.assert_allclose(getattr(kept, name)[..., 0], getattr(single, name), atol=1e-12, err_msg=name)

    for dt, sensor in ((0.1, sensors[0]), (0.1, sensors[1]), (0.3, sensors[1]), (0.0, sensors[0])):
        step(dt, sensor)
    kept.model = single.model = other
    step(0.3, sensors[0])
    kept.P = single.P = 5 * np.eye(4)  # one for all again
    step(0.3, sensors[0])
    assert kept._P.ndim == 2
    kept.P, single.P = np.repeat(2 * np.eye(4)[..., None], runs, axis=2), 2 * np.eye(4)
    step(0.3, sensors[1])
    assert kept.P.shape == (4, 4, runs)
    with pytest.raises(ValueError, match="read-only"):
        EnsembleKF(model, x0, np.eye(4)).P[0, 0, 0] = 1


@pytest.mark.parametrize("Ensemble", [EnsembleEKF, EnsembleUKF])
def test_a_run_that_breaks_down_is_named_and_leaves_its_neighbours_bit_for_bit(Ensemble):
    model = CTRV(2.0, 0.3)
    clean, spoilt = (Ensemble(model, start(model), np.eye(5)) for _ in range(2))
    spoilt.P[0, 0, 2] = -5.0
    for k in range(1, 20):
        for ens in (clean, spoilt):
            ens.predict(0.05)
            ens.update(ZS[k - 1], Lidar() if k % 2 else Radar())
    assert np.array_equal(np.flatnonzero(spoilt.failed), [2]) and not clean.failed.any()
    others = np.arange(M) != 2
    assert np.array_equal(spoilt.x[:, others], clean.x[:, others]) and np.array_equal(spoilt.P[..., others], clean.P[..., others])


def test_covariance_stays_symmetric_and_positive_over_many_extreme_steps():
    model = CTRV(1e-3, 1e-3)
    ens = EnsembleEKF(model, start(model), 1e8 * np.eye(5))
    sharp = Lidar(1e-4)
    for k in range(1, 3001):
        ens.predict(0.05)
        ens.update(np.tile(lidar_radar.truth()[:2, [min(k, 500) - 1]], M), sharp)
        assert np.array_equal(ens.P, np.swapaxes(ens.P, 0, 1))
    assert np.linalg.eigvalsh(np.moveaxis(ens.P, -1, 0)).min() > 0


def test_sampled_error_agrees_with_the_exact_recursion():
    model, T, runs = CV(0.2), 0.5, 4000
    sensor = Position(2.0, model.state)
    t = T * np.arange(60)
    truth = np.stack([5 * t, 0 * t + 5, 0.1 * t**2, 0.2 * t])  # y accelerates: the model is wrong, the filter lags
    bias, covariance, believed = exact_error(model, sensor, truth, T, truth[:, 0], np.eye(4))
    rng = np.random.default_rng(0)
    ens = EnsembleKF(model, np.repeat(truth[:, :1], runs, axis=1), np.eye(4))
    for k in range(1, 60):
        ens.predict(T)
        ens.update(truth[[0, 2], k : k + 1] + 2.0 * rng.standard_normal((2, runs)), sensor)
    error = ens.x - truth[:, -1:]
    deviation = np.sqrt(np.diag(covariance[..., -1]))
    assert np.all(np.abs(error.mean(axis=1) - bias[:, -1]) < 4 * deviation / np.sqrt(runs))
    np.testing.assert_allclose(np.cov(error), covariance[..., -1], atol=0.08 * deviation.max() ** 2)
    np.testing.assert_allclose(ens.P[..., 0], believed[..., -1], atol=1e-12)
    assert abs(bias[2, -1]) > 10 * deviation[2] / np.sqrt(runs)  # the lag is there to be seen


BAD = [
    (lambda e: e.predict(-1), "dt"),
    (lambda e: e.update(np.zeros((2, M + 1)), Lidar()), "z"),
    (lambda e: e.update(np.full((2, M), np.nan), Lidar()), "z"),
    (lambda e: e.update(np.zeros((2, M)), Lidar(), mask=np.ones(M)), "mask"),
    (lambda e: e.update(np.zeros((2, M)), Lidar(), mask=np.ones(M + 1, dtype=bool)), "mask"),
    (lambda e: e.update(np.zeros((2, M)), Lidar(state=CTRA().state)), "sensor"),
    (lambda e: e.update(np.zeros((2, M)), None), "sensor"),
]


@pytest.mark.parametrize("Ensemble", [EnsembleEKF, EnsembleUKF])
@pytest.mark.parametrize(("call", "name"), BAD)
def test_bad_input_raises_and_leaves_the_ensemble_as_it_was(Ensemble, call, name):
    ens = Ensemble(CTRV(2.0, 0.3), start(CTRV()), np.eye(5))
    x, P = ens.x.copy(), ens.P.copy()
    with pytest.raises(ValueError, match=name):
        call(ens)
    assert np.array_equal(ens.x, x) and np.array_equal(ens.P, P)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: EnsembleEKF(CTRV(), np.zeros(5), np.eye(5)), "x0"),
        (lambda: EnsembleEKF(CTRV(), np.full((5, 2), np.nan), np.eye(5)), "x0"),
        (lambda: EnsembleEKF(CTRV(), np.zeros((5, 2)), np.eye(4)), "P0"),
        (lambda: EnsembleEKF(CTRV(), np.zeros((5, 2)), -np.eye(5)), "P0"),
        (lambda: EnsembleKF(CTRV(), np.zeros((5, 2)), np.eye(5)), "model"),
        (lambda: EnsembleUKF(CTRV(), np.zeros((5, 2)), np.eye(5), alpha=0), "alpha"),
    ],
)
def test_bad_start_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_a_masked_nan_is_no_measurement():
    ens = EnsembleEKF(CTRV(2.0, 0.3), start(CTRV()), np.eye(5))
    z = np.zeros((2, M))
    z[:, 0] = np.nan
    ens.update(z, Lidar(), mask=np.arange(M) > 0)
    assert np.isfinite(ens.x).all()
    ens.update(None, Lidar())
    assert ens.y.shape == (0, M)


@pytest.mark.parametrize("noise", ["straight", "continuous"])
def test_the_unscented_prediction_of_a_linear_model_is_that_of_its_sigma_points(noise):
    rng, model = np.random.default_rng(4), CV(0.5, noise=noise)
    A = rng.normal(size=(4, 4))
    ens = EnsembleUKF(model, rng.normal(size=(4, 40)), A @ A.T)
    x, P = ens._transformed(0.7)
    ens.predict(0.7)
    np.testing.assert_allclose(ens.x, x, atol=1e-13)
    np.testing.assert_allclose(ens.P, P, atol=1e-13)


@pytest.mark.parametrize("sensor", [Lidar(0.15), Radar((0.3, 0.03, 0.3))])
@pytest.mark.parametrize("alpha", [1.0, 0.4])
def test_the_unscented_filter_is_the_same_compiled_or_not(monkeypatch, sensor, alpha):
    """The bearings lie about ±π, so that most of their differences have to go the short way round; one run's covariance is spoilt."""
    model, rng = CTRV(2.0, 0.3), np.random.default_rng(8)
    x0 = np.array([-30.0, 0.0, 5.0, 0.3, 0.1])[:, None] + 0.1 * rng.standard_normal((5, 40))
    zs = sensor.h(x0) + np.sqrt(sensor.R) @ rng.standard_normal((30, sensor.m, 40))

    def run():
        ens = EnsembleUKF(model, x0, np.eye(5), alpha=alpha)
        ens.P = np.where(np.arange(40) == 7, -1.0, 1.0) * ens.P
        for z in zs:
            ens.predict(0.05)
            ens.update(z, sensor)
        return ens

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        compiled = run()
        monkeypatch.setattr(unscented_compiled, "binding", None)
        plain = run()
    for name in ("x", "P", "S", "K"):
        np.testing.assert_allclose(getattr(compiled, name), getattr(plain, name), rtol=1e-9, atol=1e-11, err_msg=name)
    assert np.flatnonzero(compiled.failed).tolist() == [7]

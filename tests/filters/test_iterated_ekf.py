"""The iterated EKF is Gauss–Newton on the posterior density, for one target and for an ensemble, and one iteration is the EKF."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.optimize import least_squares

from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.filters import MotionEKF, MotionKF
from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import Lidar, Position, Radar, RangeBearing

MODEL = CV(0.5)
SENSOR = RangeBearing((0.3, 0.01), state=MODEL.state)
X0, P0 = np.array([40.0, 1.0, 30.0, -1.0]), np.diag([80.0, 2.0, 120.0, 2.0]) + 1.5
TRUTH = np.array([52.0, 1.5, 20.0, -0.5])


def cost(x, z, sensor, x0=X0, P0=P0):
    """Whitened deviations from the prior and from the measurement."""
    return np.concatenate(
        [np.linalg.solve(np.linalg.cholesky(C), d) for C, d in ((P0, x - x0), (sensor.R, sensor.residual(z, sensor.h(x))))]
    )


def test_many_iterations_end_at_the_mode_of_the_posterior():
    z = SENSOR.h(TRUTH)
    mode = least_squares(cost, X0, args=(z, SENSOR), xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    errors = []
    for iterations in (1, 2, 3, 20):
        kf = MotionEKF(MODEL, X0, P0, iterations=iterations)
        kf.update(z, SENSOR)
        errors.append(np.abs(kf.x - mode).max())
    assert errors[0] > 0.5 and errors[0] > errors[1] > errors[2] > errors[3] and errors[3] < 1e-6
    H = SENSOR.H(mode)  # and the covariance is that of the last linearisation
    np.testing.assert_allclose(kf.P, np.linalg.inv(np.linalg.inv(P0) + H.T @ np.linalg.inv(SENSOR.R) @ H), rtol=1e-4, atol=1e-7)


def test_the_recursion_is_the_printed_one():
    z, x = SENSOR.h(TRUTH), X0
    for _ in range(3):
        H = SENSOR.H(x)
        K = P0 @ H.T @ np.linalg.inv(H @ P0 @ H.T + SENSOR.R)
        y = SENSOR.residual(z, SENSOR.h(x)) - H @ (X0 - x)
        x = X0 + K @ y
    kf = MotionEKF(MODEL, X0, P0, iterations=3)
    kf.update(z, SENSOR)
    np.testing.assert_allclose(kf.x, x, rtol=1e-12)
    np.testing.assert_allclose(kf.y, y, rtol=1e-12)
    np.testing.assert_allclose(kf.K, K, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(kf.P, (np.eye(4) - K @ H) @ P0, rtol=1e-9, atol=1e-9)


def scene(steps=40):
    rng, model, x = np.random.default_rng(6), CTRV(2.0, 0.3), np.array([4.0, 3.0, 5.0, 2.9, 0.6])
    for k in range(steps):
        x = model.f(x, 0.1)
        sensor = Radar(position=(8.0, 4.0)) if k % 2 else Lidar()
        yield sensor, sensor.h(x) + np.sqrt(np.diag(sensor.R)) * rng.standard_normal(sensor.m)


def test_one_iteration_is_filterpys_update_bit_for_bit():
    kf, plain = MotionEKF(CTRV(2.0, 0.3), [3.0, 4.0, 4.0, 2.5, 0.0], np.eye(5)), ExtendedKalmanFilter(5, 2)
    for sensor, z in scene():
        kf.predict(0.1)
        plain.x, plain.P, plain.R = kf.x.copy(), kf.P.copy(), sensor.R
        plain.update(z, sensor.H, sensor.h, residual=sensor.residual)
        kf.update(z, sensor)
        np.testing.assert_array_equal(kf.x, kf.model.normalise(plain.x))
        np.testing.assert_array_equal(kf.P, plain.P)


@pytest.mark.parametrize("runs", [3, 64])
@pytest.mark.parametrize("iterations", [1, 2, 5])
def test_an_ensemble_is_the_single_filter_run_by_run(iterations, runs):
    """The heading and the bearing go across the cut; some runs miss some scans; another R now and then."""
    rng = np.random.default_rng(7)
    starts = np.array([4.0, 3.0, 5.0, 2.9, 0.6])[:, None] + 0.3 * rng.standard_normal((5, runs))
    ens = EnsembleEKF(CTRV(2.0, 0.3), starts, 0.3 * np.eye(5), iterations=iterations)
    singles = [MotionEKF(CTRV(2.0, 0.3), x0, 0.3 * np.eye(5), iterations=iterations) for x0 in starts.T]
    for k, (sensor, z) in enumerate(scene()):
        zs = z[:, None] + 0.05 * rng.standard_normal((sensor.m, runs))
        mask = rng.random(runs) < 0.7 if k % 3 == 0 else None
        R = 2 * sensor.R if k % 5 == 0 else None
        ens.predict(0.1)
        ens.update(zs, sensor, mask=mask, R=R)
        for r, kf in enumerate(singles):
            kf.predict(0.1)
            kf.update(zs[:, r] if mask is None or mask[r] else None, sensor, R=R)
    np.testing.assert_allclose(ens.x, np.stack([kf.x for kf in singles], axis=1), atol=1e-8)
    np.testing.assert_allclose(ens.P, np.stack([kf.P for kf in singles], axis=2), atol=1e-8)
    for r, kf in enumerate(singles):
        if kf.y.size:
            np.testing.assert_allclose(ens.y[:, r], kf.y, atol=1e-8)


def test_with_a_linear_sensor_iterating_changes_nothing():
    sensor = Position(0.3, MODEL.state)
    kf, other = MotionKF(MODEL, X0, P0), MotionEKF(MODEL, X0, P0, iterations=5)
    for each in (kf, other):
        each.update([50.0, 20.0], sensor)
    np.testing.assert_allclose(other.x, kf.x, rtol=1e-12)
    np.testing.assert_allclose(other.P, kf.P, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("iterations", [0, -1, 1.5, True, None, "two"])
def test_a_number_of_iterations_that_is_none_is_named(iterations):
    for make in (lambda: MotionEKF(MODEL, X0, P0, iterations=iterations), lambda: EnsembleEKF(MODEL, X0[:, None], P0, iterations)):
        with pytest.raises(ValueError, match="iterations"):
            make()


def test_a_singular_S_is_refused_and_changes_nothing():
    kf = MotionEKF(MODEL, X0, np.zeros((4, 4)), iterations=3)
    before = dict(kf.__dict__)
    with pytest.raises(ValueError, match="S: expected a positive definite"):
        kf.update([50.0, 20.0], SENSOR, R=np.zeros((2, 2)))
    assert all(kf.__dict__[name] is value for name, value in before.items())

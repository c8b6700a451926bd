import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter, UnscentedKalmanFilter

from trackhelpers.angles import wrap
from trackhelpers.filters import MotionEKF, MotionKF, MotionUKF
from trackhelpers.motion import CA, CTRA, CTRV, CV
from trackhelpers.sensors import Lidar, Position, Radar

x0, P0 = np.array([0.6, 0.6, 5.0, 0.7, 0.3]), np.diag([0.1, 0.1, 1.0, 0.2, 0.1])


def test_the_filters_are_filterpys():
    assert issubclass(MotionKF, KalmanFilter)
    assert issubclass(MotionEKF, ExtendedKalmanFilter)
    assert issubclass(MotionUKF, UnscentedKalmanFilter)


def test_ekf_step_equals_the_textbook_with_jacobian_at_the_old_state():
    model, lidar = CTRV(2.0, 0.3), Lidar()
    ekf = MotionEKF(model, x0, P0)
    ekf.predict(0.1)
    F = model.F(x0, 0.1)
    np.testing.assert_allclose(ekf.x, model.f(x0, 0.1))  # not F @ x, which filterpy would take
    P = F @ P0 @ F.T + model.Q(x0, 0.1)
    np.testing.assert_allclose(ekf.P, P)
    z = np.array([1.3, 1.0])
    H = lidar.H(ekf.x)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + lidar.R)
    expected = ekf.x + K @ (z - ekf.x[:2])
    ekf.update(z, lidar)
    np.testing.assert_allclose(ekf.x, expected)
    np.testing.assert_allclose(ekf.P, (np.eye(5) - K @ H) @ P, atol=1e-12)


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
def test_linear_case_equals_the_kalman_filter(Filter):
    model = CV(0.5)
    sensor = Position(0.3, model.state)
    one, other = MotionKF(model, np.zeros(4), np.eye(4)), Filter(model, np.zeros(4), np.eye(4))
    for z in np.random.default_rng(0).normal(size=(50, 2)):
        for kf in (one, other):
            kf.predict(0.2)
            kf.update(z, sensor)
    np.testing.assert_allclose(other.x, one.x, atol=1e-12)
    np.testing.assert_allclose(other.P, one.P, atol=1e-12)


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
def test_heading_across_the_cut_equals_the_same_track_turned(Filter):
    """Turning the whole scene by half a turn turns the estimate and changes nothing else."""
    base = np.array([0.6, 0.6, 5.0, -0.5, 0.3])
    spin = -np.eye(2)
    big = np.diag([-1.0, -1, 1, 1, 1])
    straight, turned = Filter(CTRV(2.0, 0.3), base, P0), Filter(CTRV(2.0, 0.3), big @ base + [0, 0, 0, np.pi, 0], big @ P0 @ big.T)
    for k in range(1, 60):
        z = CTRV().f(base, 0.1 * k)[:2] + 0.05 * np.sin([k, 2 * k])
        for kf, seen in ((straight, z), (turned, spin @ z)):
            kf.predict(0.1)
            kf.update(seen, Lidar())
    np.testing.assert_allclose(spin @ straight.x[:2], turned.x[:2], atol=1e-9)
    np.testing.assert_allclose(wrap(straight.x[3] + np.pi - turned.x[3]), 0, atol=1e-9)
    assert -np.pi <= turned.x[3] < 0 < straight.x[3]  # it did cross


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
def test_a_missing_measurement_predicts_only_and_leaves_no_stale_innovation(Filter):
    kf = Filter(CTRV(2.0, 0.3), x0, P0)
    kf.predict(0.1)
    kf.update([1.0, 1.0], Lidar())
    kf.predict(0.1)
    x, P = kf.x.copy(), kf.P.copy()
    kf.update(None, Lidar())
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P) and np.array_equal(kf.x_post, x)
    assert kf.y.size == 0 and kf.S.size == 0


def test_filterpys_own_ekf_leaves_the_old_innovation_after_none():
    """The trap the test above guards against is still there."""
    ekf = ExtendedKalmanFilter(1, 1)
    ekf.x = np.zeros(1)
    ekf.update(np.array([2.0]), lambda x: np.eye(1), lambda x: x)
    ekf.update(None, lambda x: np.eye(1), lambda x: x)
    assert ekf.y[0] == 2.0


def test_filterpys_default_ekf_state_broadcasts_with_a_vector_measurement():
    ekf = ExtendedKalmanFilter(2, 2)
    ekf.update(np.array([1.0, 2.0]), lambda x: np.eye(2), lambda x: x)
    assert ekf.x.shape == (2, 2)  # why ours keeps x as a vector
    assert MotionEKF(CTRV(), x0, P0).x.shape == (5,)


def test_two_sensors_at_one_instant_redraw_the_sigma_points():
    """Two updates after one prediction equal one update by both sensors stacked, for linear sensors."""
    model = CV(0.5)
    a, b = Position(0.3, model.state), Position(0.4, model.state)
    kf, ukf = MotionKF(model, np.zeros(4), np.eye(4)), MotionUKF(model, np.zeros(4), np.eye(4))
    for f in (kf, ukf):
        f.predict(0.5)
        f.update([1.0, 2.0], a)
        f.predict(0.0)
        f.update([1.5, 1.0], b)
    ukf2 = MotionUKF(model, np.zeros(4), np.eye(4))
    ukf2.predict(0.5)
    ukf2.update([1.0, 2.0], a)
    ukf2.update([1.5, 1.0], b)
    np.testing.assert_allclose(ukf2.x, kf.x, atol=1e-12)
    np.testing.assert_allclose(ukf2.P, kf.P, atol=1e-12)
    np.testing.assert_allclose(ukf.P, kf.P, atol=1e-12)


def test_ukf_starts_from_a_zero_covariance():
    ukf = MotionUKF(CTRV(2.0, 0.3), x0, np.zeros((5, 5)))
    ukf.predict(0.1)
    ukf.update([1.0, 1.0], Lidar())
    assert np.isfinite(ukf.x).all() and np.linalg.eigvalsh(ukf.P)[0] > -1e-12


def test_predict_update_of_filterpy_is_closed():
    with pytest.raises(NotImplementedError, match="predict"):
        MotionEKF(CTRV(), x0, P0).predict_update([0, 0], None, None)


def test_sensors_of_different_size_take_turns_and_the_likelihood_follows():
    ekf = MotionEKF(CTRV(2.0, 0.3), x0, P0)
    for k in range(6):
        ekf.predict(0.05)
        sensor = Radar() if k % 2 else Lidar()
        ekf.update(sensor.h(ekf.x), sensor)
        assert ekf.y.shape == (sensor.m,) and ekf.S.shape == (sensor.m, sensor.m) and ekf.K.shape == (5, sensor.m)
        assert np.isfinite(ekf.log_likelihood) and ekf.mahalanobis == pytest.approx(0, abs=1e-9)


BAD = [
    (lambda kf: kf.predict(-0.1), "dt"),
    (lambda kf: kf.predict(np.nan), "dt"),
    (lambda kf: kf.update([1.0, np.nan], Lidar()), "z"),
    (lambda kf: kf.update([1.0, 2.0, 3.0], Lidar()), "z"),
    (lambda kf: kf.update([1.0, 2.0], "lidar"), "sensor"),
    (lambda kf: kf.update([1.0, 2.0], Lidar(state=CTRA().state)), "sensor"),
]


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
@pytest.mark.parametrize(("call", "name"), BAD)
def test_bad_input_raises_and_leaves_the_filter_as_it_was(Filter, call, name):
    kf = Filter(CTRV(2.0, 0.3), x0, P0)
    kf.predict(0.1)
    kf.update([1.0, 1.0], Lidar())
    before = {key: np.copy(getattr(kf, key)) for key in ("x", "P", "K", "y", "S", "R", "Q", "x_prior", "P_prior")}
    with pytest.raises(ValueError, match=name):
        call(kf)
    for key, value in before.items():
        assert np.array_equal(getattr(kf, key), value), key


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: MotionKF(CTRV(), x0, P0), "model"),
        (lambda: MotionEKF(CTRV(), x0[:4], P0), "x0"),
        (lambda: MotionEKF(CTRV(), x0 * np.nan, P0), "x0"),
        (lambda: MotionEKF(CTRV(), x0, -P0), "P0"),
        (lambda: MotionUKF(CTRV(), x0, np.eye(5) + np.eye(5, k=1)), "P0"),
        (lambda: MotionUKF(CTRV(), x0, P0, kappa=-5), "kappa"),
    ],
)
def test_bad_start_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_linear_filter_refuses_a_nonlinear_sensor():
    model = CV(0.5)
    kf = MotionKF(model, np.ones(4), np.eye(4))
    with pytest.raises(ValueError, match="sensor"):
        kf.update([1, 0, 0], Radar(state=model.state))


def test_scalar_measurements_are_taken():
    kf = MotionKF(CA(1.0, axes=1), np.zeros(3), np.zeros((3, 3)))
    kf.predict(0.1)
    kf.update(3.0, Position(0.5, kf.model.state))
    assert kf.y.shape == (1,)

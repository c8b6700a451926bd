"""What every filter on a model has in common with a Kalman filter, and with itself in another order."""

import numpy as np
import pytest

from trackhelpers.filters import MotionEKF, MotionKF, MotionSquareRootUKF, MotionUKF
from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import LinearSensor, Radar

FILTERS = [MotionKF, MotionEKF, MotionUKF, MotionSquareRootUKF]
X0, P0 = [1.0, 2.0, -1.0, 0.5], np.diag([4.0, 1.0, 9.0, 2.0]) + 0.3


def sensor(*rows):
    """Of the rows of one measurement with independent noises."""
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0.5]])
    return LinearSensor(H[list(rows)], np.diag(np.array([1.0, 2.0, 0.5])[list(rows)]), CV(1.0).state)


@pytest.mark.parametrize("Filter", FILTERS)
def test_a_linear_step_is_the_kalman_filters_in_terms_of_information(Filter):
    model, seen, z = CV(0.7), sensor(0, 1, 2), np.array([2.0, -1.0, 0.3])
    kf = Filter(model, X0, P0)
    kf.predict(0.8)
    F, Q = model.F(np.array(X0), 0.8), model.Q(np.array(X0), 0.8)
    prior, H, weight = F @ P0 @ F.T + Q, seen.H(np.zeros(4)), np.linalg.inv(seen.R)
    np.testing.assert_allclose(kf.P, prior, rtol=1e-12, atol=1e-12)
    kf.update(z, seen)
    information = np.linalg.inv(prior) + H.T @ weight @ H
    np.testing.assert_allclose(np.linalg.inv(kf.P), information, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(information @ kf.x, np.linalg.solve(prior, F @ X0) + H.T @ weight @ z, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(kf.K, kf.P @ H.T @ weight, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("Filter", FILTERS)
def test_measurements_one_after_the_other_are_one_of_all(Filter):
    z, whole, parts = np.array([2.0, -1.0, 0.3]), Filter(CV(0.7), X0, P0), Filter(CV(0.7), X0, P0)
    for kf in (whole, parts):
        kf.predict(0.8)
    whole.update(z, sensor(0, 1, 2))
    for i in (2, 0, 1):
        parts.update(z[[i]], sensor(i))
    np.testing.assert_allclose(parts.x, whole.x, rtol=1e-10)
    np.testing.assert_allclose(parts.P, whole.P, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("Filter", FILTERS)
def test_after_no_measurement_nothing_of_one_is_left(Filter):
    kf = Filter(CV(0.7), X0, P0)
    kf.predict(0.8)
    kf.update([2.0, -1.0], sensor(0, 1))
    assert kf.K.shape == (4, 2) and kf.y.shape == (2,) and kf.S.shape == (2, 2)
    kf.predict(0.8)
    kf.update(None)
    assert kf.K.shape == (4, 0) and kf.y.shape == (0,) and kf.S.shape == kf.SI.shape == (0, 0) and kf.z is None
    assert kf.log_likelihood == 0 and kf.likelihood == 1 and kf.mahalanobis == 0
    assert np.array_equal(kf.x_post, kf.x) and np.array_equal(kf.P_post, kf.P) and kf.x_post is not kf.x


@pytest.mark.parametrize("Filter", FILTERS[1:])
def test_a_covariance_stays_symmetric_and_positive_over_a_turn(Filter):
    kf, radar = Filter(CTRV(1.0, 0.2), [30.0, 20.0, 4.0, 0.5, 0.3], np.diag([1.0, 1, 1, 0.1, 0.1])), Radar()
    for k in range(30):
        kf.predict(0.2)
        np.testing.assert_allclose(kf.P, kf.P.T, rtol=0, atol=1e-13 * np.abs(kf.P).max())
        kf.update(radar.h(kf.x) + np.array([0.1, 0.01 * (-1) ** k, -0.1]), radar)
        np.testing.assert_allclose(kf.P, kf.P.T, rtol=0, atol=1e-13 * np.abs(kf.P).max())
        assert np.linalg.eigvalsh(kf.P)[0] > 0


def test_what_is_not_named_is_what_is_documented():
    start = CTRV(1.0, 0.2), [30.0, 20.0, 4.0, 0.5, 0.3], np.diag([1.0, 1, 1, 0.1, 0.1])
    pairs = [
        (MotionEKF(*start), MotionEKF(*start, iterations=1)),
        (MotionUKF(*start), MotionUKF(*start, alpha=1.0, beta=2.0, kappa=0.0)),
        (MotionSquareRootUKF(*start), MotionSquareRootUKF(*start, alpha=1.0, beta=2.0, kappa=0.0, form="qr")),
    ]
    for left, named in pairs:
        for kf in (left, named):
            kf.predict(0.5)
            kf.update([40.0, 0.6, 3.0], Radar(sigma=(0.3, 0.03, 0.3)) if kf is named else Radar())
        assert np.array_equal(left.x, named.x) and np.array_equal(left.P, named.P)

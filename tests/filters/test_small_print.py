"""What no track shows: starts, scales and declarations of the filters."""

import numpy as np
import pytest

from trackhelpers.filters import MotionKF, MotionUKF, StrongTrackingKF
from trackhelpers.filters.motion_ukf import check_sigma_points
from trackhelpers.model import Model
from trackhelpers.motion import CV
from trackhelpers.sensors import LinearSensor

F, H = CV(1.0).F(np.zeros(4), 1.0), np.eye(4)[[0, 2]]


class Swing(Model):
    """A pendulum's angle that a model without motion keeps, beyond π where it is pushed."""

    state, angles, linear = ("θ", "rate"), (0,), True

    def _f(self, x, dt, parts):
        return x[0] + dt * x[1], x[1]

    def _F(self, x, dt, parts):
        return {(0, 1): dt}


def test_a_linear_filter_keeps_its_angles_and_those_of_its_prediction_within_half_a_turn():
    kf = MotionKF(Swing(Q=np.eye(2)), [3.0, 1.0], np.eye(2))
    kf.predict(0.5)
    assert kf.x[0] == pytest.approx(3.5 - 2 * np.pi) and kf.x_prior[0] == pytest.approx(3.5 - 2 * np.pi)
    kf.update([3.5 - 2 * np.pi], LinearSensor([[1, 0]], [[1.0]], Swing.state))
    assert abs(kf.y[0]) < 1e-12


def test_the_spread_of_sigma_points_is_alpha_squared_times_n_plus_kappa():
    assert check_sigma_points(5, 0.1, 2.0, 1.0) == pytest.approx(0.06)
    kf = MotionUKF(CV(1.0), np.zeros(4), np.diag([4.0, 1, 1, 1]), alpha=0.5, kappa=2.0)
    kf.predict(0.0)
    assert np.max(np.abs(kf.sigmas_f[:, 0])) == pytest.approx(2 * np.sqrt(0.25 * 6), rel=1e-6)


@pytest.mark.parametrize(("factors", "first"), [("one", 1.0), ("per axis", [1.0, 1.0])])
def test_nothing_fades_before_the_first_measurement(factors, first):
    np.testing.assert_array_equal(StrongTrackingKF(F, H, np.eye(4), np.eye(2), np.zeros(4), np.eye(4), factors=factors).fading, first)

"""The Kalman filter on a linear model."""

import numpy as np
from filterpy.kalman import KalmanFilter

from trackhelpers.arrays import check_dt
from trackhelpers.filters.base import atomic, inverse_of_S, refused
from trackhelpers.filters.on_model import REFUSED, OnModel
from trackhelpers.model import check_model


@refused(
    **REFUSED,
    predict_steadystate="predict(dt)",
    update_steadystate="update(z, sensor)",
    update_correlated="update(z, sensor)",
    update_sequential="update(z, sensor) for each sensor",
    get_prediction="predict(dt) on a copy",
    get_update="update(z, sensor) on a copy",
    residual_of="sensor.residual(z, sensor.h(kf.x))",
    log_likelihood_of="log_likelihood after update(z, sensor) on a copy",
)
class MotionKF(OnModel, KalmanFilter):
    """filterpy's KalmanFilter on a linear model and linear sensors.

    Parameters
    ----------
    model : trackhelpers.model.Model
        A linear model (CV, CA, Singer, LinearModel).
    x0 : array_like, shape (n,)
        Initial estimate, SI units.
    P0 : array_like, shape (n, n)
        Its covariance, symmetric positive semidefinite.

    Raises
    ------
    ValueError
        A model that is not linear, or arguments of the wrong shape, not finite, or not a covariance.

    References
    ----------
    Thesis, (2.9)–(2.13), with the Joseph form in place of (2.13).
    """

    def __init__(self, model, x0, P0):
        if not check_model(model).linear:
            raise ValueError(f"model: expected a linear model (CV, CA), got {model!r}; use MotionEKF or MotionUKF")
        super().__init__(dim_x=model.n, dim_z=1)
        self._start(model, x0, P0)
        self.inv = inverse_of_S
        self._step = self._seen = None, None

    @atomic
    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        if self._step != (self.model, dt):  # F and Q depend on dt alone
            _, F, Q = self.model.step(np.zeros(self.model.n), dt)
            self._step, self._matrices = (self.model, dt), (F, Q)
        self.F, self.Q = self._matrices
        super().predict()
        for x in (self.x, self.x_prior):  # new arrays of filterpy's
            self.model._normalise(x)

    @atomic
    def update(self, z, sensor=None, R=None):
        """Correct by measurement `z`, shape (m,), of a linear `sensor`; `R` (m, m) replaces the sensor's this time. None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        seen, R = self._measurement(z, sensor, R)
        if self._seen[0] is not sensor:
            if not sensor.linear:
                raise ValueError(f"sensor: expected a linear sensor (Position, Lidar), got {sensor!r}; use MotionEKF or MotionUKF")
            z_hat, H = sensor.step(np.zeros(self.model.n))
            self._seen, self._plain = (sensor, H), not (sensor.angles or z_hat.any())
        self.dim_z, self.H, self.R = sensor.m, self._seen[1], R
        # filterpy takes z − Hx for the innovation: what it is to find is the residual, which knows of angles and of where the sensor stands
        given = seen if self._plain else sensor.residual(seen, sensor.h(self.x)) + self.H @ self.x
        super().update(given)
        self.z = seen
        self._normalise_posterior()

"""The extended Kalman filter on any model."""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from trackhelpers.filters.base import atomic, refused, singular
from trackhelpers.filters.on_model import REFUSED, OnModel


@refused(**REFUSED, predict_update="predict(dt), then update(z, sensor)")
class MotionEKF(OnModel, ExtendedKalmanFilter):
    """filterpy's ExtendedKalmanFilter on any model and any sensors.

    The prediction of the state is f(x), not Fx as in filterpy, and F and Q are taken at the state *before* the step.

    Parameters
    ----------
    model : trackhelpers.model.Model
        Any model.
    x0 : array_like, shape (n,)
        Initial estimate, SI units and rad.
    P0 : array_like, shape (n, n)
        Its covariance, symmetric positive semidefinite.

    Raises
    ------
    ValueError
        Arguments of the wrong shape, not finite, or not a covariance.

    References
    ----------
    Thesis, section 4.2, steps 01–11, with the prediction of the state that its list leaves out.
    """

    def __init__(self, model, x0, P0):
        super().__init__(dim_x=model.n, dim_z=1)
        self._start(model, x0, P0)

    @atomic
    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        self._ahead, self.F, self.Q = self.model.step(self.x, dt)  # at the old x
        super().predict()

    def predict_x(self, u=0):
        """The nonlinear prediction, called by filterpy's `predict`."""
        self.x = self.model._normalise(self._ahead)

    @atomic
    def update(self, z, sensor=None, R=None):
        """Correct by measurement `z`, shape (m,), of `sensor`; `R` (m, m) replaces the sensor's this time. None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        z, R = self._measurement(z, sensor, R)
        z_hat, H = sensor.step(self.x)
        self.dim_z, self.R = sensor.m, R
        try:
            super().update(z, HJacobian=lambda x: H, Hx=lambda x: z_hat, residual=sensor.residual)
        except np.linalg.LinAlgError:
            raise singular(self.S) from None
        self._normalise_posterior()

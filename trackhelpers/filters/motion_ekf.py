"""The extended Kalman filter on any model."""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from trackhelpers.filters.base import atomic, refused, singular
from trackhelpers.filters.on_model import REFUSED, OnModel
from trackhelpers.manoeuvre import check_window
from trackhelpers.model import check_model


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
    iterations : int
        How often an update linearises: 1 is the EKF, more the iterated EKF, which takes h and H anew at the estimate that it came to; y, S and K are then those
        of the last linearisation, y = z − h(xᵢ) − Hᵢ (x⁻ − xᵢ).

    Raises
    ------
    ValueError
        Arguments of the wrong shape, not finite, or not a covariance; from `update` also iterations that run away to states which are not finite.

    References
    ----------
    Thesis, section 4.2, steps 01–11, with the prediction of the state that its list leaves out. B. M. Bell, F. W. Cathey, IEEE Transactions on Automatic Control 38
    (1993) 294–297: the iterated update is Gauss–Newton's on the posterior density.
    """

    def __init__(self, model, x0, P0, iterations=1):
        super().__init__(dim_x=check_model(model).n, dim_z=1)
        self._start(model, x0, P0)
        self.iterations = check_window(iterations, "iterations")

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
        self.dim_z, self.R, residual = sensor.m, R, sensor.residual
        try:
            if self.iterations > 1:
                H, y = self._iterated(z, z_hat, H, sensor)
                residual = lambda z, z_hat: y  # noqa: E731
            super().update(z, HJacobian=lambda x: H, Hx=lambda x: z_hat, residual=residual)
        except np.linalg.LinAlgError:
            raise singular(self.S) from None
        self._normalise_posterior()

    def _iterated(self, z, z_hat, H, sensor):
        """H where the last iteration takes it, and the innovation of the sensor so linearised."""
        y = sensor.residual(z, z_hat)
        for _ in range(self.iterations - 1):
            PHt = self.P @ H.T
            self.S = H @ PHt + self.R
            step = PHt @ np.linalg.solve(self.S, y)
            z_hat, H = sensor.step(self.x + step)
            y = sensor.residual(z, z_hat) + H @ step
        return H, y

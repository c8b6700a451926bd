"""filterpy's Kalman filters driven by a motion model and any number of sensors.

    kf = MotionEKF(model, x0, P0)
    kf.predict(dt)
    kf.update(z, sensor)        # z is None: no measurement, the prediction stands

The model and the sensor are arguments; x, P, K, y, S stay public as in filterpy, x and y as vectors (n,) and (m,). Angles among the state are kept in
[−π, π). Arguments are checked before anything is touched, so a call that raises leaves the filter as it was.
"""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from trackhelpers import angles
from trackhelpers.arrays import check_array, check_covariance, check_dt


class _OnModel:
    """The arguments and the bookkeeping that the three filters share."""

    def _start(self, model, x0, P0):
        self.model = model
        self.x = angles.wrap_components(check_array(x0, "x0", model.n, ()), model.angles)
        self.P = check_covariance(P0, "P0", model.n)
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

    def _measurement(self, z, sensor):
        """The checked measurement vector; the sensor must have been made for the model's state."""
        if getattr(sensor, "state", None) != self.model.state:
            raise ValueError(f"sensor: expected one made with state={self.model.state}, got {sensor!r}")
        return check_array(np.atleast_1d(z), "z", sensor.m, ())

    def _no_measurement(self):
        """Nothing was measured: the posterior is the prior, and no innovation of an earlier step is left to be read by mistake."""
        self.z = None
        self.y = np.zeros(0)
        self.S = self.SI = np.zeros((0, 0))
        self.K = np.zeros((self.model.n, 0))
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

    def _wrap_posterior(self):
        self.x = angles.wrap_components(self.x, self.model.angles)
        self.x_post = self.x.copy()


class MotionKF(_OnModel, KalmanFilter):
    """filterpy's KalmanFilter on a linear motion model and linear sensors.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        A linear model (CV, CA).
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
        if not model.linear:
            raise ValueError(f"model: expected a linear model (CV, CA), got {model!r}; use MotionEKF or MotionUKF")
        super().__init__(dim_x=model.n, dim_z=1)
        self._start(model, x0, P0)

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        self.F, self.Q = self.model.F(self.x, dt), self.model.Q(self.x, dt)
        super().predict()

    def update(self, z, sensor):
        """Correct by measurement `z`, shape (m,), of a linear `sensor`; None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        z = self._measurement(z, sensor)
        if not sensor.linear:
            raise ValueError(f"sensor: expected a linear sensor (Position, Lidar), got {sensor!r}; use MotionEKF or MotionUKF")
        self.dim_z = sensor.m
        self.H, self.R = sensor.H(self.x), sensor.R
        super().update(z)


class MotionEKF(_OnModel, ExtendedKalmanFilter):
    """filterpy's ExtendedKalmanFilter on any motion model and any sensors.

    The prediction of the state is f(x), not Fx as in filterpy, and F and Q are taken at the state *before* the step.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        Any motion model.
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

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        self._dt = check_dt(dt)
        self.F, self.Q = self.model.F(self.x, self._dt), self.model.Q(self.x, self._dt)  # at the old x
        super().predict()

    def predict_x(self, u=0):
        """The nonlinear prediction, called by filterpy's `predict`."""
        self.x = angles.wrap_components(self.model.f(self.x, self._dt), self.model.angles)

    def update(self, z, sensor):
        """Correct by measurement `z`, shape (m,), of `sensor`; None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        z = self._measurement(z, sensor)
        self.dim_z, self.R = sensor.m, sensor.R
        super().update(z, HJacobian=sensor.H, Hx=sensor.h, residual=sensor.residual)
        self._wrap_posterior()

    def predict_update(self, *args, **kwargs):
        """Not offered: filterpy's version predicts linearly and stores the wrong prior."""
        raise NotImplementedError("call predict(dt), then update(z, sensor)")


class MotionUKF(_OnModel, UnscentedKalmanFilter):
    """filterpy's UnscentedKalmanFilter on any motion model and any sensors.

    Sigma points are drawn anew before every update, so several sensors may follow one prediction, and a covariance that is only semidefinite (P0 = 0, say)
    is taken by an eigenvalue square root where the Cholesky factorisation fails.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        Any motion model.
    x0 : array_like, shape (n,)
        Initial estimate, SI units and rad.
    P0 : array_like, shape (n, n)
        Its covariance, symmetric positive semidefinite.
    alpha, beta, kappa : float
        Parameters of the scaled sigma points of van der Merwe.

    Raises
    ------
    ValueError
        Arguments of the wrong shape, not finite, or not a covariance; sigma points whose spread n + λ is not positive.
    """

    def __init__(self, model, x0, P0, alpha=1.0, beta=2.0, kappa=0.0):
        spread = alpha**2 * (model.n + kappa)
        if not (np.isfinite(spread) and spread > 0 and np.isfinite(beta)):
            raise ValueError(f"alpha, beta, kappa: expected finite numbers with alpha²(n + kappa) > 0, got {alpha}, {beta}, {kappa}")
        points = MerweScaledSigmaPoints(model.n, alpha, beta, kappa, sqrt_method=upper_root)
        super().__init__(
            dim_x=model.n,
            dim_z=1,
            dt=0.0,
            hx=None,
            fx=model.f,
            points=points,
            x_mean_fn=lambda sigmas, Wm: angles.mean(sigmas.T, Wm, model.angles),
            residual_x=lambda a, b: angles.residual(a, b, model.angles),
            state_add=lambda x, dx: angles.wrap_components(x + dx, model.angles),
        )
        self._start(model, x0, P0)

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        self.Q = self.model.Q(self.x, dt)  # at the old x
        super().predict(dt=dt)

    def update(self, z, sensor):
        """Correct by measurement `z`, shape (m,), of `sensor`; None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        z = self._measurement(z, sensor)
        self._dim_z, self.R = sensor.m, sensor.R
        self.z_mean = lambda sigmas, Wm: angles.mean(sigmas.T, Wm, sensor.angles)
        self.residual_z = sensor.residual
        self.sigmas_f = self.points_fn.sigma_points(self.x, self.P)
        super().update(z, hx=sensor.h)


def upper_root(P):
    """U with UᵀU = P, whose rows displace the sigma points: Cholesky's factor, or an eigenvalue root where P is only semidefinite."""
    try:
        return np.linalg.cholesky(P).T
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
        if values[0] < -1e-9 * max(values[-1], 0.0) or not np.all(np.isfinite(P)):
            raise ValueError(f"P: expected a positive semidefinite covariance, got smallest eigenvalue {values[0]:.3g}") from None
        return np.sqrt(np.maximum(values, 0))[:, None] * vectors.T

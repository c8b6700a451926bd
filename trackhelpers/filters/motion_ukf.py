"""The unscented Kalman filter on any model."""

import warnings

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from trackhelpers import angles as _angles
from trackhelpers.arrays import all_finite, check_dt
from trackhelpers.checks import check_number
from trackhelpers.filters.base import atomic, inverse_of_S, refused
from trackhelpers.filters.on_model import REFUSED, OnModel
from trackhelpers.model import check_model


class SigmaPoints(MerweScaledSigmaPoints):
    """filterpy's scaled sigma points of van der Merwe, drawn in one go."""

    def sigma_points(self, x, P):
        """Points (2n + 1, n) about x (n,) with covariance P (n, n)."""
        root = np.sqrt(self.alpha**2 * (self.n + self.kappa)) * upper_root(P)
        points = np.empty((2 * self.n + 1, self.n))
        points[0], points[1 : self.n + 1], points[self.n + 1 :] = x, x + root, x - root
        return points


@refused(**REFUSED)
class MotionUKF(OnModel, UnscentedKalmanFilter):
    """filterpy's UnscentedKalmanFilter on any model and any sensors.

    Sigma points are drawn anew before every update, so several sensors may follow one prediction, and a covariance that is only semidefinite (P0 = 0, say)
    is taken by an eigenvalue square root where the Cholesky factorisation fails. Their angles are not wrapped, for the model's f is smooth in them; the mean is.

    Parameters
    ----------
    model : trackhelpers.model.Model
        Any model.
    x0 : array_like, shape (n,)
        Initial estimate, SI units and rad.
    P0 : array_like, shape (n, n)
        Its covariance, symmetric positive semidefinite.
    alpha, beta, kappa : float
        Parameters of the scaled sigma points of van der Merwe.

    Raises
    ------
    ValueError
        Arguments of the wrong shape, not finite, or not a covariance; sigma points whose spread n + λ is not positive; an angle whose standard deviation exceeds π,
        so that it is not known at all and no Gaussian tells anything of it. Where a filter comes to that later it warns.
    """

    def __init__(self, model, x0, P0, alpha=1.0, beta=2.0, kappa=0.0):
        check_sigma_points(check_model(model).n, alpha, beta, kappa)
        super().__init__(dim_x=model.n, dim_z=1, dt=0.0, hx=None, fx=model.f, points=SigmaPoints(model.n, alpha, beta, kappa))
        self._start(model, x0, P0)
        self.inv = inverse_of_S
        check_known(self.P, model, "P0")
        self._drawn = None, None  # x and P of the last sigma points

    @atomic
    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        self.Q = self.model.Q(self.x, dt)  # at the old x
        self._predict(dt)
        warn_unknown(self.P, self.model)

    def _predict(self, dt):
        super().predict(dt=dt, UT=self._moments_of_state)
        self._drawn = self.x_prior, self.P_prior

    def _points(self):
        """Sigma points (2n + 1, n) about x."""
        return self.points_fn.sigma_points(self.x, self.P)

    def compute_process_sigmas(self, dt, fx=None, **fx_args):
        """Draw the sigma points and take all of them through the model at once; called by filterpy's `predict`."""
        self.sigmas_before = self._points()
        self.sigmas_f = self.model.f(self.sigmas_before.T, dt).T

    def _about_state(self, sigmas):
        """Mean of sigma points of the state, normalised, and their deviations from it, not wrapped."""
        mean = self.Wm @ sigmas
        deviation = sigmas - mean
        return self.model._normalise(mean), deviation

    def _moments_of_state(self, sigmas, Wm, Wc, noise, mean_fn, residual_fn):
        mean, deviation = self._about_state(sigmas)
        self.cross = (
            Wc[:, None] * (self.sigmas_before - self.x)
        ).T @ deviation  # covariance of the state before and after the step, for smoothing
        return mean, (Wc[:, None] * deviation).T @ deviation + noise

    @atomic
    def update(self, z, sensor=None, R=None):
        """Correct by measurement `z`, shape (m,), of `sensor`; `R` (m, m) replaces the sensor's this time. None leaves the prediction."""
        if z is None:
            self._no_measurement()
            return
        z, R = self._measurement(z, sensor, R)
        self._dim_z, self.R, self._sensor, self.residual_z = sensor.m, R, sensor, sensor.residual
        self._update(z)
        self._normalise_posterior()
        warn_unknown(self.P, self.model)

    def _update(self, z):
        if not (np.array_equal(self.x, self._drawn[0]) and np.array_equal(self.P, self._drawn[1])):
            self.sigmas_f = self._points()
            self._drawn = self.x.copy(), self.P.copy()
        seen = iter(self._seen())  # of all points at once; filterpy asks for one after the other
        super().update(z, UT=self._moments_of_measurement, hx=lambda point: next(seen))

    def _seen(self):
        """What the sensor measures at the sigma points, (2n + 1, m)."""
        points = self._sensor.h(self.sigmas_f.T).T
        if not all_finite(points):
            raise ValueError("sensor: h does not exist at a sigma point (NaN): the prior reaches beyond what the sensor can see")
        return points

    def _about_measurement(self, sigmas):
        """Mean of sigma points of the measurement, and their deviations from it, angles the short way round."""
        angular = self._sensor.angles
        mean = _angles.mean(sigmas.T, self.Wm, angular) if angular else self.Wm @ sigmas
        return mean, self._sensor.residual(sigmas.T, mean[:, None]).T

    def _moments_of_measurement(self, sigmas, Wm, Wc, noise, mean_fn, residual_fn):
        mean, deviation = self._about_measurement(sigmas)
        self._deviation = deviation.T
        return mean, (Wc * self._deviation) @ self._deviation.T + noise

    def cross_variance(self, x, z, sigmas_f, sigmas_h):
        """Covariance (n, m) of state and measurement, called by filterpy's `update`."""
        return (self.Wc[:, None] * (sigmas_f - x)).T @ self._deviation.T


def check_sigma_points(n, alpha, beta, kappa):
    """The squared spread alpha² (n + kappa) of the sigma points; ValueError unless it is positive."""
    alpha, beta, kappa = check_number(alpha, "alpha"), check_number(beta, "beta"), check_number(kappa, "kappa")
    spread = alpha * alpha * (n + kappa)
    if not (np.isfinite(spread) and spread > 0):
        raise ValueError(f"alpha, beta, kappa: expected finite numbers with alpha²(n + kappa) > 0, got {alpha}, {beta}, {kappa}")
    return spread


def _unknown(P, model):
    """The model's angles whose standard deviation exceeds π, in any run."""
    return [model.state[i] for i in model.angles if np.any(P[i, i] > np.pi**2)]


def check_known(P, model, name):
    """ValueError where an angle's standard deviation exceeds π: it is not known at all, and sigma points would lie several turns away."""
    if names := _unknown(P, model):
        raise ValueError(
            f"{name}: expected standard deviations up to π of angles, got {', '.join(names)} wider; start from a first bearing or a few positions"
        )


def warn_unknown(P, model):
    """As `check_known`, but a RuntimeWarning: a filter that lost its heading may find it again."""
    if names := _unknown(P, model):
        warnings.warn(
            f"the standard deviation of {', '.join(names)} exceeds π: no Gaussian filter tells anything of it", RuntimeWarning, stacklevel=4
        )


def upper_root(P):
    """U with UᵀU = P, whose rows displace the sigma points: Cholesky's factor, or an eigenvalue root where P is only semidefinite."""
    try:
        return np.linalg.cholesky(P).T
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(P)
        if values[0] < -1e-9 * max(values[-1], 0.0) or not np.all(np.isfinite(P)):
            raise ValueError(f"P: expected a positive semidefinite covariance, got smallest eigenvalue {values[0]:.3g}") from None
        return np.sqrt(np.maximum(values, 0))[:, None] * vectors.T

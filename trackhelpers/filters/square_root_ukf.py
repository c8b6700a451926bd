"""The square-root unscented Kalman filter: what is kept and propagated is a factor of P, so that P can never lose its positive definiteness to rounding."""

from math import log, pi, sqrt

import numpy as np
from filterpy.kalman import UnscentedKalmanFilter

from trackhelpers.arrays import all_finite, check_array, check_dt, check_scale, solve_lower
from trackhelpers.checks import check_choice, check_count, check_vector
from trackhelpers.filters.base import OneTarget, atomic, singular
from trackhelpers.filters.factors import cholupdate, lower_root, triangular

FORMS = ("qr", "cholupdate")


class SquareRootUKF(OneTarget, UnscentedKalmanFilter):
    """filterpy's UnscentedKalmanFilter, on a lower triangular factor of P in the place of P.

    The predicted factor comes from one QR decomposition, of [√Wc (χ − x̂), √Q]. Sigma points are drawn from the factor, anew before every update, so that several
    measurements may follow one prediction.

    Parameters
    ----------
    dim_x, dim_z, dt, hx, fx : as in filterpy
    points : filterpy.kalman.MerweScaledSigmaPoints or JulierSigmaPoints
        Their weights, spread and `subtract` are taken; the displacements are the columns of `factor`, whatever root the points themselves would take.
    sqrt_fn : callable, optional
        Takes the roots of P (where it is set), Q and R: U with UᵀU = P, as filterpy has it. Every root ends as the triangular one; by default it is Cholesky's, and an
        eigenvalue root where the matrix is only semidefinite.
    x_mean_fn, z_mean_fn, residual_x, residual_z, state_add : callable, optional
        As in filterpy.
    form : {"qr", "cholupdate"}
        "qr": one QR of the joint factor of measurement and state, [√Wc δy, √Wc δx; √R, 0], gives S_y, K S_y and the posterior factor, which is that of
        [√Wc (δx − K δy), K √R]; nothing is subtracted. "cholupdate": van der Merwe and Wan's downdates of the prior factor by the columns of K S_y, which cancel where a
        measurement is far better than the prediction.

    Attributes
    ----------
    factor : numpy.ndarray, shape (n, n)
        L with L Lᵀ = P, lower triangular, its diagonal ≥ 0. Not named S, which is the innovation's covariance.
    P : numpy.ndarray, shape (n, n)
        L Lᵀ. Setting it, in part (``kf.P[0, 0] = 9``) or as a whole, factors it.
    x, Q, R, K, y, S, SI, z, x_prior, P_prior, x_post, P_post : as in filterpy
        y, S and K are empty after a missed measurement.

    Raises
    ------
    ValueError
        Sigma points that are not 2n + 1 in symmetric pairs, a `form` that is none of the two; a P, Q or R that is no covariance; from `predict` and `update` states,
        measurements or values of fx and hx of a wrong shape or not finite, a singular S, a downdate after which nothing positive definite is left. The filter is then as it was.

    Notes
    -----
    A negative weight Wc₀ (alpha < 1 brings it) takes its point out of each factor by `cholupdate`. Then, and with form="cholupdate", P must be positive definite; with
    form="qr" and Wc₀ ≥ 0 it may be semidefinite. To compute K from P_xz, as van der Merwe and Wan do, squares what √Wc δx and √Wc δy hold: where S is singular up to
    rounding a posterior factor that is built on such a K is positive definite and wrong, by whole orders of magnitude.

    References
    ----------
    R. van der Merwe, E. A. Wan, *The square-root unscented Kalman filter for state and parameter-estimation*, ICASSP 2001, algorithm 3.1.
    """

    def __init__(
        self,
        dim_x,
        dim_z,
        dt,
        hx,
        fx,
        points,
        sqrt_fn=None,
        x_mean_fn=None,
        z_mean_fn=None,
        residual_x=None,
        residual_z=None,
        state_add=None,
        form="qr",
    ):
        check_form(form)
        dim_x, dim_z, dt = check_count(dim_x, "dim_x"), check_count(dim_z, "dim_z"), check_dt(dt)
        for name, value in (("hx", hx), ("fx", fx)):
            if value is not None and not callable(value):
                raise ValueError(f"{name}: expected a function, got {value!r}")
        if not hasattr(points, "num_sigmas"):
            raise ValueError(f"points: expected filterpy's MerweScaledSigmaPoints or JulierSigmaPoints, got {points!r}")
        pairs, weights = points.num_sigmas() == 2 * dim_x + 1, (points.Wm[1:], points.Wc[1:])
        if not (pairs and points.Wm[1] > 0 and all(np.allclose(w, points.Wm[1]) for w in weights)):
            raise ValueError(f"points: expected {2 * dim_x + 1} sigma points in symmetric pairs (Merwe's or Julier's), got {points!r}")
        self._sqrt_fn, self.form = sqrt_fn, form
        super().__init__(dim_x, dim_z, dt, hx, fx, points, sqrt_fn, x_mean_fn, z_mean_fn, residual_x, residual_z, state_add)
        self._no_measurement()

    @property
    def P(self):
        """Covariance of the state, L Lᵀ, shape (n, n)."""
        return self._P

    @P.setter
    def P(self, value):
        self._keep(self._root(value, "P", len(self.x)))

    @property
    def factor(self):
        """L with L Lᵀ = P, shape (n, n), lower triangular."""
        if not np.array_equal(self._P, self._P_kept):  # somebody changed P in place
            self.P = self._P
        return self._factor

    def _keep(self, factor):
        self._factor = factor
        self._P = factor @ factor.T
        self._P_kept = self._P.copy()

    def _root(self, P, name, n):
        return lower_root(P, name, n, self._sqrt_fn)

    @atomic
    def predict(self, dt=None, UT=None, fx=None, **fx_args):
        """Predict over `dt`, by default the constructor's, with `fx` and its further arguments in the place of the constructor's fx."""
        _no_transform(UT)
        self.x = check_array(self.x, "x", self._dim_x, ())
        self.compute_process_sigmas(check_dt(self._dt if dt is None else dt), fx, **fx_args)
        self._predict_factor()

    def compute_process_sigmas(self, dt, fx=None, **fx_args):
        """Draw the sigma points and take each of them through fx."""
        fx = self.fx if fx is None else fx
        moved = [fx(point, dt, **fx_args) for point in self._points()]
        self.sigmas_f = _finite(moved, "fx", (self._num_sigmas, self._dim_x))

    def _predict_factor(self):
        """x and the factor from the sigma points that have moved."""
        self.x, deviation = self._about_state(self.sigmas_f)
        self.cross = (self.Wc[:, None] * self._displaced).T @ deviation  # covariance of the state before and after the step, for smoothing
        self._keep(self._weighted(deviation, self._root(self.Q, "Q", self._dim_x)))
        self.sigmas_f = self._points()
        self.x_prior, self.P_prior = self.x.copy(), self._P.copy()

    @atomic
    def update(self, z, R=None, UT=None, hx=None, **hx_args):
        """Correct by the measurement `z`, (dim_z,), with `R`, (dim_z, dim_z) or a number, and `hx` and its further arguments in the place of the filter's; None leaves
        the prediction."""
        _no_transform(UT)
        if z is None:
            self._no_measurement()
            return
        z = check_vector(z, "z", self._dim_z)
        R = self.R if R is None else check_scale(R, "R") * np.eye(self._dim_z) if np.isscalar(R) else R
        hx = self.hx if hx is None else hx
        self.x = check_array(self.x, "x", self._dim_x, ())
        self.sigmas_f = self._points()
        seen = [np.atleast_1d(hx(point, **hx_args)) for point in self.sigmas_f]
        self._correct(z, R, _finite(seen, "hx", (self._num_sigmas, self._dim_z)))

    def _correct(self, z, R, sigmas_h):
        """x, factor and all that belongs to an update, from the sigma points as the sensor sees them."""
        z_hat, deviation = self._about_measurement(sigmas_h)
        S_y, U, factor = self._joint(deviation, R) if self.form == "qr" else self._in_turn(deviation, R)
        inverse = solve_lower(S_y, np.eye(self._dim_z))
        self.S, self.K, self.SI = S_y @ S_y.T, U @ inverse, inverse.T @ inverse
        self.y, self.z, self.sigmas_h = np.atleast_1d(self.residual_z(z, z_hat)), z.copy(), sigmas_h
        self._keep(factor)
        self.x = self.state_add(self.x, self.K @ self.y)
        self.x_post, self.P_post = self.x.copy(), self._P.copy()
        white = solve_lower(S_y, self.y)  # from the factor, for S may be too ill-conditioned
        self._mahalanobis, self._likelihood = sqrt(white @ white), None
        self._log_likelihood = -0.5 * (white @ white + len(white) * log(2 * pi)) - float(np.log(S_y.diagonal()).sum())

    def _joint(self, deviation, R):
        """Factor S_y of S, U = K S_y, and the posterior factor, from the factor [[S_y, 0], [U, L]] of the joint covariance of measurement and state."""
        m = self._dim_z
        noise = np.concatenate([self._root(R, "R", m), np.zeros((self._dim_x, m))])
        joint = self._weighted(np.concatenate([deviation, self._displaced], axis=1), noise)
        return _regular(joint[:m, :m]), joint[m:, :m], joint[m:, m:]

    def _in_turn(self, deviation, R):
        """The same, S_y by QR, U by a triangular solve, the posterior factor by downdates of the prior one."""
        S_y = _regular(self._weighted(deviation, self._root(R, "R", self._dim_z)))
        P_xz = self._displaced.T @ (self.Wc[:, None] * deviation)
        U, factor = solve_lower(S_y, P_xz.T).T, self.factor
        for column in U.T:
            factor = _downdated(factor, column)
        return S_y, U, factor

    def _points(self):
        """Sigma points (2n + 1, n) about x; `_displaced` are their displacements."""
        rows = sqrt(0.5 / self.Wm[1]) * self.factor.T
        self._displaced = np.concatenate([np.zeros((1, len(rows))), rows, -rows])
        subtract = getattr(self.points_fn, "subtract", np.subtract)
        return self.x + self._displaced if subtract is np.subtract else np.array([subtract(self.x, -row) for row in self._displaced])

    def _about_state(self, sigmas):
        """Mean of sigma points of the state, and their deviations from it."""
        return _about(sigmas, self.Wm, self.x_mean, self.residual_x)

    def _about_measurement(self, sigmas):
        """Mean of sigma points of the measurement, and their deviations from it."""
        return _about(sigmas, self.Wm, self.z_mean, self.residual_z)

    def _weighted(self, deviation, noise):
        """Factor of Σ Wc d dᵀ + N Nᵀ for the deviations d, rows of (2n + 1, p), and N (p, ...)."""
        rows = np.sqrt(np.abs(self.Wc))[:, None] * deviation
        centre = self.Wc[0] < 0
        L = triangular(np.concatenate([rows[1:] if centre else rows, noise.T]))
        return _downdated(L, rows[0]) if centre else L


def check_form(form):
    """`form`; ValueError unless it is one of `FORMS`."""
    return check_choice(form, "form", FORMS)


def _regular(S_y):
    """S_y; ValueError where it is singular, also up to rounding."""
    if (S_y.diagonal() <= 1e-14 * np.sqrt((S_y**2).sum(axis=1))).any():
        raise singular(S_y @ S_y.T)
    return S_y


def _downdated(L, x):
    try:
        return cholupdate(L, x, -1)
    except ValueError:
        raise ValueError(
            "P: expected a covariance that stays positive definite when its factor is downdated, got one that does not, by rounding or because it is only semidefinite; "
            'use form="qr" and sigma points with Wc₀ ≥ 0 (alpha = 1), which need no downdate'
        ) from None


def _about(sigmas, Wm, mean_fn, residual_fn):
    mean = Wm @ sigmas if mean_fn is None else np.asarray(mean_fn(sigmas, Wm), dtype=float)
    return mean, sigmas - mean if residual_fn is np.subtract else np.array([residual_fn(point, mean) for point in sigmas], dtype=float)


def _finite(values, name, shape):
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not all_finite(array):
        raise ValueError(f"{name}: expected {shape[1]} finite numbers for each sigma point, got {values}")
    return array


def _no_transform(UT):
    if UT is not None:
        raise NotImplementedError(
            "UT: a transform that gives a covariance gives no factor of it; use x_mean_fn, z_mean_fn, residual_x, residual_z"
        )

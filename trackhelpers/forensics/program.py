"""The program behind the thesis's tables: its filter, as the digits of Table 5 give it away, and a process noise that is no covariance."""

import numpy as np

from trackhelpers.arrays import check_dt, congruence, matmul
from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.ensemble.base import QUIET
from trackhelpers.filters import MotionEKF
from trackhelpers.filters.base import atomic
from trackhelpers.scenarios.thesis.lidar_radar import T


class ProgramEKF(MotionEKF):
    """The extended Kalman filter of the thesis's program, as the digits of Table 5 give it away.

    It differs from `MotionEKF` in three things that the thesis does not say; each keyword can put one of them right.

    Parameters
    ----------
    model, x0, P0
        As for `MotionEKF`. The program's own model is ``PrintedCTRV(2.0, 0.3, errors=["3.11"])``.
    late_F, late_Q : bool
        Take F, and Q, at the predicted state instead of the state before the step.
    step, noise_step : float or None
        A constant time step of f and F, and of Q, in s; None takes the one passed to `predict`.
    Q : callable, optional
        (x, dt) -> (n, n), the process noise in the place of the model's; it need not be symmetric, as (3.16) is not.
    """

    def __init__(self, model, x0, P0, late_F=True, late_Q=True, step=T, noise_step=None, Q=None):
        super().__init__(model, x0, P0)
        self.late_F, self.late_Q = late_F, late_Q
        self.noise = model.Q if Q is None else Q
        self.step = None if step is None else check_dt(step, "step")
        self.noise_step = None if noise_step is None else check_dt(noise_step, "noise_step")

    @atomic
    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        step, noise_step = (dt if fixed is None else fixed for fixed in (self.step, self.noise_step))
        before = self.x
        after = self.model.normalise(self.model.f(before, step))
        self.F = self.model.F(after if self.late_F else before, step)
        self.Q = self.noise(after if self.late_Q else before, noise_step)
        self.x, self.P = after, congruence(self.F, self.P) + self.Q
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()


class EnsembleProgramEKF(EnsembleEKF):
    """`ProgramEKF` with its defaults over M runs: F and Q at the predicted state, F of the first step over T."""

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0; the transition takes T = 0.05 s whatever `dt` is, as in the program."""
        dt = check_dt(dt)
        x = self.model.normalise(self.model.f(self.x, T))
        self.P = congruence(self.model.F(x, T), self.P) + self.model.Q(x, dt)
        self.x = x


class EnsembleUnsymmetricEKF(EnsembleEKF):
    """`EnsembleEKF` with a process noise that need not be symmetric: P is then no covariance, and no symmetry is assumed or made, as filterpy does it.

    Parameters
    ----------
    model, x0, P0
        As for `EnsembleEKF`.
    Q : callable
        (x, dt) -> (n, n, M), in the place of the model's.
    """

    def __init__(self, model, x0, P0, Q):
        super().__init__(model, x0, P0)
        self.noise = Q

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        with np.errstate(**QUIET):
            self.P = congruence(self.model.F(self.x, dt), self.P) + self.noise(self.x, dt)
            self.x = self.model.normalise(self.model.f(self.x, dt))

    def _corrected(self, x, P, z, sensor, R):
        with np.errstate(**QUIET):
            H, R = sensor.H(x), R.reshape(*R.shape, *[1] * (3 - R.ndim))
            PHt = np.einsum("ij...,kj...->ik...", P, H)
            S = matmul(H, PHt) + R
            K, y = matmul(PHt, _inverse(S)), sensor.residual(z, sensor.h(x))
            B = P - matmul(K, matmul(H, P))  # Joseph's form, multiplied out as far as no symmetry is needed
            slack = np.einsum("ij...,kj...->ik...", B, H) - matmul(K, R)
            return self._moved(x, K, y), B - np.einsum("ij...,kj...->ik...", slack, K), y, S, K


def _inverse(S):
    """Inverse of S (m, m, M), NaN in the runs where it is singular: those must not stop the others."""
    stack = np.moveaxis(S, -1, 0)
    try:
        inverse = np.linalg.inv(stack)
    except np.linalg.LinAlgError:
        inverse = np.linalg.inv(np.where(np.abs(np.linalg.det(stack))[:, None, None] > 0, stack, np.nan))
    return np.ascontiguousarray(np.moveaxis(inverse, 0, -1))  # runs side by side again


def window_deviations(x, table):
    """Largest deviation of `table` from every run of consecutive states.

    Parameters
    ----------
    x : array_like, shape (n, N)
        States.
    table : array_like, shape (r, n)
        Printed rows, r ≤ N.

    Returns
    -------
    numpy.ndarray, shape (N − r + 1,)
        Entry i is the largest |x − table| over all components of samples i, …, i + r − 1.
    """
    x, table = np.asarray(x, dtype=float), np.asarray(table, dtype=float)
    if x.ndim != 2 or table.ndim != 2 or table.shape[1] != len(x) or len(table) > x.shape[1]:
        raise ValueError(f"table: expected shape (r, n) with r ≤ N for x of shape (n, N), got {table.shape} for {x.shape}")
    windows = np.lib.stride_tricks.sliding_window_view(x, len(table), axis=1)  # (n, N − r + 1, r)
    return np.max(np.abs(windows - table.T[:, None, :]), axis=(0, 2))

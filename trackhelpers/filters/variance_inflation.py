"""Variance inflation: more process noise as long as the innovations say that the target manoeuvres (paper 3, introduction)."""

import numpy as np

from trackhelpers.filters.base import atomic
from trackhelpers.filters.matrix_filter import AdaptiveKF, inverse_of_S
from trackhelpers.manoeuvre import check_inflation, check_window, fading_limit, fading_sum


def inflated(P, noise, manoeuvring, inflation):
    """P (n, n, ...), into which `noise` (n, n, ...) went since the last measurement, with `inflation` times that where `manoeuvring`, shape (...)."""
    return P + (inflation - 1) * noise * manoeuvring


class VarianceInflationKF(AdaptiveKF):
    """Kalman filter that multiplies Q by a constant while a fading sum of its squared innovations is above its limit.

    The innovations are normalised by the covariance that the filter would have had without any inflation; otherwise the inflated filter would find itself
    consistent, go back at once, and chatter. A missed scan leaves the sum; what the target did meanwhile is inflated, or not, at the next measurement.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        As for `MatrixKF`.
    inflation : float
        What Q is multiplied by, ≥ 1.
    window : int
        Steps that the fading sum remembers; see `trackhelpers.manoeuvre.fading_limit`.
    probability : float
        With which the sum stays below its limit while the target does not manoeuvre.

    Attributes
    ----------
    manoeuvring : bool
        Whether the last measurement was taken with the inflated Q.

    References
    ----------
    Y. Bar-Shalom, K. Birmiwal, IEEE Transactions on Aerospace and Electronic Systems AES-18 (1982) 621–629; [5] in the text of paper 3.
    """

    def __init__(self, F, H, Q, R, x0, P0, inflation=100.0, window=5, probability=0.999):
        super().__init__(F, H, Q, R, x0, P0)
        self.inflation = check_inflation(inflation)
        self.window = check_window(window)
        self.limit = fading_limit(self.dim_z, self.window, probability)
        self.statistic, self.manoeuvring = 0.0, False
        self._quiet_P, self._noise = self.P.copy(), 0 * self.Q  # P without any inflation; the process noise since the last measurement

    @atomic
    def predict(self):
        """Predict with the plain Q; `update` adds the rest where it is wanted."""
        super().predict()
        self._quiet_P, self._noise = (self.F @ P @ self.F.T + self.Q for P in (self._quiet_P, self._noise))

    def _update(self, z, R):
        seen, y = self.H @ self._quiet_P, z - self.H @ self.x
        SI = inverse_of_S(seen @ self.H.T + R)
        self.statistic = fading_sum(self.statistic, y @ SI @ y, self.window)
        self.manoeuvring = bool(self.statistic > self.limit)
        self.P_prior = self.P = inflated(self.P, self._noise, self.manoeuvring, self.inflation)
        K = seen.T @ SI
        A = np.eye(self.dim_x) - K @ self.H
        self._quiet_P, self._noise = (
            A @ self._quiet_P @ A.T + K @ R @ K.T,
            0 * self.Q,
        )  # a second measurement at the same instant finds the noise inflated
        super()._update(z, R)

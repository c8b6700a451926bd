"""Variance inflation: more process noise as long as the innovations say that the target manoeuvres (paper 3, introduction)."""

import numpy as np

from trackhelpers.consistency import nis
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.manoeuvre import check_inflation, check_window, fading_limit


class VarianceInflationKF(MatrixKF):
    """Kalman filter that multiplies Q by a constant while a fading sum of its squared innovations is above its limit.

    The innovations are normalised by the covariance that the filter would have had without any inflation; otherwise the inflated filter would find itself
    consistent, go back at once, and chatter.

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
        self._quiet_P, self._predicted = self.P.copy(), False

    def predict(self):
        """Predict with the plain Q; `update` adds the rest where it is wanted."""
        super().predict()
        self._quiet_P, self._predicted = self.F @ self._quiet_P @ self.F.T + self.Q, True

    def update(self, z):
        """Correct by measurement `z`, shape (m,); None leaves the prediction and the fading sum."""
        if z is None:
            self._no_measurement()
            return
        z = self._measurement(z)
        quiet_S = self.H @ self._quiet_P @ self.H.T + self.R
        self.statistic = (1 - 1 / self.window) * self.statistic + nis(z - self.H @ self.x, quiet_S)
        self.manoeuvring = bool(self.statistic > self.limit)
        if self.manoeuvring and self._predicted:  # a second measurement at the same instant finds Q inflated already
            self.P = self.P + (self.inflation - 1) * self.Q
            self.P_prior = self.P.copy()
        K = np.linalg.solve(quiet_S, self.H @ self._quiet_P).T
        A = np.eye(self.dim_x) - K @ self.H
        self._quiet_P = A @ self._quiet_P @ A.T + K @ self.R @ K.T
        self._predicted = False
        super().update(z)

"""Ensembles of the filters that adapt their covariance to the innovations: strong tracking, variance inflation, input estimation.

Each is the filter of the same name in `trackhelpers.filters` over M runs; their decisions are masks over the runs.
"""

from collections import deque

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_scale, congruence, matvec
from trackhelpers.consistency import nis
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_forgetting,
    check_inflation,
    check_input,
    check_probability,
    check_window,
    constant_input,
    fading_limit,
)


class EnsembleStrongTrackingKF(EnsembleMatrixKF):
    """`trackhelpers.filters.StrongTrackingKF` over M runs; arguments as there, x0 (n, M).

    Parameters
    ----------
    axis : array_like of int, shape (n,), optional
        For the several factors of "per axis": the measurement that sees each state component (`trackhelpers.filters.strong_tracking.axes_seen`). Without it one
        factor serves all.

    Attributes
    ----------
    fading : numpy.ndarray, shape (M,) or (m, M)
    """

    def __init__(self, F, H, Q, R, x0, P0, beta=4.0, rho=0.95, axis=None):
        super().__init__(F, H, Q, R, x0, P0)
        self.beta, self.rho = check_scale(beta, "beta"), check_forgetting(rho)
        self.axis = None if axis is None else np.asarray(axis)
        if axis is not None and (self.axis.shape != (len(self.x),) or not np.isin(self.axis, np.arange(self.m)).all()):
            raise ValueError(f"axis: expected {len(self.x)} numbers of measurements from 0 to {self.m - 1}, got {axis!r}")
        self.V, self._moved = None, None
        self.fading = np.ones(self.runs) if axis is None else np.ones((self.m, self.runs))

    def predict(self):
        """Predict with λ = 1."""
        self._moved = self.matrices.moved(self.P)
        super().predict()

    def update(self, z):
        """Correct all runs by z, shape (m, M), each with λ from its own innovation."""
        z, (H, Q, R) = self._measurement(z), (self.matrices.H, self.matrices.Q, self.matrices.R)
        innovation = z - H @ self.x
        square = innovation[:, None] * innovation[None]
        self.V = square if self.V is None else (self.rho * self.V + square) / (1 + self.rho)
        if self._moved is None:  # a second measurement at the same instant finds the covariance already fading
            self._correct(z)
            return
        N = np.einsum("iim->im", self.V) - np.diag(H @ Q @ H.T + self.beta * R)[:, None]
        M = np.einsum("iim->im", congruence(H, self._moved))
        if self.axis is None:
            self.fading = _fading(N.sum(axis=0), M.sum(axis=0))
            self.P = self.fading * self._moved + Q[..., None]
        else:
            self.fading = _fading(N, M)
            root = np.sqrt(self.fading)[self.axis]
            self.P = root[:, None] * self._moved * root[None] + Q[..., None]
        self._moved = None
        self._correct(z)


def _fading(N, M):
    return np.maximum(1.0, np.divide(N, M, out=np.ones_like(M), where=M > 0))


class EnsembleVarianceInflationKF(EnsembleMatrixKF):
    """`trackhelpers.filters.VarianceInflationKF` over M runs; arguments as there, x0 (n, M).

    Attributes
    ----------
    manoeuvring : numpy.ndarray of bool, shape (M,)
    """

    def __init__(self, F, H, Q, R, x0, P0, inflation=100.0, window=5, probability=0.999):
        super().__init__(F, H, Q, R, x0, P0)
        self.inflation, self.window = check_inflation(inflation), check_window(window)
        self.limit = fading_limit(self.m, self.window, probability)
        self.statistic, self.manoeuvring = np.zeros(self.runs), np.zeros(self.runs, dtype=bool)
        self._quiet_P, self._predicted = self.P[..., :1], False  # one for all runs: it does not depend on the data

    def predict(self):
        """Predict with the plain Q; `update` adds the rest where it is wanted."""
        super().predict()
        _, self._quiet_P = self.matrices.predict(np.zeros((len(self.x), 1)), self._quiet_P)
        self._predicted = True

    def update(self, z):
        """Correct all runs by z, shape (m, M)."""
        z, model = self._measurement(z), self.matrices
        innovation = z - model.H @ self.x
        quiet_S = np.broadcast_to(model.innovation_covariance(self._quiet_P), (self.m, self.m, self.runs))
        self.statistic = (1 - 1 / self.window) * self.statistic + nis(innovation, quiet_S)
        self.manoeuvring = self.statistic > self.limit
        if self._predicted:  # a second measurement at the same instant finds Q inflated already
            self.P = self.P + (self.inflation - 1) * model.Q[..., None] * self.manoeuvring
            self._predicted = False
        self._quiet_P = model.correct(np.zeros((len(self.x), 1)), self._quiet_P, np.zeros((self.m, 1)))[1]
        self._correct(z)


class EnsembleInputEstimationKF(OneAPrediction, EnsembleMatrixKF):
    """`trackhelpers.filters.InputEstimationKF` over M runs; arguments as there, x0 (n, M).

    Attributes
    ----------
    u : numpy.ndarray, shape (q, M)
    changes : numpy.ndarray of int, shape (M,)
    """

    def __init__(self, F, G, H, Q, R, x0, P0, window=10, probability=0.9999):
        super().__init__(F, H, Q, R, x0, P0)
        self.G, self.window = check_input(self.matrices.F, G, self.matrices.H, window)
        self.limit = float(stats.chi2.ppf(check_probability(probability, "probability"), self.G.shape[1]))
        self.u, self.changes = np.zeros((self.G.shape[1], self.runs)), np.zeros(self.runs, dtype=int)
        self._past, self._full = (
            deque(maxlen=self.window),
            np.zeros(self.runs, dtype=int),
        )  # how many of the kept steps belong to a run's window

    def predict(self):
        """Predict with the input in force."""
        super().predict()
        self.x = self.x + self.G @ self.u
        self._predicted = True

    def update(self, z):
        """Correct all runs by z, shape (m, M), one a prediction, and by a change of the input in the runs whose window shows one."""
        z = self._measurement(z)
        self._one_a_prediction()
        self._correct(z)
        self._past.append((self.y, self.S, self.K))
        self._full += 1
        ready = np.flatnonzero(self._full >= self.window)
        if not len(ready):
            return
        past = ([part[..., ready] for part in parts] for parts in zip(*self._past, strict=True))
        change, covariance, shift, significance = constant_input(*past, self.matrices.F, self.G, self.matrices.H)
        found = significance > self.limit
        some, change, shift = ready[found], change[:, found], shift[..., found]
        self.u[:, some] += change
        self.x[:, some] += matvec(shift, change)
        self.P[..., some] += congruence(shift, covariance[..., found])
        self.changes[some] += 1
        self._full[some] = 0

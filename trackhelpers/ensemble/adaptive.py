"""Ensembles of the filters that adapt their covariance to the innovations: strong tracking, variance inflation, input estimation.

Each is the filter of the same name in `trackhelpers.filters` over M runs, with its rule; a decision is a mask over the runs.
"""

import numpy as np
from scipy import stats

from trackhelpers import matrix_steps
from trackhelpers.arrays import check_scale, congruence, matvec
from trackhelpers.consistency import nis
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.filters.strong_tracking import axes_seen, faded, innovation_spread
from trackhelpers.filters.variance_inflation import inflated
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_forgetting,
    check_inflation,
    check_input,
    check_probability,
    check_window,
    fading_limit,
    fading_sum,
    input_found,
    input_moves,
    input_seen,
)


class EnsembleStrongTrackingKF(EnsembleMatrixKF):
    """`trackhelpers.filters.StrongTrackingKF` over M runs; arguments as there, x0 (n, M).

    Attributes
    ----------
    fading : numpy.ndarray, shape (M,) or (m, M)
    V : numpy.ndarray, shape (m, m, M)
        NaN before a run's first measurement.
    """

    _by_run = (*EnsembleMatrixKF._by_run, "V", "fading", "_before")

    def __init__(self, F, H, Q, R, x0, P0, beta=4.0, rho=0.95, factors="one"):
        super().__init__(F, H, Q, R, x0, P0)
        self.beta, self.rho, self.factors = check_scale(beta, "beta"), check_forgetting(rho), factors
        self._axis = axes_seen(self.matrices.F, self.matrices.H, factors)
        self.V, self._before = np.full((self.m, self.m, self.runs), np.nan), self.P  # and P before the last prediction
        self.fading = np.ones(self.runs) if self._axis is None else np.ones((self.m, self.runs))

    def predict(self):
        """Predict with λ = 1."""
        self._before = self.P
        super().predict()

    def _update(self, z, R):
        fresh = self._steps > 0
        self.V, fading, P = self._faded(z, R)
        if not fresh.all():  # a second measurement at the same instant finds the covariance already fading
            fading, P = np.where(fresh, fading, self.fading), np.where(fresh, P, self.P)
        self.fading, self.P = fading, P
        super()._update(z, R)

    def _faded(self, z, R):
        """V, λ and P after the innovation of z."""
        found = matrix_steps.fade(self.matrices, self.x, self._before, self.V, z, R, self.beta, self.rho, self._axis)
        if found is not None:
            return found
        H, moved = self.matrices.H, self.matrices.moved(self._before)
        V = innovation_spread(self.V, z - H @ self.x, self.rho)
        return V, *faded(moved, V, H, self.matrices.Q, R, self.beta, self._axis)


class EnsembleVarianceInflationKF(EnsembleMatrixKF):
    """`trackhelpers.filters.VarianceInflationKF` over M runs; arguments as there, x0 (n, M).

    Attributes
    ----------
    manoeuvring : numpy.ndarray of bool, shape (M,)
    """

    _by_run = (*EnsembleMatrixKF._by_run, "statistic", "manoeuvring", "_quiet_P", "_noise")

    def __init__(self, F, H, Q, R, x0, P0, inflation=100.0, window=5, probability=0.999):
        super().__init__(F, H, Q, R, x0, P0)
        self.inflation, self.window = check_inflation(inflation), check_window(window)
        self.limit = fading_limit(self.m, self.window, probability)
        self.statistic, self.manoeuvring = np.zeros(self.runs), np.zeros(self.runs, dtype=bool)
        self._quiet_P, self._noise = self.P[..., :1], 0 * self.P[..., :1]  # one for all runs, as long as none misses a measurement

    def predict(self):
        """Predict with the plain Q; `update` adds the rest where it is wanted."""
        super().predict()
        both = self.matrices.moved(np.concatenate([self._quiet_P, self._noise], axis=2)) + self.matrices.Q[..., None]
        self._quiet_P, self._noise = both[..., : both.shape[2] // 2], both[..., both.shape[2] // 2 :]

    def _update(self, z, R):
        model, innovation = self.matrices, z - self.matrices.H @ self.x
        _, P, _, S, _ = model.correct(0.0 * self._quiet_P[0], self._quiet_P, np.zeros((self.m, 1)), R)
        self.statistic = fading_sum(self.statistic, nis(innovation, np.broadcast_to(S, (self.m, self.m, self.runs))), self.window)
        self.manoeuvring = self.statistic > self.limit
        self.P = inflated(self.P, self._noise, self.manoeuvring, self.inflation)
        self._quiet_P, self._noise = P, 0 * self._noise
        super()._update(z, R)


class EnsembleInputEstimationKF(OneAPrediction, EnsembleMatrixKF):
    """`trackhelpers.filters.InputEstimationKF` over M runs; arguments as there, x0 (n, M).

    Attributes
    ----------
    u : numpy.ndarray, shape (q, M)
    changes : numpy.ndarray of int, shape (M,)
    """

    _by_run = (*EnsembleMatrixKF._by_run, "u", "changes", "_b", "_information", "_weighted", "_full")

    def __init__(self, F, G, H, Q, R, x0, P0, window=10, probability=0.9999):
        super().__init__(F, H, Q, R, x0, P0)
        self.G, self.window = check_input(self.matrices.F, G, self.matrices.H, window)
        (n, q), w, M = self.G.shape, self.window, self.runs
        self.limit = float(stats.chi2.ppf(check_probability(probability, "probability"), q))
        self.u, self.changes = np.zeros((q, M)), np.zeros(M, dtype=int)
        # The sums of `trackhelpers.manoeuvre.constant_input` for the windows that are open, one begun after each of the last w measurements, the oldest first.
        self._b, self._information, self._weighted = np.zeros((n, q, w, M)), np.zeros((q, q, w, M)), np.zeros((q, w, M))
        self._full = np.zeros(M, dtype=int)  # measurements since the input in force was found

    def predict(self):
        """Predict with the input in force."""
        super().predict()
        self.x = self.x + self.G @ self.u
        self._b = input_moves(self._b, self.matrices.F, self.G)

    def _update(self, z, R):
        self._one_a_prediction()
        super()._update(z, R)
        arguments = self._b, self._information, self._weighted, self.y, self.S, self.K, self.matrices.H
        sums = matrix_steps.input_seen(*arguments) or input_seen(*arguments)
        self._b, self._information, self._weighted = (_next_window(a) for a in sums)
        self._full = self._full + 1
        ready = np.flatnonzero(self._full >= self.window)
        if not len(ready):
            return
        oldest = [a[..., 0, ready] for a in sums]
        change, covariance, shift, significance = matrix_steps.input_found(*oldest) or input_found(*oldest)
        found = significance > self.limit
        some, change, shift = ready[found], change[:, found], shift[..., found]
        x, P = self.x[:, some] + matvec(shift, change), self.P[..., some] + congruence(shift, covariance[..., found])
        self._put(some, x=x, P=P, u=self.u[:, some] + change, changes=self.changes[some] + 1, _full=0)


def _next_window(sums):
    """Sums (..., w, M) without the oldest window, and with a new one."""
    return np.concatenate([sums[..., 1:, :], np.zeros_like(sums[..., :1, :])], axis=-2)

"""Ensembles of the filters with two models: variable dimension and interacting multiple models.

Each is the filter of the same name in `trackhelpers.filters` over M runs, with its rule; a run's model is a mask.
"""

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_covariance
from trackhelpers.consistency import nis
from trackhelpers.ensemble.covariance import log_density
from trackhelpers.ensemble.many_matrix_filters import Matrices, MatrixEnsemble, check_runs, of_runs
from trackhelpers.filters.imm import embedding, mixture, weighed
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_pair,
    check_probability,
    check_step,
    check_switching,
    check_window,
    fading_limit,
    fading_sum,
    manoeuvre_start,
    position_rows,
)


def _matrices(model, R, dt):
    nought = np.zeros(model.n)
    return Matrices(model.F(nought, dt), position_rows(model), model.Q(nought, dt), R)


class EnsembleVariableDimensionKF(OneAPrediction, MatrixEnsemble):
    """`trackhelpers.filters.VariableDimensionKF` over M runs; arguments as there, x0 (2 axes, M).

    Attributes
    ----------
    manoeuvring : numpy.ndarray of bool, shape (M,)
    x : numpy.ndarray, shape (3 axes, M)
        State with acceleration, with its covariance P, shape (3 axes, 3 axes, M); at rest what it was when the last manoeuvre ended.
    y : numpy.ndarray, shape (axes, M)
        Innovation of the measurement, with its covariance S, shape (axes, axes, M), by the model that predicted it.
    estimate : numpy.ndarray, shape (2 axes, M)
        Position and velocity, of whichever model is in force, with the covariance estimate_P, shape (2 axes, 2 axes, M).
    """

    _by_run = (*MatrixEnsemble._by_run, "estimate", "estimate_P", "manoeuvring", "statistic", "_past", "_full", "_significance")

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, window=5, enter=0.999, leave=0.95):
        check_pair(quiet, manoeuvring)
        self.dt, self.window = check_step(dt), check_window(window)
        self.estimate = check_runs(x0, "x0", quiet.n).copy()
        self._start(self.estimate, check_covariance(R, "R", len(position_rows(quiet))))
        self._rest, self._turn = (_matrices(model, self.R, dt) for model in (quiet, manoeuvring))
        self._kept = [manoeuvring.state.index(name) for name in quiet.state]
        self._accelerations = [i for i in range(manoeuvring.n) if i not in self._kept]
        self.enter_limit = fading_limit(self.m, self.window, check_probability(enter, "enter"))
        self.leave_limit = float(stats.chi2.ppf(check_probability(leave, "leave"), self.window * len(self._accelerations)))
        self.manoeuvring, self.statistic = np.zeros(self.runs, dtype=bool), np.zeros(self.runs)
        self.estimate_P = np.repeat(check_covariance(P0, "P0", quiet.n)[..., None], self.runs, axis=2)
        self.x, self.P = np.zeros((manoeuvring.n, self.runs)), np.zeros((manoeuvring.n, manoeuvring.n, self.runs))
        empty = np.zeros((self.m, 1)), self.R[..., None], np.zeros(1, dtype=int)
        self._past = ((self.estimate, self.estimate_P, *empty),) * (self.window + 2)  # each with its measurement, R and steps
        self._significance = (np.zeros(self.runs),) * self.window
        self._full = np.zeros(self.runs, dtype=int)  # measurements since the present model came into force

    def predict(self):
        """Predict every run by its model."""
        for runs, model, x, P in self._modes():
            self._set(runs, *model.predict(x, P))
        self._steps = self._steps + 1

    def _modes(self):
        """Of the runs at rest and of those in a manoeuvre: their numbers, the model, x and P."""
        rest, turn = np.flatnonzero(~self.manoeuvring), np.flatnonzero(self.manoeuvring)
        modes = [
            (rest, self._rest, self.estimate[:, rest], self.estimate_P[..., rest]),
            (turn, self._turn, self.x[:, turn], self.P[..., turn]),
        ]
        return [mode for mode in modes if len(mode[0])]

    def _update(self, z, R):
        self._one_a_prediction()
        y, S = np.empty_like(z), np.empty((self.m, *z.shape))
        for runs, model, x, P in self._modes():
            x, P, y[:, runs], S[..., runs], _ = model.correct(x, P, z[:, runs], R if R.ndim == 2 else R[..., runs])
            self._set(runs, x, P)
        self.y, self.S, turning = y, S, self.manoeuvring
        R = np.broadcast_to(R if R.ndim == 3 else R[..., None], S.shape)
        self._past, self._steps = (*self._past[1:], (self.estimate, self.estimate_P, z, R, self._steps)), 0 * self._steps
        self._full = self._full + 1
        self.statistic = np.where(turning, 0.0, fading_sum(self.statistic, nis(y, S), self.window))
        if turning.any():
            self._perhaps_leave(np.flatnonzero(turning))
        alarmed = (self.statistic > self.enter_limit) & ~turning & (self._full > self.window)
        if alarmed.any():
            self._enter(np.flatnonzero(alarmed))

    def _enter(self, runs):
        (x, P, *_), (_, _, first, R, steps), *later = of_runs(self._past, runs)
        x, P = manoeuvre_start(x, P, first, R, steps * self.dt)
        for _, _, z, R, steps in later:
            for step in range(steps.max()):
                moved, moved_P = self._turn.predict(x, P)
                x, P = np.where(step < steps, moved, x), np.where(step < steps, moved_P, P)
            x, P, *_ = self._turn.correct(x, P, z, R)
        self._set(runs, x, P)
        self._put(runs, manoeuvring=True, statistic=0.0, _full=0)

    def _perhaps_leave(self, runs):
        some = self._accelerations
        newest = np.zeros(self.runs)
        newest[runs] = nis(self.x[np.ix_(some, runs)], self.P[np.ix_(some, some, runs)])
        self._significance = (*self._significance[1:], newest)
        over = (self._full[runs] >= self.window) & (sum(self._significance)[runs] < self.leave_limit)
        self._put(runs[over], manoeuvring=False, _full=0)  # the newest of the past is the memory of the state at rest

    def _set(self, runs, x, P):
        if len(x) == len(self.x):
            self._put(runs, x=x, P=P)
            x, P = x[self._kept], P[np.ix_(self._kept, self._kept)]
        self._put(runs, estimate=x, estimate_P=P)


class EnsembleIMM(MatrixEnsemble):
    """`trackhelpers.filters.ManoeuvreIMM` over M runs; arguments as there, x0 (2 axes, M).

    Attributes
    ----------
    mu : numpy.ndarray, shape (2, M)
        Probability of rest and of manoeuvre.
    x : numpy.ndarray, shape (3 axes, M)
        Of the mixture, with its covariance P, shape (3 axes, 3 axes, M).
    y : numpy.ndarray, shape (axes, M)
        Innovation of the mixture's prediction, with its covariance S, shape (axes, axes, M).
    estimate : numpy.ndarray, shape (2 axes, M)
        Its position and velocity, with the covariance estimate_P, shape (2 axes, 2 axes, M).
    """

    _by_run = (*MatrixEnsemble._by_run, "mu", "_xs", "_Ps")

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, stay=(0.98, 0.98), mu=(0.9, 0.1)):
        check_pair(quiet, manoeuvring)
        x0, H, nought = check_runs(x0, "x0", quiet.n), position_rows(manoeuvring), np.zeros(quiet.n)
        self._start(x0, check_covariance(R, "R", len(H)))
        self._kept = [manoeuvring.state.index(name) for name in quiet.state]
        E = embedding(quiet, manoeuvring)
        at_rest = Matrices(E @ quiet.F(nought, dt) @ E.T, H, E @ quiet.Q(nought, dt) @ E.T, self.R)
        self._models = at_rest, _matrices(manoeuvring, self.R, dt)
        self._transition, mu = check_switching(stay, mu)
        self.mu = np.repeat(mu[:, None], self.runs, axis=1)
        self._xs = (E @ x0,) * 2
        self._Ps = (np.repeat((E @ check_covariance(P0, "P0", quiet.n) @ E.T)[..., None], self.runs, axis=2),) * 2
        self._mix()

    @property
    def estimate(self):
        """Position and velocity."""
        return self.x[self._kept]

    @property
    def estimate_P(self):
        """Their covariance."""
        return self.P[np.ix_(self._kept, self._kept)]

    def predict(self):
        """Let the chain move, mix the two models' estimates, and predict each; x and P are the mixture by the probabilities after the step."""
        ahead = self._transition.T @ self.mu
        moments = (mixture(row[:, None] * self.mu / ahead[j], self._xs, self._Ps) for j, row in enumerate(self._transition.T))
        self._xs, self._Ps = zip(*(model.predict(*moment) for model, moment in zip(self._models, moments, strict=True)), strict=True)
        self.mu = ahead
        self._mix()

    def _update(self, z, R):
        H = self._models[0].H
        self.y, self.S = z - H @ self.x, self._models[0].innovation_covariance(self.P, R)
        found = [model.correct(x, P, z, R) for model, x, P in zip(self._models, self._xs, self._Ps, strict=True)]
        self._xs, self._Ps, ys, Ss, _ = zip(*found, strict=True)
        self.mu, _ = weighed(self.mu, np.array([log_density(y, S) for y, S in zip(ys, Ss, strict=True)]))
        self._mix()

    def _mix(self):
        self.x, self.P = mixture(self.mu, self._xs, self._Ps)

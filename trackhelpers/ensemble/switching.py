"""Ensembles of the filters with two models: variable dimension and interacting multiple models.

Each is the filter of the same name in `trackhelpers.filters` over M runs; a run's model is a mask.
"""

from collections import deque

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_covariance
from trackhelpers.consistency import nis
from trackhelpers.ensemble.many_matrix_filters import Matrices, check_runs
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_pair,
    check_probability,
    check_step,
    check_switching,
    check_window,
    fading_limit,
    manoeuvre_start,
    position_rows,
)


def _matrices(model, R, dt):
    nought = np.zeros(model.n)
    return Matrices(model.F(nought, dt), position_rows(model), model.Q(nought, dt), R)


class EnsembleVariableDimensionKF(OneAPrediction):
    """`trackhelpers.filters.VariableDimensionKF` over M runs; arguments as there, x0 (2 axes, M).

    Attributes
    ----------
    manoeuvring : numpy.ndarray of bool, shape (M,)
    x (3 axes, M), P (3 axes, 3 axes, M) : state with acceleration; at rest what it was when the last manoeuvre ended
    estimate (2 axes, M), estimate_P (2 axes, 2 axes, M) : position and velocity, of whichever model is in force
    """

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, window=5, enter=0.999, leave=0.95):
        check_pair(quiet, manoeuvring)
        self.dt, self.window, self.m = check_step(dt), check_window(window), len(position_rows(quiet))
        self.estimate = check_runs(x0, "x0", quiet.n).copy()
        self.runs, self.R = self.estimate.shape[1], check_covariance(R, "R", self.m)
        self._rest, self._turn = (_matrices(model, self.R, dt) for model in (quiet, manoeuvring))
        self._kept = [manoeuvring.state.index(name) for name in quiet.state]
        self._accelerations = [i for i in range(manoeuvring.n) if i not in self._kept]
        self.enter_limit = fading_limit(self.m, self.window, enter)
        self.leave_limit = float(stats.chi2.ppf(check_probability(leave, "leave"), self.window * len(self._accelerations)))
        self.manoeuvring = np.zeros(self.runs, dtype=bool)
        self.estimate_P = np.repeat(check_covariance(P0, "P0", quiet.n)[..., None], self.runs, axis=2)
        self.x, self.P = np.zeros((manoeuvring.n, self.runs)), np.zeros((manoeuvring.n, manoeuvring.n, self.runs))
        self.statistic = np.zeros(self.runs)
        self._significance = np.zeros((window, self.runs))
        self._steps = np.zeros(self.runs, dtype=int)  # since the present model came into force
        self._past = deque([(self.estimate, self.estimate_P, None)], maxlen=window + 2)

    def predict(self):
        """Predict every run by its model."""
        rest, turn = np.flatnonzero(~self.manoeuvring), np.flatnonzero(self.manoeuvring)
        x, P = self._rest.predict(self.estimate[:, rest], self.estimate_P[..., rest])
        self.estimate, self.estimate_P = self.estimate.copy(), self.estimate_P.copy()
        self.estimate[:, rest], self.estimate_P[..., rest] = x, P
        if len(turn):
            self._put(turn, *self._turn.predict(self.x[:, turn], self.P[..., turn]))
        self._predicted = True

    def update(self, z):
        """Correct every run by z, shape (axes, M), and change its model where it is time."""
        z = check_runs(z, "z", self.m, self.runs)
        self._one_a_prediction()
        rest, turn = np.flatnonzero(~self.manoeuvring), np.flatnonzero(self.manoeuvring)
        x, P, y, S, _ = self._rest.correct(self.estimate[:, rest], self.estimate_P[..., rest], z[:, rest])
        self.estimate[:, rest], self.estimate_P[..., rest] = x, P
        self.statistic[rest] = (1 - 1 / self.window) * self.statistic[rest] + nis(y, S)
        self._past.append((self.estimate.copy(), self.estimate_P.copy(), z))
        self._steps += 1
        if len(turn):
            self._put(turn, *self._turn.correct(self.x[:, turn], self.P[..., turn], z[:, turn])[:2])
            self._perhaps_leave(turn)
        alarmed = (self.statistic > self.enter_limit) & ~self.manoeuvring & (self._steps > self.window)
        if np.any(alarmed):
            self._enter(np.flatnonzero(alarmed))

    def _enter(self, runs):
        (x, P, _), (_, _, first), *later = self._past
        x, P = manoeuvre_start(x[:, runs], P[..., runs], first[:, runs], self.R, self.dt)
        for _, _, z in later:
            x, P = self._turn.predict(x, P)
            x, P = self._turn.correct(x, P, z[:, runs])[:2]
        self._put(runs, x, P)
        self.manoeuvring[runs], self.statistic[runs], self._steps[runs] = True, 0.0, 0

    def _perhaps_leave(self, runs):
        some = self._accelerations
        part = self.P[np.ix_(some, some, runs)]
        self._significance[self._steps[runs] % self.window, runs] = nis(self.x[np.ix_(some, runs)], part)
        over = (self._steps[runs] >= self.window) & (self._significance[:, runs].sum(axis=0) < self.leave_limit)
        done = runs[over]
        self.manoeuvring[done], self._steps[done] = False, 0
        newest = self._past[-1]  # where a manoeuvre ends, the memory of the state at rest begins
        newest[0][:, done], newest[1][..., done] = self.estimate[:, done], self.estimate_P[..., done]

    def _put(self, runs, x, P):
        self.x[:, runs], self.P[..., runs] = x, P
        self.estimate[:, runs], self.estimate_P[..., runs] = x[self._kept], P[np.ix_(self._kept, self._kept)]


class EnsembleIMM(OneAPrediction):
    """`trackhelpers.filters.ManoeuvreIMM` over M runs; arguments as there, x0 (2 axes, M).

    Attributes
    ----------
    mu : numpy.ndarray, shape (2, M)
        Probability of rest and of manoeuvre.
    x (3 axes, M), P (3 axes, 3 axes, M) : of the mixture
    estimate (2 axes, M), estimate_P (2 axes, 2 axes, M) : its position and velocity
    """

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, stay=(0.98, 0.98), mu=(0.9, 0.1)):
        check_pair(quiet, manoeuvring)
        x0, n = check_runs(x0, "x0", quiet.n), manoeuvring.n
        self.runs = x0.shape[1]
        self._kept = [manoeuvring.state.index(name) for name in quiet.state]
        E = np.eye(n)[:, self._kept]
        H, R, nought = position_rows(manoeuvring), check_covariance(R, "R", len(position_rows(manoeuvring))), np.zeros(quiet.n)
        at_rest = Matrices(E @ quiet.F(nought, dt) @ E.T, H, E @ quiet.Q(nought, dt) @ E.T, R)
        self._models = at_rest, _matrices(manoeuvring, R, dt)
        self._stay, mu = check_switching(stay, mu)
        self.mu = np.repeat(mu[:, None], self.runs, axis=1)
        start = E @ x0
        self._xs = [start.copy() for _ in range(2)]
        self._Ps = [np.repeat((E @ check_covariance(P0, "P0", quiet.n) @ E.T)[..., None], self.runs, axis=2) for _ in range(2)]
        self._mixture(self.mu)

    @property
    def estimate(self):
        """Position and velocity."""
        return self.x[self._kept]

    @property
    def estimate_P(self):
        """Their covariance."""
        return self.P[np.ix_(self._kept, self._kept)]

    def predict(self):
        """Mix the two models' estimates, and predict each; x and P are the mixture by the probabilities after the step."""
        self._ahead = self._stay.T @ self.mu  # probability of each model after the step
        moments = [_mixed(self._stay[:, j, None] * self.mu / self._ahead[j], self._xs, self._Ps) for j in range(2)]
        moved = [model.predict(*moment) for model, moment in zip(self._models, moments, strict=True)]
        self._xs, self._Ps = [x for x, _ in moved], [P for _, P in moved]
        self._mixture(self._ahead)
        self._predicted = True

    def update(self, z):
        """Correct both models by z, shape (axes, M), and weigh them by their likelihoods."""
        z = check_runs(z, "z", len(self._models[0].H), self.runs)
        self._one_a_prediction()
        logs = np.empty((2, self.runs))
        for j, model in enumerate(self._models):
            self._xs[j], self._Ps[j], y, S, _ = model.correct(self._xs[j], self._Ps[j], z)
            logs[j] = -0.5 * (nis(y, S) + np.linalg.slogdet(np.moveaxis(S, -1, 0))[1])
        weights = self._ahead * np.exp(logs - logs.max(axis=0))
        self.mu = weights / weights.sum(axis=0)
        self._mixture(self.mu)

    def _mixture(self, mu):
        self.x, self.P = _mixed(mu, self._xs, self._Ps)


def _mixed(weights, xs, Ps):
    """Mean and covariance of a mixture, weights (2, M)."""
    mean = sum(w * x for w, x in zip(weights, xs, strict=True))
    spread = 0.0
    for w, x, P in zip(weights, xs, Ps, strict=True):
        d = x - mean
        spread = spread + w * (P + d[:, None] * d[None])
    return mean, spread

"""The variable-dimension filter: constant velocity until a manoeuvre is detected, with acceleration until it is over (paper 3, introduction)."""

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_array
from trackhelpers.consistency import nis
from trackhelpers.filters.base import atomic
from trackhelpers.filters.matrix_filter import AdaptiveKF
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_pair,
    check_probability,
    check_step,
    check_window,
    fading_limit,
    fading_sum,
    manoeuvre_start,
    position_rows,
)


class VariableDimensionKF(OneAPrediction, AdaptiveKF):
    """Kalman filter that changes its model, and with it its dimension, between rest and manoeuvre.

    *At rest* it runs `quiet` and sums its NIS with a fading memory of `window` measurements. When the sum passes its limit, the manoeuvre is taken to have begun
    `window` + 1 measurements ago: the state with acceleration is started there (`trackhelpers.manoeuvre.manoeuvre_start`) and run through the kept measurements up to now.
    *In a manoeuvre* it runs `manoeuvring`, and sums the acceleration's significance âᵀP_a⁻¹â over the last `window` measurements; when that is no longer significant, it
    drops the acceleration. A missed scan is no evidence: it leaves both sums, and the start and the run through the past take as many steps as there were.

    Parameters
    ----------
    quiet, manoeuvring : trackhelpers.motion.Model
        Linear models, CV and CA or Singer, with the same axes.
    R : array_like, shape (axes, axes)
        Covariance of the measured position, m².
    dt : float
        Step, s, > 0.
    x0 : array_like, shape (2 axes,)
    P0 : array_like, shape (2 axes, 2 axes)
        Start in the state of `quiet`.
    window : int
        Effective memory, measurements.
    enter : float
        Probability that the fading sum stays below its limit while the target is at rest.
    leave : float
        Quantile of chi-square, `window` · axes degrees of freedom, below which the summed significance ends a manoeuvre.

    Attributes
    ----------
    manoeuvring : bool
    x, P : of the model in force, n = 2 axes or 3 axes
    y, S : innovation of the measurement and its covariance, by the model that predicted it
    estimate (2 axes,), estimate_P : position and velocity in either

    Raises
    ------
    ValueError
        As for `MatrixKF`; models that do not belong together, dt = 0, window < 1, probabilities outside (0, 1).

    References
    ----------
    Y. Bar-Shalom, K. Birmiwal, IEEE Transactions on Aerospace and Electronic Systems AES-18 (1982) 621–629; [5] in the text of paper 3.
    """

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, window=5, enter=0.999, leave=0.95):
        check_pair(quiet, manoeuvring)
        self.dt = check_step(dt)
        x0 = check_array(x0, "x0", quiet.n, ())
        self._models = {False: self._matrices(quiet), True: self._matrices(manoeuvring)}
        F, H, Q = self._models[False]
        super().__init__(F, H, Q, R, x0, P0)
        self._kept = [manoeuvring.state.index(name) for name in quiet.state]
        self._accelerations = [i for i in range(manoeuvring.n) if i not in self._kept]
        self.window = check_window(window)
        self.enter_limit = fading_limit(self.dim_z, self.window, check_probability(enter, "enter"))
        self.leave_limit = float(stats.chi2.ppf(check_probability(leave, "leave"), self.window * len(self._accelerations)))
        self.manoeuvring, self.statistic = False, 0.0
        self._past = [(self.x, self.P, None, None, 0)]  # estimates at rest, each with its measurement, R and steps
        self._significance = []

    def _matrices(self, model):
        nought = np.zeros(model.n)
        return model.F(nought, self.dt), position_rows(model), model.Q(nought, self.dt)

    @property
    def estimate(self):
        """Position and velocity, shape (2 axes,)."""
        return self.x[self._kept] if self.manoeuvring else self.x

    @property
    def estimate_P(self):
        """Their covariance."""
        return self.P[np.ix_(self._kept, self._kept)] if self.manoeuvring else self.P

    @atomic
    def predict(self):
        """Predict by the model in force."""
        super().predict()
        self._steps += 1

    def _update(self, z, R):
        """One measurement a prediction, for the memory counts steps: RuntimeError for a second one."""
        self._one_a_prediction()
        super()._update(z, R)
        steps, self._steps = self._steps, 0
        if self.manoeuvring:
            self._perhaps_leave()
            return
        self._past = [*self._past[-self.window - 1 :], (self.x, self.P, self.z, R.copy(), steps)]
        self.statistic = fading_sum(self.statistic, nis(self.y, self.S), self.window)
        if self.statistic > self.enter_limit and len(self._past) == self.window + 2:
            self._enter()

    def _enter(self):
        evidence = {name: getattr(self, name) for name in ("y", "S", "SI")}
        (x, P, *_), (_, _, first, R, steps), *later = self._past
        self._change(True, *manoeuvre_start(x, P, first, R, steps * self.dt))
        for _, _, z, R, steps in later:
            for _ in range(steps):
                super().predict()
            super()._update(z, R)
        self.__dict__.update(evidence)
        self._past, self.statistic = [], 0.0

    def _perhaps_leave(self):
        some = self._accelerations
        self._significance = [*self._significance, nis(self.x[some], self.P[np.ix_(some, some)])][-self.window :]
        if len(self._significance) == self.window and sum(self._significance) < self.leave_limit:
            self.x_prior, self.P_prior = self.x_prior[self._kept], self.P_prior[np.ix_(self._kept, self._kept)]
            self._change(False, self.estimate, self.estimate_P)
            self._significance, self._past = [], [(self.x, self.P, None, None, 0)]

    def _change(self, manoeuvring, x, P):
        self.manoeuvring = manoeuvring
        self.F, self.H, self.Q = self._models[manoeuvring]
        self.dim_x, self._I = len(x), np.eye(len(x))
        self.x, self.P = x, P
        self.x_post, self.P_post = x.copy(), P.copy()

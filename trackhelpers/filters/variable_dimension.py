"""The variable-dimension filter: constant velocity until a manoeuvre is detected, with acceleration until it is over (paper 3, introduction)."""

from collections import deque

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.consistency import nis
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.manoeuvre import (
    OneAPrediction,
    check_pair,
    check_probability,
    check_step,
    check_window,
    fading_limit,
    manoeuvre_start,
    position_rows,
)


class VariableDimensionKF(OneAPrediction, MatrixKF):
    """Kalman filter that changes its model, and with it its dimension, between rest and manoeuvre.

    *At rest* it runs `quiet` and sums its NIS with a fading memory of `window` steps. When the sum passes its limit, the manoeuvre is taken to have begun `window` + 1
    steps ago: the state with acceleration is started there (`trackhelpers.manoeuvre.manoeuvre_start`) and run through the kept measurements up to now.
    *In a manoeuvre* it runs `manoeuvring`, and sums the acceleration's significance âᵀP_a⁻¹â over the last `window` steps; when that is no longer significant, it drops
    the acceleration.

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
        Effective memory, steps.
    enter : float
        Probability that the fading sum stays below its limit while the target is at rest.
    leave : float
        Quantile of chi-square, `window` · axes degrees of freedom, below which the summed significance ends a manoeuvre.

    Attributes
    ----------
    manoeuvring : bool
    x, P : of the model in force, n = 2 axes or 3 axes
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
        self.enter_limit = fading_limit(self.dim_z, self.window, enter)
        self.leave_limit = float(stats.chi2.ppf(check_probability(leave, "leave"), self.window * len(self._accelerations)))
        self.manoeuvring, self.statistic = False, 0.0
        self._past = deque([(self.x, self.P, None)], maxlen=self.window + 2)  # estimates at rest, each with its measurement
        self._significance = deque(maxlen=self.window)

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

    def predict(self):
        """Predict by the model in force."""
        super().predict()
        self._predicted = True

    def update(self, z):
        """Correct by measurement `z`, shape (axes,), and change the model where it is time; None leaves the prediction and both sums.

        One measurement a prediction: the sums count steps. RuntimeError for a second one.
        """
        if z is None:
            self._no_measurement()
            if not self.manoeuvring:
                self._past.clear()
                self._past.append((self.x, self.P, None))
            return
        z = self._measurement(z)
        self._one_a_prediction()
        super().update(z)
        if self.manoeuvring:
            self._perhaps_leave()
            return
        self._past.append((self.x, self.P, self.z))
        self.statistic = (1 - 1 / self.window) * self.statistic + nis(self.y, self.S)
        if self.statistic > self.enter_limit and len(self._past) == self.window + 2:
            self._enter()

    def _enter(self):
        (x, P, _), (_, _, first), *later = self._past
        self._change(True, *manoeuvre_start(x, P, first, self.R, self.dt))
        for _, _, z in later:
            super().predict()
            super().update(z)
        self._past.clear()
        self.statistic = 0.0

    def _perhaps_leave(self):
        some = self._accelerations
        self._significance.append(nis(self.x[some], self.P[np.ix_(some, some)]))
        if len(self._significance) == self.window and sum(self._significance) < self.leave_limit:
            self._change(False, self.estimate, self.estimate_P)
            self._significance.clear()
            self._past.append((self.x, self.P, None))

    def _change(self, manoeuvring, x, P):
        self.manoeuvring = manoeuvring
        self.F, self.H, self.Q = self._models[manoeuvring]
        self.dim_x, self._I = len(x), np.eye(len(x))
        self.x, self.P = x, check_covariance(P, "P", len(x))
        self.x_post, self.P_post = x.copy(), self.P.copy()

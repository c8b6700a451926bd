"""Two models at once: filterpy's interacting multiple model estimator on constant velocity and constant acceleration (paper 3, introduction)."""

import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter

from trackhelpers import matrix_steps
from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.filters.base import OneTarget, atomic
from trackhelpers.filters.matrix_filter import MatrixKF, inverse_of_S
from trackhelpers.manoeuvre import check_pair, check_switching, position_rows


def embedding(quiet, manoeuvring):
    """E (n, n₀), which puts the state of `quiet` into that of `manoeuvring`, accelerations 0."""
    return np.array([[float(a == b) for b in quiet.state] for a in manoeuvring.state])


def mixture(weights, xs, Ps):
    """Mean (n, ...) and covariance (n, n, ...) of a mixture of two: weights (2, ...), two states (n, ...) and their covariances (n, n, ...)."""
    (a, b), (x, other), (P, other_P) = weights, xs, Ps
    if x.ndim == 2 and (mixed := matrix_steps.mixture(weights, xs, Ps)) is not None:
        return mixed
    apart = x - other
    return a * x + b * other, a * P + b * other_P + a * b * (apart[:, None] * apart)


def weighed(ahead, logs):
    """Probabilities (2, ...) of the models after a measurement, from those before it and its log-likelihoods under each, and its log-likelihood under both, (...).

    Only differences of logarithms are turned into likelihoods: far from both models filterpy's are both rounded up to the least positive number, and so equal.
    """
    most = np.max(logs, axis=0)
    weights = ahead * np.exp(logs - most)
    total = weights.sum(axis=0)
    return weights / total, most + np.log(total)


class ManoeuvreIMM(OneTarget, IMMEstimator):
    """filterpy's IMMEstimator on a quiet and a manoeuvring model, both in the state of the latter.

    The inner filters' predictions and updates are filterpy's. The Markov chain moves in `predict`, where filterpy moves it in `update`: so a missed scan moves it too,
    and several measurements may follow one prediction.

    filterpy mixes states of one dimension only. The quiet model is therefore written in the larger state, with the columns and rows of the acceleration zero: it
    forgets every acceleration and is sure that there is none.

    Parameters
    ----------
    quiet, manoeuvring : trackhelpers.motion.Model
        Linear models, CV and CA or Singer, with the same axes.
    R : array_like, shape (axes, axes)
        Covariance of the measured position, m².
    dt : float
        Step, s.
    x0 : array_like, shape (2 axes,)
    P0 : array_like, shape (2 axes, 2 axes)
        Start in the state of `quiet`.
    stay : (float, float)
        Probabilities of staying at rest and in a manoeuvre for one more step.
    mu : (float, float)
        Probabilities of the two at the start.

    Attributes
    ----------
    mu : numpy.ndarray, shape (2,)
        Probability of rest and of manoeuvre.
    x : numpy.ndarray, shape (3 axes,)
        Of the mixture, with its covariance P.
    y : numpy.ndarray, shape (axes,)
        Innovation of the mixture's prediction, with its covariance S.
    likelihood : numpy.ndarray, shape (2,)
        Of the last measurement under each model, up to a common factor; 1 where nothing was measured.
    log_likelihood : float
        Of the last measurement under both.
    estimate : numpy.ndarray, shape (2 axes,)
        Position and velocity of the mixture, with the covariance estimate_P.

    Raises
    ------
    ValueError
        Models that do not belong together, arguments as for `MatrixKF`, probabilities outside (0, 1).
    """

    def __init__(self, quiet, manoeuvring, R, dt, x0, P0, stay=(0.98, 0.98), mu=(0.9, 0.1)):
        check_pair(quiet, manoeuvring)
        E = embedding(quiet, manoeuvring)
        x0, P0 = check_array(x0, "x0", quiet.n, ()), check_covariance(P0, "P0", quiet.n)
        transition, mu = check_switching(stay, mu)
        H, nought = position_rows(manoeuvring), np.zeros
        matrices = (
            (E @ quiet.F(nought(quiet.n), dt) @ E.T, E @ quiet.Q(nought(quiet.n), dt) @ E.T),
            (manoeuvring.F(nought(manoeuvring.n), dt), manoeuvring.Q(nought(manoeuvring.n), dt)),
        )
        super().__init__([MatrixKF(F, H, Q, R, E @ x0, E @ P0 @ E.T) for F, Q in matrices], mu, transition)
        self._kept = E.T
        self._no_measurement()

    @property
    def estimate(self):
        """Position and velocity, shape (2 axes,)."""
        return self._kept @ self.x

    @property
    def estimate_P(self):
        """Their covariance."""
        return self._kept @ self.P @ self._kept.T

    @atomic
    def predict(self):
        """Let the chain move, mix the two estimates accordingly, and predict each. x, P is the mixture by the probabilities after the step."""
        self.cbar = self.mu @ self.M
        self.omega = self.M * self.mu[:, None] / self.cbar
        xs, Ps = [kf.x for kf in self.filters], [kf.P for kf in self.filters]
        for kf, weights in zip(self.filters, self.omega.T.tolist(), strict=True):
            kf.x, kf.P = mixture(weights, xs, Ps)
            KalmanFilter.predict(kf)
        self.mu = self.cbar
        self._mix()
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()

    @atomic
    def update(self, z, R=None):
        """Correct by measurement `z`, shape (axes,), with the noise covariance `R` in this call only. None leaves the prediction and the probabilities."""
        if z is None:
            for kf in (self, *self.filters):
                kf._no_measurement()
            return
        self._log_likelihood = self._mahalanobis = None
        first = self.filters[0]
        z, noise = first._arguments(z, R)
        self.z, self.y, self.S = z.copy(), z - first.H @ self.x, first.H @ self.P @ first.H.T + noise
        self.SI = inverse_of_S(self.S)
        for kf in self.filters:
            KalmanFilter.update(kf, z, None if R is None else noise)
        logs = np.array([kf.log_likelihood for kf in self.filters])
        self.likelihood = np.exp(logs - logs.max())
        self.mu, self._log_likelihood = weighed(self.mu, logs)
        self._mix()
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

    def _mix(self):
        self.x, self.P = mixture(self.mu.tolist(), [kf.x for kf in self.filters], [kf.P for kf in self.filters])

    def _no_measurement(self):
        super()._no_measurement()
        self.likelihood = np.ones(2)

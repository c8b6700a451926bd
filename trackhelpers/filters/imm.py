"""Two models at once: filterpy's interacting multiple model estimator on constant velocity and constant acceleration (paper 3, introduction)."""

import numpy as np
from filterpy.kalman import IMMEstimator

from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.manoeuvre import OneAPrediction, check_pair, check_switching, position_rows


def embedding(quiet, manoeuvring):
    """E (n, n₀), which puts the state of `quiet` into that of `manoeuvring`, accelerations 0."""
    return np.array([[float(a == b) for b in quiet.state] for a in manoeuvring.state])


class ManoeuvreIMM(OneAPrediction, IMMEstimator):
    """filterpy's IMMEstimator on a quiet and a manoeuvring model, both in the state of the latter.

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
    estimate (2 axes,), estimate_P : position and velocity of the mixture

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

    @property
    def estimate(self):
        """Position and velocity, shape (2 axes,)."""
        return self._kept @ self.x

    @property
    def estimate_P(self):
        """Their covariance."""
        return self._kept @ self.P @ self._kept.T

    def predict(self):
        """Mix the two estimates and predict each. The mixture x, P is weighed by the probabilities after the step; filterpy weighs it by those before."""
        super().predict()
        self._predicted = True
        before, self.mu = self.mu, self.cbar
        self._compute_state_estimate()
        self.mu = before
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()

    def update(self, z):
        """Correct by measurement `z`, shape (axes,), one a prediction. None leaves the prediction; filterpy would weigh the models by an older measurement's likelihood.

        The likelihoods are compared by their logarithms: far from both models filterpy's are both rounded up to the least positive number, and so equal.
        """
        if z is None:
            for kf in self.filters:
                kf.update(None)
            self.mu = self.cbar.copy()
        else:
            z = self.filters[0]._measurement(z)
            self._one_a_prediction()
            for kf in self.filters:
                kf.update(z)
            logs = np.array([kf.log_likelihood for kf in self.filters])
            self.likelihood = np.exp(logs - logs.max())  # up to a common factor
            self.mu = self.cbar * self.likelihood
            self.mu = self.mu / self.mu.sum()
        self._compute_mixing_probabilities()
        self._compute_state_estimate()
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

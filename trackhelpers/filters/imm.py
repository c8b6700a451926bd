"""Two models at once: filterpy's interacting multiple model estimator on constant velocity and constant acceleration (paper 3, introduction)."""

import numpy as np
from filterpy.kalman import IMMEstimator

from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.detection import position_rows
from trackhelpers.filters.matrices import MatrixKF, check_matrix
from trackhelpers.filters.variable_dimension import check_pair


def embedding(quiet, manoeuvring):
    """E (n, n₀), which puts the state of `quiet` into that of `manoeuvring`, accelerations 0."""
    return np.array([[float(a == b) for b in quiet.state] for a in manoeuvring.state])


class ManoeuvreIMM(IMMEstimator):
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

    def update(self, z):
        """Correct by measurement `z`, shape (axes,). None leaves the prediction; filterpy would weigh the models by the likelihood of an older measurement."""
        if z is not None:
            super().update(self.filters[0]._measurement(z))
            return
        for kf in self.filters:
            kf.update(None)
        self.mu = self.cbar.copy()
        self._compute_mixing_probabilities()
        self.x_post, self.P_post = self.x.copy(), self.P.copy()


def check_switching(stay, mu):
    """The transition matrix, [i, j] from model i to model j, and the first probabilities; ValueError unless all lie strictly between 0 and 1."""
    stay, mu = check_matrix(stay, "stay", (2,)), check_matrix(mu, "mu", (2,))
    for name, value in (("stay", stay), ("mu", mu)):
        if np.any((value <= 0) | (value >= 1)):
            raise ValueError(f"{name}: expected two probabilities between 0 and 1, got {value}")
    if abs(mu.sum() - 1) > 1e-9:
        raise ValueError(f"mu: expected probabilities that sum to 1, got {mu}")
    return np.array([[stay[0], 1 - stay[0]], [1 - stay[1], stay[1]]]), mu

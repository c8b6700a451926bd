"""The filters of paper 3 and their rivals, each as one filterpy subclass and as an ensemble.

Every contender is handed a start x0 and stands on the same measured positions. The filters whose gain does not depend on the data are one matrix model each, and run on
`EnsembleKF`; the others have ensembles of their own.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from trackhelpers import exact
from trackhelpers.arrays import congruence
from trackhelpers.consistency import nees, nis
from trackhelpers.ensemble import EnsembleKF
from trackhelpers.ensemble.adaptive import EnsembleInputEstimationKF, EnsembleStrongTrackingKF, EnsembleVarianceInflationKF
from trackhelpers.ensemble.switching import EnsembleIMM, EnsembleVariableDimensionKF
from trackhelpers.filters import (
    AugmentedBiasKF,
    InputEstimationKF,
    ManoeuvreIMM,
    MatrixKF,
    StrongTrackingKF,
    VariableDimensionKF,
    VarianceInflationKF,
    augmented_matrices,
)
from trackhelpers.follow import follow
from trackhelpers.motion import CA, CV, LinearModel, Singer
from trackhelpers.scenarios.augmented_bias.target import P0, R, T
from trackhelpers.sensors import LinearSensor

SIGMA_A = 0.1  # m/s²: Q_cv = diag(0.01, 0.01) is printed, and taken as the covariance of the acceleration
MODEL = CV(SIGMA_A, axes=2)
F, Q, GAMMA = MODEL.F(np.zeros(4), T), MODEL.Q(np.zeros(4), T), MODEL.G(np.zeros(4), T)
H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])

# Q_Λ is garbled in print ("0.1.0.1.": four components); the first is the default, the last is rank one an axis, q ΓΓᵀ
BIAS_NOISE = {
    "0.01, 0.01": np.diag([0.01, 0.01, 0.01, 0.01]),
    "0.1, 0.01": np.diag([0.1, 0.01, 0.1, 0.01]),
    "0.001, 0.001": np.diag([0.001, 0.001, 0.001, 0.001]),
    "0.01 ΓΓᵀ": 0.01 * GAMMA @ GAMMA.T,
}
ACCELERATING = CA(0.1, axes=2)  # the same increment as in 0.01 ΓΓᵀ
CORRELATED = Singer(2.0, 20.0, axes=2)
POSITION_VELOCITY = np.kron(np.eye(2), [[1.0, 0, 0], [0, 1, 0]])  # what is estimated, of a state with accelerations

LOOK = {  # one colour and dash a method in all figures of the paper
    "SKF": {"color": "#0072B2", "linestyle": "-"},
    "STKF": {"color": "#D55E00", "linestyle": "--"},
    "ABMA": {"color": "#009E73", "linestyle": "-"},
    "CA": {"color": "#E69F00", "linestyle": "-."},
    "Singer": {"color": "#CC79A7", "linestyle": ":"},
    "IMM": {"color": "#882255", "linestyle": "-"},
    "VDF": {"color": "#56B4E9", "linestyle": (0, (6, 2))},
    "input estimation": {"color": "#332288", "linestyle": (0, (1, 1))},
    "inflation": {"color": "#999933", "linestyle": (0, (4, 1, 1, 1, 1, 1))},
}


class Followed(NamedTuple):
    """What a filter says after each of N measurements, over M runs."""

    x: np.ndarray  # (4, N, M) position and velocity
    P: np.ndarray  # (4, 4, N, M) their covariance, (4, 4, N, 1) where it is the same in all runs
    nis: np.ndarray  # (N, M)


class Judged(NamedTuple):
    """What is asked of a filter over M runs after each of N measurements."""

    x: np.ndarray  # (4, N, M) position and velocity
    nees: np.ndarray | None  # (N, M), None for a covariance that means nothing
    nis: np.ndarray  # (N, M)


@dataclass(frozen=True)
class Linear:
    """A filter whose gain is known before any measurement: matrices of its own state, and the estimate (4, n) as a function of it."""

    name: str
    F: np.ndarray
    H: np.ndarray
    Q: np.ndarray
    to_estimate: np.ndarray
    from_start: np.ndarray  # (n, 4): the state at the start, from the start of position and velocity
    honest: bool = True  # whether its covariance means something

    @property
    def P0(self):
        """Covariance of its state at the start."""
        return self.from_start @ P0 @ self.from_start.T

    @cached_property
    def model(self):
        return LinearModel(self.F, self.Q, T, [f"c{i}" for i in range(len(self.F))])

    @cached_property
    def sensor(self):
        return LinearSensor(self.H, R, self.model.state)

    def single(self, x0):
        """The filterpy subclass, started at x0 (4,)."""
        return MatrixKF(self.F, self.H, self.Q, R, self.from_start @ x0, self.P0)

    def _history(self, x0, z, keep):
        return follow(EnsembleKF(self.model, self.from_start @ x0, self.P0), np.moveaxis(z, 1, 0), self.sensor, T, keep=keep)

    def estimates(self, x0, z):
        """Estimates (4, N, M) after each measurement of z (2, N, M), from x0 (4, M): the quick way to them alone."""
        return np.tensordot(self.to_estimate, self._history(x0, z, ("x",)).x, 1)

    def followed(self, x0, z):
        """What the filter says of z (2, N, M), from x0 (4, M): `Followed`."""
        known = exact.gains(self.F, self.H, self.Q, R, self.P0, z.shape[1])
        history, P = self._history(x0, z, ("x", "y")), congruence(self.to_estimate[..., None], known.P[..., 1:])
        return Followed(np.tensordot(self.to_estimate, history.x, 1), P[..., None], nis(history.y, known.S[..., None]))

    def judged(self, x0, z, truth):
        """Estimates, NEES and NIS against the truth (4, N) of all runs: `Judged`; the rest as for `followed`."""
        x, P, by_step = self.followed(x0, z)
        return Judged(x, nees(truth[..., None], x, P) if self.honest else None, by_step)


@dataclass(frozen=True)
class Adaptive:
    """A filter whose gain depends on the data: the filterpy subclass and its ensemble, and what both are built from."""

    name: str
    classes: tuple  # the filterpy subclass and its ensemble
    arguments: callable  # x0, whether for one target -> (args, keywords)
    honest: bool = True

    def single(self, x0):
        """The filterpy subclass, started at x0 (4,)."""
        args, keywords = self.arguments(x0, True)
        return self.classes[0](*args, **keywords)

    def ensemble(self, x0):
        """The ensemble, started at x0 (4, M)."""
        args, keywords = self.arguments(x0, False)
        return self.classes[1](*args, **keywords)

    def estimates(self, x0, z):
        """As `Linear.estimates`."""
        return follow(self.ensemble(x0), np.moveaxis(z, 1, 0), keep=("x",)).x

    def followed(self, x0, z):
        """As `Linear.followed`. With two models in force the NIS is that of the mixture's, or of the present model's, prediction."""
        history = follow(self.ensemble(x0), np.moveaxis(z, 1, 0), keep=("x", "P", "y", "S"))
        return Followed(history.x, history.P, nis(history.y, history.S))

    def judged(self, x0, z, truth):
        """As `Linear.judged`; NEES step by step, so that the covariances need not be kept."""
        truth = truth if self.honest else None
        history = follow(self.ensemble(x0), np.moveaxis(z, 1, 0), keep=("x", "y", "S"), truth=truth)
        return Judged(history.x, history.nees if self.honest else None, nis(history.y, history.S))


def gains(linear, steps):
    """Gains (n, m, steps) and posterior covariances (n, n, steps + 1) of a `Linear` contender: they know no measurement."""
    known = exact.gains(linear.F, linear.H, linear.Q, R, linear.P0, steps)
    return known.K, known.P


def exact_errors(linear, track):
    """Mean and covariance of a `Linear` contender's error on a fixed track, by recursion.

    Parameters
    ----------
    linear : Linear
    track : array_like, shape (4, N + 1)
        True positions and velocities; measured from sample 1 on with the covariance R, the start drawn about sample 0.

    Returns
    -------
    bias : numpy.ndarray, shape (4, N + 1)
    covariance, believed : numpy.ndarray, shape (4, 4, N + 1)
        True covariance of the error, and the filter's own.
    """
    state, L = linear.from_start @ track, linear.to_estimate  # measured as the track is; what else the filter's state holds is 0 there
    bias, *covariances = exact.exact_error(linear.model, linear.sensor, state, T, state[:, 0], linear.P0, linear.P0)
    return L @ (bias + state) - track, *(congruence(L[..., None], P) for P in covariances)


def plain():
    """The standard Kalman filter (SKF) on CV, (1)–(6)."""
    return Linear("SKF", F, H, Q, np.eye(4), np.eye(4))


def accelerating(model=ACCELERATING, name="CA"):
    """A plain Kalman filter with accelerations in its state, known to be 0 at the start, where the target is at rest."""
    nought = np.zeros(6)
    sensor = POSITION_VELOCITY[[0, 2]]
    return Linear(name, model.F(nought, T), sensor, model.Q(nought, T), POSITION_VELOCITY, POSITION_VELOCITY.T)


def augmented(Q_bias="0.01, 0.01", reading="R1", name=None):
    """The augmented bias model algorithm (ABMA) with Q_Λ from `BIAS_NOISE` or given, (4, 4)."""
    matrix = BIAS_NOISE[Q_bias] if isinstance(Q_bias, str) else Q_bias
    A = augmented_matrices(F, H, Q, matrix, reading)
    rank_one = np.linalg.matrix_rank(matrix) <= 2
    return Linear(name or f"ABMA {Q_bias}", A.F, A.H, A.Q, A.estimate, np.eye(8, 4), honest=rank_one)


def augmented_kf(x0, Q_bias="0.01, 0.01", reading="R1"):
    """The same as the filterpy subclass `AugmentedBiasKF`."""
    matrix = BIAS_NOISE[Q_bias] if isinstance(Q_bias, str) else Q_bias
    return AugmentedBiasKF(F, H, Q, R, matrix, x0, P0, reading)


def _adaptive(name, classes, args, settings, honest=True):
    return Adaptive(name, classes, lambda x0, single: ((*args, x0, P0), settings), honest)


def strong_tracking(beta=4.0, factors="one", rho=0.95):
    """The strong tracking filter (STKF) on CV."""
    settings = {"beta": beta, "rho": rho, "factors": factors}
    return _adaptive(f"STKF β={beta:g}, {factors}", (StrongTrackingKF, EnsembleStrongTrackingKF), (F, H, Q, R), settings, honest=False)


def variance_inflation(**settings):
    """Variance inflation on CV."""
    return _adaptive("inflation", (VarianceInflationKF, EnsembleVarianceInflationKF), (F, H, Q, R), settings)


def input_estimation(**settings):
    """Input estimation on CV."""
    return _adaptive("input estimation", (InputEstimationKF, EnsembleInputEstimationKF), (F, GAMMA, H, Q, R), settings)


def variable_dimension(manoeuvring=ACCELERATING, **settings):
    """The variable-dimension filter (VDF) between CV and CA."""
    return _adaptive("VDF", (VariableDimensionKF, EnsembleVariableDimensionKF), (MODEL, manoeuvring, R, T), settings)


def interacting(manoeuvring=ACCELERATING, **settings):
    """The interacting multiple model estimator (IMM) of CV and CA."""
    return _adaptive("IMM", (ManoeuvreIMM, EnsembleIMM), (MODEL, manoeuvring, R, T), settings)

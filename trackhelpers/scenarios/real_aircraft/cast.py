"""The filters that are held against real aircraft: how each is built over an ensemble, its settings, and how it predicts."""

from typing import NamedTuple

import numpy as np

from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.ensemble.adaptive import EnsembleStrongTrackingKF
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.ensemble.motion_imm import EnsembleMotionIMM
from trackhelpers.ensemble.switching import EnsembleIMM
from trackhelpers.filters import augmented_matrices
from trackhelpers.motion import CA, CTRA, CTRV, CV, Singer
from trackhelpers.motion.base import pair

STAY = (60.0, 30.0)  # s in quiet flight and in a manoeuvre, on average, of the filters with two models


class StraightTurn(CTRV):
    """CV in the state of CTRV, so that the two may be mixed: the turn rate is forgotten at each step, and the noise is CV's, the same along the heading and across.

    Parameters
    ----------
    sigma_a : float
        Standard deviation of the acceleration, constant within a step, m/s².
    """

    def __init__(self, sigma_a):
        super().__init__(sigma_a, sigma_a)

    def _parts(self, x, dt, order):
        return super()._parts([*x[:4], 0.0 * x[4]], dt, order)

    def _f(self, x, dt, arc):
        return *super()._f([*x[:4], 0.0 * x[4]], dt, arc)[:4], 0.0 * x[4]

    def _F(self, x, dt, arc):
        E = arc[1][0]
        return pair(2, E) | pair(3, 1j * x[2] * E) | {(4, 4): 0.0}

    def _G(self, x, dt, arc):
        ahead = dt**2 / 2 * arc[0]
        return pair(0, ahead) | pair(1, 1j * ahead) | {(2, 0): dt, (3, 1): dt / np.maximum(np.abs(x[2]), 1.0)}


class WholeIMM(EnsembleIMM):
    """`EnsembleIMM` whose `estimate` is its whole state, accelerations too."""

    @property
    def estimate(self):
        return self.x


class Contender(NamedTuple):
    """One method: `grid`, its settings; build(setting, blocks) gives the ensemble; ahead(ens, x, h) the positions (2, ...) h seconds after the states x (n, ...) that it kept."""

    grid: tuple
    build: object
    ahead: object


def _of_model(ens, x, h):
    return ens.model.f(x, h)[[0, ens.model.state.index("y")]]


def _on_cartesian(make, Ensemble=EnsembleEKF):
    """A builder for a model whose axes are chains: position, velocity, and what is 0 at the start."""

    def build(setting, blocks):
        model = make(*setting)
        rows = [model.state.index(name) for name in ("x", "vx", "y", "vy")]
        x0, P0 = np.zeros((model.n, blocks.start.shape[1])), 2.0**2 * np.eye(model.n)
        x0[rows], P0[np.ix_(rows, rows)] = blocks.start, blocks.P0
        return Ensemble(model, x0, P0)

    return build


def polar(start, P0, n):
    """A start (x, vx, y, vy) (4, M) with its covariance (4, 4) in the state (x, y, v, θ, ω[, a]): (n, M) and (n, n, M)."""
    px, vx, py, vy = start
    v = np.hypot(vx, vy)
    zero = np.zeros_like(v)
    x0 = np.array([px, py, v, np.arctan2(vy, vx), zero, zero][:n])
    variances = np.array(
        [P0[0, 0] + zero, P0[2, 2] + zero, P0[1, 1] + zero, np.minimum(P0[3, 3] / np.maximum(v, 1) ** 2, 1.0), 0.03**2 + zero, 4 + zero][:n]
    )
    return x0, np.eye(n)[..., None] * variances


def _on_polar(make, Ensemble=EnsembleEKF):
    def build(setting, blocks):
        model = make(*setting, blocks.T)
        return Ensemble(model, *polar(blocks.start, blocks.P0, model.n))

    return build


def _matrices(sigma_a, T):
    model, nought = CV(sigma_a, noise="continuous"), np.zeros(4)
    return model.F(nought, T), np.eye(4)[[0, 2]], model.Q(nought, T)


def _plain_R(blocks):
    return blocks.R if blocks.R.ndim == 2 else 20.0**2 * np.eye(2)  # replaced at each update


def _strong_tracking(setting, blocks):
    sigma_a, beta = setting
    F, H, Q = _matrices(sigma_a, blocks.T)
    return EnsembleStrongTrackingKF(F, H, Q, _plain_R(blocks), blocks.start, blocks.P0, beta=beta, rho=0.95)


def _augmented_bias(setting, blocks):
    sigma_a, q = setting
    F, H, Q = _matrices(sigma_a, blocks.T)
    A = augmented_matrices(F, H, Q, q * np.eye(4))
    x0 = np.concatenate([blocks.start, 0 * blocks.start])
    P0 = np.zeros((8, 8))
    P0[:4, :4] = blocks.P0
    ens = EnsembleMatrixKF(A.F, A.H, A.Q, _plain_R(blocks), x0, P0)
    ens.to_estimate, ens.T = A.estimate, blocks.T
    return ens


def _augmented_ahead(ens, x, h):
    whole = ens.to_estimate[[0, 2]] @ np.linalg.matrix_power(ens.matrices.F, h // ens.T)
    return np.tensordot(whole, x, 1)


def _imm_singer(setting, blocks):
    quiet, lively = setting
    ens = WholeIMM(
        CV(quiet, noise="continuous"), Singer(lively, 10.0), _plain_R(blocks), blocks.T, blocks.start, blocks.P0,
        stay=tuple(np.exp(-blocks.T / np.array(STAY))),
    )  # fmt: skip
    ens.lively = Singer(lively, 10.0)
    return ens


def _imm_turn(setting, blocks):
    quiet, along, turning = setting
    root = np.sqrt(blocks.T)
    models = StraightTurn(quiet / root), CTRV(along / root, turning / root)
    stay = np.exp(-blocks.T / np.array(STAY))
    chain = [[stay[0], 1 - stay[0]], [1 - stay[1], stay[1]]]
    start = polar(blocks.start, blocks.P0, 5)
    ens = EnsembleMotionIMM([EnsembleEKF(model, *start) for model in models], [0.9, 0.1], chain)
    ens.model = models[1]
    return ens


def _matrix_ahead(ens, x, h):
    return x[[0, 2]] + h * x[[1, 3]]


def _grid(*axes):
    return tuple(tuple(float(part) for part in point) for point in np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes)))


_CTRA = _grid([0.03, 0.1, 0.5, 2], [0.001, 0.003, 0.01])
CAST = {  # σ of white noise in continuous time where a step's noise is held: σ √s over √T
    "CV": Contender(_grid([0.3, 1, 2, 4, 8, 16]), _on_cartesian(lambda s: CV(s, noise="continuous")), _of_model),
    "CA": Contender(_grid([0.1, 0.3, 1, 3]), _on_cartesian(lambda s: CA(s, noise="continuous")), _of_model),
    "Singer": Contender(_grid([0.7, 2, 5], [5, 20, 80]), _on_cartesian(Singer), _of_model),
    "CTRV": Contender(_grid([0.3, 1, 3, 8], [0.001, 0.003, 0.01]), _on_polar(lambda a, w, T: CTRV(a / T**0.5, w / T**0.5)), _of_model),
    "CTRA": Contender(_CTRA, _on_polar(lambda j, w, T: CTRA(j / T**0.5, w / T**0.5)), _of_model),
    "UKF–CTRA": Contender(_CTRA, _on_polar(lambda j, w, T: CTRA(j / T**0.5, w / T**0.5), EnsembleUKF), _of_model),
    "STKF": Contender(_grid([0.03, 0.1, 0.3, 1, 3], [1, 4]), _strong_tracking, _matrix_ahead),
    "ABMA": Contender(_grid([0.3, 1], [0.01, 0.1, 1, 10, 100]), _augmented_bias, _augmented_ahead),
    "IMM(CV, Singer)": Contender(_grid([0.1, 0.3, 1], [2, 5]), _imm_singer, lambda ens, x, h: _of_lively(ens, x, h)),
    "IMM(CV, CTRV)": Contender(_grid([0.1, 0.3, 1], [2, 6], [0.003, 0.01]), _imm_turn, _of_model),
}


def _of_lively(ens, x, h):
    return ens.lively.f(x, h)[[0, 3]]

"""Paper 2, section 2.4: every fusion rule on the same runs, the same numbers without runs, and what becomes of them in the long run.

All the filters are linear and their gains do not depend on the data, so a fused error is a fixed matrix times the errors of the tracks. `rule_weights` finds these
matrices by handing each rule the unit vectors for estimates; what a rule truly achieves then follows from the true joint covariance of the tracks, whatever the rule believes.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from trackhelpers.arrays import check_covariance, check_scale, inverse
from trackhelpers.ensemble import monte_carlo
from trackhelpers.exact import steady_errors
from trackhelpers.exact import steady_state as riccati
from trackhelpers.fusion import bar_shalom_campo, convex_combination, covariance_intersection
from trackhelpers.scenarios.track_fusion import Fused, exact_errors, expected_nees, rms, run, simulate

METHODS = ("sensor 1", "sensor 2", "convex", "BSC", "CI", "centralised")
DEFINED = slice(3, None)  # the steps at which every rule is defined, whatever the start


class Errors(NamedTuple):
    """Errors of the six `METHODS` along a track."""

    rms: np.ndarray  # (6, 4, N) root mean square over the runs, m and m/s
    nees: np.ndarray  # (6, N) mean over the runs
    by_run: np.ndarray | None = None  # (windows, 6, 4, M) mean square over each window, run by run; sampled errors only


def rule_weights(P1, P2, P12):
    """What the three rules do with two tracks.

    Parameters
    ----------
    P1, P2 : array_like, shape (n, n) or (n, n, N)
        Covariances that the tracks report, at one step or at N.
    P12 : array_like, of the same shape
        Cross-covariance that Bar-Shalom–Campo is told.

    Returns
    -------
    dict
        Name of the rule -> (W1, P): the fused x is W1 x₁ + (I − W1) x₂, and P is what the rule believes; shapes as P1's.
    """
    P1 = np.asarray(P1, dtype=float)
    nought = np.zeros((len(P1), *P1.shape[2:]))
    units = [nought + np.reshape(row, (-1, *[1] * (P1.ndim - 2))) for row in np.eye(len(P1))]
    fused = {
        "convex": [convex_combination([unit, nought], [P1, P2]) for unit in units],
        "BSC": [bar_shalom_campo(unit, P1, nought, P2, P12) for unit in units],
        "CI": [covariance_intersection(unit, P1, nought, P2) for unit in units],
    }
    return {name: (np.stack([x for x, _ in columns], axis=1), columns[0][1]) for name, columns in fused.items()}


def combined_covariance(W1, P1, P2, P12):
    """True covariance of W1 x₁ + (I − W1) x₂ where the tracks' errors have the covariances P1, P2 and the cross-covariance P12, all (n, n)."""
    weights = np.hstack([W1, np.eye(len(W1)) - W1])
    return weights @ np.block([[P1, P12], [np.transpose(P12), P2]]) @ weights.T


def rules(plan):
    """The six `METHODS` as weights on the three filters of a design and the covariances that they believe: method -> `Fused`.

    As `trackhelpers.scenarios.track_fusion.fuse`, at all steps at once. The fused tracks are NaN before `DEFINED`, where a known start leaves singular covariances.
    """
    steps, known = plan.P.shape[-1], (..., DEFINED)
    fused = [Fused(np.repeat(np.eye(4, 12, 4 * i)[..., None], steps, axis=2), plan.P[i]) for i in range(3)]
    for W1, P in rule_weights(plan.P[0][known], plan.P[1][known], plan.P12[known]).values():
        fused.insert(-1, Fused(np.full((4, 12, steps), np.nan), np.full((4, 4, steps), np.nan)))
        fused[-2].W[known] = np.concatenate([W1, np.eye(4)[..., None] - W1, np.zeros_like(W1)], axis=1)
        fused[-2].P[known] = P
    return dict(zip(METHODS, fused, strict=True))


def exact(plan, methods, truth, sigma_a=0.0):
    """Errors of all methods on one track without sampling: bias and joint covariance by recursion.

    Parameters
    ----------
    plan : trackhelpers.scenarios.track_fusion.Design
    methods : dict
        Of `rules(plan)`.
    truth : array_like, shape (4, N)
    sigma_a : float
        True standard deviation of a random acceleration, m/s²; 0 is the source's deterministic track.

    Returns
    -------
    Errors
    """
    joint = exact_errors(plan, truth, sigma_a)
    each = [(method.error(*joint), method.P) for method in methods.values()]
    return Errors(np.stack([rms(*error) for error, _ in each]), np.stack([expected_nees(*error, P) for error, P in each]))


def sampled(plan, methods, truth, runs=1000, seed=20201129, sigma_a=0.0, windows=(DEFINED,)):
    """Errors of all methods over Monte Carlo runs, every method on the same runs.

    Parameters are those of `exact`, and

    runs, seed : int
        As for `trackhelpers.ensemble.monte_carlo`.
    windows : sequence of slice
        Steps over which the squared errors of one run are averaged, for comparisons run by run.

    Returns
    -------
    Errors
        With `by_run`.
    """
    truth = np.asarray(truth, dtype=float)
    weights = [np.moveaxis(method.W, -1, 0) for method in methods.values()]
    precisions = [np.moveaxis(inverse(method.P), -1, 0) for method in methods.values()]
    x0 = None if plan.first else truth[:, 0]

    def task(rngs):
        track, z = simulate(rngs, truth, plan.pair, sigma_a)
        errors = np.moveaxis((run(z, plan, x0)[0] - track).reshape(12, truth.shape[1], -1), 1, 0)
        squares, nees, by_run = [], [], []
        for W, precision in zip(weights, precisions, strict=True):
            fused = W @ errors
            nees.append(np.sum(fused * (precision @ fused), axis=(1, 2)))
            square = fused**2
            squares.append(square.sum(axis=-1).T)
            by_run.append([square[window].mean(axis=0) for window in windows])
        return {"squares": np.stack(squares), "nees": np.stack(nees), "by_run": np.swapaxes(by_run, 0, 1)}

    sums = monte_carlo(task, runs, seed, reduce={"by_run": "concat"}, chunk=1000)
    return Errors(np.sqrt(sums["squares"] / runs), sums["nees"] / runs, sums["by_run"])


def over(errors, window=DEFINED):
    """Root mean square errors (6, 4) and mean NEES (6,) over a window of steps."""
    return np.sqrt(np.mean(errors.rms[..., window] ** 2, axis=-1)), errors.nees[..., window].mean(axis=-1)


class Steady(NamedTuple):
    """Two filters of one target and the centralised filter, long after the start; all matrices (n, n) but the gains (n, m)."""

    P1: np.ndarray
    P2: np.ndarray
    P12: np.ndarray
    central: np.ndarray
    bias: np.ndarray  # (3, n)
    gains: tuple  # K1, K2 (n, m), and K (n, 2m) of the centralised filter, for both measurements stacked


def steady_state(F, Q, H, R1, R2, Q_true=None, d=None):
    """Joint covariance and bias of two settled filters that measure the same components of one target, and of the centralised filter.

    The gains come from discrete algebraic Riccati equations, the joint covariance from a Lyapunov equation: the three errors, stacked, follow
    e ← 𝐀e − 𝐃(w + d) + 𝐁v with the process noise w common to all.

    Parameters
    ----------
    F, Q : array_like, shape (n, n)
        The filters' model.
    H : array_like, shape (m, n)
    R1, R2 : array_like, shape (m, m)
    Q_true : array_like, shape (n, n), optional
        The target's own process noise; default Q, a matched model. Zero for a track that is straight in truth.
    d : array_like, shape (n,), optional
        A constant x(k) − F x(k−1) that the model does not know, such as that of a steady acceleration; default 0.

    Returns
    -------
    Steady
        What is true; with a matched model it is also what each filter believes.
    """
    F, H = np.asarray(F, dtype=float), np.atleast_2d(np.asarray(H, dtype=float))
    n, R1, R2 = len(F), check_covariance(R1, "R1", len(H), definite=True), check_covariance(R2, "R2", len(H), definite=True)
    Q, both, R = check_covariance(Q, "Q", n), np.vstack([H, H]), block_diag(R1, R2)
    settled = [riccati(F, rows, Q, noise) for rows, noise in ((H, R1), (H, R2), (both, R))]
    gains, E = tuple(each.K for each in settled), np.tile(np.eye(n), (3, 1))
    A, K = block_diag(*(each.A for each in settled)), np.vstack([block_diag(*gains[:2]), gains[2]])
    Q_true, d = Q if Q_true is None else Q_true, np.zeros(n) if d is None else d
    bias, joint = steady_errors(np.kron(np.eye(3), F), A, K, R, E @ d, E @ Q_true @ E.T)
    block = joint.reshape(3, n, 3, n).swapaxes(1, 2)
    return Steady(block[0, 0], block[1, 1], block[0, 1], block[2, 2], bias.reshape(3, n), gains)


def axis_errors(ratio, index, truth="matched", acceleration=0.0):
    """True mean square errors of the six methods on one axis, settled, with T = 1 and σ₁ = 1.

    Parameters
    ----------
    ratio : float
        σ₂/σ₁ ≥ 1.
    index : float
        Tracking index σ_a T²/σ₁ of the filters, > 0.
    truth : {"matched", "straight"}
        A target with the filters' process noise, or with none.
    acceleration : float
        A steady acceleration of the target, in units of σ_a.

    Returns
    -------
    errors : numpy.ndarray, shape (6, 2)
        Position and velocity, in the order of `METHODS`.
    believed : float
        Position variance that the convex combination believes.
    """
    if truth not in ("matched", "straight"):
        raise ValueError(f"truth: expected 'matched' or 'straight', got {truth!r}")
    if check_scale(ratio, "ratio") < 1 or check_scale(index, "index") == 0:
        raise ValueError(f"ratio, index: expected a ratio ≥ 1 and an index > 0, got {ratio!r} and {index!r}")
    g = np.array([0.5, 1.0]) * index
    F, Q, H, R = np.array([[1.0, 1.0], [0.0, 1.0]]), np.outer(g, g), np.array([[1.0, 0.0]]), np.eye(1)
    told = steady_state(F, Q, H, R, ratio**2 * R)
    true = told
    if truth != "matched" or acceleration:
        true = steady_state(F, Q, H, R, ratio**2 * R, Q_true=None if truth == "matched" else 0 * Q, d=acceleration * g)
    fused = rule_weights(told.P1, told.P2, told.P12)
    weights = [np.eye(2), np.zeros((2, 2)), *[W for W, _ in fused.values()]]
    means = [W @ true.bias[0] + (np.eye(2) - W) @ true.bias[1] for W in weights] + [true.bias[2]]
    covariances = [combined_covariance(W, *true[:3]) for W in weights] + [true.central]
    errors = np.array([np.diag(C) + b**2 for C, b in zip(covariances, means, strict=True)])
    return errors, fused["convex"][1][0, 0]


def worse_from(index, component, highest=100.0):
    """The ratio σ₂/σ₁ from which on the convex combination of two settled, matched tracks is worse than sensor 1 alone.

    Parameters
    ----------
    index : float
        Tracking index σ_a T²/σ₁.
    component : int
        0 compares the position's variance, 1 the velocity's.

    Returns
    -------
    float
        NaN where it is better up to the ratio `highest`.
    """

    def excess(log_ratio):
        errors, _ = axis_errors(np.exp(log_ratio), index)
        return errors[2, component] / errors[0, component] - 1

    ends = 0.0, np.log(highest)
    return float(np.exp(brentq(excess, *ends, xtol=1e-8))) if excess(ends[1]) > 0 else np.nan

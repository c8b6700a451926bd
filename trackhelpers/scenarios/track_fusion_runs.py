"""Paper 2, section 2.4: every fusion rule on the same runs, and the same numbers without runs.

All the filters are linear and their gains do not depend on the data, so a fused error is a fixed matrix times the errors of the tracks. `rule_weights` finds these
matrices by handing each rule the unit vectors for estimates; what a rule truly achieves then follows from the true joint covariance of the tracks, whatever the rule believes.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are, solve_discrete_lyapunov

from trackhelpers.fusion import bar_shalom_campo, convex_combination, covariance_intersection

METHODS = ("sensor 1", "sensor 2", "convex", "BSC", "CI", "centralised")


def intersection(x1, P1, x2, P2):
    """`trackhelpers.fusion.covariance_intersection`, with ω = ½ where the two covariances are equal.

    There every ω gives the same determinant, and rounding alone would choose; the middle is the choice that treats both tracks alike.
    """
    if np.allclose(P1, P2, rtol=1e-9, atol=0):
        return 0.5 * (np.asarray(x1) + np.asarray(x2)), np.asarray(P1, dtype=float)
    return covariance_intersection(x1, P1, x2, P2)


def rule_weights(P1, P2, P12):
    """What the three rules do with two tracks.

    Parameters
    ----------
    P1, P2 : array_like, shape (n, n)
        Covariances that the tracks report.
    P12 : array_like, shape (n, n)
        Cross-covariance that Bar-Shalom–Campo is told.

    Returns
    -------
    dict
        Name of the rule -> (W1, P): the fused x is W1 x₁ + (I − W1) x₂, each (n, n), and P is what the rule believes.
    """
    unit, nought = np.eye(len(P1)), np.zeros((len(P1), len(P1)))
    return {
        "convex": convex_combination([unit, nought], [P1, P2]),
        "BSC": bar_shalom_campo(unit, P1, nought, P2, P12),
        "CI": intersection(unit, P1, nought, P2),
    }


def combined_covariance(W1, P1, P2, P12):
    """True covariance of W1 x₁ + (I − W1) x₂ where the tracks' errors have the covariances P1, P2 and the cross-covariance P12, all (n, n)."""
    weights = np.hstack([W1, np.eye(len(W1)) - W1])
    return weights @ np.block([[P1, P12], [np.transpose(P12), P2]]) @ weights.T


class Steady(NamedTuple):
    """Two filters of one target and the centralised filter, long after the start; all matrices (n, n) but the gains (n, m)."""

    P1: np.ndarray
    P2: np.ndarray
    P12: np.ndarray
    central: np.ndarray
    K1: np.ndarray
    K2: np.ndarray
    K: np.ndarray  # (n, 2m): the centralised gain, for both measurements stacked


def steady_state(F, Q, H, R1, R2, Q_true=None):
    """Joint covariance of two settled filters that measure the same components of one target.

    The gains come from the discrete algebraic Riccati equation, the joint covariance from a Lyapunov equation, e = 𝐀e + 𝐃w + 𝐁v with the process noise w
    common to all.

    Parameters
    ----------
    F, Q : array_like, shape (n, n)
        The filters' model.
    H : array_like, shape (m, n)
    R1, R2 : array_like, shape (m, m)
    Q_true : array_like, shape (n, n), optional
        The target's own process noise; default Q, a matched model. Zero for a track that is straight in truth.

    Returns
    -------
    Steady
        True covariances; with a matched model they are also what each filter believes.
    """
    n, m = len(F), len(H)
    gains = [_settled_gain(F, Q, H, R1), _settled_gain(F, Q, H, R2), _settled_gain(F, Q, np.vstack([H, H]), block_diag(R1, R2))]
    A, D, B = error_system(F, H, gains)
    common = D @ (Q if Q_true is None else Q_true) @ D.T
    joint = solve_discrete_lyapunov(A, common + B @ block_diag(R1, R2) @ B.T)
    block = joint.reshape(3, n, 3, n).swapaxes(1, 2)
    return Steady(block[0, 0], block[1, 1], block[0, 1], block[2, 2], gains[0], gains[1], gains[2])


def error_system(F, H, gains):
    """One step of the errors of filter 1, filter 2 and the centralised filter, stacked: e ← A e + D d + B v.

    Parameters
    ----------
    F, H : array_like, shapes (n, n), (m, n)
    gains : sequence of three arrays, shapes (n, m), (n, m), (n, 2m)

    Returns
    -------
    A (3n, 3n), D (3n, n), B (3n, 2m) : numpy.ndarray
        d is the prediction's own mistake F x(k−1) − x(k), v the two measurement noises.
    """
    K1, K2, K = gains
    left = [np.eye(len(F)) - K1 @ H, np.eye(len(F)) - K2 @ H, np.eye(len(F)) - K @ np.vstack([H, H])]
    return block_diag(*[part @ F for part in left]), np.vstack(left), np.vstack([block_diag(K1, K2), K])


def _settled_gain(F, Q, H, R):
    P = solve_discrete_are(np.transpose(F), np.transpose(H), Q, R)
    return np.linalg.solve(H @ P @ np.transpose(H) + R, H @ P).T

"""One step of a linear filter whose covariance is everyone's: P (n, n) without runs, states x (n, M), measurements z (m, M).

The matrices are so small that a step is a matter of how many calls it takes. Of many runs, where numba is installed, it takes two.
"""

import os
from functools import cache

import numpy as np
from scipy.linalg.lapack import dposv

from trackhelpers.arrays import symmetrised
from trackhelpers.ensemble.base import QUIET

LEAST_RUNS = 4096  # below that it would take ten thousands of steps to save the half second in which numba is loaded


def predict(x, P, F, Q):
    """F x and F P Fᵀ + Q."""
    if x.shape[1] >= LEAST_RUNS and (compiled := _compiled()):
        return compiled.predict(*map(_plain, (x, P)), F, Q)
    return F.dot(x), F.dot(P).dot(F.T) + Q


def correct(x, P, z, H, R):
    """x, P, y, S and K of one update, P in Joseph's form as in `trackhelpers.ensemble.covariance.correct`; K is NaN where S is singular."""
    if x.shape[1] >= LEAST_RUNS and (compiled := _compiled()):
        *corrected, positive = compiled.correct(*map(_plain, (x, P, z)), H, R)
        if positive:
            return corrected
    HP = H.dot(P)
    S = HP.dot(H.T) + R
    _, KT, failed = dposv(S, HP)  # NumPy's solve takes four times as long, nearly all of it for the call
    if failed:
        try:
            KT = np.linalg.solve(S, HP)
        except np.linalg.LinAlgError:
            KT = np.full(HP.shape, np.nan)
    K = KT.T
    B = P - K.dot(HP)
    with np.errstate(**QUIET):
        y = z - H.dot(x)
        step = K.dot(y)
        step += x
    return step, symmetrised(B - (B.dot(H.T) - K.dot(R)).dot(KT)), y, S, K


@cache
def _compiled():
    """The module `shared_compiled`, or None without numba or with ``TRACKHELPERS_COMPILED=0`` in the environment."""
    if os.environ.get("TRACKHELPERS_COMPILED") == "0":
        return None
    try:
        from trackhelpers.ensemble import shared_compiled
    except ImportError:
        return None
    return shared_compiled


def _plain(array):
    return np.ascontiguousarray(array, dtype=float)

"""One step of a linear filter whose covariance is everyone's: P (n, n) without runs, states x (n, M), measurements z (m, M).

The matrices are so small that a step is a matter of how many calls it takes. Where numba is installed it takes two.
"""

import os

import numpy as np
from scipy.linalg.lapack import dposv

from trackhelpers.arrays import symmetrised
from trackhelpers.ensemble.base import QUIET

try:
    if os.environ.get("TRACKHELPERS_COMPILED") == "0":
        raise ImportError
    from numba import njit
except ImportError:
    njit = None

LEAST_RUNS = 32  # below that, NumPy's products are as quick


def predict(x, P, F, Q):
    """F x and F P Fᵀ + Q."""
    if njit is not None and x.shape[1] >= LEAST_RUNS:
        return _predict_compiled(*map(_plain, (x, P)), F, Q)
    return F.dot(x), F.dot(P).dot(F.T) + Q


def correct(x, P, z, H, R):
    """x, P, y, S and K of one update, P in Joseph's form as in `trackhelpers.ensemble.covariance.correct`; K is NaN where S is singular."""
    if njit is not None and x.shape[1] >= LEAST_RUNS:
        *corrected, positive = _correct_compiled(*map(_plain, (x, P, z)), H, R)
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


def _plain(array):
    return np.ascontiguousarray(array, dtype=float)


if njit is not None:
    compiled = njit(cache=True, error_model="numpy", fastmath={"contract"})

    @compiled
    def _add(C, sign, A, B):
        """C ± A B in place."""
        for i in range(A.shape[0]):
            for k in range(A.shape[1]):
                factor = sign * A[i, k]
                if factor != 0.0:
                    for r in range(np.uintp(B.shape[1])):
                        C[i, r] += factor * B[k, r]
        return C

    @compiled
    def _predict_compiled(x, P, F, Q):
        return _add(np.zeros_like(x), 1.0, F, x), _add(Q.copy(), 1.0, _add(np.zeros_like(P), 1.0, F, P), F.T)

    @compiled
    def _correct_compiled(x, P, z, H, R):
        """`correct`, and whether it found S positive definite."""
        m = len(R)
        HP = _add(np.zeros_like(H), 1.0, H, P)
        S = _add(R.copy(), 1.0, HP, H.T)
        L, KT = S.copy(), HP.copy()
        for j in range(m):
            if not L[j, j] > 0.0:
                return x, P, z, S, KT.T, False
            L[j, j] = np.sqrt(L[j, j])
            for i in range(j + 1, m):
                L[i, j] /= L[j, j]
            for i in range(j + 1, m):
                for c in range(j + 1, i + 1):
                    L[i, c] -= L[i, j] * L[c, j]
        for a in range(m):
            for b in range(a):
                KT[a] -= L[a, b] * KT[b]
            KT[a] /= L[a, a]
        for back in range(m):
            a = m - 1 - back
            for b in range(a + 1, m):
                KT[a] -= L[b, a] * KT[b]
            KT[a] /= L[a, a]
        K = KT.T
        B = _add(P.copy(), -1.0, K, HP)
        slack = _add(_add(np.zeros(K.shape), 1.0, B, H.T), -1.0, K, R)
        _add(B, -1.0, slack, KT)
        y = _add(z.copy(), -1.0, H, x)
        return _add(x.copy(), 1.0, K, y), 0.5 * (B + B.T), y, S, K, True

"""The two functions of `shared`, compiled by numba; a module of its own, for numba takes a third of a second to be imported."""

import numpy as np
from numba import njit

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
def predict(x, P, F, Q):
    return _add(np.zeros_like(x), 1.0, F, x), _add(Q.copy(), 1.0, _add(np.zeros_like(P), 1.0, F, P), F.T)


@compiled
def correct(x, P, z, H, R):
    """`shared.correct`, and whether it found S positive definite."""
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

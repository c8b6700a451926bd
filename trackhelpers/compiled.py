"""The covariance algebra compiled by numba, where numba is installed: the same results as `arrays` and `ensemble.covariance` to rounding, sooner.

Everything works without it. The functions take the entries that the models and sensors write down, so a new model needs nothing here. They work through the
runs in blocks that stay in the processor's cache, the run innermost, where the compiler turns a loop into vector instructions.
``TRACKHELPERS_COMPILED=0`` in the environment leaves numba aside.
"""

import os
from functools import lru_cache

import numpy as np

BLOCK = 128  # runs at a time: a 5×5 covariance of that many takes 26 kB
LEAST_RUNS = 32  # below that, NumPy's overhead is no larger than that of handing the entries over

try:
    if os.environ.get("TRACKHELPERS_COMPILED") == "0":
        raise ImportError
    from numba import njit
except ImportError:
    njit = None


def serves(P):
    """Whether P (n, n, M) is worth a compiled loop."""
    return njit is not None and P.ndim == 3 and P.shape[2] >= LEAST_RUNS


def stacked(entries, runs):
    """Rows, columns and values (E, runs) of a dict of matrix entries."""
    values = np.empty((len(entries), runs))
    for row, value in zip(values, entries.values(), strict=True):
        row[:] = value
    return _places(tuple(entries)), values


@lru_cache(maxsize=256)
def _places(places):
    return np.array(places, dtype=np.int64).reshape(-1, 2)


if njit is not None:
    compiled = njit(cache=True, error_model="numpy", fastmath={"contract"})
    # Runs are counted by unsigned numbers: an index that might be negative would be checked in every loop, which then is no vector loop. All loops over a
    # block have its full length; in the last one, the lanes behind the last run hold what the block before left there.
    LANES = np.uintp(BLOCK)

    @compiled
    def _load(block, P, start, w):
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                for r in range(w):
                    block[i, j, r] = P[i, j, start + r]

    @compiled
    def _load_rows(block, values, start, w):
        for e in range(len(values)):
            for r in range(w):
                block[e, r] = values[e, start + r]

    @compiled
    def _store(P, block, start, w):
        for i in range(P.shape[0]):
            for j in range(P.shape[1]):
                for r in range(w):
                    P[i, j, start + r] = block[i, j, r]

    @compiled
    def _store_lower(P, block, start, w):
        """The lower half of a symmetric block, and its mirror image."""
        for i in range(P.shape[0]):
            for j in range(i + 1):
                for r in range(w):
                    P[i, j, start + r] = block[i, j, r]
                for r in range(w):
                    P[j, i, start + r] = block[i, j, r]

    @compiled
    def propagate(P, places, values, noise_places, noise):
        """F P Fᵀ + Q; see `trackhelpers.ensemble.covariance.propagate`. A diagonal value has its one taken off."""
        n, _, M = P.shape
        out = np.empty_like(P)
        whole, half = np.zeros((n, n, BLOCK)), np.zeros((n, n, BLOCK))
        f, q = np.zeros((len(places), BLOCK)), np.zeros((len(noise_places), BLOCK))
        for first in range(0, M, BLOCK):
            start, w = np.uintp(first), np.uintp(min(BLOCK, M - first))
            _load(whole, P, start, w)
            _load(half, P, start, w)
            _load_rows(f, values, start, w)
            _load_rows(q, noise, start, w)
            for e in range(len(places)):
                i, k = places[e]
                for j in range(n):
                    for r in range(LANES):
                        half[i, j, r] += f[e, r] * whole[k, j, r]
            whole[:] = half
            for e in range(len(places)):
                i, k = places[e]
                for j in range(i, n):
                    for r in range(LANES):
                        whole[j, i, r] += f[e, r] * half[j, k, r]
            for e in range(len(noise_places)):
                i, j = noise_places[e]
                for r in range(LANES):
                    whole[i, j, r] += q[e, r]
            _store_lower(out, whole, start, w)
        return out

    @compiled
    def _apply_right(block, places, h, product):
        """P Hᵀ of a block."""
        product[:] = 0.0
        for e in range(len(places)):
            a, j = places[e]
            for i in range(len(block)):
                for r in range(LANES):
                    product[i, a, r] += h[e, r] * block[i, j, r]

    @compiled
    def correct(P, places, values, R):
        """K, S and posterior P of one update; see `trackhelpers.ensemble.covariance.correct`."""
        n, _, M = P.shape
        m = len(R)
        K, S, out = np.empty((n, m, M)), np.empty((m, m, M)), np.empty_like(P)
        B, h, s = np.zeros((n, n, BLOCK)), np.zeros((len(places), BLOCK)), np.empty((m, m, BLOCK))
        one_for_all, noise = R.shape[2] == 1, np.zeros((m, m, BLOCK))
        PHt, k = np.empty((n, m, BLOCK)), np.empty((n, m, BLOCK))
        for first in range(0, M, BLOCK):
            start, w = np.uintp(first), np.uintp(min(BLOCK, M - first))
            _load(B, P, start, w)
            _load_rows(h, values, start, w)
            _apply_right(B, places, h, PHt)
            for i in range(m):
                for j in range(m):
                    if one_for_all:
                        noise[i, j] = R[i, j, 0]
                    else:
                        for r in range(w):
                            noise[i, j, r] = R[i, j, start + r]
            s[:] = noise
            for e in range(len(places)):
                i, j = places[e]
                for a in range(i + 1):
                    for r in range(LANES):
                        s[i, a, r] += h[e, r] * PHt[j, a, r]
            _store_lower(S, s, start, w)
            _factorise(s)
            k[:] = PHt  # K = PHᵀ S⁻¹ by two triangular solves
            for i in range(n):
                for a in range(m):
                    for b in range(a):
                        for r in range(LANES):
                            k[i, a, r] -= s[a, b, r] * k[i, b, r]
                    for r in range(LANES):
                        k[i, a, r] *= s[a, a, r]
                for back in range(m):
                    a = m - 1 - back
                    for b in range(a + 1, m):
                        for r in range(LANES):
                            k[i, a, r] -= s[b, a, r] * k[i, b, r]
                    for r in range(LANES):
                        k[i, a, r] *= s[a, a, r]
            _store(K, k, start, w)
            for i in range(n):  # Joseph's form: B = P − K(PHᵀ)ᵀ, then B − (BHᵀ − KR)Kᵀ
                for a in range(m):
                    for j in range(n):
                        for r in range(LANES):
                            B[i, j, r] -= k[i, a, r] * PHt[j, a, r]
            slack = PHt
            _apply_right(B, places, h, slack)
            for a in range(m):
                for b in range(m):
                    if not one_for_all or R[b, a, 0] != 0.0:
                        for i in range(n):
                            for r in range(LANES):
                                slack[i, a, r] -= k[i, b, r] * noise[b, a, r]
            for i in range(n):
                for a in range(m):
                    for j in range(i + 1):
                        for r in range(LANES):
                            B[i, j, r] -= slack[i, a, r] * k[j, a, r]
            _store_lower(out, B, start, w)
        return K, S, out

    @compiled
    def _factorise(s):
        """Cholesky's factor of a block in place, lower triangle, its diagonal inverted; NaN where it is not positive definite."""
        for j in range(len(s)):
            for r in range(LANES):
                s[j, j, r] = 1.0 / np.sqrt(s[j, j, r] if s[j, j, r] > 0.0 else np.nan)
            for i in range(j + 1, len(s)):
                for r in range(LANES):
                    s[i, j, r] *= s[j, j, r]
            for i in range(j + 1, len(s)):
                for c in range(j + 1, i + 1):
                    for r in range(LANES):
                        s[i, c, r] -= s[i, j, r] * s[c, j, r]

    @compiled
    def mahalanobis(y, S):
        """yᵀS⁻¹y; see `trackhelpers.arrays.mahalanobis`."""
        n, M = y.shape
        total = np.empty(M)
        L, b, part = np.zeros((n, n, BLOCK)), np.zeros((n, BLOCK)), np.empty(BLOCK)
        for first in range(0, M, BLOCK):
            start, w = np.uintp(first), np.uintp(min(BLOCK, M - first))
            _load(L, S, start, w)
            _load_rows(b, y, start, w)
            _factorise(L)
            part[:] = 0.0
            for j in range(n):
                for r in range(LANES):
                    b[j, r] *= L[j, j, r]
                    part[r] += b[j, r] * b[j, r]
                for i in range(j + 1, n):
                    for r in range(LANES):
                        b[i, r] -= L[i, j, r] * b[j, r]
            for r in range(w):
                total[start + r] = part[r]
        return total

"""The covariance algebra compiled by numba, where numba is installed: the same results as `arrays` and `ensemble.covariance` to rounding, sooner.

Everything works without it. The functions take the entries that the models and sensors write down, so a new model needs nothing here. They work through the
runs in blocks that stay in the processor's cache, the run innermost, where the compiler turns a loop into vector instructions.
``TRACKHELPERS_COMPILED=0`` in the environment leaves numba aside.
"""

import os

import numpy as np

BLOCK = 64  # runs at a time: a 6×6 covariance of that many takes 18 kB
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
    places = np.array(list(entries), dtype=np.int64).reshape(-1, 2)
    values = np.empty((len(entries), runs))
    for row, value in zip(values, entries.values(), strict=True):
        row[:] = value
    return places, values


if njit is not None:
    compiled = njit(cache=True, error_model="numpy", fastmath={"contract"})

    # The innermost loops, on one contiguous row of a block each.

    @compiled
    def _add_product(y, a, x):
        for r in range(y.size):
            y[r] += a[r] * x[r]

    @compiled
    def _subtract_product(y, a, x):
        for r in range(y.size):
            y[r] -= a[r] * x[r]

    @compiled
    def _divide(y, a):
        for r in range(y.size):
            y[r] /= a[r]

    @compiled
    def _root(y):
        for r in range(y.size):
            y[r] = np.sqrt(y[r] if y[r] > 0.0 else np.nan)

    @compiled
    def _copy(y, x):
        for r in range(y.size):
            y[r] = x[r]

    @compiled
    def _store_symmetric(block, out, start):
        w = block.shape[2]
        for i in range(len(block)):
            _copy(out[i, i, start : start + w], block[i, i])
            for j in range(i):
                below, above = block[i, j], block[j, i]
                for r in range(w):
                    below[r] = 0.5 * (below[r] + above[r])
                _copy(out[i, j, start : start + w], below)
                _copy(out[j, i, start : start + w], below)

    @compiled
    def propagate(P, places, values, noise_places, noise):
        """F P Fᵀ + Q; see `trackhelpers.ensemble.covariance.propagate`. A diagonal value has its one taken off."""
        n, _, M = P.shape
        out = np.empty_like(P)
        for start in range(0, M, BLOCK):
            w = min(BLOCK, M - start)
            half = P[:, :, start : start + w].copy()
            for e in range(len(places)):
                value = values[e, start : start + w]
                for c in range(n):
                    _add_product(half[places[e, 0], c], value, P[places[e, 1], c, start : start + w])
            whole = half.copy()
            for e in range(len(places)):
                value = values[e, start : start + w]
                for c in range(n):
                    _add_product(whole[c, places[e, 0]], value, half[c, places[e, 1]])
            for e in range(len(noise_places)):
                i, j = noise_places[e]
                value = noise[e, start : start + w]
                for r in range(w):
                    whole[i, j, r] += value[r]
                if i != j:
                    for r in range(w):
                        whole[j, i, r] += value[r]
            _store_symmetric(whole, out, start)
        return out

    @compiled
    def _apply_right(block, places, values, start, product):
        product[:] = 0.0
        w = block.shape[2]
        for e in range(len(places)):
            value = values[e, start : start + w]
            for c in range(len(block)):
                _add_product(product[c, places[e, 0]], value, block[c, places[e, 1]])

    @compiled
    def correct(P, places, values, R):
        """K, S and posterior P of one update; see `trackhelpers.ensemble.covariance.correct`."""
        n, _, M = P.shape
        m = len(R)
        K, S, out = np.empty((n, m, M)), np.empty((m, m, M)), np.empty_like(P)
        for start in range(0, M, BLOCK):
            w = min(BLOCK, M - start)
            B = P[:, :, start : start + w].copy()
            PHt = np.empty((n, m, w))
            _apply_right(B, places, values, start, PHt)
            s = np.empty((m, m, w))
            for i in range(m):
                for j in range(m):
                    s[i, j, :] = R[i, j]
            for e in range(len(places)):
                value = values[e, start : start + w]
                for j in range(m):
                    _add_product(s[places[e, 0], j], value, PHt[places[e, 1], j])
            _store_symmetric(s, S, start)
            _factorise(s)
            k = PHt.copy()  # K = PHᵀ S⁻¹ by two triangular solves
            for i in range(n):
                for a in range(m):
                    for b in range(a):
                        _subtract_product(k[i, a], s[a, b], k[i, b])
                    _divide(k[i, a], s[a, a])
                for a in range(m - 1, -1, -1):
                    for b in range(a + 1, m):
                        _subtract_product(k[i, a], s[b, a], k[i, b])
                    _divide(k[i, a], s[a, a])
            K[:, :, start : start + w] = k
            for i in range(n):  # Joseph's form: B = P − K(PHᵀ)ᵀ, then B − (BHᵀ − KR)Kᵀ
                for a in range(m):
                    for j in range(n):
                        _subtract_product(B[i, j], k[i, a], PHt[j, a])
            slack = PHt
            _apply_right(B, places, values, start, slack)
            for i in range(n):
                for a in range(m):
                    for b in range(m):
                        if R[b, a] != 0.0:
                            row, gain = slack[i, a], k[i, b]
                            for r in range(w):
                                row[r] -= gain[r] * R[b, a]
            for i in range(n):
                for a in range(m):
                    for j in range(n):
                        _subtract_product(B[i, j], slack[i, a], k[j, a])
            _store_symmetric(B, out, start)
        return K, S, out

    @compiled
    def _factorise(s):
        """Cholesky's factor of a block in place, lower triangle; NaN where it is not positive definite."""
        for j in range(len(s)):
            _root(s[j, j])
            for i in range(j + 1, len(s)):
                _divide(s[i, j], s[j, j])
            for i in range(j + 1, len(s)):
                for c in range(j + 1, i + 1):
                    _subtract_product(s[i, c], s[i, j], s[c, j])

    @compiled
    def mahalanobis(y, S):
        """yᵀS⁻¹y; see `trackhelpers.arrays.mahalanobis`."""
        n, M = y.shape
        total = np.zeros(M)
        for start in range(0, M, BLOCK):
            w = min(BLOCK, M - start)
            L, b = S[:, :, start : start + w].copy(), y[:, start : start + w].copy()
            _factorise(L)
            part = total[start : start + w]
            for j in range(n):
                _divide(b[j], L[j, j])
                _add_product(part, b[j], b[j])
                for i in range(j + 1, n):
                    _subtract_product(b[i], L[i, j], b[j])
        return total

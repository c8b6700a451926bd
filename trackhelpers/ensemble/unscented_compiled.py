"""What an `EnsembleUKF` does around a sensor's h, as compiled loops over the runs: the sigma points, and the update from what the sensor saw at them.

As in `trackhelpers.fused` the algebra is written in symbols and compiled once a size; None is returned without a compiler. The results are NumPy's to rounding.
"""

from functools import lru_cache

import numpy as np

from trackhelpers.kernels import Kernel, binding
from trackhelpers.symbols import Symbol, choose, number

MOST_STATES = 8  # the code grows with the cube of the number of states, and so does the time that compiling takes


def sigma_points(x, P, spread):
    """Root of spread · P, shape (n, n, M), and the points x, x + root, x − root, shape (n, 2 n + 1, M); the root is NaN where P is not positive definite."""
    n, runs = x.shape
    if binding is None or n > MOST_STATES:
        return None
    return _points(n)(runs, x, P, np.full((1, runs), np.sqrt(spread)))


def corrected(root, seen, P, R, weights):
    """The mean of what was seen, (m, M), its covariance S, the gain K and the posterior P, for a sensor without angles.

    Parameters
    ----------
    root, seen : numpy.ndarray, shapes (n, n, M) and (m, 2 n + 1, M)
        Root of the spread times P, and the sensor's h at the points.
    P : numpy.ndarray, shape (n, n, M)
    R : numpy.ndarray, shape (m, m) or (m, m, M)
    weights : tuple of float
        Of the mean: the first point and each other one; then of the covariance likewise.
    """
    n, m, runs = len(P), len(seen), P.shape[2]
    if binding is None or n > MOST_STATES:
        return None
    R = np.broadcast_to(R.reshape(m, m, -1), (m, m, runs))
    return _update(n, m, weights)(runs, root, seen, P, R)


@lru_cache(maxsize=64)
def _points(n):
    x, P, scale = [_load(0, i) for i in range(n)], _lower(1, n), _load(2, 0)
    L = [[number(0.0)] * n for _ in range(n)]
    for j in range(n):
        pivot = P[j][j] - _dot(L[j][:j], L[j][:j])
        L[j][j] = np.sqrt(choose(pivot > 0.0, pivot, float("nan")))
        for i in range(j + 1, n):
            L[i][j] = (P[i][j] - _dot(L[i][:j], L[j][:j])) / L[j][j]
    root = [[value * scale for value in row] for row in L]
    points = [[x[i], *(x[i] + value for value in root[i]), *(x[i] - value for value in root[i])] for i in range(n)]
    return Kernel([((n, n), _flat(root)), ((n, 2 * n + 1), _flat(points))])


@lru_cache(maxsize=64)
def _update(n, m, weights):
    k = 2 * n + 1
    root = [[_load(0, i * n + j) for j in range(n)] for i in range(n)]
    seen = [[_load(1, a * k + j) for j in range(k)] for a in range(m)]
    P, R, (_, mean_other, first, other) = _lower(2, n), _lower(3, m), weights
    # about the first point, for the points' differences are small beside what is seen
    from_first = [[value - row[0] for value in row] for row in seen]
    shift = [_total(row[1:]) * mean_other for row in from_first]  # the weights of the mean add up to one
    mean = [row[0] + shift_ for row, shift_ in zip(seen, shift, strict=True)]
    apart = [[value - shift_ for value in row] for row, shift_ in zip(from_first, shift, strict=True)]
    S = [[R[a][b] + apart[a][0] * apart[b][0] * first + _dot(apart[a][1:], apart[b][1:]) * other for b in range(a + 1)] for a in range(m)]
    # of the points' distances from x one is zero, and the others are pairs ±
    pairs = [[row[1 + j] - row[1 + n + j] for j in range(n)] for row in from_first]
    cross = [[_dot(root[i], pairs[a]) * other for a in range(m)] for i in range(n)]  # the root of a semidefinite P is not triangular
    K = _gain(cross, S)
    posterior = [[P[i][j] - _dot(K[i], cross[j]) for j in range(i + 1)] for i in range(n)]
    return Kernel([((m,), mean), ((m, m), _flat(_mirrored(S))), ((n, m), _flat(K)), ((n, n), _flat(_mirrored(posterior)))])


def _gain(cross, S):
    """cross S⁻¹ by S = L D Lᵀ; NaN where a pivot is not positive."""
    m, rest = len(S), [list(row) for row in S]
    L, inverse = [[number(0.0)] * m for _ in range(m)], []
    for j in range(m):
        inverse.append(choose(rest[j][j] > 0.0, 1.0 / rest[j][j], float("nan")))
        for i in range(j + 1, m):
            L[i][j] = rest[i][j] * inverse[j]
            for c in range(j + 1, i + 1):
                rest[i][c] = rest[i][c] - L[i][j] * rest[c][j]
    K = [list(row) for row in cross]
    for row in K:
        for a in range(m):
            row[a] = row[a] - _dot(L[a][:a], row[:a])
        row[:] = [value * pivot for value, pivot in zip(row, inverse, strict=True)]
        for a in reversed(range(m)):
            row[a] = row[a] - _dot([L[b][a] for b in range(a + 1, m)], row[a + 1 :])
    return K


def _load(array, row):
    return Symbol("load", array, row)


def _lower(array, n):
    return _mirrored([[_load(array, i * n + j) for j in range(i + 1)] for i in range(n)])


def _mirrored(lower):
    return [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]


def _flat(rows):
    return [value for row in rows for value in row]


def _dot(a, b):
    return _total([x * y for x, y in zip(a, b, strict=True)])


def _total(values):
    total = number(0.0)
    for value in values:
        total = total + value
    return total

"""What an `EnsembleUKF` does around a sensor's h, as compiled loops over the runs: the sigma points, and the update from what the sensor saw at them.

As in `trackhelpers.fused` the algebra is written in symbols and compiled once a size; None is returned without a compiler. The results are NumPy's to rounding.
"""

from functools import lru_cache

import numpy as np

from trackhelpers.kernels import Kernel, binding
from trackhelpers.symbolic import dot, flat, gain, loads, mirrored, total
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
    x, P, scale = loads(0, n), loads(1, n, n), loads(2, 1)[0]
    L = [[number(0.0)] * n for _ in range(n)]
    for j in range(n):
        pivot = P[j][j] - dot(L[j][:j], L[j][:j])
        L[j][j] = np.sqrt(choose(pivot > 0.0, pivot, float("nan")))
        for i in range(j + 1, n):
            L[i][j] = (P[i][j] - dot(L[i][:j], L[j][:j])) / L[j][j]
    root = [[value * scale for value in row] for row in L]
    points = [[x[i], *(x[i] + value for value in root[i]), *(x[i] - value for value in root[i])] for i in range(n)]
    return Kernel([((n, n), flat(root)), ((n, 2 * n + 1), flat(points))])


@lru_cache(maxsize=64)
def _update(n, m, weights):
    k = 2 * n + 1
    root, seen = _rows(0, n, n), _rows(1, m, k)
    P, R, (_, mean_other, first, other) = loads(2, n, n), loads(3, m, m), weights
    # about the first point, for the points' differences are small beside what is seen
    from_first = [[value - row[0] for value in row] for row in seen]
    shift = [total(row[1:]) * mean_other for row in from_first]  # the weights of the mean add up to one
    mean = [row[0] + shift_ for row, shift_ in zip(seen, shift, strict=True)]
    apart = [[value - shift_ for value in row] for row, shift_ in zip(from_first, shift, strict=True)]
    S = [[R[a][b] + apart[a][0] * apart[b][0] * first + dot(apart[a][1:], apart[b][1:]) * other for b in range(a + 1)] for a in range(m)]
    # of the points' distances from x one is zero, and the others are pairs ±
    pairs = [[row[1 + j] - row[1 + n + j] for j in range(n)] for row in from_first]
    cross = [[dot(root[i][: i + 1], pairs[a][: i + 1]) * other for a in range(m)] for i in range(n)]
    K = gain(cross, S)
    posterior = [[P[i][j] - dot(K[i], cross[j]) for j in range(i + 1)] for i in range(n)]
    return Kernel([((m,), mean), ((m, m), flat(mirrored(S))), ((n, m), flat(K)), ((n, n), flat(mirrored(posterior)))])


def _rows(array, p, q):
    """Symbols for the rows of a matrix (p, q)."""
    return [[Symbol("load", array, i * q + j) for j in range(q)] for i in range(p)]

"""What an `EnsembleUKF` does around a model's f and a sensor's h, as compiled loops over the runs: the sigma points, the moments of where f takes them, and the
update from what the sensor saw at them.

As in `trackhelpers.fused` the algebra is written in symbols and compiled once a size; None is returned without a compiler. The results are NumPy's to rounding.
"""

from functools import lru_cache

import numpy as np

from trackhelpers import fused
from trackhelpers.kernels import Kernel, binding
from trackhelpers.symbolic import Vector, dot, flat, gain, loads, mirrored, total
from trackhelpers.symbols import Symbol, choose, number, tracing, wrap

MOST_STATES = 8  # the code grows with the cube of the number of states, and so does the time that compiling takes


def sigma_points(x, P, spread):
    """Root of spread · P, shape (n, n, M), and the points x, x + root, x − root, shape (n, 2 n + 1, M); the root is NaN where P is not positive definite."""
    n, runs = x.shape
    if binding is None or n > MOST_STATES:
        return None
    return _points(n)(runs, x, P, np.full((1, runs), np.sqrt(spread)))


def moments(moved, Q, weights):
    """Mean (n, M) and covariance (n, n, M) of the points (n, 2 n + 1, M) that f has moved, with Q, (n, n) or (n, n, M), added; `weights` as in `corrected`."""
    n, _, runs = moved.shape
    if binding is None or n > MOST_STATES:
        return None
    return _prediction(n, weights)(runs, moved, np.broadcast_to(Q.reshape(n, n, -1), (n, n, runs)))


def corrected(root, seen, P, R, weights, angular=()):
    """The mean of what was seen, (m, M), its covariance S, the gain K and the posterior P.

    Parameters
    ----------
    root, seen : numpy.ndarray, shapes (n, n, M) and (m, 2 n + 1, M)
        Root of the spread times P, and the sensor's h at the points.
    P : numpy.ndarray, shape (n, n, M)
    R : numpy.ndarray, shape (m, m) or (m, m, M)
    weights : tuple of float
        Of each point but the first, and of the first in the covariance; in the mean it has what is left of one.
    angular : tuple of int
        Rows of what was seen that are angles, rad: averaged about the first point, their differences taken the short way round.
    """
    n, m, runs = len(P), len(seen), P.shape[2]
    if binding is None or n > MOST_STATES:
        return None
    R = np.broadcast_to(R.reshape(m, m, -1), (m, m, runs))
    return _update(n, m, weights, tuple(angular))(runs, root, seen, P, R)


def update(sensor, model, x, P, z, R, spread, weights):
    """x, P, y, S and K after a measurement by stations, whose h takes most of the time; NaN where P is not positive definite. None where that cannot be traced."""
    if not hasattr(sensor, "moving") or sensor.angles or model.angles or model._limits or len(x) > MOST_STATES:
        return None
    return fused.corrected(_whole_update, (spread, weights), sensor, model, x, P, z, R)


@lru_cache
def _points(n):
    with tracing():
        root, points = _displaced(loads(0, n), loads(1, n, n), loads(2, 1)[0])
        return Kernel([((n, n), flat(root)), ((n, 2 * n + 1), flat(points))])


@lru_cache
def _prediction(n, weights):
    with tracing():
        mean, P, _ = _moments(_rows(0, n, 2 * n + 1), loads(1, n, n), weights)
        return Kernel([((n,), mean), ((n, n), flat(mirrored(P)))])


@lru_cache
def _update(n, m, weights, angular):
    with tracing():
        root, seen = _rows(0, n, n), _rows(1, m, 2 * n + 1)
        mean, S, K, posterior = _correction(root, seen, loads(2, n, n), loads(3, m, m), weights, angular)
        return Kernel([((m,), mean), ((m, m), flat(S)), ((n, m), flat(K)), ((n, n), flat(posterior))])


def _whole_update(sensor, model, own_noise, spread, weights):
    n, m = model.n, sensor.m
    x, P, z = loads(0, n), loads(1, n, n), loads(2, m)
    R = [[number(value) for value in row] for row in sensor.R] if own_noise else loads(3, m, m)
    root, points = _displaced(x, P, float(np.sqrt(spread)))
    seen = [sensor._rows(point, sensor._parts(point)) for point in map(Vector, zip(*points, strict=True))]
    mean, S, K, posterior = _correction(root, [[number(row[a]) for row in seen] for a in range(m)], P, R, weights)
    y = [z[a] - mean[a] for a in range(m)]
    moved = [x[i] + dot(K[i], y) for i in range(n)]
    return [((n,), moved), ((n, n), flat(posterior)), ((m,), y), ((m, m), flat(S)), ((n, m), flat(K))]


def _displaced(x, P, scale):
    """A root of scale² P, and x, x + root, x − root, the points as columns."""
    n = len(x)
    L = [[number(0.0)] * n for _ in range(n)]
    for j in range(n):
        pivot = P[j][j] - dot(L[j][:j], L[j][:j])
        L[j][j] = np.sqrt(choose(pivot > 0.0, pivot, float("nan")))
        for i in range(j + 1, n):
            L[i][j] = (P[i][j] - dot(L[i][:j], L[j][:j])) / L[j][j]
    root = [[value * scale for value in row] for row in L]
    return root, [[x[i], *(x[i] + value for value in root[i]), *(x[i] - value for value in root[i])] for i in range(n)]


def _moments(points, noise, weights, angular=()):
    """Mean of points (m rows), the lower half of their covariance with the noise added, and how far from the mean they lie."""
    (other, first), mean, apart = weights, [], []
    for a, row in enumerate(points):
        short = wrap if a in angular else number
        from_first = [short(value - row[0]) for value in row]  # these differences are small beside what is seen
        shift = total(from_first[1:]) * other  # the weights of the mean add up to one
        mean.append(short(row[0] + shift))
        apart.append([short(value - shift) for value in from_first])
    spread = [
        [noise[a][b] + apart[a][0] * apart[b][0] * first + dot(apart[a][1:], apart[b][1:]) * other for b in range(a + 1)]
        for a in range(len(points))
    ]
    return mean, spread, apart


def _correction(root, seen, P, R, weights, angular=()):
    """The mean of what was seen at the points, its covariance, the gain, and the posterior covariance."""
    n, m, other = len(P), len(seen), weights[0]
    mean, S, apart = _moments(seen, R, weights, angular)
    # of the points' distances from x one is zero, and the others are pairs ±
    pairs = [[row[1 + j] - row[1 + n + j] for j in range(n)] for row in apart]
    cross = [[dot(root[i], pairs[a]) * other for a in range(m)] for i in range(n)]  # the root of a semidefinite P is not triangular
    K, S = gain(cross, S), mirrored(S)
    return mean, S, K, mirrored([[P[i][j] - dot(K[i], cross[j]) for j in range(i + 1)] for i in range(n)])


def _rows(array, p, q):
    """Symbols for the rows of a matrix (p, q)."""
    return [[Symbol("load", array, i * q + j) for j in range(q)] for i in range(p)]

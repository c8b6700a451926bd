"""Steps of filters on constant matrices, and of the mixture of two of them, as compiled loops over the runs.

As in `trackhelpers.fused` the algebra is written in symbols and compiled; None is returned without a compiler. The results are NumPy's to rounding.
"""

from functools import lru_cache

import numpy as np

from trackhelpers import fused, symbolic
from trackhelpers.kernels import Kernel
from trackhelpers.symbolic import flat, loads
from trackhelpers.symbols import number, tracing


def move(matrices, x, P):
    """F x and F P Fᵀ + Q of `trackhelpers.ensemble.many_matrix_filters.Matrices`, for x (n, M) and P (n, n, M)."""
    return None if fused.binding is None else _moves(matrices)(x.shape[1], x, P)


def correct(matrices, x, P, z, R):
    """x, P, y, S and K after the measurement z (m, M); R is the matrices' own or another one, (m, m) or (m, m, M)."""
    if fused.binding is None:
        return None
    own, runs = R is matrices.R, x.shape[1]
    more = [] if own else [np.broadcast_to(R.reshape(*R.shape[:2], -1), (*R.shape[:2], runs))]
    return _corrects(matrices, own)(runs, x, P, z, *more)


def mixture(weights, xs, Ps):
    """Mean and covariance as `trackhelpers.filters.imm.mixture` has them: weights (2, M), two states (n, M) and their covariances (n, n, M)."""
    n, runs = xs[0].shape
    return None if fused.binding is None else _mixes(n)(runs, weights, *xs, *Ps)


def log_density(y, S):
    """As `trackhelpers.ensemble.covariance.log_density`, y (m, M) and S (m, m, M)."""
    m, runs = y.shape
    if fused.binding is None:
        return None
    squared, inverse_pivots = _densities(m)(runs, y, S)
    return 0.5 * (np.log(inverse_pivots).sum(axis=0) - squared)


@lru_cache(maxsize=64)
def _moves(matrices):
    n = len(matrices.F)
    with tracing():
        x = loads(0, n)
        moved = [symbolic.dot(row, x) for row in matrices.F.tolist()]
        P = symbolic.propagated(loads(1, n, n), matrices.difference, matrices.noise)
        return Kernel([((n,), moved), ((n, n), flat(P))])


@lru_cache(maxsize=64)
def _corrects(matrices, own):
    m, n = matrices.H.shape
    with tracing():
        x, P, z = loads(0, n), loads(1, n, n), loads(2, m)
        R = [[number(value) for value in row] for row in matrices.R.tolist()] if own else loads(3, m, m)
        K, S, P = symbolic.corrected(P, matrices.seen, R)
        y = [measured - symbolic.dot(row, x) for measured, row in zip(z, matrices.H.tolist(), strict=True)]
        moved = [row + symbolic.dot(gain, y) for row, gain in zip(x, K, strict=True)]
        return Kernel([((n,), moved), ((n, n), flat(P)), ((m,), y), ((m, m), flat(S)), ((n, m), flat(K))])


@lru_cache(maxsize=64)
def _mixes(n):
    with tracing():
        (a, b), x, other, P, other_P = loads(0, 2), loads(1, n), loads(2, n), loads(3, n, n), loads(4, n, n)
        apart = [one - two for one, two in zip(x, other, strict=True)]
        mean = [a * one + b * two for one, two in zip(x, other, strict=True)]
        both = [[a * P[i][j] + b * other_P[i][j] + a * b * (apart[i] * apart[j]) for j in range(i + 1)] for i in range(n)]
        return Kernel([((n,), mean), ((n, n), flat(symbolic.mirrored(both)))])


@lru_cache(maxsize=64)
def _densities(m):
    with tracing():
        S = loads(1, m, m)
        return Kernel([((), [symbolic.mahalanobis(loads(0, m), S)]), ((m,), symbolic.inverse_pivots(S))])

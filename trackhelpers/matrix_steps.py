"""Steps of filters on constant matrices, and of the mixture of two of them, as compiled loops over the runs.

As in `trackhelpers.fused` the algebra is written in symbols and compiled; None is returned without a compiler. The results are NumPy's to rounding.
"""

from functools import lru_cache

import numpy as np

from trackhelpers import fused, symbolic
from trackhelpers.kernels import Kernel
from trackhelpers.symbolic import flat, loads
from trackhelpers.symbols import Symbol, choose, number, tracing


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


def fade(matrices, x, P, V, z, R, beta, rho, axis):
    """V, λ and the predicted covariance as `innovation_spread` and `faded` of `trackhelpers.filters.strong_tracking` have them.

    x (n, M) is the prediction and P (n, n, M) the covariance before it; R as for `correct`.
    """
    if fused.binding is None:
        return None
    own, runs = R is matrices.R, x.shape[1]
    more = [] if own else [np.broadcast_to(R.reshape(*R.shape[:2], -1), (*R.shape[:2], runs))]
    return _fades(matrices, own, beta, rho, None if axis is None else tuple(axis.tolist()))(runs, x, P, V, z, *more)


def input_seen(b, information, weighted, y, S, K, H):
    """As `trackhelpers.manoeuvre.input_seen`, for sums with an axis of windows before that of the runs: b (n, q, w, M), information (q, q, w, M), weighted (q, w, M)."""
    if fused.binding is None:
        return None
    (n, q, *many), m = b.shape, len(H)
    given = (np.broadcast_to(a[..., None, :], (*a.shape[:-1], *many)) for a in (y, S, K))  # what all windows of a run share
    rows = (a.reshape(*a.shape[:-2], -1) for a in (b, information, weighted, *given))
    found = _inputs(n, m, q, tuple(map(tuple, np.argwhere(H).tolist())), tuple(H[H != 0].tolist()))(many[0] * many[1], *rows)
    return tuple(a.reshape(*a.shape[:-1], *many) for a in found)


def input_found(b, information, weighted):
    """As `trackhelpers.manoeuvre.input_found`, of M runs."""
    if fused.binding is None:
        return None
    u, covariance, significance = _solutions(len(information))(b.shape[-1], information, weighted)
    return u, covariance, b, significance


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


@lru_cache
def _moves(matrices):
    n = len(matrices.F)
    with tracing():
        x = loads(0, n)
        moved = [symbolic.dot(row, x) for row in matrices.F.tolist()]
        P = symbolic.propagated(loads(1, n, n), matrices.difference, matrices.noise)
        return Kernel([((n,), moved), ((n, n), flat(P))])


@lru_cache
def _corrects(matrices, own):
    m, n = matrices.H.shape
    with tracing():
        x, P, z = loads(0, n), loads(1, n, n), loads(2, m)
        R = [[number(value) for value in row] for row in matrices.R.tolist()] if own else loads(3, m, m)
        K, S, P = symbolic.corrected(P, matrices.seen, R)
        y = [measured - symbolic.dot(row, x) for measured, row in zip(z, matrices.H.tolist(), strict=True)]
        moved = [row + symbolic.dot(gain, y) for row, gain in zip(x, K, strict=True)]
        return Kernel([((n,), moved), ((n, n), flat(P)), ((m,), y), ((m, m), flat(S)), ((n, m), flat(K))])


@lru_cache
def _fades(matrices, own, beta, rho, axis):
    m, n = matrices.H.shape
    with tracing():
        x, moved = loads(0, n), symbolic.propagated(loads(1, n, n), matrices.difference, {})
        V, z, R = loads(2, m, m), loads(3, m), matrices.R.tolist() if own else loads(4, m, m)
        y = [measured - symbolic.dot(row, x) for measured, row in zip(z, matrices.H.tolist(), strict=True)]
        V = [
            [choose(V[i][j] == V[i][j], (rho * V[i][j] + y[i] * y[j]) / (1 + rho), y[i] * y[j]) for j in range(m)] for i in range(m)
        ]  # NaN is no V yet
        known = np.diag(matrices.H @ matrices.Q @ matrices.H.T).tolist()
        N = [V[i][i] - known[i] - beta * R[i][i] for i in range(m)]
        M = [symbolic.dot([symbolic.dot(row, column) for column in moved], row) for row in matrices.H.tolist()]
        if axis is None:
            N, M = [symbolic.total(N)], [symbolic.total(M)]
        fading = [choose(below > 0.0, choose(1.0 < above / below, above / below, 1.0), 1.0) for above, below in zip(N, M, strict=True)]
        root = [Symbol("llvm.sqrt", fading[a]) for a in axis or ()]
        whole = [[(root[i] * root[j] if axis else fading[0]) * moved[i][j] + matrices.Q[i, j] for j in range(n)] for i in range(n)]
        return Kernel([((m, m), flat(V)), (() if axis is None else (m,), fading), ((n, n), flat(whole))])


@lru_cache
def _inputs(n, m, q, places, values):
    with tracing():
        b, information, weighted = (
            [[Symbol("load", k, i * q + j) for j in range(q)] for i in range(rows)] for k, rows in ((0, n), (1, q), (2, 1))
        )
        y, S, K = loads(3, m), loads(4, m, m), [[Symbol("load", 5, i * m + a) for a in range(m)] for i in range(n)]
        seen = [
            [symbolic.total([value * b[i][j] for (c, i), value in zip(places, values, strict=True) if c == a]) for j in range(q)]
            for a in range(m)
        ]
        whitened = symbolic.gain([[row[j] for row in seen] for j in range(q)], S)  # its row j: S⁻¹ H b's column j
        more = [[information[i][j] + symbolic.dot([row[i] for row in seen], whitened[j]) for j in range(i + 1)] for i in range(q)]
        weighted = [weighted[0][j] + symbolic.dot(whitened[j], y) for j in range(q)]
        b = [[b[i][j] - symbolic.dot(K[i], [row[j] for row in seen]) for j in range(q)] for i in range(n)]
        return Kernel([((n, q), flat(b)), ((q, q), flat(symbolic.mirrored(more))), ((q,), weighted)])


@lru_cache
def _solutions(q):
    with tracing():
        information, weighted = loads(0, q, q), loads(1, q)
        covariance = symbolic.gain([[number(float(i == j)) for j in range(q)] for i in range(q)], information)
        covariance = symbolic.mirrored(covariance)
        u = [symbolic.dot(row, weighted) for row in covariance]
        return Kernel([((q,), u), ((q, q), flat(covariance)), ((), [symbolic.dot(u, weighted)])])


@lru_cache
def _mixes(n):
    with tracing():
        (a, b), x, other, P, other_P = loads(0, 2), loads(1, n), loads(2, n), loads(3, n, n), loads(4, n, n)
        apart = [one - two for one, two in zip(x, other, strict=True)]
        mean = [a * one + b * two for one, two in zip(x, other, strict=True)]
        both = [[a * P[i][j] + b * other_P[i][j] + a * b * (apart[i] * apart[j]) for j in range(i + 1)] for i in range(n)]
        return Kernel([((n,), mean), ((n, n), flat(symbolic.mirrored(both)))])


@lru_cache
def _densities(m):
    with tracing():
        S = loads(1, m, m)
        return Kernel([((), [symbolic.mahalanobis(loads(0, m), S)]), ((m,), symbolic.inverse_pivots(S))])

"""A filter's step as one compiled loop over the runs, made of the models' and sensors' own hooks, where llvmlite (it comes with numba) is installed.

A hook is called once with `symbols` in the place of numbers; the covariance algebra is written in symbols too; and the list of operations that this leaves behind is put down
as vector code and compiled. Numbers that occur in it (σ, R, a sensor's place) are handed over at each call, so that what differs only in these shares the code. What cannot be
traced (a sensor that moves, a hook without arithmetic) is left to NumPy. The results are NumPy's to rounding.
"""

from functools import lru_cache
from threading import RLock
from weakref import WeakKeyDictionary

import numpy as np

from trackhelpers.kernels import Kernel, binding
from trackhelpers.symbols import Symbol, Vector, choose, number, tracing, wrap

MOST_STEPS = 16  # different ones of a model that cannot be traced for any dt at once; the further ones are left to NumPy
_kept = WeakKeyDictionary()  # model or sensor -> what was traced of it
_alone = RLock()


# The algebra of `trackhelpers.ensemble.covariance` and `trackhelpers.arrays`, on matrices that are lists of rows of symbols.


def _propagated(P, difference, noise):
    """F P Fᵀ + Q; F − I and the lower half of Q by their entries."""
    n = len(P)
    half = [list(row) for row in P]
    for (i, k), value in difference.items():
        for j in range(n):
            half[i][j] = half[i][j] + value * P[k][j]
    whole = [list(row) for row in half]
    for (i, k), value in difference.items():
        for j in range(i, n):
            whole[j][i] = whole[j][i] + value * half[j][k]
    for (i, j), value in noise.items():
        whole[i][j] = whole[i][j] + value
    return _mirrored(whole)


def _corrected(P, H, R):
    """K, S and P of one update in Joseph's form, (I − KH) P (I − KH)ᵀ + K R Kᵀ = B − (B Hᵀ − K R) Kᵀ with B = P − K (P Hᵀ)ᵀ; H by its entries."""
    n, m = len(P), len(R)
    PHt = _times_transposed(P, H, m)
    S = [list(row) for row in R]
    for (a, j), value in H.items():
        for b in range(a + 1):
            S[a][b] = S[a][b] + value * PHt[j][b]
    S = _mirrored(S)
    L, inverse = _factors(S)
    K = [list(row) for row in PHt]
    for k in K:  # K = P Hᵀ S⁻¹, a row at a time
        for a in range(m):
            for b in range(a):
                k[a] = k[a] - L[a][b] * k[b]
        k[:] = [value * pivot for value, pivot in zip(k, inverse, strict=True)]
        for a in reversed(range(m)):
            for b in range(a + 1, m):
                k[a] = k[a] - L[b][a] * k[b]
    B = [[P[i][j] - _dot(K[i], PHt[j]) for j in range(n)] for i in range(n)]
    slack = _times_transposed(B, H, m)
    slack = [[slack[i][a] - _dot(K[i], [row[a] for row in R]) for a in range(m)] for i in range(n)]
    return K, S, _mirrored([[B[i][j] - _dot(slack[i], K[j]) for j in range(i + 1)] for i in range(n)])


def _mahalanobis(y, S):
    """yᵀS⁻¹y."""
    L, inverse = _factors(S)
    y, total = list(y), 0.0
    for j, pivot in enumerate(inverse):
        total = total + y[j] * y[j] * pivot
        for i in range(j + 1, len(y)):
            y[i] = y[i] - L[i][j] * y[j]
    return total


def _factors(S):
    """L below its diagonal, and the inverse of D, of S = L D Lᵀ; NaN from where a pivot is not positive."""
    m, rest = len(S), [list(row) for row in S]
    L, inverse = [[0.0] * m for _ in range(m)], []
    for j in range(m):
        inverse.append(choose(rest[j][j] > 0.0, 1.0 / rest[j][j], float("nan")))
        for i in range(j + 1, m):
            L[i][j] = rest[i][j] * inverse[j]
            for c in range(j + 1, i + 1):
                rest[i][c] = rest[i][c] - L[i][j] * rest[c][j]
    return L, inverse


def _times_transposed(A, H, m):
    """A Hᵀ."""
    product = [[number(0.0)] * m for _ in A]
    for (a, j), value in H.items():
        for i, row in enumerate(A):
            product[i][a] = product[i][a] + value * row[j]
    return product


def _dot(a, b):
    total = number(0.0)
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def _mirrored(lower):
    return [[lower[max(i, j)][min(i, j)] for j in range(len(lower))] for i in range(len(lower))]


def _loads(array, *shape):
    """Symbols for the rows of the input with this number: a vector (n,), or a matrix (n, n) of which the lower half is read."""
    if len(shape) == 1:
        return Vector(Symbol("load", array, i) for i in range(shape[0]))
    return _mirrored([[Symbol("load", array, i * shape[1] + j) for j in range(i + 1)] for i in range(shape[0])])


def _flat(A):
    return [value for row in A for value in row]


# What is compiled, each made once.


def _traced(owner, key, build):
    """The kernel that `build` traces, kept with `owner`; None where it cannot be traced."""
    kept = _kept.setdefault(owner, {})
    if key not in kept:
        with _alone, tracing():
            try:
                outputs = build()
            except Exception:  # whatever a hook raises that wanted a number
                outputs = None
            kept[key] = outputs and Kernel(outputs)
    return kept[key]


def _prediction(model, dt):
    n = model.n
    x, P = _loads(0, n), _loads(1, n, n)
    rows, transition, noise = model._hooks(x, dt)
    difference = {(i, j): value - 1.0 if i == j else value for (i, j), value in transition.items()}
    return [((n,), _normalised(model, rows)), ((n, n), _flat(_propagated(P, difference, noise)))]


def _normalised(model, rows):
    rows = [wrap(number(row)) if i in model.angles else number(row) for i, row in enumerate(rows)]
    for i, (low, high) in model._limits.items():
        rows[i] = choose(rows[i] < low, low, choose(rows[i] > high, high, rows[i]))
    return rows


def _update(sensor, model, own_noise):
    n, m = model.n, sensor.m
    x, P, z = _loads(0, n), _loads(1, n, n), _loads(2, m)
    R = [[number(value) for value in row] for row in sensor.R] if own_noise else _loads(3, m, m)
    seen, H = sensor._hooks(x)
    y = [wrap(z[a] - row) if a in sensor.angles else z[a] - row for a, row in enumerate(seen)]
    K, S, P = _corrected(P, H, R)
    x = _normalised(model, [x[i] + _dot(K[i], y) for i in range(n)])
    return [((n,), x), ((n, n), _flat(P)), ((m,), y), ((m, m), _flat(S)), ((n, m), _flat(K))]


def predict(model, x, P, dt):
    """x (n, M) and P (n, n, M) after dt seconds by the EKF's equations; None where this model cannot be traced, or there is no compiler."""
    if binding is None or not _plain(type(model), "_normalise", "_arguments"):
        return None
    kernel = _traced(model, "any dt", lambda: _prediction(model, Symbol("dt")))
    if kernel is None and (dt in _kept[model] or len(_kept[model]) <= MOST_STEPS):
        kernel = _traced(model, dt, lambda: _prediction(model, float(dt)))
    return kernel and kernel(x.shape[1], x, P, dt=dt)


def update(sensor, model, x, P, z, R):
    """x, P, y, S and K of an EKF's update; None as for `predict`, and for a sensor that changes with time or from run to run."""
    if binding is None or not _plain(type(sensor), "at", "of_runs", "residual") or not _plain(type(model), "_normalise"):
        return None
    own = R is sensor.R
    kernel = _traced(sensor, (model.state, model.angles, *model._limits.items(), own), lambda: _update(sensor, model, own))
    if kernel is None:
        return None
    runs = x.shape[1]
    return kernel(runs, x, P, z, *([] if own else [np.broadcast_to(R.reshape(*R.shape[:2], -1), (*R.shape[:2], runs))]))


def propagate(P, difference, noise):
    """F P Fᵀ + Q as `trackhelpers.ensemble.covariance.propagate` has it; None without a compiler."""
    n, runs = P.shape[0], P.shape[2]
    first = len(difference)
    kernel = binding and _traced(
        Symbol,
        ("propagate", n, tuple(difference), tuple(noise)),
        lambda: [((n, n), _flat(_propagated(_loads(0, n, n), _entries(1, difference), _entries(1, noise, first))))],
    )
    return kernel and kernel(runs, P, _stacked([*difference.values(), *noise.values()], runs))[0]


def correct(P, entries, R):
    """K, S and P as `trackhelpers.ensemble.covariance.correct` has them; None without a compiler."""
    n, runs, m = P.shape[0], P.shape[2], len(R)

    def build():
        K, S, posterior = _corrected(_loads(0, n, n), _entries(1, entries), _loads(2, m, m))
        return [((n, m), _flat(K)), ((m, m), _flat(S)), ((n, n), _flat(posterior))]

    kernel = binding and _traced(Symbol, ("correct", n, m, tuple(entries)), build)
    return kernel and kernel(runs, P, _stacked(entries.values(), runs), np.broadcast_to(R, (m, m, runs)))


def mahalanobis(y, S):
    """yᵀS⁻¹y of each run, y (n, M) and S (n, n, M); None without a compiler."""
    n, runs = y.shape
    kernel = binding and _traced(Symbol, ("mahalanobis", n), lambda: [((), [_mahalanobis(_loads(0, n), _loads(1, n, n))])])
    return kernel and kernel(runs, y, S)[0]


def _entries(array, places, first=0):
    return {place: Symbol("load", array, first + i) for i, place in enumerate(places)}


def _stacked(values, runs):
    stacked = np.empty((len(values), runs))
    for row, value in zip(stacked, values, strict=True):
        row[:] = value
    return stacked


@lru_cache(maxsize=256)
def _plain(kind, *methods):
    """Whether a class has these methods from the package's base class: another one's would not be seen."""
    return all(getattr(kind, name) is getattr(kind.__mro__[-2], name) for name in methods)

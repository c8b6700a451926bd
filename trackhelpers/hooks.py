"""What models and sensors share: arrays, dense and sparse, out of the rows and entries that their hooks write down.

A hook gets the components of x one by one, `x[i]`, each a number or an array (...), and returns rows (one an output) or the entries of a matrix,
(row, column) -> number or array (...).
"""

import numpy as np

from trackhelpers.angles import wrap_rows

_STEP = np.cbrt(np.finfo(float).eps)  # of central differences: truncation and rounding weigh alike


def evaluate(compute, x, *more):
    """compute(x, …), for one target, x (n,), on plain numbers: on those Python is several times as fast as NumPy.

    Where Python raises (an overflow, a division by zero, a function that wants arrays) NumPy has the last word.
    """
    if x.ndim == 1:
        try:
            return compute(x.astype(object), *more)
        except (ArithmeticError, ValueError, TypeError, AttributeError):
            pass
    return compute(x, *more)


def filled(rows, m, x, name):
    """An array (m, ...) of m rows; ValueError unless there are as many."""
    if len(rows) != m:
        raise ValueError(f"{name}: expected {m} rows, got {len(rows)}")
    if x.ndim == 1:
        return np.array(rows, dtype=float)
    whole = np.empty((m, *x.shape[1:]))
    for i, row in enumerate(rows):
        whole[i] = row
    return whole


def dense(entries, constant, x, mirrored=False):
    """A matrix (p, q, ...): the entries in the place of those of `constant` (p, q), and, if `mirrored`, below and above the diagonal.

    Where no entry depends on the run it is a read-only view of one matrix.
    """
    if x.ndim > 1 and any(np.ndim(value) for value in entries.values()):
        matrix = np.empty((*constant.shape, *x.shape[1:]))
        matrix[:] = constant.reshape(*constant.shape, *[1] * (x.ndim - 1))
    else:
        matrix = constant.copy()
    for place, value in entries.items():
        matrix[place] = value
    if mirrored:
        for place, value in entries.items():
            matrix[place[::-1]] = value
    if matrix.ndim <= x.ndim:
        matrix = np.broadcast_to(matrix.reshape(*matrix.shape, *[1] * (x.ndim - 1)), (*matrix.shape, *x.shape[1:]))
    return matrix


def entries_of(matrix, nought=0.0):
    """(i, j) -> number for the entries of a constant matrix that differ from those of `nought`."""
    return {(int(i), int(j)): float(matrix[i, j]) for i, j in zip(*np.nonzero(matrix - nought), strict=True)}


def central_differences(function, x, angles=()):
    """Entries of the Jacobian of `function` at x (n, ...); the function takes (n, 2n, ...), components first, and returns rows (2n, ...), those in `angles` in rad."""
    x = np.asarray(x, dtype=float)
    n = len(x)
    steps = _STEP * np.maximum(np.abs(x), 1)
    points, upper, lower = np.repeat(x[:, None], 2 * n, axis=1), x + steps, x - steps
    for j in range(n):
        points[j, j], points[j, n + j] = upper[j], lower[j]
    width = upper - lower  # what was stepped indeed, after rounding
    entries = {}
    for i, row in enumerate(function(points)):
        row = np.broadcast_to(np.asarray(row, dtype=float), points.shape[1:])
        difference = row[:n] - row[n:]
        if i in angles:
            wrap_rows(difference[None], (0,))
        difference = difference / width
        entries |= {(i, j): difference[j] for j in range(n)}
    return entries


def applied(entries, x):
    """Rows of F x, F the identity but for the entries."""
    rows = [x[i] * entries[i, i] if (i, i) in entries else x[i] for i in range(len(x))]
    for (i, j), value in entries.items():
        if i != j:
            rows[i] = rows[i] + value * x[j]
    return rows


def refuse_overrides(cls, base, **hooks):
    """TypeError where a class has another public method (name -> its hook) than `base`: it would reach some of the filters and not the others."""
    for name, hook in hooks.items():
        if getattr(cls, name) is not getattr(base, name):
            raise TypeError(f"{cls.__name__}.{name}: write the hook {hook} instead, from which single filters and ensembles both take it")

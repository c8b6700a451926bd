"""The argument checks that everyone uses: what is not numbers of the right shape is refused by a ValueError that names the argument.

A masked array is refused where anything is masked (what stands behind a mask is no measurement), and so are complex numbers, strings and time differences:
a conversion to float would take them for something else.
"""

import math
import operator
import sys

import numpy as np
from scipy.linalg.lapack import dpotrf

_FLOAT, _LARGEST = np.dtype(float), sys.float_info.max


def all_finite(a):
    """Whether all numbers of an array are finite: when their sum of squares is, they are, and only when it is not a closer look is needed."""
    a = np.asarray(a)
    return math.isfinite(np.vdot(a, a)) or bool(np.isfinite(a).all())


def check_dt(dt, name="dt"):
    """The time step as a float, s. ValueError unless it is a finite scalar ≥ 0 (0 is allowed: two sensors at one instant)."""
    if (isinstance(dt, float) or type(dt) is int) and 0 <= dt <= _LARGEST:
        return float(dt)
    return _check_scalar(dt, name, "a finite time step ≥ 0, seconds as a number")


def check_scale(value, name):
    """A standard deviation as a float. ValueError unless it is a finite number ≥ 0."""
    if (isinstance(value, float) or type(value) is int) and 0 <= value <= _LARGEST:
        return float(value)
    return _check_scalar(value, name, "a finite number ≥ 0")


def check_array(value, name, first, trailing=None):
    """`value` as a float array whose first axis has length `first`.

    Parameters
    ----------
    first : int or None
        None allows any length but zero axes.
    trailing : None or tuple of int
        The axes behind the first; None allows any. A plain vector, shape (first,), must be finite; NaN in an ensemble marks a run that has
        diverged and passes.
    """
    if type(value) is np.ndarray and value.dtype == _FLOAT:
        array = value
    else:
        array = _floats(value, name, f"numbers of shape ({_any(first)},) or ({_any(first)}, ...)")
    shape = array.shape
    if not shape or (first is not None and shape[0] != first) or (trailing is not None and shape[1:] != trailing):
        wanted = ", ".join(map(str, [_any(first), "..."] if trailing is None else [_any(first), *trailing]))
        raise ValueError(f"{name}: expected shape ({wanted}), components on the first axis, got {shape}")
    if len(shape) == 1 and not math.isfinite(np.vdot(array, array)) and not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, got {array}")
    return array


def check_matrix(value, name, shape):
    """`value` as a float array of the given shape, of which the first length may be None for any; ValueError unless it has it and is finite."""
    matrix = check_array(value, name, shape[0], tuple(shape[1:]))
    if not all_finite(matrix):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(matrix))} that are not")
    return matrix


def check_angles(angles, n, name="angles"):
    """Indices of the angular ones among n components as a tuple; ValueError unless they are whole numbers from 0 to n − 1."""
    try:
        indices = tuple(operator.index(i) for i in angles)
    except TypeError:
        indices = (-1,)
    if any(not 0 <= i < n for i in indices):
        raise ValueError(f"{name}: expected indices from 0 to {n - 1}, got {angles!r}")
    return indices


def check_covariance(value, name, n, runs=None, definite=False):
    """A copy of `value` as a covariance of shape (n, n), or (n, n, runs) where `runs` is given and the value has that axis.

    ValueError unless it is finite, symmetric, and positive semidefinite (`definite`: positive definite). What rounding may do is measured on the correlations,
    1e-9 of them, so that the verdict does not depend on units; a negative variance is never rounding, nor is a covariance with what has no variance.
    """
    P = np.array(_floats(value, name, f"a covariance of shape ({n}, {n})"))
    shapes = [(n, n)] if runs is None else [(n, n), (n, n, runs)]
    if P.shape not in shapes:
        raise ValueError(f"{name}: expected shape {' or '.join(map(str, shapes))}, got {P.shape}")
    if not all_finite(P):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(P))} that are not")
    variances = P.diagonal().T
    asymmetry = np.abs(P - P.swapaxes(0, 1))
    if asymmetry.max() <= 1e-9 * variances.min() and _has_cholesky(P):
        return P
    wanted = f"{name}: expected a positive {'definite' if definite else 'semidefinite'} matrix"
    if (variances < 0).any():
        raise ValueError(f"{wanted}, got a variance of {variances.min():.3g}")
    C = correlations(P)
    if (np.abs(C - C.swapaxes(0, 1)) > 1e-9).any():
        raise ValueError(f"{name}: expected a symmetric matrix, got one that differs from its transpose by up to {asymmetry.max():.3g}")
    if (variances == 0).any() and ((P != 0) & ((variances == 0)[:, None] | (variances == 0))).any():
        raise ValueError(f"{wanted}, got a covariance with a component that has no variance")
    if _has_cholesky(C):
        return P
    smallest = np.linalg.eigvalsh(np.moveaxis(C, (0, 1), (-2, -1)))[..., 0].min()
    if definite or smallest < -1e-9:
        raise ValueError(f"{wanted}, got one whose correlations have the eigenvalue {smallest:.3g}")
    return P


def correlations(P):
    """P (n, n, ...) divided by the standard deviations of its rows and columns; a component without variance is left as it is."""
    sigma = deviations(P)
    return P / sigma[:, None] / sigma


def deviations(P):
    """Standard deviations (n, ...) of a covariance (n, n, ...), with 1 for those that are zero: the units in which it is a matrix of correlations."""
    sigma = np.sqrt(P.diagonal().T)
    return np.where(sigma > 0, sigma, 1.0)


def _has_cholesky(P):
    """Whether all matrices of P (n, n, ...) are positive definite."""
    if P.ndim == 2:
        return dpotrf(P)[1] == 0
    try:
        np.linalg.cholesky(np.moveaxis(P, (0, 1), (-2, -1)))
    except np.linalg.LinAlgError:
        return False
    return True


def _check_scalar(value, name, wanted):
    number = _floats(value, name, wanted)
    if number.ndim or np.asarray(value).dtype == bool or not 0 <= number < math.inf:
        raise ValueError(f"{name}: expected {wanted}, got {value!r}")
    return float(number)


def _floats(value, name, wanted):
    """`value` as a float array; ValueError where that would read a masked entry, or change what is meant."""
    if _masked(value):
        raise ValueError(f"{name}: expected {wanted}, got a masked array: leave out what is masked, or pass None for a missing measurement")
    try:
        array = np.asarray(value)
        kinds = {np.asarray(item).dtype.kind for item in array.flat} if array.dtype == object else {array.dtype.kind}
        if not kinds <= set("biufO"):
            raise TypeError
        return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name}: expected {wanted}, got {value!r}") from None


def _masked(value):
    if isinstance(value, (list, tuple)):
        return any(map(_masked, value))
    return isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value)


def _any(first):
    return "n" if first is None else first

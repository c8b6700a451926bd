"""The door: every array and number that somebody hands over enters through one of these, or is refused by a ValueError that names argument, value and expectation.

A masked array is refused where anything is masked (what stands behind a mask is no measurement), and so are complex numbers, truth values, strings, time differences, arrays of
objects and numbers too large for a float: a conversion would take them for something else.
"""

import math
import operator
import sys

import numpy as np
from scipy.linalg.lapack import dpotrf

from trackhelpers.real import floats, is_masked, said

_FLOAT, _LARGEST = np.dtype(float), sys.float_info.max
_LONGEST = 1e12  # s: thirty thousand years, whose powers in a covariance are numbers still


def all_finite(a):
    """Whether all numbers of an array are finite: when their sum of squares is, they are, and only when it is not a closer look is needed."""
    a = np.asarray(a)
    return math.isfinite(np.vdot(a, a)) or bool(np.isfinite(a).all())


def check_dt(dt, name="dt"):
    """The time step as a float, s. ValueError unless it is a scalar from 0 (two sensors at one instant) to 1e12."""
    if (isinstance(dt, float) or type(dt) is int) and 0 <= dt <= _LONGEST:
        return float(dt)
    return check_number(dt, name, "a finite time step ≥ 0 and ≤ 1e12, seconds as a number", 0, _LONGEST)


def check_scale(value, name):
    """A standard deviation as a float. ValueError unless it is a finite number ≥ 0."""
    if (isinstance(value, float) or type(value) is int) and 0 <= value <= _LARGEST:
        return float(value)
    return check_number(value, name, "a finite number ≥ 0", 0)


def check_number(value, name, wanted="a finite number", low=-math.inf, high=math.inf):
    """`value` as a float. ValueError unless it is one finite number from `low` to `high`; `wanted` says so in words."""
    number = floats(value, name, wanted)
    if number.ndim or not math.isfinite(number) or not low <= number <= high:
        raise ValueError(f"{name}: expected {wanted}, got {said(value)}")
    return float(number)


def check_positive(value, name, wanted="a finite number > 0"):
    """`value` as a float. ValueError unless it is a finite number > 0."""
    number = check_number(value, name, wanted, 0)
    if number == 0:
        raise ValueError(f"{name}: expected {wanted}, got {said(value)}")
    return number


def check_probability(value, name):
    """`value` as a float. ValueError unless it lies between 0 and 1."""
    wanted = "a probability between 0 and 1"
    number = check_number(value, name, wanted)
    if not 0 < number < 1:
        raise ValueError(f"{name}: expected {wanted}, got {said(value)}")
    return number


def check_count(value, name, least=1):
    """`value` as an int. ValueError unless it is a whole number ≥ `least` that an array could have for its length."""
    if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (int, np.integer)) or not least <= value <= sys.maxsize:
        raise ValueError(f"{name}: expected a whole number ≥ {least}, got {said(value)}")
    return int(value)


def check_choice(value, name, choices):
    """`value`. ValueError unless it is one of some words."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name}: expected one of {tuple(choices)}, got {said(value)}")
    return value


def check_names(value, name, empty=False):
    """A sequence of words as a tuple, or a string of letters as one each. ValueError unless they are words, each once, and some, but for `empty`."""
    names = tuple(value) if isinstance(value, (list, tuple, str)) else None
    if names is None or not (names or empty) or not all(isinstance(each, str) for each in names) or len(set(names)) < len(names):
        raise ValueError(f"{name}: expected a sequence of names, each once, got {said(value)}")
    return names


def check_mask(value, name, runs):
    """Which of the runs are meant, an array (runs,) of truth values. ValueError unless it is that: no whole numbers, no None."""
    mask = np.asarray(value) if not is_masked(value) else np.empty(0)
    if mask.dtype != bool or mask.shape != (runs,):
        raise ValueError(f"{name}: expected booleans of shape ({runs},), got {mask.dtype} of shape {mask.shape}")
    return mask


def check_numbers(value, name, wanted="numbers, an array of any shape"):
    """`value` as a float array of any shape, NaN and infinities among the numbers; what already is one comes back as it is."""
    if type(value) is np.ndarray and value.dtype == _FLOAT:
        return value
    return floats(value, name, wanted)


def check_together(wanted="one number, or arrays of one length", **values):
    """Float arrays of any shape that broadcast against each other, in the order of the arguments; ValueError where they don't."""
    arrays = [check_numbers(value, name) for name, value in values.items()]
    if len({array.shape for array in arrays}) == 1:
        return arrays
    try:
        np.broadcast_shapes(*(array.shape for array in arrays))
    except ValueError:
        raise ValueError(f"{', '.join(values)}: expected {wanted}, got the shapes {', '.join(str(a.shape) for a in arrays)}") from None
    return arrays


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
        array = floats(value, name, f"numbers of shape ({_any(first)},) or ({_any(first)}, ...)")
    shape = array.shape
    if not shape or (first is not None and shape[0] != first) or (trailing is not None and shape[1:] != trailing):
        wanted = ", ".join(map(str, [_any(first), "..."] if trailing is None else [_any(first), *trailing]))
        raise ValueError(f"{name}: expected shape ({wanted}), components on the first axis, got {shape}")
    if len(shape) == 1 and not math.isfinite(np.vdot(array, array)) and not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, got {array}")
    return array


def check_vector(value, name, n=None):
    """`value` as a float array (n,), one number as (1,); ValueError unless it is n finite numbers, as many as you like without `n`."""
    if type(value) is np.ndarray and value.dtype == _FLOAT and value.shape == (n,) and all_finite(value):  # at a glance, or closely
        return value
    return check_array(value if isinstance(value, (list, tuple)) or getattr(value, "ndim", 0) else [value], name, n, ())


def check_matrix(value, name, shape):
    """`value` as a float array of the given shape, of which the first length may be None for any; ValueError unless it has it and is finite."""
    matrix = check_array(value, name, shape[0], tuple(shape[1:]))
    if not all_finite(matrix):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(matrix))} that are not")
    return matrix


def check_lengths(numbers=(), **values):
    """Arrays to be drawn against each other, of one length; those named in `numbers` may be numbers."""
    arrays = check_together("arrays of one length", **values)
    first = arrays[0].shape[:1]
    for name, array in zip(values, arrays, strict=True):
        if array.shape[:1] != first and not (name in numbers and array.ndim == 0):
            raise ValueError(
                f"{', '.join(values)}: expected arrays of one length, got the shapes {', '.join(str(a.shape) for a in arrays)}"
            )
    return arrays


def check_angles(angles, n, name="angles"):
    """Indices of the angular ones among n components as a tuple; ValueError unless they are whole numbers from 0 to n − 1."""
    if type(angles) is tuple:  # at a glance, or closely
        for i in angles:
            if type(i) is not int or not 0 <= i < n:
                break
        else:
            return angles
    try:
        indices = tuple(-1 if isinstance(i, (bool, np.bool_)) else operator.index(i) for i in angles)
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
    P = np.array(floats(value, name, f"a covariance of shape ({n}, {n})"))
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


def _any(first):
    return "n" if first is None else first

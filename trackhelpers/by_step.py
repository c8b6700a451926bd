"""Checks of matrices that are constant or given one a step, as a list of N or with the steps last."""

import numpy as np

from trackhelpers.arrays import all_finite, check_array, check_covariance
from trackhelpers.checks import check_numbers


def check_system(F, H, Q, R, steps):
    """F (n, n), H (m, n), Q (n, n) and R (m, m) as `check_by_step` returns them; the sizes are those of F and R."""
    n, m = check_size(F, "F"), check_size(R, "R")
    kinds = (F, "F", (n, n), False), (H, "H", (m, n), False), (Q, "Q", (n, n), True), (R, "R", (m, m), True)
    return [check_by_step(value, name, shape, steps, covariance) for value, name, shape, covariance in kinds]


def check_size(value, name):
    """The size n of a square matrix (n, n), or of one a step."""
    shape = check_numbers(value, name).shape
    if len(shape) not in (2, 3) or 0 in shape[:2]:
        raise ValueError(f"{name}: expected a square matrix, or one a step, got shape {shape}")
    return shape[-2]  # whichever way it carries the steps


def check_by_step(value, name, shape, steps, covariance=False):
    """A constant matrix, or one a step, as an array (steps, *shape)."""
    matrix = check_finite(check_array(value, name, None), name)
    listed = isinstance(value, (list, tuple)) and len(value) > 0 and np.ndim(value[0]) == 2
    matrix = np.moveaxis(matrix, -1, 0) if matrix.ndim == 3 and not listed else matrix
    if matrix.shape not in (shape, (steps, *shape)):
        raise ValueError(f"{name}: expected shape {shape}, or {steps} of them, got {np.shape(value)}")
    if covariance:
        check_covariance(np.moveaxis(np.reshape(matrix, (-1, *shape)), 0, -1), name, shape[0], matrix.size // (shape[0] * shape[1]))
    return np.broadcast_to(matrix, (steps, *shape))


def check_finite(array, name):
    """The array; ValueError that counts what is not finite in it."""
    if not all_finite(array):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(array))} that are not")
    return array

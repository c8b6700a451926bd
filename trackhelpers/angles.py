"""Angles: the one place that knows that θ and θ + 2π are the same direction.

Arrays follow the house's convention: components on the first axis, anything else (sigma points, runs) behind it.
"""

from math import cos, pi, sin

import numpy as np

from trackhelpers import symbols
from trackhelpers.checks import check_angles, check_array, check_numbers, check_together
from trackhelpers.symbols import Symbol

NAMES = ("θ", "Φ", "ψ")  # of components that are angles in every layout of this package


def wrap(angle):
    """Angle brought into [−π, π).

    Parameters
    ----------
    angle : array_like
        Angles of any shape, rad. NaN stays NaN.

    Returns
    -------
    numpy.ndarray or float
        The same directions in [−π, π); values that lie there already come back bit for bit.

    Raises
    ------
    ValueError
        For what is no number.
    """
    angle = np.array(check_numbers(angle, "angle"))
    wrap_rows(angle[None], (0,))
    return angle[()]


def wrap_rows(x, angles):
    """Wrap the rows of the array `x` (n, ...) named by the indices `angles`, rad, in place; returns `x`."""
    for i in angles:
        row = x[i]
        if x.ndim == 1:
            if not -pi <= row < pi:
                x[i] = (row + pi) % (2 * pi) - pi
            continue
        outside = (row < -np.pi) | (row >= np.pi)
        if outside.any():
            with np.errstate(invalid="ignore"):  # a diverged run holds inf
                x[i] = np.where(outside, np.mod(row + np.pi, 2 * np.pi) - np.pi, row)
    return x


def wrap_components(x, angles):
    """Copy of `x` whose rows named by the indices `angles` are wrapped; `x` (n, ...), angles in rad. ValueError for what is neither."""
    x = np.array(check_numbers(x, "x"))
    return wrap_rows(x, check_angles(angles, x.shape[0] if x.ndim else 0))


def cos_sin(angle):
    """Cosine and sine of `angle` (rad, any shape), both from the tangent of its half: the one of the three functions that NumPy computes in vectors.

    Their absolute error is a few last places of 1, the sine's relative error too. A plain number is left to Python's own.
    """
    if type(angle) is float:
        return cos(angle), sin(angle)
    if isinstance(angle, Symbol):
        return symbols.cos_sin(angle)
    t = np.tan(np.multiply(angle, 0.5))
    square = t * t
    scale = 1 / (1 + square)
    return (1 - square) * scale, (t + t) * scale


def residual(a, b, angles=()):
    """Difference a − b, taken the short way round in the angular components.

    Parameters
    ----------
    a, b : array_like, shapes (n, ...) that broadcast against each other from the right
        Vectors with their components on the first axis.
    angles : sequence of int
        Indices of the components that are angles, rad.

    Returns
    -------
    numpy.ndarray, shape (n, ...)

    Raises
    ------
    ValueError
        Shapes that do not fit, what is no number, indices that there are not.
    """
    a, b = check_together("shapes (n, ...) that broadcast against each other", a=a, b=b)
    difference = np.subtract(a, b)
    if isinstance(angles, tuple) and not angles:
        return difference
    return wrap_rows(difference, check_angles(angles, difference.shape[0] if difference.ndim else 0))


def mean(points, weights, angles=()):
    """Weighted mean of sigma points, with angular components averaged about the first point.

    An angle is averaged as θ₀ + Σ wᵢ wrap(θᵢ − θ₀). Where no point lies half a turn from the first this is the linear mean, whatever the signs of
    the weights; the mean of unit vectors, the usual recipe, flips over when a negative weight outweighs the others.

    Parameters
    ----------
    points : array_like, shape (n, k, ...)
        k points with components on the first axis.
    weights : array_like, shape (k,)
        Weights that sum to one.
    angles : sequence of int
        Indices of the angular components, rad.

    Returns
    -------
    numpy.ndarray, shape (n, ...)

    Raises
    ------
    ValueError
        Shapes that do not fit, what is no number, indices that there are not.
    """
    points, weights = check_array(points, "points", None), check_numbers(weights, "weights")
    if points.ndim < 2 or weights.shape != points.shape[1:2]:
        raise ValueError(
            f"weights: expected shape ({points.shape[1] if points.ndim > 1 else '?'},) for points {points.shape}, got {weights.shape}"
        )
    angles = check_angles(angles, len(points))
    average = np.einsum("k,nk...->n...", weights, points)
    for i in angles:
        centre = points[i, 0]
        average[i] = wrap(centre + np.einsum("k,k...->...", weights, wrap(points[i] - centre)))
    return average

"""Where on the sea an emitter is, from range differences alone: in closed form from one pair, paper 4, section 3.1, and its covariance.

Positions are ECEF, m; d and the points have any trailing axes (times, runs), against which those of `satellites` (3, 3) or (3, 3, ...) broadcast.
"""

from math import prod

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, inverse
from trackhelpers.batch import BatchFix as BatchFix
from trackhelpers.batch import batch_fix as batch_fix
from trackhelpers.charts import check_chart, dot
from trackhelpers.sea_points import FLAT, SQUARES, sea_points
from trackhelpers.sensors.tdoa import check_stations, difference_gradients

_BLOCK = 2048  # problems at a time, which fit into the processor's cache
_QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}


def fix(d, satellites, near=None):
    """The point of the sea that a pair of range differences tells.

    Parameters
    ----------
    d : array_like, shape (2, ...)
        d_1 and d_2, m; (2,) is one epoch.
    satellites : array_like, shape (3, 3) or (3, 3, ...)
        Positions of S0, S1, S2 as columns; of N epochs (3, 3, N, 1), say, for d (2, N, M).
    near : array_like, shape (3,) or (3, ...), optional
        Of several points that all satellites see, the nearest to this one is taken; without it that is no fix.

    Returns
    -------
    numpy.ndarray, shape (3, ...)
        NaN where there is no fix, so that ``np.isfinite(p[0])`` is the mask of those that have one.

    Raises
    ------
    ValueError
        A formation that lies in a plane with the Earth's centre (a collinear one, a string along one orbit), from which left and right look the same. For one epoch
        also a difference that is not shorter than its baseline, no point that all satellites see, several of them.

    Notes
    -----
    Of an emitter below the horizon the differences may have another point that is seen: nothing tells that from d alone.
    """
    d, s = _arguments(d, satellites)
    if d.ndim == 1:
        _refuse(d, s, np.isfinite(candidates(d, s)[0]).sum(), near)
    shape = np.broadcast_shapes(d.shape[1:], s.shape[2:])
    near = None if near is None else check_array(near, "near", 3)
    p = np.empty((3, prod(shape)))
    for block, there in _blocks(shape):
        found = sea_points(_part(d, shape, there, 1), _part(s, shape, there, 2), True)
        p[:, block] = _chosen(found, None if near is None else _part(near, shape, there, 1))
    return p.reshape(3, *shape)


def candidates(d, satellites, seen=True):
    """All points of the sea with the range differences d: shape (3, 4, ...), NaN where there are fewer than four.

    ``(s_i − s_0)·p = ½[(s_i − s_0)·(s_i + s_0) − d_i²] − d_i r_0`` and ``s_0·p = ½(R² + |s_0|² − r_0²)`` give p as a quadratic in r_0, and ``|p|² = R²`` a quartic. Roots count that
    are real with r_0 > 0 and r_0 + d_i > 0; R becomes the Earth's radius there, and Newton's iteration on d_1, d_2 and the ellipsoid takes off the rest.

    Parameters
    ----------
    d, satellites
        As for `fix`.
    seen : bool
        Only those that are over the horizon of all satellites.
    """
    d, s = _arguments(d, satellites)
    shape = np.broadcast_shapes(d.shape[1:], s.shape[2:])
    points = np.empty((3, 4, prod(shape)))
    for block, there in _blocks(shape):
        points[..., block] = sea_points(_part(d, shape, there, 1), _part(s, shape, there, 2), seen)
    return points.reshape(3, 4, *shape)


def _blocks(shape):
    """Slices of what has these axes in a row, and the indices that they stand for."""
    count = prod(shape)
    for first in range(0, count, _BLOCK):
        block = slice(first, min(first + _BLOCK, count))
        yield block, np.unravel_index(np.arange(block.start, block.stop), shape or (1,))


def _part(values, shape, there, leading):
    """The elements `there` of values, whose axes after the `leading` ones broadcast to `shape`: in a row, on the last axis."""
    first, rest = values.shape[:leading], values.shape[leading:]
    shape = shape or (1,)
    return np.broadcast_to(values.reshape(*first, *[1] * (len(shape) - len(rest)), *rest), (*first, *shape))[(..., *there)]


def _chosen(found, near):
    """Of points (3, 4, K) the only one, or the one nearest to `near` (3, K): (3, K)."""
    there = np.isfinite(found[0])
    distance = np.zeros(there.shape) if near is None else np.sum((found - near[:, None]) ** 2, axis=0)
    chosen, count = np.argmin(np.where(there, distance, np.inf), axis=0), there.sum(axis=0)
    lost = count != 1 if near is None else count == 0
    return np.where(lost, np.nan, found[:, chosen, np.arange(len(lost))])


def fix_covariance(position, satellites, R, chart):
    """Covariance of a fix in the chart's coordinates, (H_xyᵀ R⁻¹ H_xy)⁻¹: the paper's PdX, to first order.

    Parameters
    ----------
    position : array_like, shape (3, ...)
        The fix, or the emitter.
    satellites : array_like, shape (3, S) or (3, S, ...)
    R : array_like, shape (S − 1, S − 1)
        Covariance of the range differences, m².
    chart : trackhelpers.charts.Chart

    Returns
    -------
    numpy.ndarray, shape (2, 2, ...)
        NaN where the position is, or is below the horizon of a satellite, or where the differences do not tell it; for one position that is a ValueError.
    """
    p, s, chart = check_array(position, "position", 3), check_stations(satellites, "satellites"), check_chart(chart)
    visible = _seen(p, s)
    if p.ndim == 1 and not np.all(visible):
        raise ValueError(f"position: expected one that all satellites see, got one below the horizon, {p}")
    W = np.linalg.inv(check_covariance(R, "R", s.shape[1] - 1, definite=True))
    shape = np.broadcast_shapes(p.shape[1:], s.shape[2:])
    if p.ndim == 1 or np.ndim(getattr(chart, "sign", 0)):
        P = _covariance(p, s, W, chart)
    else:
        P = np.empty((2, 2, prod(shape)))
        for block, there in _blocks(shape):
            P[..., block] = _covariance(_part(p, shape, there, 1), _part(s, shape, there, 2), W, chart)
    if not shape and not np.isfinite(P).all():
        raise ValueError("satellites: expected range differences that tell the position, got a singular HᵀR⁻¹H")
    return np.where(visible, P.reshape(2, 2, *shape), np.nan)


def _covariance(p, s, W, chart):
    """(Hᵀ W H)⁻¹, NaN where that has no inverse."""
    H = np.einsum("ik...,kj...->ij...", difference_gradients(p, s), chart.jacobian(chart.to_chart(p)))
    with np.errstate(**_QUIET):
        return inverse(np.einsum("ki...,kj...->ij...", H, np.tensordot(W, H, 1)))


def _arguments(d, satellites):
    d, s = check_array(d, "d", 2), check_stations(satellites, "satellites")
    if s.shape[1] != 3:
        raise ValueError(f"satellites: expected three, shape (3, 3), got {s.shape}")
    if s.ndim == 2:
        b1, b2, first = s[:, 1] - s[:, 0], s[:, 2] - s[:, 0], s[:, 0]
        if abs(np.cross(b1, b2) @ first) < FLAT * np.linalg.norm(b1) * np.linalg.norm(b2) * np.linalg.norm(first):
            raise ValueError("satellites: expected a formation that is in no plane with the Earth's centre, got a collinear or a flat one")
    return d, s


def _refuse(d, s, count, near):
    """ValueError for one epoch that has no fix."""
    baselines = np.linalg.norm(s[:, 1:] - s[:, :1], axis=0)
    if np.any(np.abs(d) >= baselines):
        raise ValueError(f"d: expected range differences shorter than their baselines, {baselines}, got {d}")
    if count == 0:
        raise ValueError(f"d: no visible root: no point of the sea that all satellites see has the range differences {d}")
    if count > 1 and near is None:
        raise ValueError(f"d: all satellites see {count} points with the range differences {d}; tell by near= which one is meant")


def _seen(p, s):
    """Whether all satellites s (3, S, ...) are above the horizon of p (3, ...)."""
    normal = [pk / square for pk, square in zip(p, SQUARES, strict=True)]
    above = [dot([sk - pk for sk, pk in zip(s[:, i], p, strict=True)], normal) > 0 for i in range(s.shape[1])]
    return np.all(np.broadcast_arrays(*above), axis=0)

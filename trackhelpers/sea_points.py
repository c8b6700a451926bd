"""The points of the sea that a pair of range differences leaves open, of many pairs at a time: what `trackhelpers.fixes` chooses from."""

from functools import cache

import numpy as np

from trackhelpers.charts import Ellipsoid, dot
from trackhelpers.kernels import Kernel, binding
from trackhelpers.quartic import real_roots, roots_up_to_one
from trackhelpers.sensors.tdoa import ranges
from trackhelpers.symbolic import loads
from trackhelpers.symbols import tracing

SQUARES = (Ellipsoid.a**2, Ellipsoid.a**2, Ellipsoid.b**2)  # m², of the semi-axes
FLAT = 1e-5  # the least volume that S0's radius and the baselines span, as a share of a box's
_ROWS = (3, 3, 3, 3, 9, 2)  # of what `_finished` takes
_UNIT = 1e6  # m, of the ranges in the quartic
_REACH = 1.3  # the farthest root on the sphere whose point on the ellipsoid may be in sight, in distances of S0's horizon
_QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}


def sea_points(d, s, seen):
    """The points (3, 4, K) of K problems, d (2, K) and s (3, 3, K)."""
    points = np.full((3, 4, d.shape[1]), np.nan)
    with np.errstate(**_QUIET):
        curve = _Curve(d, s)
        r, where, column = curve.roots(near=seen)
        parts = [part[:, where] for part in (curve.P0, curve.P1, curve.P2, curve.normal, s.reshape(9, -1), d)]
        kernel = binding and _kernel(seen)
        p = np.stack(_finished(*parts, r, seen)) if not kernel else kernel(len(r), *parts, r)[0]
        kept = np.isfinite(p[0])
    points[:, column[kept], where[kept]] = p[:, kept]
    return points


class _Curve:
    """The points that share d_1 and d_2 with an emitter, p = P0 + P1 r + P2 r² with r = r_0 their range from S0; K problems in a row."""

    def __init__(self, d, s):
        self.d, self.s = d, s
        first, b1, b2 = self.s[:, 0], self.s[:, 1] - self.s[:, 0], self.s[:, 2] - self.s[:, 0]
        c1, c2, c3 = (np.stack(_cross(*pair)) for pair in ((b2, first), (first, b1), (b1, b2)))
        volume = dot(b1, c1)
        too_flat = np.abs(volume) < FLAT * np.sqrt(dot(b1, b1) * dot(b2, b2) * dot(first, first))
        volume = np.where(too_flat | np.any(np.abs(self.d) >= np.sqrt(np.stack([dot(b1, b1), dot(b2, b2)])), axis=0), np.nan, volume)
        self.normal, square = c3 / volume, dot(first, first)
        k1, k2 = (0.5 * (dot(b, self.s[:, i] + first) - di**2) for i, b, di in ((1, b1, self.d[0]), (2, b2, self.d[1])))
        self.P0 = (k1 * c1 + k2 * c2) / volume + 0.5 * square * self.normal  # without R²
        self.P1 = -(self.d[0] * c1 + self.d[1] * c2) / volume
        self.P2 = -0.5 * self.normal

    def roots(self, near=False):
        """The real roots r (J,) with the sphere of the radius under S0, and whose they are and which of the four (J,).

        With `near` only those that may turn out to be in sight. A problem that has one, as most do, is solved without the other three.
        """
        R = _radius(self.s[:, 0])
        P0, P1, P2 = self.P0 + 0.5 * R**2 * self.normal, self.P1, self.P2
        quartic = np.stack([dot(P0, P0) - R**2, 2 * dot(P0, P1), dot(P1, P1) + 2 * dot(P0, P2), 2 * dot(P1, P2), dot(P2, P2)])
        quartic *= _UNIT ** np.arange(5.0)[:, None]
        good = np.flatnonzero(np.isfinite(quartic).all(axis=0))
        if not near:
            r, which, column = real_roots(quartic[:, good])
            return r * _UNIT, good[which], column
        reach = _REACH * np.sqrt(np.maximum(dot(self.s[:, 0], self.s[:, 0]) - SQUARES[2], 0)) / _UNIT
        scaled = quartic[:, good] * reach[good] ** np.arange(5.0)[:, None]  # the roots in sight are in (0, 1)
        r, which, column = roots_up_to_one(scaled)
        return r * reach[good[which]] * _UNIT, good[which], column


@cache
def _kernel(seen):
    """`_finished` compiled."""
    with tracing():
        return Kernel([((3,), _finished(*(loads(i, n) for i, n in enumerate(_ROWS)), loads(6, 1)[0], seen))])


def _finished(P0, P1, P2, normal, s, d, r, seen):
    """The point of the ellipsoid that a root r on the sphere stands for, in three components, NaN where it does not count; all in rows, of numbers or of symbols.

    By Newton's iterations, first on |p(r)|² = R² with the Earth's radius R at the point, then on d_1, d_2 and the ellipsoid.
    """
    first, *others = [[s[3 * k + i] for k in range(3)] for i in range(3)]
    baselines = [[a - b for a, b in zip(first, other, strict=True)] for other in others]
    baselines = [(b, dot(b, b)) for b in baselines]

    def point(r, R):
        return [a + 0.5 * R * R * n + (b + c * r) * r for a, b, c, n in zip(P0, P1, P2, normal, strict=True)]

    R = _radius(first)
    for _ in range(3):  # the radius changes by 0.3 % of a way at most, so each takes off two digits or more
        R = _radius(point(r, R))
        p = point(r, R)
        r = r - 0.5 * (dot(p, p) - R * R) / dot(p, [b + 2.0 * c * r for b, c in zip(P1, P2, strict=True)])
    p = point(r, R)
    for positive in (r, r + d[0], r + d[1]):
        p[0] = np.where(positive > 0, p[0], np.nan)
    for _ in range(4):
        u = [a - b for a, b in zip(p, first, strict=True)]
        r0, rows = ranges(u, baselines)
        g1, g2 = ([(bk - di / r0 * uk) / ri for bk, uk in zip(b, u, strict=True)] for (b, _), (ri, di) in zip(baselines, rows, strict=True))
        up = [pk / square for pk, square in zip(p, SQUARES, strict=True)]
        off = d[0] - rows[0][1], d[1] - rows[1][1], 0.5 * (1.0 - dot(p, up))
        across = _cross(g2, up), _cross(up, g1), _cross(g1, g2)
        volume = dot(g1, across[0])
        step = [dot(off, column) / volume for column in zip(*across, strict=True)]
        p = [a + b for a, b in zip(p, step, strict=True)]
    p[0] = np.where(dot(step, step) < 1e-6, p[0], np.nan)  # elsewhere it does not end: two roots nearly meet at the horizon
    up = [pk / square for pk, square in zip(p, SQUARES, strict=True)]
    for satellite in (first, *others) if seen else ():
        p[0] = np.where(dot([a - b for a, b in zip(satellite, p, strict=True)], up) > 0, p[0], np.nan)
    return p


def _radius(p):
    """The Earth's radius, m, in the direction of p (3, ...)."""
    return np.sqrt(dot(p, p) / dot([pk / square for pk, square in zip(p, SQUARES, strict=True)], p))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]

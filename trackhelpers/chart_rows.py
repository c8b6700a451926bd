"""Position and Jacobian of the charts row by row, of arrays and of symbols alike: what an ensemble's sensors work with, and what `trackhelpers.fused` traces."""

import numpy as np

from trackhelpers.charts import Ellipsoid, LocalENU, Plane


def traceable(chart):
    """Whether `rows` and `slopes` take symbols: for the charts of this project, of which `LocalENU` on the sea."""
    return type(chart) in (Plane, Ellipsoid) or (type(chart) is LocalENU and chart.h == 0)


def rows(chart, q):
    """The three rows of ``chart.position(q)`` by the two of q, arrays (...) or, where the chart is `traceable`, `trackhelpers.symbols`."""
    if not traceable(chart):
        return chart.position(np.stack(q))
    if isinstance(chart, LocalENU):
        return _sea(chart, q)[0]
    return [*q, _z(chart, q) if isinstance(chart, Ellipsoid) else 0.0]


def slopes(chart, q):
    """The three rows of ``chart.jacobian(q)``, of two entries each; as `rows`."""
    if not traceable(chart):
        return chart.jacobian(np.stack(q))
    if isinstance(chart, Plane):
        return [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]
    if isinstance(chart, Ellipsoid):
        z = _z(chart, q)
        z = np.where(z == 0, np.nan, z)
        return [[1.0, 0.0], [0.0, 1.0], [-((chart.b / chart.a) ** 2) * row / z for row in q]]
    (east, north, up), normal = chart._axes.T.tolist(), _sea(chart, q)[1]
    rise = [-dot(axis, normal) / dot(up, normal) for axis in (east, north)]  # of the height over the plane: the normal stays normal
    return [[east[k] + up[k] * rise[0], north[k] + up[k] * rise[1]] for k in range(3)]


def _z(chart, q):
    chart._fit(np.shape(q[0]))
    return chart._height(np.hypot(*q))


def _sea(chart, q):
    """Position, and a normal there, of a `LocalENU` on the sea; as its `_surface`."""
    origin, (east, north, up) = chart._origin.tolist(), chart._axes.T.tolist()
    p = [o + e * q[0] + n * q[1] for o, e, n in zip(origin, east, north, strict=True)]
    weights = [Ellipsoid.a**-2, Ellipsoid.a**-2, Ellipsoid.b**-2]
    normal = [row * w for row, w in zip(p, weights, strict=True)]
    A, B, C = dot([u * w for u, w in zip(up, weights, strict=True)], up), dot(normal, up), dot(normal, p) - 1.0
    discriminant = B * B - A * C
    down = C / (B + np.sqrt(np.where(discriminant > 0, discriminant, np.nan)))
    p = [row - down * u for row, u in zip(p, up, strict=True)]
    return p, [row * w for row, w in zip(p, weights, strict=True)]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

"""Position and Jacobian of the charts row by row, of arrays and of symbols alike: what an ensemble's sensors work with, and what `trackhelpers.fused` traces."""

import numpy as np

from trackhelpers.charts import Ellipsoid, LocalENU, Plane, dot


def traceable(chart):
    """Whether `rows` and `slopes` take symbols: for the charts of this project, of which `LocalENU` on the sea."""
    return type(chart) in (Plane, Ellipsoid) or (type(chart) is LocalENU and chart.h == 0)


def rows(chart, q):
    """The three rows of ``chart.position(q)`` by the two of q, arrays (...) or, where the chart is `traceable`, `trackhelpers.symbols`."""
    if not traceable(chart):
        return chart.position(np.stack(q))
    if isinstance(chart, LocalENU):
        return chart._near_root(q)[0]
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
    (east, north, up), normal = chart._axes.T.tolist(), chart._near_root(q)[1]
    rise = [-dot(axis, normal) / dot(up, normal) for axis in (east, north)]  # of the height over the plane: the normal stays normal
    return [[east[k] + up[k] * rise[0], north[k] + up[k] * rise[1]] for k in range(3)]


def _z(chart, q):
    chart._fit(np.shape(q[0]))
    return chart._height(np.hypot(*q))

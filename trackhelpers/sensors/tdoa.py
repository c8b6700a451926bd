"""Time differences of arrival at satellites, or at any stations, as range differences in metres: paper 4, section 2.1. The emitter stays on a surface."""

import copy
from math import sqrt

import numpy as np

from trackhelpers.arrays import check_array
from trackhelpers.chart_rows import rows as rows_of
from trackhelpers.chart_rows import slopes, traceable
from trackhelpers.charts import Ellipsoid, LocalENU, check_chart
from trackhelpers.checks import check_mask, check_numbers
from trackhelpers.sensors.base import Sensor, check_time
from trackhelpers.symbols import Symbol


def range_differences(position, satellites):
    """``|p − s_i| − |p − s_0|`` for i = 1 … S − 1, without cancellation. ValueError for shapes that do not fit.

    With b = s_0 − s_i and u = p − s_0 it is c/(r_i + r_0), where c = r_i² − r_0² = b·(2u + b).

    Parameters
    ----------
    position : array_like, shape (3, ...)
        Of the emitter, m.
    satellites : array_like, shape (3, S) or (3, S, ...)
        Of the satellites, m, S ≥ 2, s_0 first; further axes broadcast against those of `position`.

    Returns
    -------
    numpy.ndarray, shape (S − 1, ...)
    """
    _, _, rows = _rows(position, satellites)
    return np.stack([d for _, _, d in rows])


def difference_gradients(position, satellites):
    """The gradient of the range differences by the emitter's position, û_i − û_0: shape (S − 1, 3, ...); arguments as for `range_differences`.

    With û the unit vectors from the satellites to the emitter it is (b − d_i û_0)/r_i, without cancellation.
    """
    return differences_and_gradients(position, satellites)[1]


def differences_and_gradients(position, satellites):
    """`range_differences` and `difference_gradients` in one go."""
    u, r0, rows = _rows(position, satellites)
    gradients = np.empty((len(rows), 3, *r0.shape))
    for slope, (b, r, d) in zip(gradients, rows, strict=True):
        ratio = d / r0
        for k in range(3):
            slope[k] = (b[k] - ratio * u[k]) / r
    return np.stack([d for _, _, d in rows]), gradients


class _Kind:
    """What a sensor and its copies at other times have in common."""


class StationDifferences(Sensor):
    """What sensors share that compare stations with the first one: where the stations are and when, and the chart of the emitter.

    The state holds the chart's two coordinates under the names x and y, whatever they mean there (east and north in `LocalENU`), in any place and order;
    further components are left alone. `h` and `H` of a sensor whose satellites depend on time are those of an instant, ``sensor.at(t)``.

    Parameters
    ----------
    sigma : float, sequence of float, or array_like (m, m)
        Standard deviations of the differences, SI units, or their covariance R; of those in `rows`, or of all.
    satellites : array_like (3, S), or a function t -> (3, S)
        Positions of the S ≥ 2 satellites in the chart's frame, m, s_0 first. (2, S) lie in the plane z = 0.
    chart : trackhelpers.charts.Chart
        Where the emitter can be.
    state : sequence of str
        Names of the state's components.
    rows : sequence of int or of str
        Which differences are measured: numbers i of the satellites that are compared with s_0, or names; in this order.
    R : array_like, shape (m, m), optional
        The covariance in the place of `sigma`.

    Raises
    ------
    ValueError
        From `h` and `H` for one target outside the chart; in an ensemble that run gets NaN. From `at` for satellites that are not (3, S), S large enough.
    """

    letter = ""

    def __init__(self, sigma=None, satellites=None, chart=None, state=("x", "y", "vx", "vy"), rows=(1, 2), R=None):
        if (sigma is None) == (R is None):
            raise ValueError("sigma, R: expected one of the two")
        self.satellites, self.chart = satellites, check_chart(chart)
        rows = self._named(rows)
        if callable(satellites):
            count = max([2, *(int(row[len(self.letter) :]) for row in rows if row[len(self.letter) :].isdecimal())])
        else:
            self.satellites = check_stations(satellites, "satellites").copy()
            count = self.satellites.shape[1] - 1
        self.names = tuple(f"{self.letter}{i}" for i in range(1, count + 1))
        given = (
            sigma is not None
            and (isinstance(sigma, (list, tuple)) or getattr(sigma, "ndim", 0))
            and check_numbers(sigma, "sigma").ndim == 2
        )
        super().__init__(None if given else sigma, state, sigma if given else R, rows)
        self._place = self._column("x"), self._column("y")
        self._latest, self._numbers, self._kind = (None, None), None, _Kind()
        self._stations = None if callable(satellites) else self._prepared(None)

    def at(self, t):
        """The sensor at the time `t`, s; the last one is kept, so that it costs nothing to ask again. ValueError for what is no time."""
        check_time(t)
        if not callable(self.satellites):
            return self
        if self._latest[0] != t:
            self._latest = t, self._copy(_stations=self._prepared(t))
        return self._latest[1]

    def with_chart(self, chart):
        """The same sensor with another chart: where a sign of the `Ellipsoid` has changed, see `trackhelpers.charts.next_sign`."""
        return self._copy(chart=check_chart(chart))

    def of_runs(self, mask):
        """The sensor of some runs of an ensemble, mask (M,) bool: itself, unless the chart has a sign for each run."""
        sign = getattr(self.chart, "sign", None)
        return self.with_chart(self.chart.with_sign(sign[check_mask(mask, "mask", len(sign))])) if np.ndim(sign) else self

    def moving(self):
        """How `trackhelpers.fused` takes the sensor, which is traced once for all times; None for other charts than those of `trackhelpers.charts`, for a subclass with another `at`, and without a time.

        Returns
        -------
        owner, key : object, tuple
            Equal for sensors that differ in nothing but `given` and `signs`.
        given : numpy.ndarray, shape (k,)
            Where the stations are.
        signs : tuple
            Of an `Ellipsoid` with a sign for each run this array (M,).
        on_symbols : callable
            ``on_symbols(k)`` is the sensor with symbols in the place of what is given, and of the signs as the array with the number k.
        """
        chart, kind = self.chart, type(self.chart)
        if self._stations is None or not traceable(chart) or type(self).at is not StationDifferences.at:
            return None
        if self._numbers is None:
            first, baselines = self._stations[:2]
            self._numbers = np.array([*first, *(number for b, bb in baselines for number in (*b, bb))])
        signs = (chart.sign,) if kind is Ellipsoid and chart.sign.ndim else ()
        place = (chart.lat, chart.lon, chart.h) if kind is LocalENU else ()
        sign = (float(chart.sign),) if kind is Ellipsoid and not signs else ()
        return self._kind, (kind, *place, *sign), self._numbers, signs, self._on_symbols

    def _on_symbols(self, array):
        numbers = [Symbol("given", i) for i in range(len(self._numbers))]
        baselines = [(numbers[i : i + 3], numbers[i + 3]) for i in range(3, len(numbers), 4)]
        signs = np.ndim(getattr(self.chart, "sign", 0))
        chart = self.chart.with_symbol(Symbol("load", array, 0)) if signs else self.chart
        return self._copy(_stations=(numbers[:3], baselines), chart=chart)

    def _named(self, rows):
        """The names of rows that are given by numbers or names."""
        rows = [rows] if isinstance(rows, str) or not hasattr(rows, "__iter__") else list(rows)
        if not rows or not all(isinstance(row, (str, int, np.integer)) and not isinstance(row, bool) for row in rows):
            raise ValueError(f"rows: expected numbers of satellites, from 1, or names, got {rows}")
        return [row if isinstance(row, str) else f"{self.letter}{row}" for row in rows]

    def _copy(self, **changed):
        other = copy.copy(self)
        other.__dict__.update(changed, _latest=(None, None), _numbers=None)
        return other

    def _prepared(self, t):
        """What `_parts` needs of the satellites at the time t: s_0, and for each row that is taken s_0 − s_i and its square."""
        s = check_stations(self.satellites if t is None else self.satellites(t), "satellites")
        if s.ndim > 2 or s.shape[1] <= max(self._taken) + 1:
            raise ValueError(f"satellites: expected shape (3, S) with S > {max(self._taken) + 1}, got {s.shape}")
        baselines = [(s[:, 0] - s[:, i + 1]).tolist() for i in self._taken]
        return s[:, 0].tolist(), [(b, b[0] * b[0] + b[1] * b[1] + b[2] * b[2]) for b in baselines]

    def _seen(self, x):
        """The two coordinates q, and from s_0 the emitter's direction, its range r_0, and for each row that is taken (i, s_0 − s_i, r_i, d_i)."""
        if self._stations is None:
            raise ValueError(f"{type(self).__name__}: the satellites move: ask for the sensor of an instant, .at(t)")
        first, baselines = self._stations[:2]
        q, single = [x[i] for i in self._place], x.ndim == 1
        p = self.chart.position(np.stack(q)).tolist() if single else rows_of(self.chart, q)
        u = [row - s for row, s in zip(p, first, strict=True)]
        r0, rows = ranges(u, baselines, sqrt if single else np.sqrt)
        return q, u, r0, [(i, b, r, d) for i, (b, _), (r, d) in zip(self._taken, baselines, rows, strict=True)]


class TDOA(StationDifferences):
    """Range differences ``d_i = |p − s_i| − |p − s_0| = c (τ_i − τ_0)``, m: paper 4, (3).

    TDOA(sigma or R, satellites, chart, state, rows=(1, 2)): everything as for `StationDifferences`; the components are d1, d2, …

    Example: a ship under three satellites, of which at time t the second saw nothing::

        tdoa = TDOA(24.0, satellites, Ellipsoid(), model.state)
        first = TDOA(24.0, satellites, Ellipsoid(), model.state, rows=(1,))
        kf.update(z[:1], first.at(t))
    """

    letter = "d"

    def _parts(self, x):
        return self._seen(x)

    def _h(self, x, parts):
        rows = [None] * len(self.components)
        for i, _, _, d in parts[3]:
            rows[i] = d
        return rows

    def _H(self, x, parts):
        q, u, r0, rows = parts
        J = self.chart.jacobian(np.stack(q)).tolist() if x.ndim == 1 else slopes(self.chart, q)
        entries = {}
        for i, b, r, d in rows:
            ratio = d / r0
            slope = [(bk - ratio * uk) / r for bk, uk in zip(b, u, strict=True)]  # û_i − û_0
            for k, column in enumerate(self._place):
                entries[i, column] = slope[0] * J[0][k] + slope[1] * J[1][k] + slope[2] * J[2][k]
        return entries


def check_stations(value, name):
    """Positions (3, S, ...) of S ≥ 2 stations; (2, S) are in the plane z = 0. ValueError for another shape, or what is not finite."""
    s = check_array(value, name, None)
    if s.ndim < 2 or s.shape[0] not in (2, 3) or s.shape[1] < 2 or not np.isfinite(s).all():
        raise ValueError(f"{name}: expected finite positions of shape (3, S), S ≥ 2, got shape {s.shape}")
    return s if len(s) == 3 else np.concatenate([s, np.zeros_like(s[:1])])


def _rows(position, satellites):
    """The emitter from s_0, its range, and for each further satellite b = s_0 − s_i, r_i and d_i."""
    p, s = check_array(position, "position", 3), check_stations(satellites, "satellites")
    u = [pk - sk for pk, sk in zip(p, s[:, 0], strict=True)]
    r0, rows = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]), []
    for i in range(1, s.shape[1]):
        b = s[:, 0] - s[:, i]
        c = _excess(u, b, b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
        r = np.sqrt(r0 * r0 + c)
        rows.append((b, r, c / (r + r0)))
    return u, r0, rows


def ranges(u, baselines, root=np.sqrt):
    """r_0, and r_i and d_i for each s_0 − s_i, which comes with its square, of an emitter u from s_0: by rows, of numbers, arrays or symbols."""
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    r0, rows = root(square), []
    for b, bb in baselines:
        c = _excess(u, b, bb)
        r = root(square + c)
        rows.append((r, c / (r + r0)))
    return r0, rows


def _excess(u, b, bb):
    """r_i² − r_0² = b·(2u + b)."""
    along = b[0] * u[0] + b[1] * u[1] + b[2] * u[2]
    return along + along + bb

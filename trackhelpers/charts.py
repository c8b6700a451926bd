"""Charts: where a state is. Two coordinates of a target that stays on a surface, and its position in space.

All charts take coordinates q (2,) of one target or (2, ...) with runs behind, m, and offer ``position(q)`` -> (3, ...), ``jacobian(q)`` -> (3, 2, ...), the
derivative of that position by the coordinates, ``velocity(q, rate)`` and ``to_chart(position)``, the way back. A q where the surface ends is a ValueError for
one target and NaN in an ensemble's run. Latitudes and longitudes are geodetic, on WGS-84, and in rad; ECEF is the earth-centred, earth-fixed frame.
"""

import copy

import numpy as np
import pymap3d

from trackhelpers.arrays import check_array, matvec
from trackhelpers.checks import check_dt, check_number, check_together, check_vector

_WGS84 = pymap3d.Ellipsoid.from_name("wgs84")


def ecef(lat, lon, h=0.0):
    """ECEF position (3, ...), m, of geodetic latitude and longitude, rad, and height, m, which broadcast against each other; ValueError where they don't."""
    lat, lon, h = check_together(lat=lat, lon=lon, h=h)
    return np.stack(np.broadcast_arrays(*pymap3d.geodetic2ecef(*np.broadcast_arrays(lat, lon, h), deg=False)))


def geodetic(position):
    """Geodetic latitude and longitude, rad, and height, m, of an ECEF position (3, ...), m: shape (3, ...)."""
    p = check_array(position, "position", 3)
    return np.stack([np.reshape(row, p.shape[1:]) for row in pymap3d.ecef2geodetic(*p, deg=False)])  # pymap3d drops axes of length one


def next_sign(z, z_rate, dt):
    """Sign of z after `dt` seconds, paper 4, (2): that of z + ż dt.

    A chart keeps its sign until it is given another one. Between the steps of a filter, for one target or for an ensemble's runs alike::

        p, v = chart.position(kf.x[:2]), chart.velocity(kf.x[:2], kf.x[2:])
        chart = chart.with_sign(next_sign(p[2], v[2], dt))
        kf.predict(dt)
        kf.update(z, sensor.at(t).with_chart(chart))

    Parameters
    ----------
    z, z_rate : float or array_like (M,)
        m and m/s; of a run that is NaN the sign is 1.
    dt : float
        s.

    Returns
    -------
    float or numpy.ndarray (M,)
        1 or −1.

    Raises
    ------
    ValueError
        Shapes that do not fit, what is no number, a negative dt.
    """
    z, z_rate = check_together(z=z, z_rate=z_rate)
    return np.where(z + z_rate * check_dt(dt) < 0, -1.0, 1.0)[()]  # (2)


def check_chart(chart, name="chart"):
    """`chart`; ValueError unless it is a `Chart`."""
    if not isinstance(chart, Chart):
        raise ValueError(f"{name}: expected a chart of trackhelpers.charts, got {chart!r}")
    return chart


class Chart:
    """What the charts have in common."""

    def velocity(self, q, rate):
        """Velocity (3, ...) in space, m/s, of coordinates q (2, ...) that change by `rate` (2, ...)."""
        J, rate = self.jacobian(q), check_array(rate, "rate", 2)
        check_together("shapes (2, ...) that broadcast", q=J[0, 0], rate=rate[0])
        return matvec(J, rate)

    def _refuse(self, q, outside, expected):
        """ValueError for one target that is outside."""
        if q.ndim == 1 and np.any(outside):
            raise ValueError(f"q: expected {expected}, got {q}")


class Plane(Chart):
    """The plane z = 0 of a local frame; coordinates (x, y)."""

    def position(self, q):
        q = check_array(q, "q", 2)
        return np.concatenate([q, np.zeros_like(q[:1])])

    def jacobian(self, q):
        q = check_array(q, "q", 2)
        return np.broadcast_to(np.eye(3, 2).reshape(3, 2, *[1] * (q.ndim - 1)), (3, 2, *q.shape[1:])).copy()

    def to_chart(self, position):
        """The first two components: what lies off the plane is projected onto it."""
        return check_array(position, "position", 3)[:2].copy()


class Ellipsoid(Chart):
    """The sea, WGS-84, in ECEF coordinates (x, y): z = ±b √(1 − (x² + y²)/a²), paper 4, (1).

    Near the equator, within about 0.4°, this chart degenerates: dz/dx = −(b²/a²) x/z grows beyond bounds, and there is none for z = 0; `LocalENU` has no
    such place.

    Parameters
    ----------
    sign : 1, -1 or array_like of them, shape (M,)
        The sign of z, for all runs or of each. It is a value of the chart and cannot be set: `with_sign` makes another chart.

    Attributes
    ----------
    a, b : float
        Semi-axes, m.
    sign : numpy.ndarray, shape () or (M,), read only

    Raises
    ------
    ValueError
        A sign that is not ±1, a q outside the disc x² + y² ≤ a² (for the Jacobian: or on its rim).
    """

    a, b = _WGS84.semimajor_axis, _WGS84.semiminor_axis

    def __init__(self, sign=1):
        signs = check_vector(sign, "sign")
        if not np.all(np.abs(signs) == 1):
            raise ValueError(f"sign: expected 1 or -1, or one of them for each run, got {sign!r}")
        self._sign = np.array(signs if np.ndim(sign) else signs[0])
        self._sign.setflags(write=False)

    @property
    def sign(self):
        return self._sign

    def with_sign(self, sign):
        """The same chart with another sign of z."""
        return type(self)(sign)

    def with_symbol(self, sign):
        """The same chart with a symbol for the sign of each run."""
        other = copy.copy(self)
        other._sign = sign
        return other

    def position(self, q):
        q = check_array(q, "q", 2)
        return np.stack([*q, self._z(q)])

    def jacobian(self, q):
        q = check_array(q, "q", 2)
        z = self._z(q)
        self._refuse(q, z == 0, "a point off the equator, where this chart ends")
        slope = -((self.b / self.a) ** 2) * q / np.where(z == 0, np.nan, z)
        J = np.zeros((3, 2, *slope.shape[1:]))
        J[0, 0] = J[1, 1] = 1
        J[2] = slope
        return J

    def to_chart(self, position):
        """The first two components. Which of the two charts has the point is in the sign of the third."""
        return check_array(position, "position", 3)[:2].copy()

    def _z(self, q):
        self._fit(q.shape[1:])
        r = np.hypot(*q)
        self._refuse(q, r > self.a, f"a point of the ellipsoid, x² + y² ≤ ({self.a:.0f} m)²")
        return self._height(r)

    def _fit(self, runs):
        """ValueError where there is a sign for each run, and q (2, *runs) has others."""
        if self._sign.ndim and runs[-1:] != self._sign.shape:
            raise ValueError(f"q: expected {self._sign.shape[0]} runs on the last axis, one a sign, got shape {(2, *runs)}")

    def _height(self, r):
        """z in the distance r from the axis, NaN where there is no sea."""
        return self._sign * (self.b / self.a) * np.sqrt((self.a + r) * np.where(r > self.a, np.nan, self.a - r))


class LocalENU(Chart):
    """The surface of height h over WGS-84 in coordinates (east, north) of the plane that touches it at its origin.

    A target stands vertically over or under its point of that plane. Positions are ECEF.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude of the origin, rad.
    h : float
        Height of the surface, m; 0 is the sea.

    Raises
    ------
    ValueError
        Angles that look like degrees, numbers that are not finite, a q farther away than the surface reaches (some 6400 km).
    """

    def __init__(self, lat, lon, h=0.0):
        self.lat, self.lon, self.h = check_number(lat, "lat"), check_number(lon, "lon"), check_number(h, "h")
        if abs(self.lat) > np.pi / 2 or abs(self.lon) > 2 * np.pi:
            raise ValueError(f"lat, lon: expected radians, |lat| ≤ π/2 and |lon| ≤ 2π, got {self.lat}, {self.lon}")
        self._origin = ecef(self.lat, self.lon, self.h)
        self._axes = np.array(pymap3d.enu2uvw(*np.eye(3), self.lat, self.lon, deg=False))  # columns east, north, up

    def position(self, q):
        return self._surface(q)[0]

    def jacobian(self, q):
        east_north, up = self._axes[:, :2], self._axes[:, 2]
        normal = self._surface(q)[1]
        slope = -np.tensordot(east_north, normal, (0, 0)) / np.tensordot(
            up, normal, (0, 0)
        )  # of the height over the plane: the normal stays normal
        return east_north.reshape(3, 2, *[1] * (slope.ndim - 1)) + up.reshape(3, *[1] * slope.ndim) * slope

    def to_chart(self, position):
        """East and north of an ECEF position (3, ...): what lies off the surface is projected vertically."""
        p = check_array(position, "position", 3)
        return np.tensordot(self._axes[:, :2], p - self._origin.reshape(3, *[1] * (p.ndim - 1)), (0, 0))

    def _near_root(self, q):
        """Of the two points in which q's vertical meets the ellipsoid of the semi-axes a + h and b + h, the one near the plane.

        By rows, of arrays and of symbols alike: the point, a normal there, and what is not positive where there is none. The ellipsoid is the sea for h = 0,
        and within metres of the surface for other heights.
        """
        origin, (east, north, up) = self._origin.tolist(), self._axes.T.tolist()
        p = [o + e * q[0] + n * q[1] for o, e, n in zip(origin, east, north, strict=True)]
        weights = [(axis + self.h) ** -2 for axis in (Ellipsoid.a, Ellipsoid.a, Ellipsoid.b)]
        normal = [row * w for row, w in zip(p, weights, strict=True)]
        A, B, C = dot([u * w for u, w in zip(up, weights, strict=True)], up), dot(normal, up), dot(normal, p) - 1.0
        discriminant = B * B - A * C
        down = C / (B + np.sqrt(np.where(discriminant > 0, discriminant, np.nan)))
        p = [row - down * u for row, u in zip(p, up, strict=True)]
        return p, [row * w for row, w in zip(p, weights, strict=True)], discriminant

    def _surface(self, q):
        """Position, and a normal of the surface there, both (3, ...)."""
        q = check_array(q, "q", 2)
        p, normal, discriminant = self._near_root(q)
        self._refuse(q, discriminant <= 0, "a point that the surface reaches")
        p, up = np.stack(p), self._axes[:, 2].reshape(3, *[1] * (q.ndim - 1))
        if self.h == 0:
            return p, np.stack(normal)
        for _ in range(5):  # Newton: the gradient of the height is the normal
            lat, lon, h = geodetic(p)
            normal = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
            p = p + (self.h - h) / np.sum(normal * up, axis=0) * up
        return p, normal


def dot(a, b):
    """a·b of three rows each, arrays or symbols."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]

"""Paper 4's situation: three satellites, two emitters and a ship, time differences of which some are missing.

Positions are ECEF, m, and times those of the pass, t = 0 … 600 s; the filters run on t = 1, 2, …, 600 s. Orbits are sgp4's, turned into the earth-fixed frame
by skyfield, from what the two packages bring along: nothing is downloaded.
"""

import functools

import numpy as np
from pymap3d.vincenty import vreckon
from scipy.interpolate import make_interp_spline
from sgp4.api import WGS72, Satrec, jday
from skyfield.api import EarthSatellite, load
from skyfield.framelib import itrs

from trackhelpers.arrays import check_array, check_covariance, check_scale
from trackhelpers.charts import Ellipsoid, ecef, geodetic
from trackhelpers.ensemble.montecarlo import standard_normal
from trackhelpers.sensors.tdoa import range_differences

C = 299_792_458.0
SIGMA = C * 80e-9  # m, of a range difference: 80 ns a time difference
TIMES = np.arange(1.0, 601.0)
R_TIME_DIFFERENCE = SIGMA**2 * np.eye(2)
R_TIME_OF_ARRIVAL = SIGMA**2 * np.array([[2.0, 1.0], [1.0, 2.0]])  # 80 ns a time of arrival

AXIS = 7_378_137.0  # m, semi-major axis of the mean orbit, 1000 km over the equator
INCLINATION = np.radians(63.4)
LATITUDE_ARGUMENT, LONGITUDE, MIDDLE = np.radians(28.2), np.radians(137.0), 300.0  # of S0 and of the point under it, at that second
LAYOUTS = {  # where S1 and S2 are from S0: along the track and across it, in units of the formation's size
    "triangle": ((-1.0, 0.0), (-0.5, np.sqrt(3) / 2)),
    "mirrored": ((-0.5, np.sqrt(3) / 2), (-1.0, 0.0)),
    "wide": ((-0.5, np.sqrt(3) / 2), (-0.5, -np.sqrt(3) / 2)),
    "right angle": ((-1.0, 0.0), (0.0, 1.0)),
    "side by side": ((0.0, 1.0), (0.0, -1.0)),
    "string": ((-1.0, 0.0), (-2.0, 0.0)),
}
SCENARIOS = {  # shares of the seconds with a pair, with d1 alone, with d2 alone
    "complete": (1.0, 0.0, 0.0),
    "1": (0.2, 0.4, 0.4),
    "2-b1": (0.2, 0.8, 0.0),
    "2-b2": (0.2, 0.0, 0.8),
    "3-b1": (0.2, 0.5, 0.3),
    "3-b2": (0.2, 0.3, 0.5),
    "bursts": (0.2, 0.4, 0.4),
    "singles": (0.0, 0.5, 0.5),
}
TARGETS = ("T1", "T2", "ship")
SHIP_SPEED, SHIP_AZIMUTH, SHIP_TIME = 15 * 1852 / 3600, np.radians(60.0), 240.0  # m/s, rad, s when it is where T1 is

_BURST = 20  # s
_STEP, _MARGIN, _ORDER = 10.0, 60.0, 7  # s between the orbit's nodes, s beyond the pass, of the spline through them


class Formation:
    """Satellites that fly together.

    Parameters
    ----------
    offsets : sequence of (float, float)
        Where S1, S2, … are from S0, m: ahead along the track, and across it, at t = 300 s.

    Attributes
    ----------
    elements : numpy.ndarray, shape (3, S)
        Inclination, right ascension of the ascending node and argument of latitude of the mean orbits at t = 300 s, rad; the orbits are circles.
    """

    def __init__(self, offsets):
        along, across = np.array([(0.0, 0.0), *offsets]).T / AXIS
        i, u = INCLINATION, LATITUDE_ARGUMENT
        node = -across * np.cos(u) / np.sin(i)
        self.elements = np.stack([i + across * np.sin(u), node, u + along - node * np.cos(i)])
        x, y, _ = _positions(self.elements[:, 0], [MIDDLE])[:, 0]
        self.elements[1] += LONGITUDE - np.arctan2(y, x)
        nodes = np.arange(-_MARGIN, TIMES[-1] + _MARGIN + _STEP, _STEP)
        orbits = np.stack([_positions(elements, nodes) for elements in self.elements.T], axis=1)
        self._position = make_interp_spline(nodes, orbits, _ORDER, axis=-1)
        self._velocity = self._position.derivative()
        self._instant = functools.lru_cache(maxsize=2048)(
            _read_only
        )  # several sensors ask for the same second, and again in the next scenario

    def satellites(self, t):
        """Positions (3, S) at the time t, s, or (3, S, N) at N times. ValueError for a time more than a minute outside the pass."""
        return self._at(self._position, t)

    def satellite_velocities(self, t):
        """Velocities over the Earth, m/s; as `satellites`."""
        return self._at(self._velocity, t)

    def _at(self, spline, t):
        t = np.asarray(t, dtype=float)
        if not t.ndim and abs(t - MIDDLE) <= MIDDLE:
            return self._instant(spline, float(t))
        if not np.all((t >= -_MARGIN) & (t <= TIMES[-1] + _MARGIN)):
            raise ValueError(f"t: expected times of the pass, from {-_MARGIN:.0f} to {TIMES[-1] + _MARGIN:.0f} s, got {t}")
        return spline(t)


@functools.cache
def formation(size=100e3, layout="triangle"):
    """One of the LAYOUTS, of a size in m: by default the paper's three satellites, some 100 km apart."""
    if layout not in LAYOUTS:
        raise ValueError(f"layout: expected one of {tuple(LAYOUTS)}, got {layout!r}")
    return Formation(tuple((size * along, size * across) for along, across in LAYOUTS[layout]))


def satellites(t):
    """Positions of the paper's satellites, as `Formation.satellites`."""
    return formation().satellites(t)


def satellite_velocities(t):
    """Velocities of the paper's satellites, as `Formation.satellite_velocities`."""
    return formation().satellite_velocities(t)


def nadir(position):
    """The point of the sea on the line from `position` (3, ...) to the Earth's centre: (3, ...)."""
    p = check_array(position, "position", 3)
    return p / np.sqrt((p[0] ** 2 + p[1] ** 2) / Ellipsoid.a**2 + p[2] ** 2 / Ellipsoid.b**2)


def track(target, t):
    """Where a target is.

    Parameters
    ----------
    target : str
        "T1" and "T2" stand where the nadir of the paper's S0 is at 240 and 360 s; the "ship" sails at 15 kn on the geodesic that leaves T1 with the azimuth 60° at 240 s.
    t : float or array_like, shape (N,)
        s.

    Returns
    -------
    position, velocity : numpy.ndarray, shape (3,) or (3, N)
        m and m/s over the Earth.
    """
    t = np.asarray(t, dtype=float)
    if target not in TARGETS:
        raise ValueError(f"target: expected one of {TARGETS}, got {target!r}")
    if target == "ship":
        half = 5.0  # s
        ahead, behind = _ship(t + half), _ship(t - half)
        return _ship(t), (ahead - behind) / (2 * half)
    point = nadir(satellites({"T1": 240.0, "T2": 360.0}[target])[:, 0])
    position = np.broadcast_to(point.reshape(3, *[1] * t.ndim), (3, *t.shape)).copy()
    return position, np.zeros_like(position)


def measurements(position, satellites, R, rngs):
    """Range differences with noise, of M runs.

    Parameters
    ----------
    position : array_like, shape (3, N) or (3, N, M)
        Of the emitter at N times, m.
    satellites : array_like, shape (3, S, N)
        At these times.
    R : float or array_like, shape (S − 1, S − 1)
        Standard deviation of all differences, m, or their covariance, m².
    rngs : sequence of numpy.random.Generator, M
        One a run; `availability`, called after it with the same, leaves these numbers as they are.

    Returns
    -------
    numpy.ndarray, shape (S − 1, N, M)
    """
    p = check_array(position, "position", 3)
    s = np.asarray(satellites, dtype=float)
    if s.ndim != 3 or p.ndim not in (2, 3) or s.shape[2] != p.shape[1]:
        raise ValueError(f"satellites: expected shape (3, S, N) for a position of shape (3, N) or (3, N, M), got {s.shape} for {p.shape}")
    m = s.shape[1] - 1
    root = check_scale(R, "R") * np.eye(m) if np.ndim(R) == 0 else np.linalg.cholesky(check_covariance(R, "R", m, definite=True))
    clean = range_differences(p if p.ndim == 3 else p[..., None], s[..., None])
    noise = standard_normal(rngs, (m, s.shape[2]))
    return clean + np.tensordot(root, noise, 1)


def availability(scenario, rngs, N=600):
    """Which differences there are, in exact counts that are permuted in each run.

    Parameters
    ----------
    scenario : str
        One of SCENARIOS: shares of pairs and of single differences of the two baselines. Of "bursts", scenario 1's shares, the single differences come from
        baseline 1 for 20 s, from baseline 2 for 20 s, and so on, and the pairs interrupt both alike.
    rngs : sequence of numpy.random.Generator, M
        One a run.
    N : int
        Number of seconds.

    Returns
    -------
    numpy.ndarray of bool, shape (2, N, M)
    """
    if scenario not in SCENARIOS:
        raise ValueError(f"scenario: expected one of {tuple(SCENARIOS)}, got {scenario!r}")
    pairs, first, _ = SCENARIOS[scenario]
    there = np.ones((2, N, len(rngs)), dtype=bool)
    if scenario == "bursts":
        baseline = np.arange(N) // _BURST % 2
        for run, rng in enumerate(rngs):
            for kept in (0, 1):
                seconds = rng.permutation(np.flatnonzero(baseline == kept))
                there[1 - kept, seconds[round(pairs * len(seconds)) :], run] = False
        return there
    ends = round(pairs * N), round((pairs + first) * N)
    for run, rng in enumerate(rngs):
        seconds = rng.permutation(N)
        there[1, seconds[ends[0] : ends[1]], run] = False
        there[0, seconds[ends[1] :], run] = False
    return there


def _read_only(spline, t):
    values = spline(t)
    values.setflags(write=False)
    return values


def _ship(t):
    """Position (3, ...) of the ship at the time t (...)."""
    lat, lon, _ = np.degrees(geodetic(track("T1", 0.0)[0]))
    way = np.atleast_1d(SHIP_SPEED * (t - SHIP_TIME))
    ahead, behind = (np.array(vreckon(lat, lon, np.abs(way), np.degrees(SHIP_AZIMUTH) + turned)) for turned in (0.0, 180.0))
    return ecef(*np.radians(np.where(way < 0, behind, ahead))).reshape(3, *np.shape(t))


def _positions(elements, t):
    """ECEF positions (3, N), m, at the times t (N,) of the pass, of a circular mean orbit: inclination, node, argument of latitude, rad, at t = 300 s."""
    i, node, u = elements
    orbit, (day, fraction) = Satrec(), jday(2015, 6, 1, 0, 0, MIDDLE)  # the Earth's turn is the only thing that the day decides
    motion = 60 * np.sqrt(398_600.8e9 / AXIS**3)  # rad/min, with WGS-72's constant as sgp4 takes it
    orbit.sgp4init(WGS72, "i", 0, day + fraction - 2_433_281.5, 0.0, 0.0, 0.0, 0.0, 0.0, i, u, motion, node)
    scale = load.timescale(builtin=True)
    times = scale.utc(2015, 6, 1, 0, 0, np.asarray(t, dtype=float))
    return EarthSatellite.from_satrec(orbit, scale).at(times).frame_xyz(itrs).m

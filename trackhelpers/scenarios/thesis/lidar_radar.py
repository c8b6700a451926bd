"""Section 4.2: a lidar and a radar take turns at a target that turns left, then right.

Along a track the samples are the second axis, so that a single run is (n, N) and M runs are (n, N, M).
"""

import numpy as np

from trackhelpers.arrays import check_array
from trackhelpers.ensemble import standard_normal
from trackhelpers.follow import follow
from trackhelpers.motion import CTRV
from trackhelpers.sensors import Lidar, Radar

T = 0.05  # s, one measurement of either sensor
STEPS = 500
SPEED = 5.2  # m/s
TURN_RATE = 0.35  # rad/s, first to the left
SAMPLES_A_TURN = 250
START = (0.6, 0.6)  # m
HEADING = np.pi / 4
SIGMA_A, SIGMA_W = 2.0, 0.3  # m/s², rad/s²: the filter's process noise
COMPONENTS = ("x", "y", "vx", "vy")  # what Tables 7, 8 and 9 print


def truth(steps=STEPS):
    """True state at samples k = 1, …, `steps`, the one that reproduces the truth columns of the thesis's Tables 7 and 8 to every printed digit.

    The heading is turned first, θ_k = θ_{k−1} + ω_k T, and the position moves with the velocity already turned, p_k = p_{k−1} + v_k T.

    Returns
    -------
    numpy.ndarray, shape (5, steps)
        (x, y, v, θ, ω) in m, m/s, rad, rad/s; θ is not wrapped.
    """
    if not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"steps: expected a whole number ≥ 1, got {steps!r}")
    k = np.arange(1, steps + 1)
    rate = np.where(k <= SAMPLES_A_TURN, TURN_RATE, -TURN_RATE)
    heading = HEADING + T * np.cumsum(rate)
    x = START[0] + SPEED * T * np.cumsum(np.cos(heading))
    y = START[1] + SPEED * T * np.cumsum(np.sin(heading))
    return np.stack([x, y, np.full(steps, SPEED), heading, rate])


def velocity(x):
    """Cartesian velocity (2, ...) of a state (x, y, v, θ, …) of shape (n, ...)."""
    return np.stack([x[2] * np.cos(x[3]), x[2] * np.sin(x[3])])


def components(x):
    """The printed components (x, y, v_x, v_y), shape (4, ...), of a state (x, y, v, θ, …) of shape (n, ...)."""
    return np.concatenate([x[:2], velocity(x)])


def sensor_at(k, lidar, radar):
    """The sensor that measures at sample k = 1, 2, …: the lidar at odd samples, the radar at even ones."""
    return lidar if k % 2 else radar


def measurements(rngs, lidar=None, radar=None, track=None):
    """Measurements of the whole track for a set of runs, each component with a noise of its own.

    Parameters
    ----------
    rngs : sequence of numpy.random.Generator
        One a run; each draws its run's noise in one block.
    lidar, radar : trackhelpers.sensors.Sensor
        Default: ``Lidar(0.15)`` and ``Radar((0.3, 0.03, 0.3))``.
    track : numpy.ndarray, shape (5, N), optional
        Default: `truth()`.

    Returns
    -------
    list of numpy.ndarray
        Entry k−1 is the measurement at sample k: shape (2, M) at odd k, (3, M) at even k.
    """
    track = truth() if track is None else track
    return measure(standard_normal(rngs, (track.shape[1], 3)), lidar, radar, track)


def measure(noise, lidar=None, radar=None, track=None):
    """`measurements` with a given noise.

    Parameters
    ----------
    noise : array_like, shape (N, 3, M)
        Noise of each sample in units of the sensor's σ; the lidar takes the first two.
    lidar, radar, track
        As for `measurements`; the track may be longer than the noise.

    Returns
    -------
    list of numpy.ndarray
    """
    lidar = Lidar() if lidar is None else lidar
    radar = Radar() if radar is None else radar
    track = truth() if track is None else track
    noise = np.asarray(noise, dtype=float)
    if noise.ndim != 3 or noise.shape[1] != 3 or len(noise) > track.shape[1]:
        raise ValueError(f"noise: expected shape (N, 3, M) with N ≤ {track.shape[1]} samples, got {noise.shape}")
    zs = []
    for k, sample in enumerate(noise, start=1):
        sensor = sensor_at(k, lidar, radar)
        zs.append(sensor.h(track[:, k - 1])[:, None] + np.asarray(sensor.sigma)[:, None] * sample[: sensor.m])
    return zs


def start(filter, z, model=None, P0=None):
    """A filter at the first lidar point with v = θ = ω = 0 and P0 = I, as the thesis starts it.

    Parameters
    ----------
    filter : callable
        ``filter(model, x0, P0)``, such as `MotionEKF` for one target or `EnsembleEKF` for M runs.
    z : array_like, shape (2,) or (2, M)
        First lidar measurement.
    model : trackhelpers.motion.Model, optional
        Default: ``CTRV(2.0, 0.3)``.
    P0 : array_like, shape (5, 5), optional
        Default: the identity.
    """
    z = check_array(z, "z", 2)
    x0 = np.concatenate([z, np.zeros((3, *z.shape[1:]))])
    return filter(CTRV(SIGMA_A, SIGMA_W) if model is None else model, x0, np.eye(5) if P0 is None else P0)


def steps(kf, zs, lidar=None, radar=None):
    """Feed a filter from `start` the measurements one by one; yield the sample number k after each.

    The first measurement, which gives the start, is used once more, after a prediction over 0 s, as the thesis's program did.

    Parameters
    ----------
    kf : filter for one target or for M runs
    zs : sequence of arrays
        Measurement at k = 1, 2, …: (m,) for one target, (m, M) for runs; None is a missing one.
    lidar, radar : trackhelpers.sensors.Sensor
        Default: ``Lidar(0.15)`` and ``Radar((0.3, 0.03, 0.3))``.
    """
    lidar = Lidar() if lidar is None else lidar
    radar = Radar() if radar is None else radar
    for k, z in enumerate(zs, start=1):
        follow(kf, [z], [sensor_at(k, lidar, radar)], [T if k > 1 else 0.0], keep=())
        yield k


def estimates(kf, zs, lidar=None, radar=None):
    """State after every measurement, shape (5, N) for one target or (5, N, M) for runs; arguments as for `steps`."""
    return np.stack([kf.x for _ in steps(kf, zs, lidar, radar)], axis=1)


def errors(x, track=None):
    """Estimate minus truth in x, y, v_x, v_y: shape (4, N) or (4, N, M) for estimates (5, N) or (5, N, M)."""
    track = truth() if track is None else track
    true = components(track)[:, : x.shape[1]]
    return components(x) - (true if x.ndim == 2 else true[..., None])

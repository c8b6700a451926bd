"""Section 4.2: a lidar and a radar take turns at a target that turns left, then right."""

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.ensemble import standard_normal
from trackhelpers.sensors import Lidar, Radar

T = 0.05  # s, one measurement of either sensor
STEPS = 500
SPEED = 5.2  # m/s
TURN_RATE = 0.35  # rad/s, first to the left
SAMPLES_A_TURN = 250
START = (0.6, 0.6)  # m
HEADING = np.pi / 4


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


def sensor_at(k, lidar, radar):
    """The sensor that measures at sample k = 1, 2, …: the lidar at odd samples, the radar at even ones."""
    return lidar if k % 2 else radar


def measurements(rngs, lidar=None, radar=None, track=None, noise_scale=1.0):
    """Measurements of the whole track for a set of runs.

    Parameters
    ----------
    rngs : sequence of numpy.random.Generator
        One a run; each draws its run's noise in one block.
    lidar, radar : trackhelpers.sensors.Sensor
        Default: ``Lidar(0.15)`` and ``Radar((0.3, 0.03, 0.3))``.
    track : numpy.ndarray, shape (5, N), optional
        Default: `truth()`.
    noise_scale : float
        Factor on the noise that is drawn, the sensors' R unchanged.

    Returns
    -------
    list of numpy.ndarray
        Entry k−1 is the measurement at sample k: shape (2, M) at odd k, (3, M) at even k.
    """
    lidar = Lidar() if lidar is None else lidar
    radar = Radar() if radar is None else radar
    track = truth() if track is None else track
    scale = check_scale(noise_scale, "noise_scale")
    noise = scale * standard_normal(rngs, (track.shape[1], 3))
    zs = []
    for k in range(1, track.shape[1] + 1):
        sensor = sensor_at(k, lidar, radar)
        z = sensor.h(track[:, k - 1])[:, None] + np.asarray(sensor.sigma)[:, None] * noise[k - 1, : sensor.m]
        zs.append(z)
    return zs

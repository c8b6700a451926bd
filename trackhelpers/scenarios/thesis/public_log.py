"""Section 4.2's Table 5: filter states that the thesis printed without their source, found again on a public lidar/radar log.

The log is a table as `trackhelpers.datasets.lidar_radar_log` returns it; the sensors, the models and the filters are the project's own.
"""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import mahalanobis
from trackhelpers.filters import MotionEKF
from trackhelpers.motion import CTRV
from trackhelpers.scenarios.thesis.lidar_radar import SIGMA_A, SIGMA_W, components
from trackhelpers.sensors import Lidar, Radar

ROWS = slice(18, 27)  # of the 500 samples, those that Table 5 prints: t = 0.90 … 1.30 s


class Track(NamedTuple):
    """What a filter made of the log; N samples on the last axis."""

    x: np.ndarray  # (n, N) estimate after each sample
    P: np.ndarray  # (n, n, N) its covariance
    y: np.ndarray  # (3, N) innovation, NaN where there is none
    nis: np.ndarray  # (N,) normalised innovation squared, NaN where nothing was measured


def truth(log):
    """The log's own truth as CTRV states.

    Returns
    -------
    numpy.ndarray, shape (5, N)
        (x, y, v, θ, ω) in m, m/s, rad, rad/s, with v = √(vx² + vy²); θ runs on beyond π as it does in the log.
    """
    return np.stack([log.x, log.y, np.hypot(log.vx, log.vy), log.yaw, log.yaw_rate])


def velocity_errors(log, x):
    """Errors (4, N) of x, y, v_x, v_y of the estimates `x` (5, N), in m and m/s: the components whose RMSE the log's course asks for."""
    return components(np.asarray(x)) - log[["x", "y", "vx", "vy"]].to_numpy().T


def track(log, model=None, filter=MotionEKF, lidar=None, radar=None, use=None, first_again=True):
    """Filter the log from the thesis's start: the first lidar point with v = θ = ω = 0, and P0 = I.

    Parameters
    ----------
    log : pandas.DataFrame
        As `trackhelpers.datasets.lidar_radar_log` returns it, or its first rows.
    model : trackhelpers.motion.Model, optional
        Default: ``CTRV(2.0, 0.3)``.
    filter : callable
        ``filter(model, x0, P0)`` gives the filter.
    lidar, radar : trackhelpers.sensors.Sensor, optional
        Default: ``Lidar(0.15)`` and ``Radar((0.3, 0.03, 0.3))``.
    use : array_like of bool, shape (N,), optional
        Which measurements arrive; the others are missing, and the prediction stands in their place.
    first_again : bool
        Whether the first measurement, which gives the start, is also used as a measurement, after a prediction over 0 s.

    Returns
    -------
    Track

    Raises
    ------
    ValueError
        For a log that does not begin with a lidar point, or a `use` of another shape.
    """
    use = np.ones(len(log), dtype=bool) if use is None else np.asarray(use)
    if use.shape != (len(log),) or use.dtype != bool:
        raise ValueError(f"use: expected {len(log)} truth values, one a sample, got shape {use.shape} and dtype {use.dtype}")
    if len(log) == 0 or log.sensor.iloc[0] != "L":
        raise ValueError(f"log: expected one that begins with a lidar point, got {'no row' if len(log) == 0 else log.sensor.iloc[0]!r}")
    sensors = {"L": Lidar() if lidar is None else lidar, "R": Radar() if radar is None else radar}
    zs = log[["z1", "z2", "z3"]].to_numpy()
    kf = filter(CTRV(SIGMA_A, SIGMA_W) if model is None else model, [*zs[0, :2], 0, 0, 0], np.eye(5))
    result = Track(np.empty((5, len(log))), np.empty((5, 5, len(log))), np.full((3, len(log)), np.nan), np.full(len(log), np.nan))
    steps = np.diff(log.t, prepend=log.t.iloc[0])
    for k, (name, dt) in enumerate(zip(log.sensor, steps, strict=True)):
        if k > 0 or first_again:
            kf.predict(dt)
            sensor = sensors[name]
            kf.update(zs[k, : sensor.m] if use[k] else None, sensor)
            if use[k]:
                result.y[: sensor.m, k], result.nis[k] = kf.y, mahalanobis(kf.y, kf.S)
        result.x[:, k], result.P[:, :, k] = kf.x, kf.P
    return result

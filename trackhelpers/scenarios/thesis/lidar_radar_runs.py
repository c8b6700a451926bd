"""Section 4.2 over many runs: where a printed Table 9 lies among them, how consistent a filter is, and which runs are lost."""

import numpy as np
from scipy import stats

from trackhelpers.angles import wrap
from trackhelpers.consistency import cramer_rao, nees, nis
from trackhelpers.ensemble import EnsembleEKF, monte_carlo
from trackhelpers.motion import CTRV
from trackhelpers.published import published
from trackhelpers.scenarios.thesis.lidar_radar import (
    COMPONENTS,
    FIGURES,
    SAMPLES_A_TURN,
    STEPS,
    T,
    errors,
    estimates,
    measurements,
    sensor_at,
    start,
    steps,
    table_9,
    truth,
    velocity,
)
from trackhelpers.sensors import Lidar, Radar

LOST = 5.0  # m: a run that is farther from the truth than this at any of the last samples is lost
LAST = 100  # samples
SECOND = 20  # samples in the first second, the filter's transient
EXACT = ("vx max", "vy max")  # cells of Table 9 that do not depend on the noise
FEATURES = ("first speed", "sign changes", "position", "velocity", "resultant", "along")


def cell_names():
    """Names of Table 9's 16 cells, ``"x RMSE"`` first, row by row."""
    return [f"{component} {figure}" for component in COMPONENTS for figure in FIGURES]


def printed_cells():
    """The 16 printed numbers of Table 9, in the order of `cell_names`."""
    return published("thesis", 9, numeric=True).loc[list(COMPONENTS), list(FIGURES)].to_numpy().ravel()


def simulate_table_9(runs, seed, measure=measurements, filter=EnsembleEKF, **settings):
    """Table 9 of `runs` runs, shape (16, runs), cells in the order of `cell_names`.

    Parameters
    ----------
    runs, seed : int
        As for `trackhelpers.ensemble.monte_carlo`.
    measure : callable
        ``measure(rngs)`` gives the measurements of the runs.
    filter, **settings
        The filter and any of ``model``, ``P0``, ``lidar``, ``radar``, ``reuse_first``.
    """
    begin = {name: settings.pop(name) for name in ("model", "P0") if name in settings}

    def task(rngs):
        zs = measure(rngs)
        error = errors(estimates(start(filter, zs[0], **begin), zs, **settings))
        return {"cells": table_9(error).reshape(16, -1)}

    return monte_carlo(task, runs, seed, reduce={"cells": "concat"})["cells"]


def percentiles(cells, printed):
    """Percentile of each printed number among the runs, ties halved: shape (c,) for cells (c, M) and printed (c,)."""
    printed = np.asarray(printed, dtype=float)[:, None]
    return 50 * (np.mean(cells < printed, axis=1) + np.mean(cells <= printed, axis=1))


def joint_share(cells, printed):
    """Share of the runs that lie farther out than the printed numbers, all cells taken together.

    The distance is Mahalanobis's of the ranks, turned into normal scores: it minds the correlation between the cells of a run, and asks of each cell no
    more than its order.

    Parameters
    ----------
    cells : numpy.ndarray, shape (c, M)
    printed : array_like, shape (c,)

    Returns
    -------
    float
    """
    together = np.column_stack([cells, printed])
    scores = stats.norm.ppf((stats.rankdata(together, axis=1) - 0.5) / together.shape[1])
    distance = np.einsum("im,im->m", scores, np.linalg.solve(np.cov(scores[:, :-1]), scores))
    return float(np.mean(distance[:-1] > distance[-1]))


def judge(cells):
    """What a simulated Table 9 (16, M) says of the printed one.

    Returns
    -------
    dict
        ``"x RMSE"``, ``"y RMSE"``, ``"vx RMSE"``, ``"vy RMSE"`` (percentiles of the printed numbers), ``"cells inside"`` (of the 14 that depend on the noise,
        those in the central 95 %), ``"runs farther out"`` (`joint_share` of the 14), ``"both maxima"`` (share of runs that have the two exact cells).
    """
    names, printed = cell_names(), printed_cells()
    random = [i for i, name in enumerate(names) if name not in EXACT]
    exact = [names.index(name) for name in EXACT]
    percentile = percentiles(cells, printed)
    return {f"{component} RMSE": percentile[names.index(f"{component} RMSE")] for component in COMPONENTS} | {
        "cells inside": int(np.sum((percentile[random] >= 2.5) & (percentile[random] <= 97.5))),
        "runs farther out": joint_share(cells[random], printed[random]),
        "both maxima": float(np.mean(np.all(hit(cells[exact], printed[exact]), axis=0))),
    }


def hit(cells, printed):
    """Where cells (c, M) agree with printed numbers (c,) of six decimals to every digit."""
    return np.abs(cells - np.asarray(printed)[:, None]) <= 0.5e-6 * (1 + 1e-9)


def simulate_consistency(runs, seed, filter=EnsembleEKF, measure=measurements, **settings):
    """NEES and NIS averaged over the runs, at every sample.

    Parameters
    ----------
    As for `simulate_table_9`.

    Returns
    -------
    dict
        ``"nees"`` (N,), of the state, 5 expected; ``"nis"`` (N,), 2 expected at odd samples (lidar) and 3 at even ones (radar); ``"square"`` (4, N), the
        mean squared errors of x, y, v_x, v_y, from which an RMSE over the runs follows.
    """
    begin = {name: settings.pop(name) for name in ("model", "P0") if name in settings}
    track = truth()

    def task(rngs):
        zs = measure(rngs)
        kf = start(filter, zs[0], **begin)
        sums = {"nees": np.zeros(STEPS), "nis": np.zeros(STEPS), "square": np.zeros((4, STEPS))}
        for k in steps(kf, zs, **settings):
            sums["nees"][k - 1] = np.sum(nees(track[:, k - 1], kf.x, kf.P, kf.model.angles))
            sums["nis"][k - 1] = np.sum(nis(kf.y, kf.S)) if kf.y.size else np.nan
            error = errors(kf.x[:, None], track[:, k - 1, None])[:, 0]
            sums["square"][:, k - 1] = np.sum(error**2, axis=1)
        return sums

    return {name: total / runs for name, total in monte_carlo(task, runs, seed).items()}


def follow_with(radar, runs, seed, measure=measurements, filter=EnsembleEKF):
    """How an EKF does that has a wrong idea of the radar.

    Parameters
    ----------
    radar : trackhelpers.sensors.Sensor
        The filter's radar.
    runs, seed, measure, filter
        As for `simulate_table_9`.

    Returns
    -------
    lost : numpy.ndarray, shape (runs,)
        True for a run that is not finite at the end, or farther than `LOST` from the truth at any of the last `LAST` samples.
    rmse : numpy.ndarray, shape (runs,)
        Root mean square distance from the truth after the first second, m; not finite in a run that broke down.
    """

    def task(rngs):
        zs = measure(rngs)
        kf = start(filter, zs[0])
        x = estimates(kf, zs, radar=radar)
        with np.errstate(over="ignore", invalid="ignore"):  # what a lost run does
            distance = np.hypot(*errors(x)[:2])
            near = np.all(distance[-LAST:] <= LOST, axis=0)
            return {"lost": kf.failed | ~near, "rmse": np.sqrt(np.mean(distance[SECOND:] ** 2, axis=0))}

    result = monte_carlo(task, runs, seed, reduce={"lost": "concat", "rmse": "concat"})
    return result["lost"], result["rmse"]


def features(x, zs):
    """What the thesis says in words of its Figure 6, as one number a run.

    Parameters
    ----------
    x : numpy.ndarray, shape (5, N, M)
        Estimates.
    zs : sequence of arrays
        Measurements that led to them.

    Returns
    -------
    dict of str -> numpy.ndarray, shape (M,)
        ``"first speed"`` (m/s), the estimated speed after the first measurement. The others leave out the first second: ``"sign changes"`` of the errors of v_x and
        v_y, the mean of the two; ``"position"`` and ``"velocity"``, RMSE as a fraction of that of lidar points and of differences of neighbouring lidar points;
        ``"resultant"``, RMSE of the speed as a fraction of that of the components; ``"along"``, mean square change of the velocity along the heading as a
        multiple of that across it, the turn by ωT taken off.
    """
    track = truth()
    error = errors(x, track)[:, SECOND:]
    points = np.stack(zs[::2], axis=1)
    point_error = (points - track[:2, ::2, None])[:, SECOND // 2 :]
    difference_error = (np.diff(points, axis=1) / (2 * T) - velocity(track)[:, 2::2, None])[:, SECOND // 2 :]
    along = np.diff(x[2], axis=0)
    across = x[2, :-1] * (wrap(np.diff(x[3], axis=0)) - x[4, :-1] * T)
    return {
        "first speed": np.abs(x[2, 0]),
        "sign changes": np.mean(np.sum(np.diff(np.sign(error[2:]), axis=1) != 0, axis=1), axis=0),
        "position": _rms(error[:2]) / _rms(point_error),
        "velocity": _rms(error[2:]) / _rms(difference_error),
        "resultant": _rms((x[2] - track[2, :, None])[None, SECOND:]) / _rms(error[2:]),
        "along": _rms(along[None, SECOND:]) ** 2 / _rms(across[None, SECOND:]) ** 2,
    }


def _rms(values):
    """Root mean square over all axes but the runs'."""
    return np.sqrt(np.mean(values**2, axis=(0, 1)))


def lower_bound():
    """Cramér–Rao bound on the state's covariance, shape (N, 5, 5), for somebody who knows more than the filter.

    He knows that speed and turn rate are constant, but for one jump of the turn rate by about 1 rad/s at a known sample; he knows nothing of the start
    (10 m/s, 1 rad/s and any heading).
    """
    track, model, lidar, radar = truth(), CTRV(), Lidar(), Radar()
    sensors = [sensor_at(k, lidar, radar) for k in range(1, STEPS + 1)]
    Fs = [np.eye(5), *(model.F(x, T) for x in track.T[:-1])]
    Qs = [np.diag([0, 0, 0, 0, float(k == SAMPLES_A_TURN + 1)]) for k in range(1, STEPS + 1)]
    Hs, Rs = [sensor.H(x) for sensor, x in zip(sensors, track.T, strict=True)], [sensor.R for sensor in sensors]
    return cramer_rao(Fs, Qs, Hs, Rs, np.diag([1e4, 1e4, 1e2, 10.0, 1.0]))

"""Section 4.2 over many runs: where a printed Table 9 lies among them, how consistent a filter is, and which runs are lost."""

import numpy as np
from scipy import stats

from trackhelpers.consistency import nees, nis
from trackhelpers.ensemble import EnsembleEKF, monte_carlo
from trackhelpers.published import published
from trackhelpers.scenarios.thesis.lidar_radar import (
    COMPONENTS,
    FIGURES,
    STEPS,
    errors,
    estimates,
    measurements,
    start,
    steps,
    table_9,
    truth,
)

LOST = 5.0  # m: a run that is farther from the truth than this at any of the last samples is lost
LAST = 100  # samples
EXACT = ("vx max", "vy max")  # cells of Table 9 that do not depend on the noise


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


def lost_runs(runs, seed, radar, measure=measurements, filter=EnsembleEKF):
    """Which runs are lost, (runs,) bool: not finite, or farther than 5 m from the truth at any of the last hundred samples.

    Parameters
    ----------
    radar : trackhelpers.sensors.Sensor
        The filter's idea of the radar.
    runs, seed, measure, filter
        As for `simulate_table_9`.
    """

    def task(rngs):
        zs = measure(rngs)
        kf = start(filter, zs[0])
        error = errors(estimates(kf, zs, radar=radar))
        with np.errstate(over="ignore", invalid="ignore"):
            near = np.all(np.hypot(error[0, -LAST:], error[1, -LAST:]) <= LOST, axis=0)
        return {"lost": kf.failed | ~near}

    return monte_carlo(task, runs, seed, reduce={"lost": "concat"})["lost"]

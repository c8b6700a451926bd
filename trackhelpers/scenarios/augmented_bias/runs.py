"""All filters on the same runs of Table 1's target, and the scores by which paper 3's claims are judged."""

from typing import NamedTuple

import numpy as np

from trackhelpers.ensemble import monte_carlo
from trackhelpers.intervals import mean_interval, ratio_interval
from trackhelpers.scenarios.augmented_bias.target import COMPONENTS, SEGMENTS, STEPS, simulate, truth

PARTS = ("settled", "transient", "samples")
KEYS = ("mean", "square", "by_run", "mean_by_run", "nees", "nis")


class Score(NamedTuple):
    """Errors (estimate − truth) of one filter over M runs; samples k = 0 … 1300 on the time axis."""

    mean: np.ndarray  # (4, 1301) mean over the runs
    square: np.ndarray  # (4, 1301) mean square
    by_run: np.ndarray  # (7, 3, 4, M) mean square of each run, by segment and `PARTS`
    mean_by_run: np.ndarray  # (7, 3, 4, M) the mean of each run
    nees: np.ndarray  # (1301,) mean NEES of position and velocity, NaN at k = 0 and for a covariance that means nothing
    nis: np.ndarray  # (1301,) mean NIS, NaN at k = 0
    runs: int

    def rmse(self, window):
        """Root mean square error over a slice of samples and all runs, (4,)."""
        return np.sqrt(self.square[:, window].mean(axis=1))

    def bias(self, window):
        """Root mean square over a slice of samples of the error's mean over the runs, with the mean's own variance taken off, (4,)."""
        variance = (self.square - self.mean**2) / (self.runs - 1)
        return np.sqrt(np.maximum(0.0, (self.mean**2 - variance)[:, window].mean(axis=1)))

    def part(self, segment, part="settled"):
        """Mean square errors of each run, (4, M), over a part of the segment with this index."""
        return self.by_run[segment, PARTS.index(part)]

    def steady_bias(self, segment, component):
        """Mean over runs and settled samples of one component's error in the segment with this index, with its 95 % interval: (mean, low, high).

        It is the bias where that does not change with time, as under a constant acceleration.
        """
        return mean_interval(self.mean_by_run[segment, PARTS.index("settled"), COMPONENTS.index(component)])


def score(contenders, runs=500, seed=2018, a=2.0, path=0, n_jobs=1, consistency=True, last=STEPS):
    """Run all contenders on the same runs.

    Parameters
    ----------
    contenders : sequence of `trackhelpers.scenarios.augmented_bias.contenders` objects
        With names that differ.
    runs, seed, n_jobs
        As for `trackhelpers.ensemble.monte_carlo`.
    a, path
        As for `trackhelpers.scenarios.augmented_bias.target.truth`.
    consistency : bool
        False leaves NEES and NIS out (NaN), half of the time.
    last : int
        The last sample that is asked for: filters stop there, on the same noise, and what comes later is NaN.

    Returns
    -------
    dict
        Name -> `Score`.
    """
    names = [contender.name for contender in contenders]
    if len(set(names)) != len(names):
        raise ValueError(f"contenders: expected names that differ, got {names}")
    track = truth(a, path)

    def task(rngs):
        x0, z = simulate(rngs, track)
        z = z[:, :last]
        return {f"{c.name}|{key}": value for c in contenders for key, value in _errors(c, x0, z, track, consistency).items()}

    reduce = {f"{name}|{key}": "concat" for name in names for key in ("by_run", "mean_by_run")}
    found = monte_carlo(task, runs, seed, n_jobs, reduce=reduce, chunk=500)
    return {name: Score(**{key: found[f"{name}|{key}"] / (1 if "by_run" in key else runs) for key in KEYS}, runs=runs) for name in names}


def _errors(contender, x0, z, track, consistency):
    """Sums over the runs of one contender's errors, and its means run by run, by the names of `Score`."""
    normalised, innovations = np.full(STEPS + 1, np.nan), np.full(STEPS + 1, np.nan)
    if consistency:
        estimates, of_errors, of_innovations = contender.judged(x0, z, track[:, 1 : z.shape[1] + 1])
        innovations[1 : z.shape[1] + 1] = of_innovations.sum(axis=1)
        if of_errors is not None:
            normalised[1 : z.shape[1] + 1] = of_errors.sum(axis=1)
    else:
        estimates = contender.estimates(x0, z)
    errors = np.full((*track.shape, z.shape[2]), np.nan)
    errors[:, 0], errors[:, 1 : z.shape[1] + 1] = x0, estimates
    errors -= track[..., None]
    square = errors**2
    windows = [[getattr(segment, part) for part in PARTS] for segment in SEGMENTS]
    by_run, mean_by_run = (np.array([[a[:, w].mean(axis=1) for w in parts] for parts in windows]) for a in (square, errors))
    values = errors.sum(axis=2), square.sum(axis=2), by_run, mean_by_run, normalised, innovations
    return dict(zip(KEYS, values, strict=True))


def compared(numerator, denominator, segment, components, part="settled", against=None):
    """Ratio of two root mean square errors over the same runs, with its 95 % interval: (ratio, low, high).

    Parameters
    ----------
    numerator, denominator : Score
    segment : int
        Index into `SEGMENTS`.
    components : sequence of str
        Whose squares are summed: ``["x", "y"]`` is the distance.
    part : str
        One of `PARTS`.
    against : int, optional
        Segment of the denominator, where it is another one.
    """
    chosen = [COMPONENTS.index(name) for name in components]
    places = (numerator, segment), (denominator, segment if against is None else against)
    sums = [score.part(where, part)[chosen].sum(axis=0) for score, where in places]
    return tuple(float(np.sqrt(value)) for value in ratio_interval(*sums))


def settling_time(bias, limit, change, end):
    """Samples after `change` until |bias| stays at or below `limit` up to `end`.

    Parameters
    ----------
    bias : array_like, shape (N,)
        Mean error of one component.
    limit : float
        Bound, in the unit of the error.
    change, end : int
        First sample of the segment, and last.

    Returns
    -------
    int
        0 if it never leaves the bound; end − change + 1 if it does not settle.
    """
    outside = np.flatnonzero(np.abs(np.asarray(bias)[change : end + 1]) > limit)
    return int(outside[-1]) + 1 if len(outside) else 0

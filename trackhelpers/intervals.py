"""Averages over runs, and how far they can be trusted."""

from typing import NamedTuple

import numpy as np
from scipy import stats

from trackhelpers.checks import check_numbers, check_probability
from trackhelpers.tables import number


class Interval(NamedTuple):
    """An average over runs and the interval of it; prints as ``0.203 [0.198, 0.208]``."""

    value: float
    low: float
    high: float

    def __str__(self):
        return f"{number(self.value)} [{number(self.low)}, {number(self.high)}]"


def mean_interval(samples, level=0.95):
    """Mean of one value a run, samples (M,), with its interval for many runs (normal distribution of the mean); returns `Interval`.

    Truth values count as 1 and 0, so that the mean is a share. ValueError for fewer than two samples, what is no finite number, and a level that is no probability (0.95, not 95).
    """
    samples, level = _samples(samples, "samples"), check_probability(level, "level")
    half = stats.norm.ppf(0.5 + level / 2) * samples.std(ddof=1) / np.sqrt(samples.size)
    mean = samples.mean()
    return Interval(float(mean), float(mean - half), float(mean + half))


def ratio_interval(numerator, denominator, level=0.95):
    """Ratio of two means over the same M runs, both (M,) and paired, with its interval by the delta method; returns `Interval`.

    ValueError as for `mean_interval`, for another number of runs, and a denominator whose mean is 0.
    """
    numerator, denominator = _samples(numerator, "numerator"), _samples(denominator, "denominator")
    if numerator.shape != denominator.shape:
        raise ValueError(f"denominator: expected the {numerator.size} runs of the numerator, got {denominator.size}")
    if denominator.mean() == 0:
        raise ValueError("denominator: expected a mean that is not 0, got 0")
    ratio = numerator.mean() / denominator.mean()
    _, low, high = mean_interval((numerator - ratio * denominator) / denominator.mean(), level)
    return Interval(float(ratio), float(ratio + low), float(ratio + high))


def _samples(values, name):
    if isinstance(values, np.ndarray) and values.dtype == bool:  # whether something happened, of which the mean is the share
        values = values.astype(float)
    values = check_numbers(values, name, "two or more finite numbers, one a run")
    if values.ndim != 1 or values.size < 2 or not np.all(np.isfinite(values)):
        raise ValueError(f"{name}: expected two or more finite numbers, one a run, got shape {values.shape}")
    return values

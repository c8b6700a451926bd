"""The manoeuvre on which paper 3's introduction is tried: rest, constant acceleration in x, rest, a minute each, T = 1 s.

Samples are k = 0 … 180, measured from 1 on; the acceleration is held from sample 60 to 120, so 61 is the first sample that it moves and 121 the first after it.
"""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.scenarios.augmented_bias.target import simulate

STEPS, BEGIN, END = 180, 60, 120
PARTS = {  # slices of the samples
    "rest": slice(21, 61),
    "onset": slice(61, 81),
    "manoeuvre": slice(81, 121),
    "end": slice(121, 141),
    "after": slice(141, 181),
    "accelerated": slice(61, 121),  # onset and manoeuvre
}


class Runs(NamedTuple):
    """M runs: truth (4, N + 1, M), or (4, N + 1, 1) where all have the same; starts (4, M); measured positions (2, N, M) at samples 1 … N."""

    track: np.ndarray
    start: np.ndarray
    z: np.ndarray


def accelerations(a=2.0):
    """(2, 180), m/s²: a in x from sample 60 to 120, nothing else; ValueError unless a ≥ 0 is finite."""
    both = np.zeros((2, STEPS))
    both[0, BEGIN:END] = check_scale(a, "a")
    return both


def draw(track, runs=500, seed=2018):
    """`Runs` on one track (4, N + 1). Equal seeds give equal noise on every track of the same length, so that runs are paired."""
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]
    return Runs(track[..., None], *simulate(rngs, track))

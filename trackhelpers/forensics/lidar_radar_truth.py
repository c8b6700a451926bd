"""Which motion is behind the truth columns of Tables 7 and 8? Candidates, and a count of the printed cells that each meets."""

from functools import cache

import numpy as np
import pandas as pd

from trackhelpers.arrays import check_array
from trackhelpers.published import last_digit, published
from trackhelpers.scenarios.thesis.lidar_radar import HEADING, SPEED, START, TURN_RATE, T

SCHEMES = ("turned velocity", "old velocity", "exact arc")
SAMPLES = 20  # more than the tables can reach


def printed_truth():
    """The truth columns of Tables 7 and 8: the printed strings, a DataFrame of six rows with the columns x, y, vx, vy."""
    return _columns("true")


def printed_estimates():
    """The filter columns of Tables 7 and 8: the printed strings, a DataFrame of six rows with the columns x, y, vx, vy."""
    return _columns("filtered")


def _columns(kind):
    tables = pd.concat([published("thesis", 7), published("thesis", 8)], axis=1)
    return pd.DataFrame({name: tables[f"{name}_{kind}"] for name in ("x", "y", "vx", "vy")})


def half_units(printed):
    """Half a unit of the last printed digit of every cell of a frame of strings, shape (rows, columns)."""
    return np.array([[last_digit(cell) for cell in row] for row in printed.to_numpy()])


@cache
def _truth_cells():
    printed = printed_truth()
    return printed.to_numpy(dtype=float), half_units(printed)


def candidate(scheme="turned velocity", speed=SPEED, heading=HEADING, start=START, samples=SAMPLES):
    """Positions and velocities of a left turn at samples k = 1, …, `samples`.

    Parameters
    ----------
    scheme : {"turned velocity", "old velocity", "exact arc"}
        How the position is carried on: with the velocity after the turn of the step (semi-implicit Euler), with the one before it (explicit Euler), or along
        the arc.
    speed : float
        m/s.
    heading : float
        At k = 0, rad.
    start : tuple of two floats
        Position at k = 0, m.

    Returns
    -------
    numpy.ndarray, shape (4, samples)
        (x, y, v_x, v_y).
    """
    if scheme not in SCHEMES:
        raise ValueError(f"scheme: expected one of {SCHEMES}, got {scheme!r}")
    start = check_array(start, "start", 2, ())
    turned = heading + TURN_RATE * T * np.arange(samples + 1)
    directions = {"turned velocity": turned[1:], "old velocity": turned[:-1], "exact arc": (turned[1:] + turned[:-1]) / 2}
    chord = np.sinc(TURN_RATE * T / (2 * np.pi)) if scheme == "exact arc" else 1.0
    moves = speed * T * chord * np.exp(1j * directions[scheme])
    p = complex(*start) + np.cumsum(moves)
    v = speed * np.exp(1j * turned[1:])
    return np.stack([p.real, p.imag, v.real, v.imag])


def matched_cells(track, first=None):
    """How many of the 24 printed truth cells a track meets to half a unit of the last digit.

    Parameters
    ----------
    track : numpy.ndarray, shape (4, N)
        As of `candidate`.
    first : int, optional
        Sample of the first printed row; without it the best one is taken.

    Returns
    -------
    cells, first : int
    """
    value, half = _truth_cells()
    rows = len(value)
    firsts = range(1, track.shape[1] - rows + 2) if first is None else [first]
    # the last factor lets a number that rounds to the printed one by a binary hair's breadth pass
    counts = {k: int(np.sum(np.abs(track[:, k - 1 : k - 1 + rows].T - value) <= half * (1 + 1e-9))) for k in firsts}
    best = max(counts, key=counts.get)
    return counts[best], best


def matching_range(name, values, **others):
    """Smallest and largest of `values` for the parameter `name` of `candidate` at which all 24 cells are met from k = 3 on."""
    good = [value for value in values if matched_cells(candidate(**others, **{name: value}), 3)[0] == 24]
    if not good:
        raise ValueError(f"values: expected some at which all cells are met, got none between {min(values)} and {max(values)}")
    return min(good), max(good)

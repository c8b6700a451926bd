"""Notebook 3: who takes part, what Table 1 and the claims come to as numbers, and the curves that compare families of filters."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd

from trackhelpers.scenarios.augmented_bias import contenders as c
from trackhelpers.scenarios.augmented_bias.runs import compared, score, settling_time
from trackhelpers.scenarios.augmented_bias.target import COMPONENTS, SEGMENTS, STEPS, simulate, truth

PAPERS = ("SKF", "STKF β=4, one", "ABMA 0.01, 0.01")  # the paper's three, in its Figures 1 to 4
FIGURES = {"x": "Figure 1", "y": "Figure 2", "vx": "Figure 3", "vy": "Figure 4"}
AXIS = {"x": (0, 1), "y": (2, 3)}


def cast():
    """All contenders of the comparison, the paper's three first."""
    return [
        c.plain(),
        c.strong_tracking(4.0),
        c.augmented(),
        c.strong_tracking(1.0),
        c.strong_tracking(4.0, "per axis"),
        c.strong_tracking(1.0, "per axis"),
        *(c.augmented(name) for name in list(c.BIAS_NOISE)[1:]),
        c.accelerating(),
        c.accelerating(c.CORRELATED, "Singer"),
        c.interacting(),
        c.variable_dimension(),
        c.input_estimation(window=5),  # window and inflation: the best of section 7 in the first 40 s of a manoeuvre
        c.variance_inflation(inflation=1000.0),
    ]


def one_run(contenders, seed=2018, a=2.0, path=0):
    """Errors (4, 1301) of each contender in one run: name -> array."""
    track = truth(a, path)
    x0, z = simulate([np.random.default_rng(seed)], track)
    first = x0 - track[:, :1]
    return {
        each.name: np.hstack([first, *(x - track[:, k, None] for k, (x, _) in enumerate(each.follow(x0, z), 1))]) for each in contenders
    }


def kinds_of_motion(track):
    """Table 1's words as numbers on a track (4, 1301): (segment, axis, quantity, rule, value), one for each of its 14 cells.

    The acceleration of an axis is the velocity's difference from sample to sample, m/s².
    """
    rows = []
    for segment in SEGMENTS:
        for axis, (_, v) in AXIS.items():
            speed = track[v, segment.first - 1 : segment.last + 1]
            steps, words = np.diff(speed), getattr(segment, axis)
            if words == "uniform":
                cell = "largest acceleration (m/s²)", "<= 1e-9", np.abs(steps).max()
            elif words == "accelerated":
                cell = "least acceleration (m/s²)", "> 0", steps.min()
            elif words == "decelerated":
                cell = "largest acceleration (m/s²)", "< 0", steps.max()
            elif words.startswith("exponentially"):
                cell = "mean acceleration (m/s²)", "> 0" if words.endswith("+a") else "< 0", steps.mean()
            else:
                cell = "largest distance of the speed from its best sinusoid (m/s)", "<= 1e-9", _from_sinusoid(speed)
            rows.append((segment, axis, *cell))
    return rows


def _from_sinusoid(speed):
    """Largest residual of a least squares fit of a constant and one frequency, over the frequencies that fit a whole number of times."""
    t, best = np.arange(len(speed)), np.inf
    for cycles in range(1, 11):
        w = 2 * np.pi * cycles / (len(speed) - 1)
        basis = np.stack([np.ones_like(t, dtype=float), np.sin(w * t), np.cos(w * t)], axis=1)
        residual = speed - basis @ np.linalg.lstsq(basis, speed, rcond=None)[0]
        best = min(best, np.abs(residual).max())
    return best


def off_the_line(track, last):
    """Largest distance of the positions 0 … last from the straight line through the first along the first velocity, m."""
    (x, vx, y, vy), n = track[:, : last + 1], np.hypot(*track[[1, 3], 0])
    return float(np.abs((x - x[0]) * vy[0] - (y - y[0]) * vx[0]).max() / n)


def table(scores, window, what="rmse"):
    """name -> 28 numbers, x, vx, y, vy of each segment: `what` is "rmse" or "bias", `window` one of the windows' names."""
    return {name: np.concatenate([getattr(each, what)(getattr(segment, window)) for segment in SEGMENTS]) for name, each in scores.items()}


def exact_rms(linear, track, window):
    """Exact root mean square over a slice of samples of a filter's bias, of its scatter, and of both together: three times (4,)."""
    squares = [part[:, window].mean(axis=1) for part in _exact_squares(linear, track)]
    return np.sqrt(squares[0]), np.sqrt(squares[1]), np.sqrt(squares[0] + squares[1])


def _exact_squares(linear, track):
    bias, covariance, _ = c.exact_errors(linear, track)
    return np.square(bias), np.einsum("iik->ik", covariance)


def settling(linear, track):
    """Seconds after each change of motion until the exact mean error has settled, (segments − 1, 4) for x, vx, y, vy.

    Settled is a mean error within one standard deviation of the noise in the same estimate about its last value in the segment: what is left there, a lag, is not a
    matter of waiting. NaN where an axis goes on as before, or where its acceleration varies, so that there is nothing to settle to.
    """
    bias, covariance, _ = c.exact_errors(linear, track)
    deviation = np.sqrt(np.einsum("iik->ik", covariance))
    found = np.full((len(SEGMENTS) - 1, 4), np.nan)
    for row, (before, segment) in enumerate(pairwise(SEGMENTS)):
        for axis, components in AXIS.items():
            motion = getattr(segment, axis)
            if motion in ("uniform", "accelerated", "decelerated") and motion != getattr(before, axis):
                for i in components:
                    about = bias[i] - bias[i, segment.last]
                    found[row, i] = settling_time(about, deviation[i, segment.last], segment.first, segment.last)
    return found


CLAIMS = {  # claim and number -> the rule of section 4
    "a: ABMA − SKF at rest, RMSE of x over the SKF's lag": "< 0.05",
    "b: bias of x at 201–400 s, ABMA / SKF": "< 0.1",
    "b: bias of vx at 201–400 s, ABMA / STKF": "< 0.1",
    "c: y at 701–900 s, STKF / STKF at rest": "> 1.1",
    "c: y at 701–900 s, ABMA / STKF": "< 0.9",
    "c: vy at 701–900 s, ABMA / STKF": "< 0.9",
    "d: bias of y at 1101–1300 s, ABMA / SKF": "< 0.1",
    "e: longest settling time of ABMA (s)": "> 5",
}


def claims_by_acceleration(by_a):
    """The paper's five claims for several accelerations: a table (`CLAIMS`, a) of their numbers.

    Parameters
    ----------
    by_a : dict
        Acceleration in m/s² -> scores of the paper's three filters, as `score` gives them.
    """
    columns = {}
    for a, scores in by_a.items():
        skf, stkf, abma = (scores[name] for name in PAPERS)
        track, rest, last = truth(a), SEGMENTS[0].settled, SEGMENTS[6].settled
        bias = {(name, i): abs(each.steady_bias(1, i)[0]) for name, each in scores.items() for i in ("x", "vx")}
        plain, ours = PAPERS[0], PAPERS[2]
        columns[a] = [
            (abma.rmse(rest)[0] - skf.rmse(rest)[0]) / bias[plain, "x"],
            bias[ours, "x"] / bias[plain, "x"],
            bias[ours, "vx"] / bias[PAPERS[1], "vx"],
            compared(stkf, stkf, 4, ["y"], against=3)[0],
            compared(abma, stkf, 4, ["y"])[0],
            compared(abma, stkf, 4, ["vy"])[0],
            exact_rms(c.augmented(), track, last)[0][2] / exact_rms(c.plain(), track, last)[0][2],
            np.nanmax(settling(c.augmented(), track)),
        ]
    return pd.DataFrame(columns, index=list(CLAIMS))


TRADE = {  # what a family of filters is judged by: segment and part of it
    "at rest": (0, "settled"),
    "accelerated, after 40 s": (1, "settled"),
    "accelerated, first 40 s": (1, "transient"),
    "varying acceleration": (4, "samples"),
}


def trade_off(family, settings, track):
    """Exact errors in x and vx of a family of filters with known gains, in the parts of the track that `TRADE` names.

    Parameters
    ----------
    family : callable
        setting -> `Linear`.
    settings : sequence of float
    track : array_like, shape (4, 1301)

    Returns
    -------
    numpy.ndarray, shape (len(settings), 4, 2)
        Root mean square errors of x and vx, m and m/s.
    """
    windows = [getattr(SEGMENTS[i], part) for i, part in TRADE.values()]
    squares = (sum(_exact_squares(family(setting), track))[:2] for setting in settings)
    return np.sqrt([[each[:, window].mean(axis=1) for window in windows] for each in squares])


def sampled_trade_off(contenders, runs, seed):
    """The same by simulation, for filters whose gain depends on the data: one row for each."""
    found = score([replace(each, name=str(i)) for i, each in enumerate(contenders)], runs, seed)
    return np.array([[each.rmse(getattr(SEGMENTS[i], part))[:2] for i, part in TRADE.values()] for each in found.values()])


def worst(scores, name, components=("x", "y"), part="settled"):
    """Largest distance error over the segments: (root mean square error, index of the segment)."""
    chosen = [COMPONENTS.index(each) for each in components]
    values = [np.sqrt((scores[name].rmse(getattr(segment, part))[chosen] ** 2).sum()) for segment in SEGMENTS]
    return float(max(values)), int(np.argmax(values))


def shade(ax, numbers=False):
    """Shade every other segment of Table 1, and number them above the axes where wanted."""
    for i, segment in enumerate(SEGMENTS):
        if i % 2:
            ax.axvspan(segment.first - 1, segment.last, color="#56B4E9", alpha=0.12, linewidth=0, zorder=0)
        if numbers:
            middle = (segment.first + segment.last) / 2
            ax.annotate(
                str(i + 1), (middle, 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=8, color="#555555"
            )
    ax.set_xlim(0, STEPS)

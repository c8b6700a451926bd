"""Paper 3's introduction: every method that it names on one manoeuvre, rest – constant acceleration in x – rest, a minute each, T = 1 s.

Samples are k = 0 … 180; the acceleration is held from sample 60 to 120, so 61 is the first sample that it moves and 121 the first after it. Errors are estimates − truth,
state (x, vx, y, vy) first, then samples, then runs.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from trackhelpers import plots
from trackhelpers.arrays import check_scale
from trackhelpers.consistency import nees
from trackhelpers.ensemble import standard_normal
from trackhelpers.intervals import Interval, ratio_interval
from trackhelpers.scenarios.augmented_bias.contenders import exact_errors
from trackhelpers.scenarios.augmented_bias.target import COMPONENTS, P0, START, R, T, simulate

STEPS, BEGIN, END = 180, 60, 120
PARTS = {
    "rest": slice(21, 61),
    "onset": slice(61, 81),
    "manoeuvre": slice(81, 121),
    "end": slice(121, 141),
    "after": slice(141, 181),
    "accelerated": slice(61, 121),  # onset and manoeuvre
}
SHOWN = ("rest", "onset", "manoeuvre", "end", "after")


class Runs(NamedTuple):
    """M runs: truth (4, N + 1, M), or (4, N + 1, 1) where all have the same; starts (4, M); measured positions (2, N, M) at samples 1 … N."""

    track: np.ndarray
    start: np.ndarray
    z: np.ndarray


class Errors(NamedTuple):
    """Errors (4, N + 1, M) of one filter, and its NEES averaged over the runs (N + 1,): NaN at k = 0 and for a covariance that means nothing."""

    values: np.ndarray
    nees: np.ndarray

    @property
    def mean(self):
        """Over the runs, (4, N + 1)."""
        return self.values.mean(axis=2)

    @property
    def rms(self):
        """Over the runs, (4, N + 1)."""
        return np.sqrt(np.mean(self.values**2, axis=2))

    def squares(self, part, component="x"):
        """Mean square error of each run over a part (a name in `PARTS`, or a slice of samples), (M,)."""
        window = PARTS[part] if isinstance(part, str) else part
        return np.mean(self.values[COMPONENTS.index(component), window] ** 2, axis=0)

    def rmse(self, part, component="x"):
        """Root mean square error over a part and all runs."""
        return float(np.sqrt(self.squares(part, component).mean()))


def accelerations(a=2.0):
    """(2, 180), m/s²: a in x from sample 60 to 120, nothing else."""
    both = np.zeros((2, STEPS))
    both[0, BEGIN:END] = check_scale(a, "a")
    return both


def _generators(runs, seed):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]


def draw(track, runs=500, seed=2018):
    """`Runs` on one track (4, N + 1). Equal seeds give equal noise on every track of the same length, so that runs are paired."""
    return Runs(track[..., None], *simulate(_generators(runs, seed), track))


def draw_random(model, steps=200, runs=500, seed=2018):
    """`Runs` whose tracks are drawn from a linear model of state (x, vx, ax, y, vy, ay) with σ of the acceleration at the start, such as Singer's."""
    noise = standard_normal(_generators(runs, seed), (6 * steps + 2 + 4 + 2 * steps,))
    w, first, start, v = np.split(noise, [6 * steps, 6 * steps + 2, 6 * steps + 6])
    nought = np.zeros(6)
    F, root = model.F(nought, T), np.linalg.cholesky(model.Q(nought, T))
    x = np.repeat(np.array([START[0], START[1], 0, START[2], START[3], 0.0])[:, None], runs, axis=1)
    x[[2, 5]] = np.asarray(model.sigmas)[:, None] * first
    states = [x]
    for step in w.reshape(steps, 6, runs):
        states.append(F @ states[-1] + root @ step)
    track = np.stack(states, axis=1)[[0, 1, 3, 4]]
    z = track[[0, 2], 1:] + np.sqrt(R[0, 0]) * v.reshape(2, steps, runs)
    return Runs(track, track[:, 0] + np.sqrt(np.diag(P0))[:, None] * start, z)


def errors(contender, runs):
    """`Errors` of a contender on all runs."""
    values, normalised = np.empty((4, runs.z.shape[1] + 1, runs.z.shape[2])), np.full(runs.z.shape[1] + 1, np.nan)
    values[:, 0] = runs.start - runs.track[:, 0]
    for k, (x, P) in enumerate(contender.follow(runs.start, runs.z), 1):
        values[:, k] = x - runs.track[:, k]
        if contender.honest:
            P = np.broadcast_to(P.reshape(4, 4, -1), (4, 4, x.shape[1]))
            normalised[k] = nees(np.broadcast_to(runs.track[:, k], x.shape), x, P).mean()
    return Errors(values, normalised)


def walk(kf, z):
    """Take a filterpy filter through one run's measurements z (2, N); yield it after each."""
    for measured in z.T:
        kf.predict()
        kf.update(measured)
        yield kf


def single_errors(contender, runs, run=0):
    """Errors (4, N + 1) of the contender's filterpy subclass on one run."""
    track, kept = runs.track[..., min(run, runs.track.shape[2] - 1)], getattr(contender, "to_estimate", np.eye(4))
    path = (kept @ kf.estimate for kf in walk(contender.single(runs.start[:, run]), runs.z[..., run]))
    return np.stack([runs.start[:, run], *path], axis=1) - track


def ratio(numerator, denominator, part, component="x", of_part=None):
    """Ratio of two root mean square errors over the same runs with its 95 % interval; `of_part` names another part for the denominator."""
    squares = numerator.squares(part, component), denominator.squares(of_part or part, component)
    return Interval(*(float(np.sqrt(max(value, 0.0))) for value in ratio_interval(*squares)))


def share_of_bias(errors, part, component="x"):
    """Share of the mean square error over a part that is the square of the mean over the runs, with its interval; the mean's own variance is taken off."""
    values = errors.values[COMPONENTS.index(component), PARTS[part]]
    spread = np.mean((values - values.mean(axis=1, keepdims=True)) ** 2, axis=0) * values.shape[1] / (values.shape[1] - 1)
    noise = ratio_interval(spread, np.mean(values**2, axis=0))
    return Interval(1 - noise.value, 1 - noise.high, 1 - noise.low)


def by_part(errors, component="x"):
    """Table of root mean square errors: a row a filter (name -> `Errors`), a column each for rest, onset, manoeuvre, end and after."""
    rows = {name: [e.rmse(part, component) for part in SHOWN] for name, e in errors.items()}
    return pd.DataFrame(rows, index=list(SHOWN)).T


def exact_squares(linear, track):
    """Mean square errors of x and of vx, (2, N + 1), of a filter whose gain knows no measurement: bias² + variance by recursion, without runs."""
    bias, cov, _ = exact_errors(linear, track)
    return bias[:2] ** 2 + np.stack([cov[0, 0], cov[1, 1]])


def exact_rmse(linear, track, part):
    """Root mean square error of x over a part, by recursion."""
    return float(np.sqrt(exact_squares(linear, track)[0, PARTS[part] if isinstance(part, str) else part].mean()))


def deviations(linear, errors, track):
    """Mean squares of x over all parts, runs − recursion, in standard errors: (6,)."""
    squares, expected = np.array([errors.squares(part) for part in PARTS]), exact_squares(linear, track)[0]
    return (squares.mean(axis=1) - [expected[window].mean() for window in PARTS.values()]) / (
        squares.std(axis=1) / np.sqrt(squares.shape[1])
    )


def picture(axes, errors, reference, one, inner, label, truth=None, scale="linear"):
    """Draw a method on three axes: its errors of x and vx on the scale that all methods share, and what it goes by.

    Parameters
    ----------
    axes : three matplotlib.axes.Axes
    errors, reference : Errors
        Of the method, and of the one whose mean is the dotted line.
    one : array (4, N + 1)
        Errors of the run that is drawn thin, in x.
    inner : array (N,) or (N + 1,)
        The method's own indicator in that run.
    label : str
        Its name and unit.
    truth : float or array (N + 1,), optional
        Dashed: what the indicator should be, or its limit.
    scale : {"linear", "log"}
    """
    t = T * np.arange(one.shape[1])
    names = ("error of x (m)", "error of $v_x$ (m/s)")
    for ax, i, bound, name in zip(axes[:2], (0, 1), (12, 8), names, strict=True):
        plots.band(ax, t, -errors.rms[i], errors.rms[i], label="± RMS of the runs")
        ax.plot(t, reference.mean[i], ":", color=plots.COLOURS["purple"], linewidth=1.2, label="mean of the SKF")
        if i == 0:  # of the velocity it would hide the mean
            plots.estimate(ax, t, one[i], label="one run", method=4, linewidth=0.7)
        plots.estimate(ax, t, errors.mean[i], label="mean")
        ax.set(ylim=(-bound, bound), ylabel=name)
    axes[2].plot(t[-len(inner) :], inner, color=plots.COLOURS["vermillion"], linewidth=0.9)
    if truth is not None:
        axes[2].plot(t, np.broadcast_to(truth, t.shape), "k--", linewidth=1.0)
    axes[2].set(ylabel=label, yscale=scale)
    for ax in axes:
        ax.axvspan(BEGIN, END, color="#EEEEEE", zorder=0)
        ax.set(xlabel="time (s)", xticks=[0, BEGIN, END, 180])

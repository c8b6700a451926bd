"""Drawings of section 4.2: the track in the plane, the velocity over time, and the errors that Tables 7 and 8 give away."""

import numpy as np
from matplotlib.patches import Circle

from trackhelpers import plots
from trackhelpers.scenarios.thesis.lidar_radar import T, velocity


def draw_track(ax, track, zs, x):
    """Draw the truth, both sensors' measurements and an estimate in the plane.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    track : numpy.ndarray, shape (5, N)
        Truth.
    zs : sequence of arrays
        Measurements of one run, lidar (2,) and radar (3,) in turn; the radar's are drawn where range and bearing put them.
    x : numpy.ndarray, shape (5, N)
        Estimate.
    """
    ranges, bearings = np.array(zs[1::2]).T[:2]
    plots.measured(ax, ranges * np.cos(bearings), ranges * np.sin(bearings), sensor="radar", markersize=3)
    plots.measured(ax, *np.array(zs[::2]).T, sensor="lidar", color=plots.COLOURS["green"], markersize=3)
    plots.truth(ax, *track[:2])
    plots.estimate(ax, *x[:2], label="estimate (EKF)", linewidth=1.2)
    ax.plot(0, 0, marker="^", color=plots.COLOURS["vermillion"], linestyle="none", label="both sensors", zorder=4)
    ax.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


def draw_velocity(axes, track, x, samples=slice(None), **keywords):
    """Draw the velocity components of the truth and of an estimate over time, on two axes; `samples` chooses a part, `keywords` go to the estimate's line."""
    time = T * np.arange(1, track.shape[1] + 1)[samples]
    for ax, name, true, estimated in zip(axes, "xy", velocity(track), velocity(x), strict=True):
        plots.truth(ax, time, true[samples])
        plots.estimate(ax, time, estimated[samples], label="estimate (EKF)", **{"linewidth": 1.0} | keywords)
        ax.set(xlabel="time (s)", ylabel=f"$v_{name}$ (m/s)")


def draw_position_errors(ax, error, deviation, sigma):
    """Draw the errors of the first samples in the plane, with their standard deviations and circles of one and two `sigma`.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    error, deviation : numpy.ndarray, shape (K, 2)
        Position errors at k = 1, …, K and how well they are known, m.
    sigma : float
        m.
    """
    for k, (place, spread) in enumerate(zip(error, deviation, strict=True), start=1):
        mark, colour = (".", "green") if k % 2 else ("x", "measured")
        ax.errorbar(*place, xerr=spread[0], yerr=spread[1], fmt=mark, color=plots.COLOURS[colour], linewidth=1)
        ax.annotate(f"{k}", place, xytext=(4, 4), textcoords="offset points", fontsize=8)
    for radius, style in ((sigma, "-"), (2 * sigma, "--")):
        ax.add_patch(Circle((0, 0), radius, fill=False, linestyle=style, color=plots.COLOURS["blue"]))
    ax.set(xlabel="error of x (m)", ylabel="error of y (m)", aspect="equal")

"""One vocabulary of colours and marks, so that the truth, a measurement and an estimate look the same in every figure.

The colours are those of Okabe and Ito (2008), which people with any of the common colour deficiencies tell apart. Every function draws
on axes that the caller made, and passes further keywords to matplotlib.
"""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown, display
from matplotlib.patches import Ellipse
from scipy.stats import chi2

from .arrays import check_array, check_covariance
from .checks import check_choice, check_lengths, check_number, check_positive, check_probability

__all__ = [
    "COLOURS",
    "MARKS",
    "METHODS",
    "band",
    "covariance_ellipse",
    "estimate",
    "flow",
    "measured",
    "nees_plot",
    "show",
    "truth",
    "use_style",
]

COLOURS = {
    "truth": "#000000",
    "measured": "#888888",
    "band": "#56B4E9",
    "blue": "#0072B2",
    "orange": "#E69F00",
    "green": "#009E73",
    "purple": "#CC79A7",
    "vermillion": "#D55E00",
}
METHODS = ("blue", "orange", "green", "purple", "vermillion")  # the first is the method that the figure is about
MARKS = {None: ".", "lidar": ".", "radar": "x", "position": "+", "fix": "+"}


def use_style():
    """Set matplotlib's defaults for the notebooks: 7 in × 4 in at 100 dpi, constrained layout, a light grid, a legend without a frame."""
    mpl.rcParams.update(
        {
            "figure.dpi": 100,
            "savefig.dpi": 100,
            "figure.figsize": (7.0, 4.0),
            "figure.constrained_layout.use": True,
            "axes.grid": True,
            "axes.axisbelow": True,
            "grid.color": "#DDDDDD",
            "grid.linewidth": 0.6,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.prop_cycle": mpl.cycler(color=[COLOURS[name] for name in METHODS]),
            "legend.frameon": False,
            "font.size": 10.0,
            "lines.linewidth": 1.6,
        }
    )


def truth(ax, x, y, label="truth", **keywords):
    """Draw the truth, a black line, x and y (N,), NaN where it is broken; return it. ValueError, as from all of these, for what is no number and shapes that differ."""
    x, y = check_lengths(x=x, y=y)
    return ax.plot(x, y, **{"color": COLOURS["truth"], "linewidth": 1.2, "label": label, "zorder": 2.5} | keywords)[0]


def measured(ax, x, y, sensor=None, label=None, **keywords):
    """Draw measurements in grey, not joined: dots for a lidar, crosses for a radar, plus signs for a position or a fix; return the line.

    Raises
    ------
    ValueError
        For a sensor that has no mark; `MARKS` lists them.
    """
    if sensor is not None:
        check_choice(sensor, "sensor", [name for name in MARKS if name])
    x, y = check_lengths(x=x, y=y)
    label = label if label is not None else sensor or "measured"
    style = {"color": COLOURS["measured"], "linestyle": "none", "marker": MARKS[sensor], "markersize": 4, "label": label, "zorder": 2}
    return ax.plot(x, y, **style | keywords)[0]


def estimate(ax, x, y, label="estimate", method=0, **keywords):
    """Draw an estimate, a strong line in the colour of its method: 0 blue, 1 orange, 2 green, 3 purple, 4 vermillion; return it."""
    x, y = check_lengths(x=x, y=y)
    return ax.plot(x, y, **{"color": _colour(method), "linewidth": 1.8, "label": label, "zorder": 3} | keywords)[0]


def band(ax, t, low, high, label=None, method=None, **keywords):
    """Shade what lies between `low` and `high`, arrays like `t` or numbers, in light blue or the colour of a method; return the patch."""
    colour = COLOURS["band"] if method is None else _colour(method)
    t, low, high = check_lengths(("low", "high"), t=t, low=low, high=high)
    if t.ndim != 1:
        raise ValueError(f"t: expected times (N,), got shape {t.shape}")
    return ax.fill_between(t, low, high, **{"color": colour, "alpha": 0.25, "linewidth": 0, "label": label, "zorder": 1} | keywords)


def covariance_ellipse(ax, mean, P, probability=0.95, method=0, label=None, **keywords):
    """Draw the ellipse that holds a share `probability` of a Gaussian in the plane.

    Its half axes are √(χ²₂(probability)·λ) for the eigenvalues λ of `P`: 2.448 standard deviations for 95 %. (One standard deviation
    holds only 39.3 %, and the `plot_covariance` of filterpy 2.0.0, asked for 95 %, draws 85 %.)

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    mean : array (2,)
    P : array (2, 2)
        Covariance.

    Returns
    -------
    matplotlib.patches.Ellipse

    Raises
    ------
    ValueError
        For wrong shapes, entries that are not finite, a `P` that is not symmetric or has a negative eigenvalue, and for a probability
        outside (0, 1).
    """
    mean, P = check_array(mean, "mean", 2, ()), check_covariance(P, "P", 2)
    probability = check_probability(probability, "probability")
    variances, axes = np.linalg.eigh(P)
    minor, major = 2 * np.sqrt(chi2.ppf(probability, 2) * variances.clip(0))
    angle = np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))
    style = {"facecolor": "none", "edgecolor": _colour(method), "linewidth": 1.4, "label": label, "zorder": 3} | keywords
    ellipse = ax.add_patch(Ellipse(mean, major, minor, angle=angle, **style))
    ax.autoscale_view()
    return ellipse


def nees_plot(ax, t, average, limits, expected=None, label="average NEES", method=0, **keywords):
    """Draw an average NEES or NIS over time with its chi-square band.

    Parameters
    ----------
    t, average : array (N,)
    limits : (low, high)
        The band that a consistent filter keeps to, numbers or arrays (N,); `trackhelpers.consistency.chi2_band` gives it.
    expected : float, optional
        The mean of a consistent filter, which is the number of states (NEES) or of measurements (NIS); a dashed line.

    Returns
    -------
    matplotlib.lines.Line2D
    """
    if not isinstance(limits, (list, tuple, np.ndarray)) or len(limits) != 2:
        raise ValueError(f"limits: expected (low, high), got {limits!r}")
    t, low, high = check_lengths(("limits[0]", "limits[1]"), t=t, **{"limits[0]": limits[0], "limits[1]": limits[1]})
    average = check_lengths(t=t, average=average)[1]
    band(ax, t, low, high, label="chi-square band")
    if expected is not None:
        ax.axhline(check_number(expected, "expected"), color=COLOURS["truth"], linestyle="--", linewidth=0.9, zorder=1.5)
    return estimate(ax, t, average, label=label, method=method, **{"linewidth": 1.2} | keywords)


def flow(ax, boxes, arrows, fontsize=9.0):
    """Draw boxes and the arrows between them.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Its ticks and frame are taken away.
    boxes : dict
        Name -> (x, y, text): the centre and the text of a box. Both axes have one scale, so inches are a natural unit.
    arrows : iterable
        (from, to) or (from, to, text) or (from, to, text, bend), by the names of the boxes; `bend` curves the arrow, 0 is straight.

    Returns
    -------
    dict
        Name -> matplotlib.text.Text, whose ``get_bbox_patch()`` is the box.

    Raises
    ------
    ValueError
        For an arrow that names a box which is not there.
    """
    if not isinstance(boxes, dict) or not boxes:
        raise ValueError(f"boxes: expected a dict of name -> (x, y, text), got {boxes!r}")
    if not hasattr(arrows, "__iter__"):
        raise ValueError(f"arrows: expected a sequence of (from, to), got {arrows!r}")
    fontsize = check_positive(fontsize, "fontsize")
    style = {"boxstyle": "round,pad=0.5", "facecolor": "#EAF4FB", "edgecolor": COLOURS["blue"], "linewidth": 1.2}
    drawn = {
        name: ax.text(x, y, text, ha="center", va="center", fontsize=fontsize, bbox=style, zorder=3) for name, (x, y, text) in boxes.items()
    }
    for start, end, *rest in arrows:
        unknown = {start, end} - set(boxes)
        if unknown:
            raise ValueError(f"arrow {(start, end)} names {sorted(unknown)}, expected boxes out of {list(boxes)}")
        text, bend = (*rest, *("", 0.0)[len(rest) :])
        a, b = np.array(boxes[start][:2], dtype=float), np.array(boxes[end][:2], dtype=float)
        line = {
            "arrowstyle": "-|>",
            "color": "#444444",
            "linewidth": 1.1,
            "shrinkA": 2,
            "shrinkB": 2,
            "connectionstyle": f"arc3,rad={bend}",
            "patchA": drawn[start].get_bbox_patch(),
            "patchB": drawn[end].get_bbox_patch(),
        }
        ax.annotate("", xy=b, xytext=a, arrowprops=line, zorder=4)
        if text:
            # matplotlib's arc3 passes at half its control point's distance from the chord, to the right of the way for a positive bend.
            middle = (a + b) / 2 + 0.5 * bend * np.array([(b - a)[1], -(b - a)[0]])
            label = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
            ax.text(*middle, text, ha="center", va="center", fontsize=fontsize - 1, bbox=label, zorder=5)
    centres = np.array([box[:2] for box in boxes.values()], dtype=float)
    margin = 0.18 * np.maximum(np.ptp(centres, axis=0), 1e-9) + 0.35 * (np.ptp(centres, axis=0) == 0)
    (left, bottom), (right, top) = centres.min(axis=0) - margin, centres.max(axis=0) + margin
    ax.set(xlim=(left, right), ylim=(bottom, top))
    ax.set_aspect("equal", adjustable="box")
    ax.set_axis_off()
    return drawn


def show(fig, number, caption):
    """Put out a figure, a PNG at 150 dpi, and below it its caption as Markdown, ``**Figure 4.2-3.** …``; the figure is closed.

    `number` is chapter and count, ``"4.2-3"`` in the thesis, ``"P2.3-1"`` in paper 2, ``"R1-4"`` of the real targets; `caption` says what to see, and is the web book's text for those who do not see the figure.

    Raises
    ------
    ValueError
        For a number or a caption that is no text.
    """
    for name, text in (("number", number), ("caption", caption)):
        if not isinstance(text, str) or not text.strip():
            raise ValueError(f"{name} is {text!r}, expected text")
    fig.set_dpi(150)
    display(fig)
    display(Markdown(f"**Figure {number}.** {' '.join(caption.split())}"))
    plt.close(fig)


def _colour(method):
    if isinstance(method, (bool, np.timedelta64)) or not isinstance(method, (int, np.integer)) or not 0 <= method < len(METHODS):
        raise ValueError(f"method is {method!r}, expected an int from 0 to {len(METHODS) - 1}")
    return COLOURS[METHODS[method]]

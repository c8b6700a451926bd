"""Axes and curves as SVG, with the numbers of a whole grid of curves beside it: what a `trackhelpers.play.Playground` is made of.

The numbers are whole, in units of about a 10 000th of an axis's range, so that neither a page's size nor its bytes hang on digits that nobody sees.
"""

import html
import math

import numpy as np
from matplotlib.ticker import MaxNLocator
from scipy.stats import chi2

from .checks import check_covariance, check_numbers, check_probability, check_vector
from .plots import COLOURS

__all__ = ["DASHES", "Ellipse", "Panel", "reduced"]

DASHES = {"-": "", "--": "6 4", ":": "1.5 3.5", "-.": "8 3 2 3", ".": "", "o": "", "fill": ""}
DOTS = {".": 4, "o": 9}
LEFT, RIGHT, BOTTOM, WIDTH = 54, 10, 40, 360
LETTER = 6.3  # about the width of one
_CIRCLE = [(math.cos(math.pi * k / 24), math.sin(math.pi * k / 24)) for k in range(49)]


class Ellipse(tuple):
    """The ellipse that holds a share `probability` of a Gaussian: ((mean, factor of cosine, of sine) of x, the same of y).

    ValueError for a mean that is not two numbers, a P (2, 2) that is not positive definite, and what is no probability.
    """

    def __new__(cls, mean, P, probability=0.95):
        mean, P = check_vector(mean, "mean", 2), check_covariance(P, "P", 2, definite=True)
        check_probability(probability, "probability")
        L = np.linalg.cholesky(P) * math.sqrt(chi2.ppf(probability, 2))
        return super().__new__(cls, ((mean[0], L[0, 0], 0.0), (mean[1], L[1, 0], L[1, 1])))


class Panel:
    """A pair of axes and its curves at all points of a grid; `trackhelpers.play.Playground.panel` tells the arguments.

    Parameters
    ----------
    grid : list of dict
        The curves of each point of the grid.
    """

    def __init__(self, grid, xlabel, ylabel, looks, limits, equal, log, height):
        self.xlabel, self.ylabel, self.looks, self.log, self.height = xlabel, ylabel, looks, log, height
        self.round = {name: isinstance(grid[0][name], Ellipse) for name in looks}
        scales = [np.log10 if axis in log else np.array for axis in "xy"]
        self.curves = {
            name: [[scale(np.asarray(v, dtype=float)) for scale, v in zip(scales, point[name], strict=True)] for point in grid]
            for name in looks
        }
        self.limits = [self._limits(axis, given) for axis, given in enumerate(limits)]
        shown = [tuple(10.0**v for v in pair) if xy in log else pair for xy, pair in zip("xy", self.limits, strict=True)]
        self.asked = (xlabel, ylabel, looks, shown, equal, log, height)
        self.legend = self._legend()
        self.top = 8 + 16 * (1 + max((row for *_, row in self.legend), default=-1))
        size = (WIDTH - LEFT - RIGHT, height)
        if equal:
            metre = max(np.ptp(pair) / length for pair, length in zip(self.limits, size, strict=True))
            self.limits = [(sum(p) / 2 - metre * n / 2, sum(p) / 2 + metre * n / 2) for p, n in zip(self.limits, size, strict=True)]
        self.unit = [10.0 ** (math.ceil(math.log10(high - low)) - 4) for low, high in self.limits]
        self.scale = []  # pixel = a + b · whole number
        for axis, ((low, high), length) in enumerate(zip(self.limits, size, strict=True)):
            b = length / (high - low) * (-1 if axis else 1)
            a = (self.top + height if axis else LEFT) - b * low
            self.scale.append([float(f"{a:.6g}"), float(f"{b * self.unit[axis]:.6g}")])

    def data(self, shape):
        """Return what the script needs: scales, and the numbers of each curve over a grid of that shape."""
        curves = [
            {"look": self._look(name)} | {xy: reduced(self.whole(name, axis), shape) for axis, xy in enumerate("xy")} for name in self.looks
        ]
        return {"scale": self.scale, "curves": curves}

    def whole(self, name, axis):
        """Return a curve's x (axis 0) or y (1) at all points of the grid, lists of whole numbers in units of ``unit[axis]``; None for NaN."""
        low, high = self.limits[axis]
        far = (low - 20 * (high - low), high + 20 * (high - low))  # nobody sees how far beyond that a curve goes
        points = [point[axis] if self.round[name] else point[axis].clip(*far) for point in self.curves[name]]
        return [[None if math.isnan(v) else math.floor(v / self.unit[axis] + 0.5) for v in point.tolist()] for point in points]

    def path(self, name, point):
        """Return what an SVG path draws at a point of the grid; the script writes the same."""
        x, y = (self.whole(name, axis)[point] for axis in (0, 1))
        if self.round[name]:
            x, y = ([m + c * cosine + s * sine for cosine, sine in _CIRCLE] for m, c, s in (x, y))
        text, pen, dots = "", "M", self._look(name) in DOTS
        for pair in zip(x, y, strict=True):
            if None in pair:
                pen = "M"
                continue
            px, py = (math.floor((a + b * w) * 10 + 0.5) / 10 for (a, b), w in zip(self.scale, pair, strict=True))
            text += f"{pen}{px:g} {py:g}" + "h0" * dots
            pen = "M" if dots else "L"
        return text

    def svg(self, point):
        """Return the picture at a point of the grid."""
        right, bottom = WIDTH - RIGHT, self.top + self.height
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {bottom + BOTTOM}" role="img" '
            f'aria-label="{html.escape(self.label())}" font-family="sans-serif" font-size="12" fill="currentColor">'
        ]
        for axis, (low, high) in enumerate(self.limits):
            for value, text in _ticks(low, high, "xy"[axis] in self.log):
                a, b = self.scale[axis]
                p = f"{a + b * value / self.unit[axis]:.1f}"
                line = f"M{LEFT} {p}H{right}" if axis else f"M{p} {self.top}V{bottom}"
                place = f'x="{LEFT - 5}" y="{p}" dy="4" text-anchor="end"' if axis else f'x="{p}" y="{bottom + 15}" text-anchor="middle"'
                parts.append(f'<path d="{line}" stroke="currentColor" stroke-opacity=".18"/><text {place}>{text}</text>')
        parts.append(f'<path d="M{LEFT} {self.top}V{bottom}H{right}" stroke="currentColor" fill="none"/>')
        parts.append(f'<text x="{(LEFT + right) / 2:g}" y="{bottom + 32}" text-anchor="middle">{html.escape(self.xlabel)}</text>')
        turned = f'transform="translate(12 {self.top + self.height / 2:g})rotate(-90)" text-anchor="middle"'
        parts.append(f"<text {turned}>{html.escape(self.ylabel)}</text>")
        for name, x, row in self.legend:
            text = f'<text x="{x + 23}" y="{17 + 16 * row}">{html.escape(name)}</text>'
            parts.append(f'<path d="M{x} {13 + 16 * row}h18" {self._pen(name, legend=True)}/>{text}')
        box = f"{LEFT} {self.top} {right - LEFT} {self.height}"
        x, y, wide, high = box.split()
        parts.append(f'<svg x="{x}" y="{y}" width="{wide}" height="{high}" viewBox="{box}">')
        parts += [f'<path class="c" d="{self.path(name, point)}" {self._pen(name)}/>' for name in self.looks]
        return "".join([*parts, "</svg></svg>"])

    def label(self):
        """What the picture is of, for those who do not see it."""
        names = ", ".join(name for name in self.looks if not name.startswith("_"))
        return f"{self.ylabel} against {self.xlabel}: {names}"

    def _look(self, name):
        return "round" if self.round[name] else self.looks[name].split()[1]

    def _pen(self, name, legend=False):
        colour, dash = self.looks[name].split()
        colour = {"truth": "currentColor"}.get(colour, COLOURS[colour])
        if dash == "fill":
            return f'stroke="{colour}" stroke-width="8" stroke-opacity=".3"' if legend else f'fill="{colour}" fill-opacity=".3"'
        if dash in DOTS:
            return (
                f'fill="none" stroke="{colour}" stroke-width="{DOTS[dash]}" stroke-linecap="round"'
                + f' stroke-dasharray="0 {3 * DOTS[dash]}"' * legend
            )
        return f'fill="none" stroke="{colour}" stroke-width="2"' + f' stroke-dasharray="{DASHES[dash]}"' * bool(DASHES[dash])

    def _limits(self, axis, given):
        if given is not None:
            return tuple(math.log10(v) if "xy"[axis] in self.log else float(v) for v in given)
        low, high = np.inf, -np.inf
        for name, points in self.curves.items():
            for point in points:
                m = point[axis]
                ends = (m[0] - math.hypot(*m[1:]), m[0] + math.hypot(*m[1:])) if self.round[name] else (np.nanmin(m), np.nanmax(m))
                low, high = min(low, ends[0]), max(high, ends[1])
        margin = 0.04 * (high - low) or 1.0
        return float(f"{low - margin:.4g}"), float(f"{high + margin:.4g}")

    def _legend(self):
        """(name, x, row) of each entry, as many in a row as fit."""
        found, x, row = [], LEFT, 0
        for name in (name for name in self.looks if not name.startswith("_")):
            wide = 33 + math.ceil(LETTER * len(name))
            if x > LEFT and x + wide > WIDTH:
                x, row = LEFT, row + 1
            found.append((name, x, row))
            x += wide
        return found


def check_curves(point):
    """What a playground's function returned; ValueError unless it is a dictionary of curves."""
    if not isinstance(point, dict):
        raise ValueError(f"function: expected it to return a dictionary of curves, got {point!r}")
    for name, curve in point.items():
        if name == "say":
            if not isinstance(curve, str):
                raise ValueError(f"function: expected text under 'say', got {curve!r}")
        elif not isinstance(curve, Ellipse):
            if not isinstance(curve, (tuple, list, np.ndarray)) or len(curve) != 2:
                raise ValueError(f"function: expected curve {name!r} to be (x, y) or an Ellipse, got {curve!r}")
            x, y = (check_numbers(v, f"{xy} of the function's curve {name!r}") for xy, v in zip("xy", curve, strict=True))
            if x.shape != y.shape:
                raise ValueError(f"function: expected x and y of curve {name!r} of one length, got {x.shape} and {y.shape}")
    return point


def reduced(values, shape):
    """Return lists of equal length, one a point of a grid of that shape, without those that an axis repeats: length n, strides s, values v."""
    held = np.empty(shape, dtype=object)
    held.reshape(-1)[:] = [tuple(each) for each in values]
    strides, step = [0] * len(shape), 1
    for axis in reversed(range(len(shape))):
        first = held.take([0], axis=axis)
        if (held == first).all():
            held = first
        else:
            strides[axis] = step
            step *= shape[axis]
    return {"n": len(values[0]), "s": strides, "v": [v for each in held.reshape(-1) for v in each]}


def _ticks(low, high, log):
    if log and high - low > 1.5:
        ticks = [(float(k), f"{10.0**k:g}") for k in range(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)]
    elif log:
        ticks = [(math.log10(m * 10.0**k), f"{m * 10.0**k:g}") for k in range(math.floor(low), math.ceil(high) + 1) for m in (1, 2, 5)]
    else:
        ticks = [(v, f"{v:.6g}") for v in MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)]
    return [(value, text.replace("-", "\N{MINUS SIGN}")) for value, text in ticks if low - 1e-9 <= value <= high + 1e-9]

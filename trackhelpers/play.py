"""Figures to play with: a function of one or two parameters, drawn for every value of their sliders, in the book as in JupyterLab.

A notebook writes a function from its own filter or formula, and a `Playground` calls it on a grid. What comes out is put into the page as numbers of four digits, with
a few lines of script that need no server and no network; where no script runs (a notebook that is not yet trusted), a still picture stands. `Playground.free` offers
the same function to a live kernel, with sliders over any range.
"""

import html
import itertools
import json
import re
from pathlib import Path
from urllib.parse import quote

import numpy as np
from IPython.display import Markdown, display

from .checks import check_choice, check_number, check_positive, check_vector
from .panels import DASHES, Ellipse, Panel, check_curves, reduced
from .plots import COLOURS

__all__ = ["LIMIT", "Ellipse", "Playground"]

LIMIT = 60_000  # bytes of a page
_SCRIPT, _STYLE = (Path(__file__).with_name("data").joinpath(name).read_text(encoding="utf-8") for name in ("play.js", "play.css"))


class Playground:
    """A figure with one slider or two.

    Parameters
    ----------
    function : callable
        Takes the sliders' numbers by name, and returns a dictionary: name of a curve -> (x, y), arrays (n,), or an `Ellipse`. NaN breaks a line. A text under the name
        ``"say"`` is shown below the picture.
    **sliders : array
        Parameter of the function -> the values that its slider takes. A page shows the parameter's name, underscores as spaces.

    Raises
    ------
    ValueError
        For no slider, or more than two, values that are no finite numbers, and a function that returns something else.
    """

    def __init__(self, function, **sliders):
        if not callable(function):
            raise ValueError(f"function: expected a function of the sliders' numbers, got {function!r}")
        if not 1 <= len(sliders) <= 2:
            raise ValueError(f"sliders are {list(sliders)}, expected one or two")
        self.function = function
        self.sliders = {name: [float(f"{value:.6g}") for value in _some(values, name)] for name, values in sliders.items()}
        self.start = [len(values) // 2 for values in self.sliders.values()]
        self.labels = {name: name.replace("_", " ") for name in sliders}
        self.grid = [
            check_curves(function(**dict(zip(sliders, point, strict=True)))) for point in itertools.product(*self.sliders.values())
        ]
        if any(set(point) != set(self.grid[0]) for point in self.grid):
            raise ValueError(f"function: expected the same curves at all values, {list(self.grid[0])} and no others")
        self.said = [_said(point) for point in self.grid]
        self.panels, self.traces = [], []

    def begin(self, label=None, **starts):
        """Say with which value a slider begins, and how it is called on the page: ``begin("σ_a (m/s²)", sigma_a=1.0)``; return the playground.

        ValueError for a slider that is not there, and what is no number or no text.
        """
        for name, value in starts.items():
            if name not in self.sliders:
                raise ValueError(f"{name}: expected one of the sliders {list(self.sliders)}")
            check_number(value, name)
        if label is not None:
            _text(label, "label")
        for name, value in starts.items():
            self.start[list(self.sliders).index(name)] = int(np.argmin(np.abs(np.array(self.sliders[name]) - value)))
            self.labels[name] = label or self.labels[name]
        return self

    def panel(self, xlabel, ylabel, curves, xlim=None, ylim=None, equal=False, log="", trace=False, height=250):
        """Add a pair of axes; a page shows two side by side, a phone one below the other. Return the playground.

        Parameters
        ----------
        curves : dict
            Name of a curve -> colour and dash, ``"blue --"``: a colour of `plots.COLOURS`, and ``-``, ``--``, ``:``, ``-.``, ``.`` or ``o`` for points, or ``fill``. A
            name that begins with an underscore is not in the legend.
        xlim, ylim : (low, high), optional
            Range of an axis; that of the curves over the whole grid where it is left out.
        equal : bool
            One scale for both axes.
        log : str
            ``"x"``, ``"y"`` or ``"xy"``: logarithmic axes.
        trace : bool
            The curves are single points; drawn are the lines on which they move with the first slider, and dots where they are.

        Raises
        ------
        ValueError
            For a curve that the function does not return, another colour or dash, and what is no text, no range or no number.
        """
        for name, text in (("xlabel", xlabel), ("ylabel", ylabel)):
            _text(text, name)
        if not isinstance(curves, dict) or not curves:
            raise ValueError(f"curves: expected a dictionary of names and looks, got {curves!r}")
        xlim, ylim = (limits if limits is None else _range(limits, name) for name, limits in (("xlim", xlim), ("ylim", ylim)))
        check_choice(log, "log", ("", "x", "y", "xy"))
        check_positive(height, "height")
        for name, look in curves.items():
            colour, _, dash = _text(look, f"curves[{name!r}]").partition(" ")
            if colour not in COLOURS or dash not in DASHES:
                raise ValueError(f"curves: {name!r} is {look!r}, expected a colour out of {list(COLOURS)} and a dash out of {list(DASHES)}")
            if name not in self.grid[0]:
                raise ValueError(f"curves: {name!r} is none of those of the function, expected some of {list(self.grid[0])}")
        grid, looks, every = self.grid, curves, len(self.grid) // len(next(iter(self.sliders.values())))
        if trace:
            grid = [_traced(curves, grid[k % every :: every], now) for k, now in enumerate(grid)]
            looks = curves | {f"_{name}, now": f"{look.split()[0]} o" for name, look in curves.items()}
        self.panels.append(Panel(grid, xlabel, ylabel, looks, (xlim, ylim), equal, log, height))
        self.traces.append(list(curves) if trace else [])
        return self

    def show(self, number, caption):
        """Put out the playground, and below it its caption as Markdown, ``**Figure P3.1-6.** …``, as `plots.show` does for a figure.

        Raises
        ------
        ValueError
            For a number or a caption that is no text, and a page of more than 60 kB.
        """
        page = self.html(number, caption)
        if len(page.encode()) > LIMIT:
            raise ValueError(f"the playground takes {len(page.encode())} bytes, expected at most {LIMIT}: fewer points or values will do")
        display({"text/html": page, "text/plain": f"<Playground {number}>"}, raw=True)
        display(Markdown(f"**Figure {number}.** {' '.join(caption.split())}"))

    def html(self, number, caption):
        """Return the page of the playground: pictures, numbers and script. ValueError for a number or a caption that is no text."""
        for name, text in (("number", number), ("caption", caption)):
            _text(text, name)
        shape = [len(values) for values in self.sliders.values()]
        first = int(np.ravel_multi_index(self.start, shape))
        sliders = [
            {"name": self.labels[name], "values": [_shown(value) for value in values], "start": start}
            for (name, values), start in zip(self.sliders.items(), self.start, strict=True)
        ]
        words, numbers = _words_and_numbers(self.said)
        data = {
            "sliders": sliders,
            "panels": [panel.data(shape) for panel in self.panels],
            "words": words,
            "numbers": reduced(numbers, shape),
        }
        data = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        id = "playground-" + re.sub(r"[^0-9A-Za-z]+", "-", number)
        label = html.escape(" ".join(re.sub(r"[$`*\\]", "", caption).split()))
        return f"""<figure class="playground" id="{id}" aria-label="{label}">
<style>{_STYLE}</style>
<div class="panels">{"".join(_still(panel, first) for panel in self.panels)}</div>
<p class="said" aria-live="polite">{html.escape(self.said[first])}</p>
<p class="controls">A still picture: run the cell for its slider{"s" * (len(shape) > 1)}.</p>
<script>{_SCRIPT.replace("DATA", data)}</script>
</figure>"""

    def free(self, **ranges):
        """Return sliders that move freely, and a picture that follows them: for a live JupyterLab, through ipywidgets.

        Parameters
        ----------
        **ranges : (low, high)
            Parameter of the function, also one that has no slider on the page -> what it may be.

        Raises
        ------
        ValueError
            For a range that is not two numbers, the lower one first.
        """
        ranges = {name: _range(limits, name) for name, limits in ranges.items()}
        import ipywidgets  # nothing of it is needed before somebody plays

        held = {name: values[start] for (name, values), start in zip(self.sliders.items(), self.start, strict=True)}
        moved, picture = {}, ipywidgets.HTML()
        for name, (low, high) in ranges.items():
            value = min(max(held.get(name, (low + high) / 2), low), high)
            moved[name] = ipywidgets.FloatSlider(value, min=low, max=high, step=(high - low) / 200, description=self.labels.get(name, name))

        def draw(_=None):
            at = held | {name: slider.value for name, slider in moved.items()}
            now, (first, values) = self.function(**at), next(iter(self.sliders.items()))
            way = [self.function(**at | {first: value}) for value in values] if any(self.traces) else []
            grids = [[_traced(names, way, now)] for names in self.traces]
            panels = [Panel(grid, *panel.asked) for grid, panel in zip(grids, self.panels, strict=True)]
            stills = "".join(_still(panel, 0, "width: 45%; min-width: 20em") for panel in panels)
            picture.value = f"{stills}<p>{html.escape(_said(now))}</p>"

        for slider in moved.values():
            slider.observe(draw, "value")
        draw()
        return ipywidgets.VBox([*moved.values(), picture])


def _text(value, name):
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"{name} is {value!r}, expected text")
    return value


def _some(values, name):
    values = check_vector(values, name)
    if not values.size:
        raise ValueError(f"{name}: expected at least one value, got an empty list")
    return values


def _range(limits, name):
    low, high = check_vector(limits, name, 2).tolist()
    if low >= high:
        raise ValueError(f"{name}: expected two numbers, the lower one first, got {limits!r}")
    return low, high


def _words_and_numbers(texts):
    """What texts have in common, and the numbers between these pieces, a list a text; all of it where they differ in more than numbers."""
    pieces = [re.split(r"(\N{MINUS SIGN}?[\d.]*\d)", text) for text in texts]
    words = pieces[0][::2]
    if all(each[::2] == words for each in pieces):
        return words, [each[1::2] for each in pieces]
    return ["", ""], [[text] for text in texts]


def _traced(names, way, now):
    """The curves `now`, those of single points among them as the lines through all points of `way`, with a dot where they are now."""
    lines = {name: np.concatenate([np.reshape(point[name], (2, 1)) for point in way], axis=1) for name in names}
    return now | lines | {f"_{name}, now": now[name] for name in names}


def _still(panel, point, style=""):
    """A panel as an image: of SVG itself JupyterLab would leave nothing in a notebook that it does not trust."""
    look = f' style="{style}; background: white"' if style else ""
    return f'<img alt="{html.escape(panel.label())}"{look} src="data:image/svg+xml,{quote(panel.svg(point), safe=" /:=;,.()-+")}">'


def _said(curves):
    return re.sub(r"(?<!\w)-(?=\d)", "\N{MINUS SIGN}", curves.get("say", ""))


def _shown(value):
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")

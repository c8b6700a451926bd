"""The rows of the ledger: a verdict is computed from the numbers of its row, by one rule a kind of row, and never passed in."""

import math
import re

import numpy as np
import pandas as pd

from ..published import last_digit
from ..tables import Table
from .files import COLUMNS, KINDS, VERDICTS, results_folder, write_csv
from .numbers import checked_draws, enough_digits, finite, percentile_note, short, shown
from .rules import EQUATION_TOLERANCE, agrees, conditions, holds

__all__ = ["Rows", "bears_out"]


def _satisfied(row):
    """Return whether the numbers of a row, all of them text as stored, satisfy the rule of that row."""
    ours = float(row["ours"])
    ends = [float(row[name]) for name in ("low", "high") if row[name]]
    if row["kind"] == "equation" and not row["paper"]:
        return 0.0 <= ours <= float(row["tolerance"])
    bounds = conditions(row["paper"])
    if bounds is not None:
        return all(holds(value, *condition) for value in ends or [ours] for condition in bounds)
    paper = float(row["paper"].replace("−", "-"))
    if row["tolerance"]:
        return agrees(ours, paper, float(row["tolerance"]))
    low, high = ends
    return low <= paper <= high


def bears_out(row):
    """Return whether the verdict of a row follows from its other columns.

    Parameters
    ----------
    row : mapping or pandas.Series
        One row of a ledger's CSV file, with text or numbers in its cells; NaN and None count as empty.
    """
    row = {name: "" if pd.isna(row[name]) else str(row[name]) for name in COLUMNS}
    verdict = row["verdict"]
    try:
        if row["kind"] not in KINDS or verdict not in VERDICTS or not row["id"]:
            return False
        if verdict == "not checkable":
            return bool(row["note"]) and not any(row[name] for name in ("ours", "low", "high", "tolerance"))
        if verdict == "beyond the paper":
            return not row["paper"] and not row["tolerance"] and math.isfinite(float(row["ours"]))
        if row["kind"] == "equation" and not row["paper"] and float(row["tolerance"]) != EQUATION_TOLERANCE:
            return False
        satisfied = _satisfied(row)
    except ValueError:
        return False
    explained = bool(row["note"])
    return {
        "reproduced": satisfied,
        "reproduced under an assumption": satisfied and explained,
        "not reproduced": not satisfied,
        "paper in error": not satisfied and explained,
    }[verdict]


class Rows:
    """What one notebook found, row by row: a ledger without a file of questions.

    Each method adds a row and returns its verdict. The keywords that they share:

    * ``assumption``: what had to be assumed, for the paper is silent; a satisfied row becomes "reproduced under an assumption";
    * ``erratum``: what is wrong in the paper; an unsatisfied row becomes "paper in error" (without it, "not reproduced");
    * ``note``: anything else a reader of the row should know.

    They raise ``ValueError`` for an id used before, for an empty or multi-line text, for a number that is NaN or infinite, and for an
    erratum on a satisfied row, since then its proof has failed.

    Parameters
    ----------
    paper, notebook : str
        The folder and the name of the notebook, such as ``"1_thesis"`` and ``"2_kalman_filter"``.
    """

    def __init__(self, paper, notebook):
        for name, text in (("paper", paper), ("notebook", notebook)):
            if not isinstance(text, str) or not re.fullmatch(r"[a-z0-9]+(_[a-z0-9]+)*", text):
                raise ValueError(f"{name} is {text!r}, expected lower-case words joined by single underscores")
        self.paper, self.notebook = paper, notebook
        self.rows = []

    def cell(self, id, where, quantity, paper, ours, tolerance=None, *, assumption="", erratum="", note=""):
        """Add a deterministic cell of a table: reproduced when `ours` agrees with the printed string `paper` within `tolerance`, half a
        unit of its last digit unless given."""
        half_unit = last_digit(paper)  # raises for what is not a printed number
        tolerance = half_unit if tolerance is None else finite(id, "tolerance", tolerance)
        if tolerance <= 0:
            raise ValueError(f"tolerance of row {id!r} is {tolerance!r}, expected a positive number")
        return self._judge("table", id, where, quantity, paper, {"ours": ours, "tolerance": tolerance}, assumption, erratum, note)

    def random_cell(self, id, where, quantity, paper, draws, *, assumption="", erratum="", note=""):
        """Add a cell that depends on a noise draw: reproduced when the printed value lies in the central 95 % of `draws` (M,), one value
        a run, M ≥ 40. `ours` is the median; the note gives the percentile of the printed value."""
        draws = checked_draws(id, draws)
        last_digit(paper)  # raises for what is not a printed number
        value = float(paper.replace("−", "-"))
        low, ours, high = np.quantile(draws, [0.025, 0.5, 0.975])
        note = "; ".join(filter(None, [percentile_note(draws, value), note]))
        return self._judge("table", id, where, quantity, paper, {"ours": ours, "low": low, "high": high}, assumption, erratum, note)

    def equation(self, id, where, quantity, residual, *, assumption="", erratum="", note=""):
        """Add an equation: reproduced when `residual`, the largest difference between the printed form and an independent derivation
        at 20 random points or more, is at most 1e-9."""
        numbers = {"ours": residual, "tolerance": EQUATION_TOLERANCE}
        if finite(id, "residual", residual) < 0:
            raise ValueError(f"residual of row {id!r} is {residual!r}, expected a number ≥ 0")
        return self._judge("equation", id, where, quantity, "", numbers, assumption, erratum, note, digits=1)

    def figure(self, id, where, quantity, paper, ours, low=None, high=None, *, assumption="", erratum="", note=""):
        """Add a feature of a figure as a number: reproduced when the whole interval [low, high], or `ours` where none is given,
        satisfies the inequality `paper`: ``"> 0"``, ``"<= 1"``, ``"== 6"`` or ``"in [0, 1)"``."""
        return self._inequality("figure", id, where, quantity, paper, ours, low, high, assumption, erratum, note)

    def claim(self, id, where, quantity, paper, ours, low=None, high=None, *, kind="claim", assumption="", erratum="", note=""):
        """Add a claim of the text as a number, by the rule of `figure`. A cell of a table that is words may be judged so too, with
        ``kind="table"``."""
        return self._inequality(kind, id, where, quantity, paper, ours, low, high, assumption, erratum, note)

    def not_checkable(self, id, kind, where, quantity, note):
        """Add something that the source lost or never stated; `note` says what is missing."""
        if not isinstance(note, str) or not note.strip():
            raise ValueError(f"note of row {id!r} is empty, expected what is missing")
        return self._add("not checkable", id, kind, where, quantity, "", {}, note)

    def beyond(self, id, kind, where, quantity, ours, low=None, high=None, note=""):
        """Add a result of ours that the paper has nothing to set against."""
        numbers = {name: f"{value:.6g}" for name, value in self._numbers(id, ours, low, high).items()}
        return self._add("beyond the paper", id, kind, where, quantity, "", numbers, note)

    def write(self):
        """Write the rows to ``<paper>__<notebook>.csv`` in the results folder and return the table to show.

        The folder is ``TRACKHELPERS_RESULTS`` where that is set, else ``build/results``. Numbers have six significant digits,
        residuals of equations one, and more only where the verdict would not follow from fewer.
        """
        if not self.rows:
            raise ValueError(f"the ledger of {self.paper}/{self.notebook} has no rows, expected at least one")
        frame = pd.DataFrame(self.rows, columns=COLUMNS, dtype=str)
        write_csv(frame, results_folder() / f"{self.paper}__{self.notebook}.csv")
        table = frame[["id", "where", "quantity", "paper"]].copy()
        # A number that stands beside a printed one keeps its digits.
        beside = (frame["tolerance"] != "") & (frame["kind"] != "equation")
        table["ours"] = frame["ours"].where(beside, [shown(row) for row in self.rows])
        ends = zip(frame["low"], frame["high"], strict=True)
        table["interval"] = [f"[{short(low)}, {short(high)}]" if low else "" for low, high in ends]
        table["verdict"] = frame["verdict"]
        return Table(table, caption=f"Ledger of {self.paper}/{self.notebook}", index=False)

    def _inequality(self, kind, id, where, quantity, paper, ours, low, high, assumption, erratum, note):
        if not isinstance(paper, str) or conditions(paper) is None:
            raise ValueError(f"paper of row {id!r} is {paper!r}, expected an inequality such as '> 0', '<= 1', '== 6' or 'in [0, 1]'")
        return self._judge(kind, id, where, quantity, paper, self._numbers(id, ours, low, high), assumption, erratum, note)

    @staticmethod
    def _numbers(id, ours, low, high):
        if (low is None) != (high is None):
            raise ValueError(f"low, high of row {id!r} are {low!r}, {high!r}, expected both or neither")
        numbers = {"ours": ours} | ({} if low is None else {"low": low, "high": high})
        numbers = {name: finite(id, name, value) for name, value in numbers.items()}
        if low is not None and low > high:
            raise ValueError(f"low, high of row {id!r} are {low!r}, {high!r}, expected low ≤ high")
        return numbers

    def _judge(self, kind, id, where, quantity, paper, numbers, assumption, erratum, note, digits=6):
        if assumption and erratum:
            raise ValueError(f"row {id!r} has an assumption and an erratum, expected at most one of them")
        numbers = {name: finite(id, name, value) for name, value in numbers.items()}
        tolerance = {"tolerance": f"{numbers.pop('tolerance'):.6g}" if "tolerance" in numbers else ""}
        exact = {"kind": kind, "paper": paper, "low": "", "high": ""} | tolerance
        exact |= {name: repr(value) for name, value in numbers.items()}
        satisfied = _satisfied(exact)
        # The verdict must follow from what is stored: add digits until it does.
        stored = tolerance | enough_digits(numbers, lambda text: _satisfied(exact | text) == satisfied, digits)
        if satisfied and erratum:
            raise ValueError(f"row {id!r} has the erratum {erratum!r}, but its numbers bear the paper out: {exact}")
        verdict = ("reproduced under an assumption" if assumption else "reproduced") if satisfied else "not reproduced"
        verdict = "paper in error" if erratum else verdict
        return self._add(verdict, id, kind, where, quantity, paper, stored, "; ".join(filter(None, [assumption, erratum, note])))

    def _add(self, verdict, id, kind, where, quantity, paper, numbers, note):
        if kind not in KINDS:
            raise ValueError(f"kind of row {id!r} is {kind!r}, expected one of {KINDS}")
        for name, text in (("id", id), ("where", where), ("quantity", quantity)):
            if not isinstance(text, str) or not text.strip() or "\n" in text:
                raise ValueError(f"{name} of row {id!r} is {text!r}, expected one line of text")
        if not isinstance(note, str) or "\n" in note:
            raise ValueError(f"note of row {id!r} is {note!r}, expected one line of text")
        if any(row["id"] == id for row in self.rows):
            raise ValueError(f"id {id!r} was used before, expected a new one")
        texts = {"id": id, "kind": kind, "where": where, "quantity": quantity, "paper": paper, "verdict": verdict, "note": note}
        self.rows.append(dict.fromkeys(COLUMNS, "") | texts | numbers)
        return verdict

"""The verdict: a pure function of a question and its answer."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..intervals import mean_interval
from .files import ANSWER_COLUMNS
from .numbers import SMALL_BOUND, checked_draws, enough_digits, finite, percentile_note, read_number
from .rules import EQUATION_TOLERANCE, agrees, conditions, holds_on

__all__ = ["MARKS", "Found", "stored", "verdict"]

LEAST_RESIDUAL = 1e-10  # what lies below is one: how much of it is rounding differs from one processor to the next

MARKS = {
    "reproduced": "✓ reproduced",
    "reproduced under an assumption": "✓ under an assumption",
    "not reproduced": "✗ not reproduced",
    "paper in error": "✗ paper in error",
    "misprint": "✎ misprint",
    "undecided": "~ undecided",
    "not checkable": "– not checkable",
    "beyond the paper": "+ beyond the paper",
}


@dataclass(frozen=True)
class Found:
    """An answer with words: what is wrong in the paper (`error`) or only in its text as we have it (`misprint`), and anything else that a reader should know (`note`).

    With `error` or `misprint` the value is the check of the printed form, which fails: that is the proof.
    """

    value: Any
    error: str = ""
    misprint: str = ""
    note: str = ""

    def __post_init__(self):
        for name in ("error", "misprint", "note"):
            text = getattr(self, name)
            if not isinstance(text, str) or "\n" in text or (text and not text.strip()):
                raise ValueError(f"{name} is {text!r}, expected one line of text")
        if self.error and self.misprint:
            raise ValueError(f"error and misprint are {self.error!r} and {self.misprint!r}, expected at most one of them")


def verdict(question, answer=None):
    """Return the verdict that follows from a question and its answer.

    Parameters
    ----------
    question : Question
    answer : number, (ours, low, high), draws (M,), Found, or a row as stored
        One number for the rules "cell" and "equation"; draws, one value a run, for "random cell"; any of the three for an inequality and "beyond", which take the mean of draws and its
        95 % interval. A row is a mapping with the columns of the CSV file. "lost" needs none.

    Raises
    ------
    ValueError
        For numbers that are not finite or not of the kind that the rule asks for, an interval that does not hold `ours`, an error or a misprint that the numbers do not show, and for a question that is withdrawn.
    """
    return _judged(question, *_parts(question, answer))


def stored(question, answer=None):
    """Return the row of the CSV file, a dict of text, for a question and its answer as `verdict` takes it.

    Numbers have six significant digits and residuals one, more only where the verdict would not follow from fewer. A residual that is rounding is stored as a bound, the next
    power of ten from 1e-10 on.
    """
    numbers, found = _parts(question, answer)
    judged = _judged(question, numbers, found)
    row = dict.fromkeys(ANSWER_COLUMNS, "") | {"id": question.id, "verdict": judged}
    if question.rule == "lost":
        return row
    outcome = _outcome(question, numbers)

    def keeps(text):
        return _outcome(question, {name: float(value) for name, value in text.items()}) is outcome

    vanishes = question.rule == "equation" or bool(SMALL_BOUND.match(question.rule.strip()))
    text = {"ours": f"{_bound(numbers['ours']):.0e}"} if len(numbers) == 1 and vanishes and abs(numbers["ours"]) <= 1e-9 else {}
    if not (text and keeps(text)):
        text = enough_digits(numbers, keeps, digits=1 if question.rule == "equation" else 6)
    notes = [found.error or found.misprint, found.note]
    if question.rule == "random cell" and found.value is not None:
        notes.insert(1, percentile_note(np.asarray(found.value, dtype=float), question.value))
    return row | text | {"note": "; ".join(filter(None, notes))}


def _parts(question, answer):
    """Return the numbers of an answer, a dict of ``ours`` and perhaps ``low`` and ``high``, and its `Found`."""
    if question.withdrawn:
        raise ValueError(f"question {question.id!r} is withdrawn, expected no answer")
    if isinstance(answer, Mapping | pd.Series) and "verdict" in answer:
        return _from_row(question, answer)
    if question.rule == "lost":
        if answer is not None:
            raise ValueError(f"answer to {question.id!r} is {answer!r}, expected none, for the rule is 'lost'")
        return {}, Found(None)
    found = answer if isinstance(answer, Found) else Found(answer)
    return _numbers(question, found.value), found


def _from_row(question, row):
    text = {name: "" if pd.isna(row[name]) else str(row[name]) for name in ANSWER_COLUMNS}
    names = [name for name in ("ours", "low", "high") if text[name]]
    wanted = {"lost": [[]], "cell": [["ours"]], "equation": [["ours"]], "random cell": [["ours", "low", "high"]]}
    if names not in wanted.get(question.rule, [["ours"], ["ours", "low", "high"]]):
        raise ValueError(f"row {question.id!r} has the numbers {names}, expected those of the rule {question.rule!r}")
    numbers = _ordered(question, {name: read_number(question.id, name, text[name]) for name in names})
    reason = {"paper in error": "error", "misprint": "misprint"}.get(text["verdict"], "note")
    return numbers, Found(None, **{reason: text["note"]})


def _numbers(question, value):
    id, rule = question.id, question.rule
    if isinstance(value, tuple):
        if rule in ("cell", "random cell", "equation") or len(value) != 3:
            raise ValueError(
                f"answer to {id!r} is {value!r}, expected {'draws' if rule == 'random cell' else 'one number'} for the rule {rule!r}"
            )
        numbers = {name: finite(id, f"answer ({name})", part) for name, part in zip(("ours", "low", "high"), value, strict=True)}
    elif isinstance(value, list) or getattr(value, "ndim", 0) or rule == "random cell":
        if rule in ("cell", "equation"):
            raise ValueError(f"answer to {id!r} is {value!r}, expected one number for the rule {rule!r}")
        draws = checked_draws(id, value, "answer, draws,")
        low, ours, high = np.quantile(draws, [0.025, 0.5, 0.975])
        ours, low, high = (ours, low, high) if rule == "random cell" else mean_interval(draws)
        numbers = {"ours": float(ours), "low": float(low), "high": float(high)}
    else:
        numbers = {"ours": finite(id, "answer", value)}
    return _ordered(question, numbers)


def _ordered(question, numbers):
    if len(numbers) == 3 and not numbers["low"] <= numbers["ours"] <= numbers["high"]:
        raise ValueError(f"answer to {question.id!r} is {numbers}, expected low ≤ ours ≤ high")
    if question.rule == "equation" and numbers["ours"] < 0:
        raise ValueError(f"answer to {question.id!r} is {numbers['ours']!r}, expected a residual, a number ≥ 0")
    return numbers


def _outcome(question, numbers):
    """Return whether the numbers satisfy the rule: True, False, or None where they leave it open (or the rule asks for nothing)."""
    ours, rule = numbers["ours"], question.rule
    low, high = numbers.get("low", ours), numbers.get("high", ours)
    if rule == "beyond":
        return None
    if rule == "cell":
        return agrees(ours, question.value, question.allowed)
    if rule == "equation":
        return ours <= EQUATION_TOLERANCE
    if rule == "random cell":
        if not low <= question.value <= high:
            return False
        return None if high - low > abs(question.value) else True  # so wide an interval holds anything
    return holds_on(conditions(rule), low, high)


def _judged(question, numbers, found):
    fault = "paper in error" if found.error else "misprint" if found.misprint else ""
    if question.rule in ("lost", "beyond"):
        if fault:
            raise ValueError(f"answer to {question.id!r} says {fault!r}, expected only a note, for the rule is {question.rule!r}")
        return "not checkable" if question.rule == "lost" else "beyond the paper"
    outcome = _outcome(question, numbers)
    if fault and outcome is not False:
        shows = "bear the paper out" if outcome else "leave it undecided"
        raise ValueError(
            f"answer to {question.id!r} says {found.error or found.misprint!r}, but its numbers {shows}: {numbers}, {question.paper!r}"
        )
    if outcome is None:
        return "undecided"
    if outcome:
        return "reproduced under an assumption" if question.assumption else "reproduced"
    return fault or "not reproduced"


def _bound(value):
    """Return the next power of ten from `value` on, at least 1e-10."""
    power = LEAST_RESIDUAL
    while power < value:
        power = float(f"{10 * power:.0e}")
    return power

"""The numbers of the ledger: checked as they come in, kept with as many digits as their verdict needs, shown with four."""

import re

import numpy as np

from ..checks import check_number, check_numbers
from ..tables import number

__all__ = ["FEWEST_DRAWS", "checked_draws", "enough_digits", "finite", "percentile_note", "read_number", "short", "shown"]

FEWEST_DRAWS = 40  # below, a central 95 % interval has no run outside on either side
SMALL_BOUND = re.compile(r"[<>]=?\s*\d(?:\.\d*)?e-(?:0?[6-9]|1\d)")  # of a rule for what ought to vanish


def finite(id, name, value):
    """Return `value` as a float; one that is no finite number raises ``ValueError``, which names the row."""
    return check_number(value, f"{name} of row {id!r}", "one finite number") + 0.0  # minus zero becomes zero


def read_number(id, name, text):
    """Return the number that a ledger's file holds as `text`; ``ValueError``, which names the row, for what is none."""
    try:
        return finite(id, name, float(text))
    except ValueError:
        raise ValueError(f"{name} of row {id!r} is {text!r}, expected one finite number") from None


def checked_draws(id, draws, name="draws"):
    """Return one value a run, (M,), as floats; fewer than 40 of them, or one that is NaN or infinite, raise ``ValueError``, which calls them `name`."""
    draws = check_numbers(draws, f"{name} of row {id!r}")
    if draws.ndim != 1 or draws.size < FEWEST_DRAWS:
        raise ValueError(f"{name} of row {id!r} has the shape {draws.shape}, expected ({FEWEST_DRAWS} or more,)")
    if not np.isfinite(draws).all():
        raise ValueError(f"{name} of row {id!r} has {np.count_nonzero(~np.isfinite(draws))} NaN or infinite entries, expected none")
    return draws


def percentile_note(draws, value):
    """Say where a printed value lies among the draws (M,)."""
    percentile = 50.0 * (np.mean(draws < value) + np.mean(draws <= value))
    return f"the printed value is at percentile {percentile:.1f} of {draws.size} runs"


def enough_digits(numbers, keeps, digits=6):
    """Return numbers as text with `digits` significant digits, or with more where `keeps(text)` is not true of fewer."""
    for count in range(digits, 18):
        text = {name: f"{value:.{count}g}" for name, value in numbers.items()}
        if keeps(text):
            break
    return text


def shown(row):
    """The number of a row with four digits. Of what is only rounding the digits differ from one processor to the next, and even whether there are any: where a residual is
    judged it is "< 1e-9", elsewhere 0."""
    return short(row["ours"], "< 1e-9" if row["rule"] == "equation" or SMALL_BOUND.search(row["rule"]) else "0")


def short(text, tiny="0"):
    """A stored number with four digits, `tiny` for one below 1e-9, nothing for an empty cell."""
    if not text:
        return ""
    return tiny if abs(float(text)) < 1e-9 else number(float(text), trim=True)

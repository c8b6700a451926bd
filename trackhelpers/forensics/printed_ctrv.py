"""CTRV with those errors of the thesis's chapter 3 that one asks for, so that each can be judged apart."""

import numpy as np

from trackhelpers.motion import CTRV
from trackhelpers.published import thesis_chapter_3 as printed

ERRORS = ("3.8", "3.9", "3.10 columns", "3.10 factor", "3.11")


class PrintedCTRV(CTRV):
    """CTRV with some of its equations as the thesis prints them; (3.16), which is no covariance, is for the filters of `trackhelpers.forensics.program`.

    Parameters
    ----------
    sigma_a, sigma_w : float
        As for `CTRV`, m/s² and rad/s².
    errors : collection of str
        Which of `ERRORS` to make: ``"3.8"`` (it and its derivative evaluated as written, with no branch for ω = 0), ``"3.9"`` (second branch, read
        row by row), ``"3.10 columns"`` (exchanged in row 2), ``"3.10 factor"`` (the extra Δt), ``"3.11"`` (column 5 zero). All the rest is right.
    switch : float
        The branch for ω = 0 is taken where |ω| ≤ `switch`, rad/s; 0 in the thesis.
    """

    def __init__(self, sigma_a=0.0, sigma_w=0.0, errors=(), switch=0.0):
        if isinstance(errors, str) or not set(errors) <= set(ERRORS):
            raise ValueError(f"errors: expected a collection of some of {ERRORS}, got {errors!r}")
        if not switch >= 0:
            raise ValueError(f"switch: expected a turn rate ≥ 0 rad/s, got {switch!r}")
        super().__init__(sigma_a, sigma_w)
        self.errors, self.switch = frozenset(errors), switch

    def _f(self, x, dt, arc):
        rows = super()._f(x, dt, arc)
        if "3.8" in self.errors:
            with np.errstate(invalid="ignore", divide="ignore"):
                rows = printed.transition_38(_floats(x), dt)
        if "3.9" in self.errors:
            rows = np.where(np.abs(x[4]) <= self.switch, printed.transition_39_straight(_floats(x), dt), np.stack(rows))
        return rows

    def _F(self, x, dt, arc):
        entries = super()._F(x, dt, arc)
        straight = np.abs(x[4]) <= self.switch
        with np.errstate(invalid="ignore", divide="ignore"):
            if "3.8" in self.errors:
                quotients = printed.jacobian_310_repaired(_floats(x), dt)
                entries = {place: quotients[place] for place in entries}
            for error, places in (("3.10 columns", [(1, 2), (1, 3)]), ("3.10 factor", [(0, 4), (1, 4)])):
                if error in self.errors:
                    J = printed.jacobian_310(_floats(x), dt)
                    entries |= {place: np.where(straight, entries[place], J[place]) for place in places}
        if "3.11" in self.errors:
            entries |= {place: np.where(straight, 0.0, entries[place]) for place in [(0, 4), (1, 4)]}
        return entries


def _floats(x):
    """The state as the printed formulas take it, where a hook has it as plain numbers."""
    return x.astype(float) if isinstance(x, np.ndarray) else x

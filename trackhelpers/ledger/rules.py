"""The rules by which a number is judged: half a unit of the last digit, a residual of 1e-9, an inequality."""

import re

__all__ = ["EQUATION_TOLERANCE", "agrees", "conditions", "holds", "holds_on", "satisfiable"]

EQUATION_TOLERANCE = 1e-9
ROUNDING = 1e-9  # relative: two floats that differ by less are one number

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_ONE_SIDED = re.compile(rf"\s*(<=|>=|<|>|==)\s*({_NUMBER})\s*")
_BETWEEN = re.compile(rf"\s*in\s*([\[(])\s*({_NUMBER})\s*,\s*({_NUMBER})\s*([\])])\s*")


def conditions(text):
    """Return an inequality (``"> 0"``, ``"<= 1"``, ``"== 6"``, ``"in [0, 1)"``) as a list of (relation, bound), all of which must hold, or None when `text` is none."""
    if match := _ONE_SIDED.fullmatch(text):
        relations = (">=", "<=") if match[1] == "==" else (match[1],)
        return [(relation, float(match[2])) for relation in relations]
    if match := _BETWEEN.fullmatch(text):
        return [(">=" if match[1] == "[" else ">", float(match[2])), ("<=" if match[4] == "]" else "<", float(match[3]))]
    return None


def satisfiable(text):
    """Return whether some number satisfies the inequality `text`, and its bounds are finite; not so of what is no inequality."""
    bounds = conditions(text) if isinstance(text, str) else None
    if not bounds or not all(abs(bound) < float("inf") for _, bound in bounds):
        return False
    (first, low), (last, high) = bounds[0], bounds[-1]
    return len(bounds) == 1 or low < high or (low == high and (first, last) == (">=", "<="))


def holds(value, relation, bound):
    """Return whether ``value relation bound``; what may be equal may differ by rounding."""
    if relation in ("<", ">"):
        return value < bound if relation == "<" else value > bound
    slack = ROUNDING * abs(bound)
    return value >= bound - slack if relation == ">=" else value <= bound + slack


def holds_on(bounds, low, high):
    """Return True when `conditions` hold on the whole of [low, high], False when they fail on the whole of it, None otherwise."""
    if all(holds(value, *condition) for value in (low, high) for condition in bounds):
        return True
    # The numbers that satisfy them are one stretch, so an interval that misses it lies on one side, and one condition fails at both ends.
    return False if any(not holds(low, *condition) and not holds(high, *condition) for condition in bounds) else None


def agrees(ours, paper, tolerance):
    """Return whether two numbers differ by at most `tolerance`, up to rounding."""
    return abs(ours - paper) <= tolerance + ROUNDING * abs(paper)

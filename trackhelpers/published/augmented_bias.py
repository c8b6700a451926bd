"""Equations (1) to (31) of paper 3: what our copy kept of each, and how we read it."""

from pathlib import Path

import pandas as pd

__all__ = ["equations"]

_FILE = Path(__file__).parent / "augmented_bias_equations.csv"


def equations():
    """Return all 31 equations, by number: columns ``fragment`` (as it stands in our copy) and ``reading`` (ours, as plain text without hats and tildes)."""
    return pd.read_csv(_FILE, comment="#", dtype={"fragment": str, "reading": str}).set_index("number")

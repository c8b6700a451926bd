"""The ledger: what each notebook found of its paper, a row for every cell, equation, figure and claim."""

from .files import COLUMNS, KINDS, VERDICTS, compare, read_ledger, summary, summary_markdown
from .page import folded
from .rows import Ledger, bears_out, shown

__all__ = [
    "COLUMNS",
    "KINDS",
    "VERDICTS",
    "Ledger",
    "bears_out",
    "compare",
    "folded",
    "read_ledger",
    "shown",
    "summary",
    "summary_markdown",
]

"""The ledger: what is asked of each paper and what each notebook found, a row for every cell, equation, figure and claim."""

from .answers import Ledger
from .files import KINDS, VERDICTS, compare, summary, summary_markdown
from .numbers import shown
from .questions import Question, questions_of, read_questions
from .reading import read_ledger
from .verdicts import MARKS, Found, verdict

__all__ = [
    "KINDS",
    "MARKS",
    "VERDICTS",
    "Found",
    "Ledger",
    "Question",
    "compare",
    "questions_of",
    "read_ledger",
    "read_questions",
    "shown",
    "summary",
    "summary_markdown",
    "verdict",
]

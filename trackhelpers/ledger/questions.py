"""The questions of a notebook: what is asked of the paper, and by which rule it will be judged, written before the answer is known."""

import math
import os
import re
import tomllib
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import pandas as pd

from ..published import last_digit, published
from .files import KINDS, VERDICTS, committed_folder
from .rules import EQUATION_TOLERANCE, conditions, satisfiable

__all__ = ["Question", "questions_folder", "questions_of", "read_questions"]

REQUIRED = {"kind", "where", "asks", "rule", "set"}
OPTIONAL = {"printed", "tolerance", "assumption", "known_before", "note", "changed", "withdrawn"}
TEXTS = ("where", "asks", "rule", "assumption", "known_before", "note")
RULES = ("cell", "random cell", "equation", "beyond", "lost")  # or an inequality
NOTHING = "nothing"  # what a change turned, and what stood there before, where there was no verdict yet


@dataclass(frozen=True)
class Question:
    """One question, as its table in the TOML file states it; fields that are left out there are empty."""

    notebook: str  # 1_thesis/2_kalman_filter
    id: str
    kind: str
    where: str
    asks: str
    rule: str
    set: date
    printed: str = ""
    source: dict | None = None  # table, row and column, where `printed` was looked up in `published`
    tolerance: float | None = None
    assumption: str = ""
    known_before: str = ""
    note: str = ""
    changed: tuple = ()
    withdrawn: dict | None = None

    @property
    def value(self):
        """The printed number."""
        return float(self.printed.replace("−", "-"))

    @property
    def allowed(self):
        """How far from the printed number, or from 0 for a residual, ours may lie; None for other rules."""
        if self.rule == "equation":
            return EQUATION_TOLERANCE
        if self.rule == "cell":
            return last_digit(self.printed) if self.tolerance is None else self.tolerance
        return None

    @property
    def paper(self):
        """What the ledger shows of the paper: the printed text, else the inequality."""
        return self.printed or ("" if self.rule in RULES else self.rule)

    @property
    def changes(self):
        """The changes of the question, a line of text each."""
        return [f"{c['on']}: was {c['was']!r}, {c['because']}; turned {c['turned']}" for c in self.changed]


def questions_folder():
    """Return the folder of the questions: ``TRACKHELPERS_QUESTIONS`` where that is set, else ``notebooks/questions`` of the repository."""
    folder = os.environ.get("TRACKHELPERS_QUESTIONS")
    return Path(folder) if folder else committed_folder().parent / "questions"


def questions_of(paper, notebook, folder=None):
    """Return the questions of one notebook, id -> `Question` in the order of the file, or None where it has no file.

    Raises
    ------
    ValueError
        For a file that is not as `read_questions` wants it.
    """
    if folder is None:
        try:
            folder = questions_folder()
        except FileNotFoundError:  # installed without the notebooks
            return None
    path = Path(folder) / f"{paper}__{notebook}.toml"
    return _read(path) if path.exists() else None


def read_questions(folder=None):
    """Return all questions, withdrawn ones too: notebook (``1_thesis/2_kalman_filter``) -> id -> `Question`.

    Raises
    ------
    ValueError
        That names file, id and field, for a field that is unknown or missing, a rule that is none or that no number can satisfy, a printed cell that does not exist, an id that is
        not in kebab-case or used twice.
    """
    folder = questions_folder() if folder is None else Path(folder)
    return {path.stem.replace("__", "/", 1): _read(path) for path in sorted(folder.glob("*.toml"))}


def _read(path):
    if "__" not in path.stem:
        raise ValueError(f"{path.name}: expected a name such as <paper>__<notebook>.toml")
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path.name} is not TOML, or has an id twice: {error}") from None
    if not tables:
        raise ValueError(f"{path.name} asks nothing, expected at least one question")
    questions = [question for name, table in tables.items() for question in _expanded(path, name, table)]
    twice = {question.id for question in questions if [other.id for other in questions].count(question.id) > 1}
    if twice:
        raise ValueError(f"{path.name} has the ids {sorted(twice)} twice, once from cells")
    return {question.id: question for question in questions}


def _expanded(path, name, table):
    """Yield the questions of one table of the file: one, or with ``cells`` one a printed cell, which share every other field."""
    if not isinstance(table, dict) or "cells" not in table:
        yield _question(path, name, table)
        return
    cells, printed, shared = table["cells"], table.get("printed"), {field: value for field, value in table.items() if field != "cells"}
    if not isinstance(cells, dict) or not all(isinstance(place, list) and len(place) == 2 for place in cells.values()):
        raise ValueError(f"{path.name}: {name}: cells is {cells!r}, expected {{ end of the id = [row, column], … }}")
    if not isinstance(printed, dict) or set(printed) != {"table"}:
        raise ValueError(f"{path.name}: {name}: printed is {printed!r}, expected {{ table = … }} beside cells")
    for end, (row, column) in cells.items():
        label = f"row {row + 1}" if isinstance(row, int) else row
        own = {"printed": printed | {"row": row, "column": column}, "where": f"{table.get('where', '')}, {label}, {column}"}
        yield _question(path, f"{name}-{end}", shared | own)


def _question(path, id, table):
    def fail(field, expected):
        given = f" is {table[field]!r}" if field in table else ""
        raise ValueError(f"{path.name}: {id}: {field}{given}, expected {expected}")

    if not isinstance(table, dict):
        raise ValueError(f"{path.name}: {id} is {table!r}, expected a table [{id}] of fields")
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", id):
        fail("id", "lower-case words and numbers joined by hyphens, a letter first")
    for field in sorted(set(table) - REQUIRED - OPTIONAL):
        fail(field, f"no such field, only {', '.join(sorted(REQUIRED | OPTIONAL))}")
    for field in sorted(REQUIRED - set(table)):
        fail(field, "this field to be there")
    for field in TEXTS:
        if field in table and not _is_line(table[field]):
            fail(field, "one line of text")
    if table["kind"] not in KINDS:
        fail("kind", f"one of {', '.join(KINDS)}")
    if type(table["set"]) is not date:
        fail("set", "a date such as 2026-11-22")
    source = table.get("printed") if isinstance(table.get("printed"), dict) else None
    printed = _printed(source, fail) if source else table.get("printed", "")
    if not source and "printed" in table and not _is_line(printed):
        fail("printed", "the printed text, or { table = …, row = …, column = … }")
    _check_rule(table, printed, fail)
    changed = table.get("changed", [])
    if not isinstance(changed, list):
        fail("changed", "a list of { on, was, because, turned }")
    for entry in changed:
        _check_entry(entry, ("was", "because"), "turned", table, lambda text: fail("changed", text))
    if "withdrawn" in table:
        _check_entry(table["withdrawn"], ("why",), "verdict", table, lambda text: fail("withdrawn", text))
    fields = table | {"printed": printed, "source": source, "changed": tuple(changed)}
    return Question(notebook=path.stem.replace("__", "/", 1), id=id, **fields)


def _check_rule(table, printed, fail):
    rule = table["rule"]
    if rule not in RULES:
        if conditions(rule) is None:
            fail("rule", f"one of {', '.join(RULES)}, or an inequality such as '> 0', '<= 1', '== 6' or 'in [0, 1)'")
        if not satisfiable(rule):
            fail("rule", "an inequality with finite bounds that some number satisfies")
    if rule in ("cell", "random cell"):
        try:
            last_digit(printed)
        except ValueError:
            fail("printed", f"a printed number, for the rule is {rule!r}")
    if "tolerance" in table:
        tolerance = table["tolerance"]
        if rule != "cell" or isinstance(tolerance, bool) or not isinstance(tolerance, int | float) or not 0 < tolerance < math.inf:
            fail("tolerance", "a positive number, with the rule 'cell'")
    if rule == "lost" and "note" not in table:
        fail("note", "what is missing, for the rule is 'lost'")
    for field in ("assumption", *(["printed"] if rule == "beyond" else [])):
        if rule in ("beyond", "lost") and field in table:
            fail(field, f"none, for the rule is {rule!r}")


def _check_entry(entry, texts, verdict, table, fail):
    """Check one entry of a question's history: a date, texts, and a verdict or "nothing"."""
    if not isinstance(entry, dict) or set(entry) != {"on", *texts, verdict}:
        fail(f"{{ {', '.join(('on', *texts, verdict))} }}")
    if type(entry["on"]) is not date or entry["on"] < table["set"]:
        fail("'on' to be a date, not before 'set'")
    if not all(_is_line(entry[name]) for name in texts):
        fail(f"{' and '.join(texts)} to be one line of text")
    if entry[verdict] not in (*VERDICTS, NOTHING):
        fail(f"{verdict!r} to be a verdict or {NOTHING!r}")


def _printed(source, fail):
    """Return the cell of a published table that ``{table = "thesis 9", row = "vx", column = "max"}`` names; rows without labels are counted from 0."""
    if set(source) != {"table", "row", "column"} or not isinstance(source["table"], str):
        fail("printed", "{ table, row, column }")
    paper, _, count = source["table"].rpartition(" ")
    try:
        frame = published(paper, int(count))
    except ValueError as error:
        fail("printed", f"a table that exists ({error})")
    row, column = source["row"], source["column"]
    counted = isinstance(frame.index, pd.RangeIndex)
    if type(row) is not (int if counted else str) or row not in frame.index or column not in frame.columns:
        fail("printed", f"a row out of {list(frame.index)} and a column out of {list(frame.columns)}")
    cell = frame.loc[row, column]
    if not _is_line(cell):
        fail("printed", "a cell that is not empty")
    return cell


def _is_line(text):
    return isinstance(text, str) and bool(text.strip()) and "\n" not in text

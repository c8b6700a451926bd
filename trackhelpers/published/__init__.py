"""The tables of the four papers, every cell as it was printed.

Each table is a CSV file beside this module. Lines that start with a hash hold what is not a cell: the caption, the printed headings and
row labels, translations, and a note where the source needs one.
"""

import csv
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
import pandas as pd

__all__ = ["PAPERS", "last_digit", "published", "tables_of"]

PAPERS = ("thesis", "track_fusion", "augmented_bias", "space_tdoa")
_FOLDER = Path(__file__).parent


def tables_of(paper):
    """Return the numbers of the tables that a paper prints, as a tuple of int, empty where it prints none.

    Raises
    ------
    ValueError
        For a paper that is none of `PAPERS`.
    """
    if not isinstance(paper, str) or paper not in PAPERS:
        raise ValueError(f"paper is {paper!r}, expected one of {', '.join(PAPERS)}; {_what_exists()}")
    return tuple(sorted(int(path.stem.rpartition("table")[2]) for path in _FOLDER.glob(f"{paper}_table*.csv")))


def published(paper, table, numeric=False):
    """Return a printed table.

    Parameters
    ----------
    paper : {"thesis", "track_fusion", "augmented_bias", "space_tdoa"}
    table : int
        The number printed above the table.
    numeric : bool
        Give floats in place of the printed strings.

    Returns
    -------
    pandas.DataFrame
        Strings as printed; only blanks inside a number, which the scan put there, are closed. ``attrs`` holds ``paper``, ``table``,
        ``caption``, ``printed_caption``, ``headings`` (column -> printed heading), ``rows`` (row label -> printed label), ``english``
        (printed words -> translation) and ``note``.

    Raises
    ------
    ValueError
        For an unknown paper, a table that the paper does not have, or `numeric` for a table of words. The message lists what exists.
    """
    known = tables_of(paper)
    table = table if isinstance(table, (int, np.integer)) and not isinstance(table, (bool, np.timedelta64)) else repr(table)
    if table not in known:
        gap = "the thesis numbers no table 6, it goes from 5 to 7; " if (paper, table) == ("thesis", 6) else ""
        raise ValueError(f"table {table} of {paper} does not exist, expected one that does; {gap}{_what_exists()}")
    meta, cells = _read(_FOLDER / f"{paper}_table{int(table)}.csv")
    frame = pd.DataFrame(cells[1:], columns=cells[0], dtype=str)
    if "index" in meta:
        frame = frame.set_index(meta.pop("index"))
    if numeric:
        try:
            frame = frame.astype(float)
        except ValueError as error:
            raise ValueError(f"numeric=True, but table {table} of {paper} holds words ({error})") from None
    frame.attrs = {"paper": paper, "table": int(table), **meta}
    return frame


def last_digit(text):
    """Return half a unit of the last printed digit: 0.005 for ``"5.27E+00"``, 5e-7 for ``"0.089057"``.

    Two numbers that differ by no more than this may both have been printed as `text`.

    Raises
    ------
    ValueError
        When `text` is not a finite number written as a string.
    """
    try:
        exponent = Decimal(text.strip().replace("−", "-")).as_tuple().exponent
    except (AttributeError, InvalidOperation):
        exponent = None
    if not isinstance(exponent, int):  # Decimal gives "n" or "F" for nan and infinity
        raise ValueError(f"text is {text!r}, expected a finite number as it was printed, for example '5.27E+00'")
    return float(Decimal(5).scaleb(exponent - 1))


def _what_exists():
    listed = (f"{paper}: {', '.join(map(str, tables_of(paper))) or 'none'}" for paper in PAPERS)
    return "the tables that exist are " + "; ".join(listed)


def _read(path):
    """Return the metadata as a dict and the cells as a list of rows, the column names first."""
    meta = {"caption": "", "printed_caption": "", "headings": {}, "rows": {}, "english": {}, "note": ""}
    groups = {"heading": "headings", "row": "rows", "english": "english"}
    lines = path.read_text(encoding="utf-8").splitlines()
    for line in lines:
        if line.startswith("# "):
            key, _, value = line[2:].partition(": ")
            first, _, name = key.partition(" ")
            if first in groups:
                meta[groups[first]][name] = value
            else:
                meta[key.replace(" ", "_")] = value
    return meta, list(csv.reader(line for line in lines if not line.startswith("# ")))

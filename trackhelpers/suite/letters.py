"""The page of symbols: the papers' letters, their names in the code and in filterpy, units, Chinese terms, from ``book/symbols.csv``."""

import csv

from trackhelpers.suite import ROOT

__all__ = ["COLUMNS", "FILE", "read_symbols", "symbols_page"]

FILE = ROOT / "book" / "symbols.csv"
COLUMNS = ["group", "papers", "symbol", "meaning", "unit", "code", "filterpy", "chinese"]


def read_symbols(file=FILE):
    """Return the rows of the table, each a dict of `COLUMNS`; ``code`` and ``filterpy`` as tuples of names.

    Raises
    ------
    ValueError
        For other columns, or a row without group, papers, symbol or meaning; it names file and line.
    """
    with open(file, encoding="utf-8", newline="") as lines:
        reader = csv.DictReader(lines)
        if reader.fieldnames != COLUMNS:
            raise ValueError(f"{file} has the columns {reader.fieldnames}, expected {COLUMNS}")
        rows = list(reader)
    for line, row in enumerate(rows, start=2):
        empty = [name for name in ("group", "papers", "symbol", "meaning") if not row[name]]
        if None in row or None in row.values() or empty:
            raise ValueError(f"{file}, line {line}: expected {len(COLUMNS)} cells, none of {', '.join(COLUMNS[:4])} empty")
        for name in ("code", "filterpy"):
            row[name] = tuple(part.strip() for part in row[name].split(";") if part.strip())
    return rows


def symbols_page(rows=None):
    """Return the page, as Markdown: a table for each group, in the order of the file."""
    rows = read_symbols() if rows is None else rows
    lines = [
        "# Symbols",
        "",
        "The papers' letters and what they are called here. One letter may stand for several things: the papers that use it so are named. "
        "Every name in the two columns of code is looked up on a real object by a test; where filterpy has no name of its own the column is empty.",
    ]
    for group in dict.fromkeys(row["group"] for row in rows):
        lines += [
            "",
            f"## {group}",
            "",
            "| symbol | meaning (unit) | in the code | in filterpy | in Chinese | papers |",
            "|" + " --- |" * 6,
        ]
        for row in rows:
            if row["group"] == group:
                code, filterpy = (", ".join(f"`{name}`" for name in row[column]) for column in ("code", "filterpy"))
                meaning = row["meaning"] + (f" ({row['unit']})" if row["unit"] else "")
                lines.append(f"| {row['symbol']} | {meaning} | {code} | {filterpy} | {row['chinese']} | {row['papers']} |")
    return "\n".join(lines) + "\n"

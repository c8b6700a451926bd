"""The ledger's files: where they lie, how they are written, counted and compared."""

import os
from pathlib import Path

import pandas as pd

from ..checks import check_scale
from ..whole import write_whole

__all__ = [
    "ANSWER_COLUMNS",
    "KINDS",
    "VERDICTS",
    "committed_folder",
    "compare",
    "read_csv",
    "results_folder",
    "summary",
    "summary_markdown",
    "write_csv",
]

ANSWER_COLUMNS = ["id", "ours", "low", "high", "verdict", "note"]  # the rest is in the file of questions
KINDS = ("table", "equation", "figure", "claim")
VERDICTS = (
    "reproduced",
    "reproduced under an assumption",
    "not reproduced",
    "paper in error",
    "misprint",
    "undecided",
    "not checkable",
    "beyond the paper",
)
NUMBERS = ["ours", "low", "high"]


def committed_folder():
    """Return ``notebooks/results`` of the repository: the one that holds this package, else the working directory's or a parent's.

    Raises
    ------
    FileNotFoundError
        When none of them has a folder ``notebooks``.
    """
    here = Path.cwd()
    for root in (Path(__file__).resolve().parents[2], here, *here.parents):
        if (root / "notebooks").is_dir():
            return root / "notebooks" / "results"
    raise FileNotFoundError(
        f"no folder 'notebooks' beside the package or above {here}; set TRACKHELPERS_RESULTS to a folder for the ledger"
    )


def results_folder():
    """Return the folder that notebooks write to: ``TRACKHELPERS_RESULTS``, which the suite's runner sets, else ``build/results`` beside the notebooks.

    Who runs a notebook by hand, to play with it, does not change the committed ledger.
    """
    folder = os.environ.get("TRACKHELPERS_RESULTS")
    return Path(folder) if folder else committed_folder().parents[1] / "build" / "results"


def write_csv(frame, path):
    """Write a frame of strings to `path` in one step, so that a reader never meets half a file."""
    write_whole(path, frame.to_csv(index=False, lineterminator="\n"))


def read_csv(path):
    """Return a file of a ledger as text."""
    frame = pd.read_csv(path, dtype=str, keep_default_na=False, encoding="utf-8")
    if list(frame.columns) != ANSWER_COLUMNS:
        raise ValueError(f"{path.name} has the columns {list(frame.columns)}, expected {ANSWER_COLUMNS}")
    return frame


def summary(ledger):
    """Return the number of rows by notebook (rows) and verdict (columns, the last one ``total``) of a ledger as `read_ledger` gives it; ValueError for another table."""
    if not isinstance(ledger, pd.DataFrame) or not {"notebook", "verdict"} <= set(ledger.columns):
        raise ValueError(f"ledger is {ledger!r}, expected a table as read_ledger gives it")
    counts = pd.crosstab(ledger["notebook"], ledger["verdict"])
    unknown = set(counts.columns) - set(VERDICTS)
    if unknown:
        raise ValueError(f"ledger has the verdicts {sorted(unknown)}, expected some of {VERDICTS}")
    counts = counts.reindex(columns=list(VERDICTS), fill_value=0)
    counts.columns.name = None
    counts["total"] = counts.sum(axis=1)
    return counts


def summary_markdown(ledger):
    """Return `summary` by paper as a Markdown table, with a last line of sums."""
    counts = summary(ledger)
    counts = counts.groupby(counts.index.str.split("/").str[0]).sum()
    counts.loc["together"] = counts.sum()
    lines = [["paper", *counts.columns], ["---", *["---:"] * len(counts.columns)]]
    lines += [[name, *(str(count) for count in row)] for name, row in zip(counts.index, counts.to_numpy(), strict=True)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def compare(folder_a, folder_b, exclude=(), rtol=2e-5, atol=1e-9):
    """Return the differences between two folders of ledger files, a line of text each.

    Numbers differ when ``|a − b| > atol + rtol·|a|``; `rtol` forgives a flip of the sixth digit that is stored, `atol` lets the residuals of equations be what rounding makes them. Other columns are
    compared as text.

    Parameters
    ----------
    folder_a, folder_b : path
    exclude : collection of str
        Notebooks, written ``1_thesis/4_3_public_log``, that may be missing in either folder.
    """
    rtol, atol = check_scale(rtol, "rtol"), check_scale(atol, "atol")
    files = [{path.name: path for path in Path(folder).glob("*__*.csv")} for folder in (folder_a, folder_b)]
    differences = []
    for name in sorted(files[0] | files[1]):
        notebook = name.removesuffix(".csv").replace("__", "/", 1)
        missing = [str(folder) for folder, found in zip((folder_a, folder_b), files, strict=True) if name not in found]
        if missing:
            if notebook not in exclude:
                differences.append(f"{notebook}: missing in {missing[0]}")
            continue
        a, b = (read_csv(found[name]).set_index("id", drop=False) for found in files)
        if list(a.index) != list(b.index):
            only = [f"{sorted(set(x.index) - set(y.index))} only in {folder}" for x, y, folder in ((a, b, folder_a), (b, a, folder_b))]
            differences.append(f"{notebook}: rows differ: {', '.join(only)}, or their order")
            continue
        for id in a.index:
            for column in a.columns:
                one, other = a.at[id, column], b.at[id, column]
                if not _same(one, other, column in NUMBERS, rtol, atol):
                    differences.append(f"{notebook}: {id}: {column}: {one!r} against {other!r}")
    return differences


def _same(one, other, is_number, rtol, atol):
    if one == other or not (is_number and one and other):
        return one == other
    return abs(float(one) - float(other)) <= atol + rtol * abs(float(one))

"""The whole ledger, read: answers joined with their questions."""

from pathlib import Path

import pandas as pd

from .files import committed_folder, read_csv
from .questions import questions_of

__all__ = ["COLUMNS", "read_ledger"]

COLUMNS = [
    "id",
    "kind",
    "where",
    "quantity",
    "paper",
    "ours",
    "low",
    "high",
    "tolerance",
    "verdict",
    "note",
    "rule",
    "known_before",
    "set",
    "changed",
]


def read_ledger(folder=None, questions=None):
    """Return all rows of a folder of ledger files, the committed one by default, as text and as stored.

    The column ``notebook`` comes first: ``1_thesis/2_kalman_filter``. The rows are in the order of the notebooks, each answer joined with its question:
    ``quantity`` is what is asked, ``paper`` what is printed or else the inequality, ``note`` the assumption, then what the answer says, then the question's own note.

    Parameters
    ----------
    folder, questions : path, optional
        Folders of the CSV files and of the questions.

    Raises
    ------
    ValueError
        When the folder holds no ledger, a file in it has other columns, or an answer has no question.
    """
    folder = committed_folder() if folder is None else Path(folder)
    paths = sorted(folder.glob("*__*.csv"))
    if not paths:
        raise ValueError(f"folder {folder} holds no ledger file, expected <paper>__<notebook>.csv")
    frames = []
    for path in paths:
        frame = _joined(read_csv(path), path, questions)[COLUMNS]
        frame.insert(0, "notebook", path.stem.replace("__", "/", 1))
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def _joined(answers, path, folder):
    asked = questions_of(*path.stem.split("__", 1), folder) or {}
    unasked = [id for id in answers["id"] if id not in asked or asked[id].withdrawn]
    if unasked:
        raise ValueError(f"{path.name} answers {unasked}, which {path.stem}.toml does not ask")
    return pd.DataFrame([_row(asked[answer["id"]], answer) for answer in answers.to_dict("records")])


def _row(question, answer):
    texts = {
        "kind": question.kind,
        "where": question.where,
        "quantity": question.asks,
        "paper": question.paper,
        "tolerance": "" if question.allowed is None else f"{question.allowed:.6g}",
        "note": "; ".join(filter(None, [question.assumption, answer["note"], question.note])),
        "rule": question.rule,
        "known_before": question.known_before,
        "set": str(question.set),
        "changed": " | ".join(question.changes),
    }
    return answer | texts

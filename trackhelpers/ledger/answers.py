"""The ledger of a notebook, as the notebook uses it."""

import re

import pandas as pd

from ..tables import Table
from .files import ANSWER_COLUMNS, VERDICTS, results_folder, write_csv
from .questions import questions_of
from .verdicts import stored

__all__ = ["Ledger"]


class Counts(Table):
    """How many rows have which verdict, with a link to the notebook's page of rows; shown as Markdown, so that the book finds the page."""

    _repr_html_ = None

    def __init__(self, verdicts, name):
        found = verdicts.value_counts().reindex(VERDICTS).dropna().astype(int)
        super().__init__(found.to_frame("rows"), caption=f"Ledger of {name.replace('__', '/', 1)}, {len(verdicts)} rows")
        self.link = f"../results/{name}.md"

    def _repr_markdown_(self):
        lines = ["| verdict | rows |", "| --- | ---: |", *(f"| {verdict} | {count} |" for verdict, count in self.frame["rows"].items())]
        return "\n".join([f"{self.caption}", "", *lines, "", f"[Every row: question, rule, number, history]({self.link})"])


class Ledger:
    """What one notebook found.

    It answers the questions of ``notebooks/questions/<paper>__<notebook>.toml``: `answer`, then `write`.

    Parameters
    ----------
    paper, notebook : str
        The folder and the name of the notebook, such as ``"1_thesis"`` and ``"2_kalman_filter"``.

    Raises
    ------
    ValueError
        For names that are none, and a notebook without a file of questions.
    """

    def __init__(self, paper, notebook):
        for name, text in (("paper", paper), ("notebook", notebook)):
            if not isinstance(text, str) or not re.fullmatch(r"[a-z0-9]+(_[a-z0-9]+)*", text):
                raise ValueError(f"{name} is {text!r}, expected lower-case words joined by single underscores")
        self.name, self.questions, self.answers = f"{paper}__{notebook}", questions_of(paper, notebook), {}
        if self.questions is None:
            raise ValueError(f"{self.name} has no file of questions, expected notebooks/questions/{self.name}.toml")

    def answer(self, answers):
        """Answer questions; a call that is refused answers none of them.

        Parameters
        ----------
        answers : dict
            Id -> number, (ours, low, high), draws (M,) with M ≥ 40, or `Found`; `verdict` tells which rule takes what.

        Raises
        ------
        ValueError
            For an id that is not asked, is withdrawn or was answered before, and for an answer that `verdict` refuses.
        """
        if not isinstance(answers, dict):
            raise ValueError(f"answers is {answers!r}, expected a dict of id -> answer")
        rows = {}
        for id, answer in answers.items():
            if id not in self.questions:
                raise ValueError(f"id {id!r} is not asked in {self.name}.toml, expected one of {list(self.questions)}")
            if id in self.answers:
                raise ValueError(f"id {id!r} was answered before, expected one answer")
            rows[id] = stored(self.questions[id], answer)
        self.answers |= rows

    def write(self):
        """Write the ledger to ``<paper>__<notebook>.csv`` in the results folder (``TRACKHELPERS_RESULTS``, else ``build/results``) and return the table to show.

        Raises
        ------
        ValueError
            While a question is not answered.
        """
        asked = {id: question for id, question in self.questions.items() if not question.withdrawn}
        missing = [id for id, question in asked.items() if question.rule != "lost" and id not in self.answers]
        if missing:
            raise ValueError(f"{self.name}.toml asks {missing}, expected an answer to each")
        rows = [self.answers.get(id) or stored(question) for id, question in asked.items()]
        frame = pd.DataFrame(rows, columns=ANSWER_COLUMNS, dtype=str)
        write_csv(frame, results_folder() / f"{self.name}.csv")
        return Counts(frame["verdict"], self.name)

"""The ledger of a notebook, as the notebook uses it."""

import pandas as pd

from ..tables import Table
from .files import ANSWER_COLUMNS, VERDICTS, results_folder, write_csv
from .questions import questions_of
from .rows import Rows
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


class Ledger(Rows):
    """What one notebook found.

    Where ``notebooks/questions/<paper>__<notebook>.toml`` exists, the notebook answers its questions: `answer`, then `write`. Without that file it adds rows (`Rows`).

    Parameters
    ----------
    paper, notebook : str
        The folder and the name of the notebook, such as ``"1_thesis"`` and ``"2_kalman_filter"``.
    """

    def __init__(self, paper, notebook):
        super().__init__(paper, notebook)
        self.questions = questions_of(paper, notebook)
        self.answers = {}

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
        name = f"{self.paper}__{self.notebook}"
        if self.questions is None:
            raise ValueError(f"{name} has no file of questions, expected notebooks/questions/{name}.toml, or rows by cell, claim and so on")
        rows = {}
        for id, answer in answers.items():
            if id not in self.questions:
                raise ValueError(f"id {id!r} is not asked in {name}.toml, expected one of {list(self.questions)}")
            if id in self.answers:
                raise ValueError(f"id {id!r} was answered before, expected one answer")
            rows[id] = stored(self.questions[id], answer)
        self.answers |= rows

    def write(self):
        """Write the ledger to ``<paper>__<notebook>.csv`` in the results folder (``TRACKHELPERS_RESULTS``, else ``build/results``) and return the table to show.

        Raises
        ------
        ValueError
            While a question is not answered, or a ledger without questions has no rows.
        """
        if self.questions is None:
            return super().write()
        asked = {id: question for id, question in self.questions.items() if not question.withdrawn}
        missing = [id for id, question in asked.items() if question.rule != "lost" and id not in self.answers]
        name = f"{self.paper}__{self.notebook}"
        if missing:
            raise ValueError(f"{name}.toml asks {missing}, expected an answer to each")
        rows = [self.answers.get(id) or stored(question) for id, question in asked.items()]
        frame = pd.DataFrame(rows, columns=ANSWER_COLUMNS, dtype=str)
        write_csv(frame, results_folder() / f"{name}.csv")
        return Counts(frame["verdict"], name)

    def _add(self, *row):
        if self.questions is not None:
            raise ValueError(f"{self.paper}__{self.notebook} has a file of questions, expected answers to them: ledger.answer({{id: …}})")
        return super()._add(*row)

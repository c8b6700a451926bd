"""A notebook's page of rows: each question with its rule, its answer, and what became of it, as Markdown with an anchor a row."""

import re

from .numbers import short, shown
from .verdicts import MARKS

__all__ = ["links", "marked", "record"]

_LINK = re.compile(r"\[([^\]\[]*)\](\((?:\.\./|notebooks/)?results/([a-z0-9_]+?)__([a-z0-9_]+)\.md#([^)\s]+?)(?: \"(ours|low|high)\")?\))")


def links(text):
    """Return the rows that a text links to, each once, as (notebook, id) in the order of the text."""
    return list(dict.fromkeys((f"{paper}/{name}", id) for _, _, paper, name, id, _ in _LINK.findall(text)))


def marked(text, asked, notebook):
    """Return Markdown with the text of each link to a row replaced by the mark of the row's verdict, or by its number.

    Parameters
    ----------
    text : str
        ``[?](../results/1_thesis__2_kalman_filter.md#gain)`` becomes ``[✓ reproduced](…)``, and ``[0.6](….md#gain "ours")`` our number with the decimals that stand there already
        (``"low"`` and ``"high"`` the ends of its interval, and what ends in % is a share); no other link is touched.
    asked : mapping
        Notebook (``1_thesis/2_kalman_filter``) -> id -> row of the ledger, a mapping, or None for a question not answered yet, whose link shows "?".
    notebook : str
        The notebook that holds the text, for the message.

    Raises
    ------
    ValueError
        For a link to a row that is not asked, or to a number that it does not have; it names notebook and id.
    """

    def mark(link):
        shown, target, paper, name, id, number = link.groups()
        rows = asked.get(f"{paper}/{name}", {})
        if id not in rows:
            raise ValueError(f"notebook {notebook} links to the row {id!r} of {paper}/{name}, expected one out of {list(rows)}")
        row = rows[id]
        if row is None:
            return f"[?]{target}"
        if number is None:
            return f"[{MARKS[row['verdict']]}]{target}"
        if not row[number]:
            raise ValueError(f"notebook {notebook} links to the number {number!r} of the row {id!r} of {paper}/{name}, which has none")
        return f"[{_as_shown(shown, float(row[number]))}]{target}"

    return _LINK.sub(mark, text)


def _as_shown(shown, value):
    """A value with the decimals of the text that stands there, or four digits where none does."""
    share = shown.endswith("%")
    if not re.search(r"\d", shown):
        return short(str(value))
    decimals = len(re.sub(r"[^\d.]", "", shown).partition(".")[2])
    text = f"{100 * value if share else value:.{decimals}f}".replace("-", "−")
    return text + (" %" if share else "")


def record(name, questions, rows):
    """Return the page of one notebook.

    Parameters
    ----------
    name : str
        The notebook, ``1_thesis/2_kalman_filter``.
    questions : dict of str -> Question
        All of its file, withdrawn ones too.
    rows : pandas.DataFrame
        The notebook's rows as `read_ledger` gives them.

    Returns
    -------
    str
        One section a question, headed by its id and with an explicit anchor; withdrawn ones are told at the end.
    """
    found = {row["id"]: row for row in rows.to_dict("records")}
    head = (
        f"# Rows of {name}\n\nWhat [the notebook](../{name}.ipynb) asked of its paper, by which rule, and what came out: {len(found)} rows."
    )
    parts = [head, *(_section(questions[id], row) for id, row in found.items())]
    parts += [_withdrawn(question) for question in questions.values() if question.withdrawn]
    return "\n\n".join(parts) + "\n"


def _section(question, row):
    ours = shown(row) + (f" [{short(row['low'])}, {short(row['high'])}]" if row["low"] else "")
    rule = question.rule if question.rule != "cell" else f"cell, to {row['tolerance']}"
    lines = [
        ("verdict", f"**{MARKS[row['verdict']]}**"),
        ("where", _plain(question.where)),
        ("printed", _plain(question.printed) + _place(question)),
        ("rule", _plain(rule)),
        ("ours", _plain(ours)),
        ("assumption, error, note", _plain(row["note"])),
        ("known before", _plain(question.known_before)),
        ("rule set", row["set"]),
        *(("changed", _plain(change)) for change in question.changes),
    ]
    return _head(question) + "\n".join(f"* {label}: {text}" for label, text in lines if text)


def _withdrawn(question):
    gone = question.withdrawn
    return (
        _head(question)
        + f"* withdrawn {gone['on']}: {_plain(gone['why'])}; the verdict was {gone['verdict']}\n* rule: {_plain(question.rule)}"
    )


def _head(question):
    return f'<a id="{question.id}"></a>\n\n## {question.id}\n\n{_plain(question.asks)}\n\n'


def _place(question):
    if not question.source:
        return ""
    return " (table {table}, row {row}, column {column})".format(**{name: _plain(str(part)) for name, part in question.source.items()})


def _plain(text):
    """Return text in which Markdown finds nothing to format; formulas between dollar signs stay."""
    pieces = re.split(r"(\$[^$]+\$)", text)
    return "".join(piece if i % 2 else re.sub(r"([\\`*_\[\]<>|~{}])", r"\\\1", piece).replace("$", "\\$") for i, piece in enumerate(pieces))

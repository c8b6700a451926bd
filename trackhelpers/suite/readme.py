"""The README's generated parts: the summary of the ledger between its two marks, the numbers that link to a row, and one figure taken from a notebook."""

import base64

import nbformat

from trackhelpers.ledger import read_ledger, read_questions, summary_markdown
from trackhelpers.ledger.record import marked
from trackhelpers.suite import NOTEBOOKS, ROOT, notebooks
from trackhelpers.suite.records import rows_of
from trackhelpers.whole import write_whole

FIGURE = ROOT / "book" / "readme.png"
START, END = "<!-- ledger:start -->", "<!-- ledger:end -->"
FIGURE_TAG = "readme-figure"


def tagged_figure(folder=NOTEBOOKS):
    """Bytes of the PNG that the one cell tagged ``readme-figure`` shows.

    Raises
    ------
    ValueError
        When not exactly one figure is tagged.
    """
    found = []
    for path in notebooks(folder):
        for cell in nbformat.read(path, as_version=4).cells:
            if FIGURE_TAG in cell.metadata.get("tags", []):
                found += [output.data["image/png"] for output in cell.outputs if "image/png" in output.get("data", {})]
    if len(found) != 1:
        raise ValueError(f"the tag {FIGURE_TAG!r} marks {len(found)} figures, expected exactly one")
    return base64.b64decode(found[0])


def with_summary(text, ledger):
    """Return a README's `text` with the summary of `ledger` between `START` and `END`.

    Raises
    ------
    ValueError
        When the marks are not there, once each and in this order.
    """
    before, _, rest = text.partition(START)
    _, end, after = rest.partition(END)
    if not end or START in rest or END in before + after:
        raise ValueError(f"text has no block from {START} to {END}, expected exactly one")
    return f"{before}{START}\n\n{summary_markdown(ledger)}\n{END}{after}"


def in_step(text, ledger, questions):
    """Return a README's `text` as the ledger has it: summary, marks and numbers."""
    return marked(with_summary(text, ledger), rows_of(ledger, questions), "README")


def write():
    """Bring README.md and its figure in step with what is committed."""
    readme = ROOT / "README.md"
    text, figure = in_step(readme.read_text(encoding="utf-8"), read_ledger(), read_questions()), tagged_figure()
    write_whole(readme, text)
    write_whole(FIGURE, figure)

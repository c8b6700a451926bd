"""Brings what is drawn from the ledger in step with it: the pages of rows, and the marks beside the statements of notebooks."""

from pathlib import Path

import nbformat

from trackhelpers.ledger import read_ledger, read_questions
from trackhelpers.ledger.record import marked, record
from trackhelpers.suite import NOTEBOOKS, form, notebooks
from trackhelpers.whole import write_whole


def records(ledger, questions):
    """Return the page of rows of each notebook that answers questions: name of the file -> text."""
    pages = {}
    for name, asked in questions.items():
        rows = ledger[ledger["notebook"] == name]
        if len(rows):
            pages[name.replace("/", "__") + ".md"] = record(name, asked, rows)
    return pages


def write_records(folder, ledger, questions):
    """Write the pages of rows into `folder`, and take away those of notebooks that are gone."""
    pages = records(ledger, questions)
    for old in set(Path(folder).glob("*__*.md")) - {Path(folder) / name for name in pages}:
        old.unlink()
    for name, text in pages.items():
        write_whole(Path(folder) / name, text)


def rows_of(ledger, questions):
    """Return notebook -> id -> row of all that is asked, None where it is not answered yet."""
    found = {(row["notebook"], row["id"]): row for row in ledger.to_dict("records")}
    return {
        name: {id: found.get((name, id)) for id, question in asked.items() if not question.withdrawn} for name, asked in questions.items()
    }


def mark(notebook, asked, name):
    """Fill the marks in a notebook's text, in place; return whether one changed. `asked` and the errors are those of `marked`."""
    new = [marked(cell.source, asked, name) if cell.cell_type == "markdown" else cell.source for cell in notebook.cells]
    changed = new != [cell.source for cell in notebook.cells]
    for cell, source in zip(notebook.cells, new, strict=True):
        cell.source = source
    return changed


def write(folder=NOTEBOOKS):
    """Bring pages and marks of all notebooks below `folder` in step with the ledger that is stored there."""
    folder = Path(folder)
    ledger, questions = read_ledger(folder / "results", folder / "questions"), read_questions(folder / "questions")
    write_records(folder / "results", ledger, questions)
    asked = rows_of(ledger, questions)
    for path in notebooks(folder):
        notebook = nbformat.read(path, as_version=4)
        if mark(notebook, asked, path.relative_to(folder).with_suffix("").as_posix()):
            form.write(notebook, path)

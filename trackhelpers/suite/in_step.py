"""Whether what is stored holds together: questions, answers, printed tables, pages, the text and outputs of notebooks. What was changed in one place shows in another."""

import re
from pathlib import Path

import nbformat

from trackhelpers.ledger import VERDICTS, read_ledger, read_questions, verdict
from trackhelpers.ledger.record import marked
from trackhelpers.published import PAPERS, published, tables_of
from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, notebooks
from trackhelpers.suite.records import records, rows_of

__all__ = ["faults"]

_COUNT = re.compile(rf"^\| ({'|'.join(VERDICTS)}) \| (\d+) \|$", re.MULTILINE)


def faults(folder=NOTEBOOKS):
    """Return what does not hold together below a folder of notebooks with its ``questions`` and ``results``, a line of text each, which names notebook and row."""
    folder = Path(folder)
    try:
        questions, ledger = read_questions(folder / "questions"), read_ledger(folder / "results", folder / "questions")
    except ValueError as error:
        return [str(error)]
    asked = rows_of(ledger, questions)
    found = [line for name in questions for line in _answers(name, questions[name], ledger[ledger["notebook"] == name])]
    found += [line for name in questions for line in _printed(name, questions[name])]
    pages = records(ledger, questions)
    stored = {path.name: path.read_text(encoding="utf-8") for path in (folder / "results").glob("*.md")}
    found += [
        f"{page}: not in step with the ledger" for page in sorted(pages.keys() | stored.keys()) if pages.get(page) != stored.get(page)
    ]
    for path in notebooks(folder):
        name, notebook = path.relative_to(folder).with_suffix("").as_posix(), nbformat.read(path, as_version=4)
        try:
            found += [
                f"{name}: {line}" for cell in notebook.cells if cell.cell_type == "markdown" for line in _text(cell.source, asked, name)
            ]
        except ValueError as error:
            found.append(str(error))
        if path.name != FIRST_PAGE:
            found += _counts(name, notebook, ledger[ledger["notebook"] == name])
    return found


def _answers(name, questions, answers):
    """Each question has one answer, in its order, and the verdict follows."""
    wanted = {id: question for id, question in questions.items() if not question.withdrawn}
    if answers["id"].tolist() != list(wanted):
        apart = sorted(set(wanted) ^ set(answers["id"])) or "their order"
        return [f"{name}: expected an answer to each question, in their order, apart are {apart}"]
    found = []
    for _, row in answers.iterrows():
        try:
            follows = verdict(wanted[row["id"]], row)
        except ValueError as error:
            follows = str(error)
        if follows != row["verdict"]:
            found.append(f"{name}: {row['id']}: the verdict is {row['verdict']!r}, from question and answer follows {follows!r}")
    return found


def _printed(name, questions):
    """What a published table holds is looked up there, and stands there."""
    paper = name.split("/")[0].partition("_")[2]
    tables, found = tables_of(paper) if paper in PAPERS else (), []
    for question in questions.values():
        number = re.match(r"Table (\d+)", question.where)
        looked_up = question.source["table"] if question.source else None
        if question.rule in ("cell", "random cell") and number and int(number[1]) in tables and looked_up != f"{paper} {number[1]}":
            found.append(f"{name}: {question.id}: expected the printed cell out of the table {paper} {number[1]}, not {question.printed!r}")
        if question.source:
            source, _, table = looked_up.rpartition(" ")
            cell = published(source, int(table)).loc[question.source["row"], question.source["column"]]
            if question.printed != cell:
                found.append(f"{name}: {question.id}: the table holds {cell!r}, the question {question.printed!r}")
    return found


def _text(text, asked, name):
    """Marks and numbers of a text are the ledger's."""
    right = marked(text, asked, name).splitlines()
    return [f"not in step with the ledger: {old!r}" for old, new in zip(text.splitlines(), right, strict=True) if old != new]


def _counts(name, notebook, answers):
    """How many rows of each verdict the notebook said that it wrote."""
    texts = [output.data.get("text/markdown", "") for cell in notebook.cells for output in cell.get("outputs", []) if "data" in output]
    said = [dict(_COUNT.findall(text)) for text in texts if text.startswith("Ledger of ")]
    counted = {verdict: str(count) for verdict, count in answers["verdict"].value_counts().items()}
    return [] if said == [counted] else [f"{name}: the stored output counts {said}, the ledger {counted}"]

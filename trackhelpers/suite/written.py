"""The pages of the book that are written by hand, in ``book/pages``: the papers in their own order, which filter when, reading paths.

In git they hold the marks and numbers of the stored ledger; ``python -m trackhelpers.suite readme`` keeps them in step.
"""

from pathlib import Path

from trackhelpers.ledger import read_ledger, read_questions
from trackhelpers.ledger.record import links, marked
from trackhelpers.suite import ROOT
from trackhelpers.suite.for_the_book import with_chinese
from trackhelpers.suite.letters import symbols_page
from trackhelpers.suite.records import rows_of
from trackhelpers.whole import write_whole

__all__ = ["LOOK_UP", "PAGES", "PAPERS", "dead", "filled", "lay", "report", "texts", "unreached", "write"]

PAGES = ROOT / "book" / "pages"
PAPERS = {f"paper_{paper[0]}.md": paper for paper in ("1_thesis", "2_track_fusion", "3_augmented_bias", "4_space_tdoa")}
LOOK_UP = ("reading_paths", "which_filter", "symbols")  # in the order of the table of contents


def texts(folder=PAGES):
    """Return the pages, name of the file -> text."""
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(Path(folder).glob("*.md"))}


def dead(pages, questions):
    """Return the links to rows that are not asked, or were withdrawn, as (page, notebook, id)."""
    asked = {(name, id) for name, rows in questions.items() for id, question in rows.items() if not question.withdrawn}
    return [(page, *row) for page, text in pages.items() for row in links(text) if row not in asked]


def unreached(pages, questions):
    """Return the questions put to a paper, those beyond it left out, that its page does not link to, as (notebook, id)."""
    reached = {page: set(links(text)) for page, text in pages.items()}
    page_of = {paper: page for page, paper in PAPERS.items()}
    return [
        (name, id)
        for name, rows in questions.items()
        for id, question in rows.items()
        if name.split("/")[0] in page_of and question.rule != "beyond" and not question.withdrawn
        if (name, id) not in reached.get(page_of[name.split("/")[0]], ())
    ]


def filled(pages, ledger, questions):
    """Return the pages with the marks and numbers of `ledger`.

    Raises
    ------
    RuntimeError
        That names page, notebook and id of every link to a row that is not asked.
    """
    lost = dead(pages, questions)
    if lost:
        raise RuntimeError("the written pages link to rows that are not asked:\n" + "\n".join(map(_line, lost)))
    asked = rows_of(ledger, questions)
    return {page: marked(text, asked, f"(page {page})") for page, text in pages.items()}


def write(folder=PAGES):
    """Bring the pages in `folder` in step with the stored ledger."""
    for page, text in filled(texts(folder), read_ledger(), read_questions()).items():
        write_whole(Path(folder) / page, text)


def lay(source):
    """Lay the pages and the table of symbols into ``source/pages``, filled from the ledger in `source`, the source of a book."""
    questions = read_questions(source / "questions")
    pages = filled(texts(), read_ledger(source / "results", source / "questions"), questions)
    pages["symbols.md"] = symbols_page()
    (source / "pages").mkdir()
    for page, text in pages.items():
        (source / "pages" / page).write_text(with_chinese(text), encoding="utf-8")


def report():
    """Print the links that lead nowhere and the questions that no page reaches; return 1 if a link is dead."""
    pages, questions = texts(), read_questions()
    lost = dead(pages, questions)
    for line in map(_line, lost):
        print(f"dead: {line}")
    missed = unreached(pages, questions)
    for name, id in missed:
        print(f"not reached from its paper's page: {name}: {id}")
    print(f"{len(lost)} dead links, {len(missed)} questions not reached")
    return int(bool(lost))


def _line(found):
    page, notebook, id = found
    return f"{page}: {notebook}: {id}"

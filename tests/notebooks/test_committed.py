"""What is committed holds together: ledgers bear their verdicts out, notebooks have their form, README, marks and pages of rows are in step."""

import re
from functools import cache

import nbformat
import pytest

from trackhelpers.ledger import read_ledger, read_questions
from trackhelpers.published import published, tables_of
from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, ROOT, in_step, notebooks, readme, shape

PAGES = notebooks()
CHAPTERS = [path for path in PAGES if path.name != FIRST_PAGE]


@cache
def questions_asked():
    return read_questions()


def name(path):
    return path.relative_to(NOTEBOOKS).with_suffix("").as_posix()


FIGURES_OF = {"1_thesis": "", "2_track_fusion": "P2.", "3_augmented_bias": "P3.", "4_space_tdoa": "P4.", "5_real_targets": "R"}


def test_a_figure_has_a_number_of_its_own_and_chapters_count_theirs():
    """Chapter and count: a chapter that goes on in a second notebook counts on."""
    counted = {}
    for path in CHAPTERS:
        outputs = [output for cell in nbformat.read(path, as_version=4).cells for output in cell.get("outputs", [])]
        captions = re.findall(r"\*\*Figure ([^*]+)\.\*\*", "\n".join(output.get("data", {}).get("text/markdown", "") for output in outputs))
        chapter = FIGURES_OF[path.parent.name] + re.match(r"\d(?:_\d)?", path.stem)[0].replace("_", ".")
        first = counted.get(chapter, 0) + 1
        counted[chapter] = counted.get(chapter, 0) + len(captions)
        assert captions and captions == [f"{chapter}-{n}" for n in range(first, first + len(captions))], path.name


@pytest.mark.parametrize("path", CHAPTERS, ids=name)
def test_no_section_is_missing_from_its_numbers(path):
    """`## 1`, `## 2`, … and within section 5 `### 5.1`, `### 5.2`, …: a heading that was lost leaves a gap."""
    text = "\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown")
    numbers = [tuple(map(int, found.split("."))) for found in re.findall(r"^##+ (\d+(?:\.\d+)?)(?= )", text, re.M)]
    last = {}
    for *above, number in numbers:
        known = last.get(tuple(above))
        assert number == known + 1 if known is not None else number in (0, 1), (path.name, above, number)
        last[tuple(above)] = number


@pytest.fixture(scope="module")
def ledger():
    return read_ledger()


def rows_of(ledger, paper):
    return ledger[ledger.notebook.str.startswith(f"{paper}/")]


def test_what_is_stored_holds_together(ledger):
    assert in_step.faults() == [], "run python -m trackhelpers.suite readme"
    assert set(ledger.notebook) <= set(questions_asked())


def test_an_id_is_asked_once_in_a_paper():
    asked = [
        (name.split("/")[0], id) for name, questions in questions_asked().items() for id, each in questions.items() if not each.withdrawn
    ]
    assert not {pair for pair in asked if asked.count(pair) > 1}


def test_everything_that_the_space_paper_numbers_has_a_row(ledger):
    """8 equations and 9 figures; the paper has no tables."""
    where = rows_of(ledger, "4_space_tdoa")["where"]
    together = " ".join(where)
    assert not [k for k in range(1, 9) if f"({k})" not in together]
    assert all(where.str.contains(f"Figure {k}(?!\\d)").any() for k in range(1, 10))


def test_chapters_have_their_form():
    faults = {name(path): shape.faults(nbformat.read(path, as_version=4)) for path in CHAPTERS}
    assert not {notebook: found for notebook, found in faults.items() if found}


def test_every_chapter_has_a_ledger_and_every_ledger_a_chapter(ledger):
    assert set(ledger.notebook) == {name(path) for path in CHAPTERS}


def test_every_numbered_equation_of_the_thesis_has_a_row(ledger):
    where = " ".join(rows_of(ledger, "1_thesis")["where"])
    missing = [f"({c}.{k})" for c in (2, 3) for k in range(1, 17) if f"({c}.{k})" not in where]
    assert not missing


def test_every_cell_of_the_thesis_s_tables_of_numbers_has_a_row(ledger):
    """Counted by kind and place, so a cell that nobody judged shows; Tables 1 and 2 are words, a row each."""
    rows = rows_of(ledger, "1_thesis")
    for table in tables_of("thesis"):
        found = rows["where"].str.contains(rf"Tables? {table}(?!\d)").sum()
        frame = published("thesis", table)
        wanted = 1 if table in (1, 2) else frame.size - (len(frame) if table == 3 else 0)  # Table 3's first column is the time
        assert found >= wanted, f"Table {table}: {found} rows for {wanted} cells"


@pytest.mark.parametrize("figure", range(1, 7))
def test_every_figure_of_the_thesis_has_a_row(ledger, figure):
    rows = rows_of(ledger, "1_thesis")
    assert rows["where"].str.contains(rf"Figures? {figure}(?!\d)").any()


def test_everything_that_the_augmented_bias_paper_numbers_has_a_row(ledger):
    """31 equations, the 15 cells of Table 1, four figures, three conclusions."""
    where = rows_of(ledger, "3_augmented_bias")["where"]
    together = " ".join(where)
    equations = [f"({k})" for k in range(1, 32)]
    conclusions = [f"conclusion ({k})" for k in (1, 2, 3)]
    assert not [item for item in equations + conclusions if item not in together]
    assert all(where.str.contains(f"Figure {k}(?!\\d)").any() for k in range(1, 5))
    assert where.str.startswith("Table 1, ").sum() >= 2 * (len(published("augmented_bias", 1)) - 1) + 1


@pytest.mark.parametrize("path", CHAPTERS, ids=name)
def test_chapter_has_its_parts(path):
    nb = nbformat.read(path, as_version=4)
    text = "\n".join(cell.source for cell in nb.cells if cell.cell_type == "markdown").lower()
    code = "\n".join(cell.source for cell in nb.cells if cell.cell_type == "code")
    for part in ("after this chapter", "you need", "exercise", "key points", "references"):
        assert part in text, part
    folded = [cell for cell in nb.cells if cell.cell_type == "code" and "hide-input" in cell.metadata.get("tags", [])]
    assert 1 <= code.count("# your code here") <= len(folded), "every exercise has a folded solution"
    assert "ledger.write()" in [cell for cell in nb.cells if cell.cell_type == "code"][-1].source


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_links_to_other_notebooks_lead_somewhere(path):
    text = "\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown")
    dead = [link for link in re.findall(r"\]\(([^)\s#]+\.ipynb)", text) if not (path.parent / link).exists()]
    assert not dead


def test_start_page_links_to_every_chapter():
    page = NOTEBOOKS / FIRST_PAGE
    text = "\n".join(cell.source for cell in nbformat.read(page, as_version=4).cells)
    missing = [name(path) for path in CHAPTERS if f"{name(path)}.ipynb" not in text]
    assert not missing


def test_readme_is_in_step_with_the_ledger(ledger):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.in_step(text, ledger, questions_asked()) == text, "run python -m trackhelpers.suite readme"


def test_readme_shows_the_figure_that_the_notebook_stores():
    assert readme.FIGURE.read_bytes() == readme.tagged_figure(), "run python -m trackhelpers.suite readme"

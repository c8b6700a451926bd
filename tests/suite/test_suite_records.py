"""Pages of rows and marks follow from the ledger; the book finds its way from the one to the other."""

import re

import nbformat
import pytest

from trackhelpers.ledger import MARKS, read_ledger, read_questions
from trackhelpers.ledger.record import marked
from trackhelpers.suite import book, records

QUESTIONS = """
[gain]
kind = "equation"
where = "(2.11)"
asks = "gain $K_k$: printed form against [ours]"
printed = "K = P_1 H"
rule = "equation"
assumption = "R > 0"
known_before = "asked with the answer"
set = 2026-11-22

[better]
kind = "claim"
where = "§4.1"
asks = "RMSE over the rival's"
rule = "< 0.9"
set = 2026-11-22
changed = [{ on = 2026-11-24, was = "< 1", because = "'better' is read as by 10 %", turned = "nothing" }]

[max]
kind = "table"
where = "Table 9, vx"
asks = "largest error (m/s)"
printed = { table = "thesis 9", row = "vx", column = "max" }
rule = "cell"
set = 2026-11-22

[gone]
kind = "claim"
where = "§5"
asks = "seconds a run"
rule = "< 1"
set = 2026-11-22
withdrawn = { on = 2026-11-25, why = "timings are no rows", verdict = "not reproduced" }
"""
ANSWERS = """id,ours,low,high,verdict,note
gain,1e-12,,,reproduced under an assumption,
better,0.5,0.4,1,undecided,
max,4,,,paper in error,it is m/s²
"""
ROWS = "../results/1_one__1_first.md"
TEXT = (
    f"The gain [?]({ROWS}#gain), better [✓ reproduced]({ROWS}#better), [the max]({ROWS}#max), [?](other.md#gain), [page]({ROWS}), $[a](b)$"
)


@pytest.fixture
def folder(store):
    """A folder of two notebooks, the first of which links to its rows, with questions and answers."""
    path = store("1_one/1_first.ipynb", "1 + 1", title=TEXT)
    store("00_start_here.ipynb", title="The map")
    root = path.parents[1]
    for name, text in (("questions/1_one__1_first.toml", QUESTIONS), ("results/1_one__1_first.csv", ANSWERS)):
        (root / name).parent.mkdir()
        (root / name).write_text(text, encoding="utf-8")
    return root


def test_marks_are_filled_from_the_verdicts_and_other_links_are_left_alone():
    asked = {"1_one/1_first": {"gain": {"verdict": "reproduced under an assumption"}, "better": {"verdict": "undecided"}, "max": None}}
    done = marked(TEXT, asked, "1_one/1_first")
    assert done == (
        f"The gain [✓ under an assumption]({ROWS}#gain), better [~ undecided]({ROWS}#better), [?]({ROWS}#max), "
        f"[?](other.md#gain), [page]({ROWS}), $[a](b)$"
    )
    assert marked(done, asked, "1_one/1_first") == done


@pytest.mark.parametrize("link", ["../results/1_one__1_first.md#gian", "../results/1_one__2_second.md#gain"])
def test_a_mark_of_a_row_that_is_not_asked_names_notebook_and_id(link):
    with pytest.raises(ValueError, match=rf"notebook 1_one/3_third links to the row '{link.split('#')[1]}'"):
        marked(f"see [?]({link})", {"1_one/1_first": {"gain": {"verdict": "reproduced"}}}, "1_one/3_third")


def test_every_mark_can_be_the_text_of_a_link():
    assert all(marked(f"[{mark}]({ROWS}#a)", {"1_one/1_first": {"a": None}}, "n") == f"[?]({ROWS}#a)" for mark in MARKS.values())


def test_pages_and_marks_are_written_and_a_second_time_change_no_byte(folder):
    notebook = folder / "1_one/1_first.ipynb"
    ids = [cell.id for cell in nbformat.read(notebook, as_version=4).cells]
    (folder / "results/1_one__0_gone.md").write_text("old")
    records.write(folder)
    first = {path: path.read_bytes() for path in folder.rglob("*.*") if path.is_file()}
    records.write(folder)
    assert {path: path.read_bytes() for path in folder.rglob("*.*") if path.is_file()} == first
    assert folder / "results/1_one__0_gone.md" not in first
    cells = nbformat.read(notebook, as_version=4).cells
    assert [cell.id for cell in cells] == ids
    assert "[✓ under an assumption](" in cells[0].source and "[✗ paper in error](" in cells[0].source


def test_the_page_tells_each_question_its_answer_and_its_history(folder):
    records.write(folder)
    text = (folder / "results/1_one__1_first.md").read_text(encoding="utf-8")
    assert re.findall(r'<a id="(.*?)"></a>', text) == re.findall(r"^## (.*)", text, flags=re.MULTILINE) == ["gain", "better", "max", "gone"]
    for words in (
        "gain $K_k$: printed form against \\[ours\\]",
        "* verdict: **✓ under an assumption**",
        "* printed: K = P\\_1 H",
        "* ours: \\< 1e-9",
        "* assumption, error, note: R \\> 0",
        "* known before: asked with the answer",
        "* ours: 0.5 \\[0.4, 1\\]",
        "* rule: \\< 0.9",
        "* changed: 2026-11-24: was '\\< 1', 'better' is read as by 10 %; turned nothing",
        "* printed: 3.612049 (table thesis 9, row vx, column max)",
        "* rule: cell, to 5e-07",
        "* assumption, error, note: it is m/s²",
        "* rule set: 2026-11-22",
        "* withdrawn 2026-11-25: timings are no rows; the verdict was not reproduced",
    ):
        assert words in text, words


def test_questions_asked_and_not_answered_have_no_page_and_an_open_mark(folder):
    (folder / "questions/1_one__2_second.toml").write_text(QUESTIONS, encoding="utf-8")
    questions = read_questions(folder / "questions")
    ledger = read_ledger(folder / "results", folder / "questions")
    assert list(records.records(ledger, questions)) == ["1_one__1_first.md"]
    asked = records.rows_of(ledger, questions)
    assert marked("[?](../results/1_one__2_second.md#gain)", asked, "n") == "[?](../results/1_one__2_second.md#gain)"


def test_the_book_leads_from_a_mark_and_from_the_ledger_s_table_to_the_row(folder, tmp_path):
    notebook = nbformat.read(folder / "1_one/1_first.ipynb", as_version=4)
    notebook.cells[0].source = f"# The first\n\nThe gain [?]({ROWS}#gain), [?]({ROWS}#max)."
    table = f"| verdict | rows |\n| --- | ---: |\n| reproduced | 3 |\n\n[Every row]({ROWS})"
    notebook.cells[1].outputs = [nbformat.v4.new_output("display_data", {"text/markdown": table, "text/plain": "3 rows"})]
    nbformat.write(notebook, folder / "1_one/1_first.ipynb")
    records.write(folder)
    html = book.pages(folder, tmp_path / "book").parent
    page = (html / "1_one/1_first.html").read_text(encoding="utf-8")
    rows = (html / "results/1_one__1_first.html").read_text(encoding="utf-8")
    for id in ("gain", "max"):
        assert f'href="../results/1_one__1_first.html#{id}"' in page
        assert rows.count(f'id="{id}"') == 1
    assert re.search(r'href="\.\./results/1_one__1_first\.html"', page)
    assert 'href="../1_one/1_first.html"' in rows and "orphan" not in rows


def test_a_number_in_the_text_is_the_row_s_own(folder):
    records.write(folder)
    asked = records.rows_of(read_ledger(folder / "results", folder / "questions"), read_questions(folder / "questions"))
    link = f'{ROWS}#better "{{}}"'
    text = "; ".join(f"[{old}]({link.format(end)})" for old, end in (("?", "ours"), ("0.1", "ours"), ("3.00", "low"), ("9 %", "high")))
    new = marked(text, asked, "n")
    assert re.findall(r"\[(.*?)\]", new) == ["0.5", "0.5", "0.40", "100 %"]
    assert marked(new, asked, "n") == new and new.count(ROWS) == 4
    assert "[0.5](notebooks/results/" in marked('[1.0](notebooks/results/1_one__1_first.md#better "ours")', asked, "README")
    with pytest.raises(ValueError, match=r"'low' of the row 'gain'"):
        marked(f'[1]({ROWS}#gain "low")', asked, "n")

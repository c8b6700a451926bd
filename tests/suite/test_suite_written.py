"""The pages written by hand link to rows that are asked, reach every question put to their paper, and are in step with the ledger."""

import re
import shutil
from functools import cache

import pytest

from trackhelpers.ledger import read_ledger, read_questions
from trackhelpers.published import published
from trackhelpers.suite import NOTEBOOKS, written


@cache
def questions_asked():
    return read_questions()


TEXTS = written.texts()
ROW = "[?](../results/2_track_fusion__9_last.md#{})"
TOML = """
[asked]
kind = "claim"
where = "§9"
asks = "a ratio"
rule = "< 1"
set = 2026-11-22

[more]
kind = "claim"
where = "§9"
asks = "another ratio"
rule = "beyond"
set = 2026-11-22

[gone]
kind = "claim"
where = "§9"
asks = "a third one"
rule = "< 1"
set = 2026-11-22
withdrawn = { on = 2026-11-25, why = "a repeat", verdict = "reproduced" }
"""


@pytest.fixture
def questions(tmp_path):
    (tmp_path / "2_track_fusion__9_last.toml").write_text(TOML, encoding="utf-8")
    return read_questions(tmp_path)


def test_no_page_links_to_a_row_that_is_not_asked():
    assert written.dead(TEXTS, questions_asked()) == [], "python -m trackhelpers.suite links lists them"


def test_every_question_put_to_a_paper_is_reached_from_its_page():
    missed = written.unreached(TEXTS, questions_asked())
    assert len(missed) == 0, f"{missed[:10]} …; python -m trackhelpers.suite links lists them"


def test_pages_are_in_step_with_the_ledger():
    assert written.filled(TEXTS, read_ledger(), questions_asked()) == TEXTS, "run python -m trackhelpers.suite readme"


@pytest.mark.parametrize("page", TEXTS)
def test_links_between_pages_and_notebooks_lead_somewhere(page):
    made = {
        "../ledger.md",
        "../by_number.md",
        "symbols.md",
        *(f"../api_{name}.md" for name in ("models", "sensors", "filters", "ensemble", "judging")),
    }
    links = set(re.findall(r"\]\(([^)\s#]+)\)", TEXTS[page])) - made
    assert not [link for link in links if not ((NOTEBOOKS / "pages" / link).resolve().exists() or (written.PAGES / link).exists())]


@pytest.mark.parametrize("table", [3, 5, 7, 8, 9])
def test_the_cells_of_the_thesis_s_tables_stand_there_as_printed(table):
    """Each cell that links to a question of one printed cell shows this cell."""
    printed = {
        (name, id): question.printed for name, asked in questions_asked().items() for id, question in asked.items() if question.source
    }
    rows = [line for line in TEXTS["paper_1.md"].splitlines() if line.startswith("| ") and f"#t{table}-" in line]
    cells = [cell.split() for line in rows for cell in line.split(" | ") if "](" in cell]
    assert {words[0] for words in cells} <= set(published("thesis", table).to_numpy().ravel())
    assert [words[0] for words in cells for row in written.links(" ".join(words)) if printed.get(row, words[0]) != words[0]] == []
    assert len(rows) >= len(published("thesis", table))


def test_a_dead_link_is_told_with_page_notebook_and_id(questions):
    pages = {"paper_2.md": " ".join(map(ROW.format, ("asked", "gone", "misspelt", "misspelt"))), "other.md": ROW.format("more")}
    last = "2_track_fusion/9_last"
    assert written.dead(pages, questions) == [("paper_2.md", last, "gone"), ("paper_2.md", last, "misspelt")]
    with pytest.raises(RuntimeError, match=r"paper_2\.md: 2_track_fusion/9_last: misspelt"):
        written.filled(pages, read_ledger(), questions)


def test_a_notebook_that_does_not_exist_is_dead(questions):
    assert written.dead({"paper_1.md": "[0.5](../results/1_thesis__7_none.md#a)"}, questions) == [("paper_1.md", "1_thesis/7_none", "a")]


def test_questions_that_a_page_leaves_out_are_counted(questions):
    assert written.unreached({}, questions) == [("2_track_fusion/9_last", "asked")]
    assert written.unreached({"paper_1.md": ROW.format("asked")}, questions) == [("2_track_fusion/9_last", "asked")]
    assert written.unreached({"paper_2.md": ROW.format("asked")}, questions) == []


def test_the_book_s_pages_have_their_marks_and_the_chinese_its_language(tmp_path):
    for folder in ("questions", "results"):
        shutil.copytree(NOTEBOOKS / folder, tmp_path / folder)
    written.lay(tmp_path)
    pages = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "pages").iterdir()}
    assert set(pages) == {*TEXTS, "symbols.md"} >= set(written.PAPERS)
    assert "[✓ reproduced](../results/" in pages["paper_1.md"] and '<span lang="zh">' in pages["paper_2.md"]


def test_the_report_counts_and_fails_on_dead_links(monkeypatch, capsys):
    assert written.report() == 0
    assert "0 dead links, 0 questions not reached" in capsys.readouterr().out
    monkeypatch.setattr(written, "texts", lambda: {"paper_1.md": ROW.format("asked")})
    assert written.report() == 1
    assert "dead: paper_1.md: 2_track_fusion/9_last: asked" in capsys.readouterr().out

"""Every row has a place in the book that a link can name, every printed number leads to its row, and the ledger's page holds them all."""

import re

import nbformat
import pandas as pd
import pytest

from trackhelpers.ledger import read_ledger
from trackhelpers.suite import book
from trackhelpers.suite.for_the_book import for_the_book
from trackhelpers.suite.ledger_page import by_number, ledger_page, places_of, titles

v4 = nbformat.v4
ROW = {
    "kind": "table",
    "quantity": "error of $x$ < 1",
    "paper": "1.0",
    "ours": "1.04",
    "low": "",
    "high": "",
    "verdict": "reproduced",
    "note": "",
    "rule": "cell",
}


def rows(*where, notebook="1_thesis/2_kalman_filter"):
    return pd.DataFrame([ROW | {"notebook": notebook, "id": f"row-{i}", "where": text} for i, text in enumerate(where)])


def test_printed_numbers_are_found_in_where_a_row_stands():
    places = places_of(rows("Table 9, vx", "(2.9)", "(2.14)–(2.16); Figure 1", "§4.2 (2)", "Table 9, vy", "conclusion (1)"))
    assert {key[1:]: id for key, (_, id) in places.items()} == {
        ("Table", "9"): "row-0",
        ("Equation", "2.9"): "row-1",
        ("Equation", "2.14"): "row-2",
        ("Equation", "2.15"): "row-2",
        ("Equation", "2.16"): "row-2",
        ("Figure", "1"): "row-2",
    }
    other = places_of(rows("(13)–(15)", "§2 (3)", "conclusion (2)", "§2, (8)", notebook="3_augmented_bias/2_augmented_filter"))
    assert [number for _, _, number in other] == ["13", "14", "15", "8"]


def test_the_index_sorts_numbers_as_numbers_and_leads_to_the_row():
    text = by_number(places_of(rows("(2.10)", "(2.9)")))
    assert re.findall(r">\((.*?)\)</a>", text) == ["2.9", "2.10"] and "1_thesis/2_kalman_filter.html#row-row-1" in text


def test_the_page_holds_every_row_once_escaped_and_searchable():
    page = ledger_page(rows("Table 9", "(2.9)"))
    assert page.count("<li ") == 2 and page.count('data-v="reproduced"') == 2
    assert "&lt; 1" in page and r"\(x\)" in page and "✓ reproduced" in page
    assert "results/1_thesis__2_kalman_filter.html#row-1" in page


def test_a_row_names_its_chapter_by_number_and_title():
    cells = [v4.new_markdown_cell("# 2 · The filter & its $x$"), v4.new_code_cell("# 1")]
    called = titles({"1_thesis/2_kalman_filter": v4.new_notebook(cells=cells), "00_start_here": v4.new_notebook(cells=cells[1:])})
    assert called == {"1_thesis/2_kalman_filter": "Paper 1, chapter 2 · The filter & its $x$", "00_start_here": "00_start_here"}
    row = ledger_page(rows("Table 9"), called)
    assert "Paper 1, chapter 2 · The filter &amp; its" in row and r"\(x\)</span>: row-0</a>" in row


LINK = "[✓ reproduced](../results/1_thesis__2_kalman_filter.md#{})"


def test_every_row_gets_a_place_where_it_is_said_else_where_it_is_answered():
    cells = [
        v4.new_markdown_cell(
            f"## Gains\n\nThe gain {LINK.format('gain')}, again {LINK.format('gain')}; other {LINK.format('row').replace('1_thesis', '2_other')}."
        ),
        v4.new_code_cell('ledger.answer({"t9-max": 1.0} | {f"t9-{name}": 2.0 for name in "ab"})', id="cells"),
        v4.new_code_cell('ledger.answer({"spread": 1.0})', id="spread"),
        v4.new_code_cell("ledger.write()", id="last"),
    ]
    made = for_the_book(v4.new_notebook(cells=cells), "1_thesis/2_kalman_filter", {}, ["gain", "t9-max", "t9-a", "spread"])
    text = "\n".join(cell.source for cell in made.cells)
    assert [re.findall(r'<a id="row-(.*?)">', cell.source) for cell in made.cells] == [["gain"], ["t9-max", "t9-a"], [], ["spread"], [], []]
    assert text.count("<a id=") == 4


def test_equation_numbers_lead_to_their_row_but_not_in_formulas_code_or_headings():
    places = {("1_thesis", "Equation", "2.9"): ("1_thesis/2_kalman_filter", "eq-2-9")}
    text = "## About (2.9)\n\nBy (2.9) and $P_{(2.9)}$ and `(2.9)`, not (2.10)."
    here, elsewhere = (
        for_the_book(v4.new_notebook(cells=[v4.new_markdown_cell(text)]), name, places).cells[0].source
        for name in ("1_thesis/2_kalman_filter", "1_thesis/3_motion_models")
    )
    assert here == text.replace("By (2.9)", 'By <a href="#row-eq-2-9">(2.9)</a>')
    assert '<a href="../1_thesis/2_kalman_filter.html#row-eq-2-9">(2.9)</a>' in elsewhere
    assert for_the_book(v4.new_notebook(cells=[v4.new_markdown_cell(text)]), "4_space_tdoa/1_fixes", places).cells[0].source == text


def test_equation_numbers_lead_to_the_equation_that_the_notebook_shows():
    places = {("1_thesis", "Equation", "2.9"): ("1_thesis/2_kalman_filter", "eq-2-9")}
    texts = [
        "The gain is\n\n$$K = P \\tag{2.9}$$\n\nand by (2.9), unlike (a),\n\n$$S = R \\tag{2.9'}$$",
        "It is $$v = 0 \\tag{a}$$ by (2.9) and (2.9'), not by `(a)` or (b).",
    ]
    made = for_the_book(v4.new_notebook(cells=[v4.new_markdown_cell(text) for text in texts]), "1_thesis/2_kalman_filter", places)
    first, second = (cell.source for cell in made.cells)
    assert first == (
        'The gain is\n\n<a id="eq-2-9"></a>\n\n$$K = P \\tag{2.9}$$\n\nand by <a href="#row-eq-2-9">(2.9)</a>, unlike <a href="#eq-a">(a)</a>,\n\n'
        '<a id="eq-2-9-prime"></a>\n\n$$S = R \\tag{2.9\'}$$'
    )
    assert '<a href="#eq-2-9">(2.9)</a> and <a href="#eq-2-9-prime">(2.9\')</a>, not by `(a)` or (b).' in second


def test_chinese_words_say_their_language():
    made = for_the_book(v4.new_notebook(cells=[v4.new_markdown_cell("a filter, 滤波器, of `滤波` one")]))
    assert made.cells[0].source == 'a filter, <span lang="zh">滤波器</span>, of `滤波` one'


def test_links_that_lead_nowhere_are_found(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b/two.html").write_text('<p id="there"><a href="../one.html#here">', encoding="utf-8")
    links = [
        "b/two.html#there",
        "b/two.html",
        "#here",
        "ledger.html#q=Table 9",
        "https://example.org/x",
        "b/two.html#gone",
        "three.html",
        "#lost",
    ]
    (tmp_path / "one.html").write_text('<a name="here">' + "".join(f'<a href="{link}">' for link in links), encoding="utf-8")
    (tmp_path / "ledger.html").write_text("", encoding="utf-8")
    assert book.dead_links(tmp_path) == ["one.html: #lost", "one.html: b/two.html#gone", "one.html: three.html"]


def test_every_table_equation_and_figure_of_the_papers_is_in_the_index():
    places = places_of(read_ledger())
    wanted = {("1_thesis", "Equation", f"{c}.{k}") for c in (2, 3) for k in range(1, 17)} | {
        ("3_augmented_bias", "Equation", str(k)) for k in range(1, 32)
    }
    wanted |= {("1_thesis", "Table", str(k)) for k in (1, 2, 3, 4, 5, 7, 8, 9)} | {
        ("4_space_tdoa", "Equation", str(k)) for k in range(1, 9)
    }
    wanted |= {("1_thesis", "Figure", str(k)) for k in range(1, 7)} | {("3_augmented_bias", "Table", "1")}
    assert not wanted - set(places)


@pytest.mark.parametrize("kind", ["Table", "Figure", "Equation"])
def test_places_name_rows_of_the_ledger(kind):
    ledger = read_ledger()
    known = set(zip(ledger["notebook"], ledger["id"], strict=True))
    assert {place for key, place in places_of(ledger).items() if key[1] == kind} <= known


def test_what_draws_the_opening_picture_is_folded_and_what_follows_is_not():
    codes = ["import numpy", "import pandas as pd", "x = 1", "y = 2"]
    rest = [v4.new_markdown_cell("## First"), v4.new_code_cell("1 + 1"), v4.new_code_cell("2 + 2")]
    made = for_the_book(v4.new_notebook(cells=[v4.new_markdown_cell("# One"), *map(v4.new_code_cell, codes), *rest]))
    assert [cell.metadata.get("tags") for cell in made.cells] == [None, ["hide-input", "imports"], ["hide-input", "cast"], None, None, None]
    assert [cell.source for cell in made.cells[1:3]] == ["import numpy\n\n\nimport pandas as pd", "x = 1\n\n\ny = 2"]
    assert made.cells[1].metadata["mystnb"]["code_prompt_show"] == "Imports"

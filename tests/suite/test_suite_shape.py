"""The form of a notebook that answers questions: what breaks it is named."""

import nbformat
import pytest

from trackhelpers.suite import shape

v4 = nbformat.v4
FOLDED = {"tags": ["hide-cell"], "jupyter": {"source_hidden": True}}
ANSWER = "ledger.answer({'a': 1.0})"
SENTENCE = "The next:"
LONG = "\n".join("x = 1" for _ in range(16))


def notebook(*cells):
    """A notebook that keeps to the form, with `cells` in its middle: text of code, or (text, metadata); a sentence before each."""
    made = [v4.new_markdown_cell("# Title\n\n## First"), v4.new_code_cell("ledger = Ledger('a', 'b')\nledger.questions")]
    for cell in cells:
        source, metadata = (cell, {}) if isinstance(cell, str) else cell
        made += (
            [v4.new_markdown_cell(source)]
            if source.startswith("## ")
            else [v4.new_markdown_cell(SENTENCE), v4.new_code_cell(source, metadata=metadata)]
        )
    return v4.new_notebook(cells=[*made, v4.new_markdown_cell(SENTENCE), v4.new_code_cell("ledger.write()")])


@pytest.mark.parametrize(
    "cells",
    [
        [],
        [(ANSWER, FOLDED)],
        [(ANSWER, FOLDED), "## Second", (ANSWER, FOLDED)],
        [(LONG, {"tags": ["hide-input"]})],
        [LONG + "\nplots.show(fig, '1-1', 'x')"],
        [LONG + "\nPlayground(f, a=[1, 2]).show('1-1', 'x')"],
        ["# your code here", "# your code here"],
        ["def f(x):\n    y = x + 1\n    return y", "%timeit f(1)", "my.ledger.answer"],
        ["x" * 82],
    ],
)
def test_a_notebook_in_its_form_has_no_faults(cells):
    assert shape.faults(notebook(*cells)) == []


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([LONG, "a", "b"], "16 statements"),
        (["def f(x):\n" + "    x = 1\n" * 15], "16 statements"),
        ([";".join(["x"] * 7)] * 9, "median of the open cells is 7"),
        (["x" * 83], "83 characters"),
        ([("x" * 83, FOLDED)], "83 characters"),
        ([ANSWER], "expected it folded"),
        ([(ANSWER, {"tags": ["hide-cell"]})], "expected it folded"),
        ([(ANSWER, {"tags": ["hide-input"], "jupyter": {"source_hidden": True}})], "expected it folded"),
        ([(ANSWER, FOLDED), (ANSWER, FOLDED)], "section 'First' has a second"),
        (["plots.show(a, '1', 'x')\nplots.show(b, '2', 'x')"], "2 figures"),
        (["plots.show(a, '1', 'x')\nPlayground(f, a=[1])"], "2 figures"),
        (["## " + "word " * 3801], "words"),
        (["## Second\n\n$$a = b$$"], "0 tags"),
    ],
)
def test_what_breaks_the_form_is_named(cells, words):
    assert any(words in fault for fault in shape.faults(notebook(*cells)))


def test_words_are_those_of_the_prose():
    text = "Two words $x + y$ and\n\n| a | table |\n| --- | --- |\n\n$$a = b$$\n\n```python\ncode = 1\n```\n[a link](../other/page.md) isn't <br> counted"
    assert shape.words(v4.new_notebook(cells=[v4.new_markdown_cell(text)])) == 7


def test_text_between_two_tables_counts():
    table = "| a b | c |\n|---|---|\n| d | e f |"
    notebook = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_markdown_cell(f"{table}\n\nthree words here\n\n{table}\n\none < two, four > three")]
    )
    assert shape.words(notebook) == 7


@pytest.mark.parametrize(
    ("text", "tags"),
    [
        (r"$$a = b \tag{3.9}$$", []),
        ("$$\\begin{aligned} a &= b \\\\ c &= d \\end{aligned}\n\\tag{a}$$", []),
        ("a price of $5, `$$`, inline $x$ and\n\n```\n$$a$$\n```", []),
        ("$$a = b$$", [0]),
        (r"$$a \tag{1}$$ and $$b$$ and $$c \tag{2} \tag{3}$$", [0, 2]),
    ],
)
def test_a_displayed_equation_carries_one_number(text, tags):
    found = shape.untagged(v4.new_notebook(cells=[v4.new_markdown_cell(text), v4.new_code_cell("'$$a$$'")]))
    assert [int(fault.split(" tags")[0].rpartition(" ")[2]) for fault in found] == tags


@pytest.mark.parametrize(
    ("cells", "bare"),
    [
        (["text", "a", "text", "b"], []),
        (["text", "a", ("b", FOLDED), "text", "c"], []),
        (["text", "# your code here", ("b", FOLDED)], []),
        (["text", "a", "# your code here"], []),
        (["text", "a", "b", "c"], [2, 3]),
        (["text", ("a", FOLDED), "b"], [2]),
        (["text", "a", " ", "b"], [3]),
        (["text\n\n## 1 A section", "a", "text", "b"], [1]),
        (["## 1 A section", ("a", FOLDED), "## The ledger", "ledger.write()"], []),
    ],
)
def test_an_open_cell_that_no_text_leads_to_is_named(cells, bare):
    made = []
    for k, cell in enumerate(cells):
        source, metadata = (cell, {}) if isinstance(cell, str) else cell
        make = v4.new_markdown_cell if source == " " or source.startswith(("text", "## ")) else v4.new_code_cell
        made.append(make(source, metadata=metadata, id=f"c{k}"))
    assert [int(fault.split()[1][1:]) for fault in shape.unintroduced(v4.new_notebook(cells=made))] == bare

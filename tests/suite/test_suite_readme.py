"""The README is filled in from the ledger."""

import re

import pytest

from trackhelpers.ledger import read_ledger, summary_markdown
from trackhelpers.suite import ROOT
from trackhelpers.suite.readme import END, START, with_summary


def test_the_summary_goes_between_the_marks_only_and_is_then_in_step(ledger):
    old = f"before\n{START}\nold\n{END}\nafter\n"
    text = with_summary(old, ledger)
    assert text == f"before\n{START}\n\n{summary_markdown(ledger)}\n{END}\nafter\n"
    assert with_summary(text, ledger) == text != old
    assert with_summary(text.replace("| all notebooks |", "| some notebooks |"), ledger) == text


@pytest.fixture(scope="module")
def ledger():
    return read_ledger()


@pytest.mark.parametrize("text", ["no marks", START, f"{END} {START}", f"{START} {START} {END}", f"{START} {END} {END}"])
def test_a_readme_without_its_marks_is_refused(text, ledger):
    with pytest.raises(ValueError, match="expected exactly one"):
        with_summary(text, ledger)


def test_the_example_in_the_readme_runs():
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    names = {}
    exec(example, names)
    assert names["track"].x.shape == names["better"].x.shape == (5, 3)

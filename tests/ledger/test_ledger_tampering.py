"""What somebody changes in the stored ledger, in one place, shows in another."""

import re
import shutil

import pytest

from trackhelpers.suite import NOTEBOOKS, in_step, records

NAME = "1_thesis__4_2_what_the_tables_give_away"
NOTEBOOK = NAME.replace("__", "/")


@pytest.fixture
def folder(tmp_path):
    """One notebook with its questions and answers, as they are stored."""
    copy = tmp_path / "notebooks"
    for file in (f"questions/{NAME}.toml", f"results/{NAME}.csv", f"results/{NAME}.md", f"{NOTEBOOK}.ipynb"):
        (copy / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(NOTEBOOKS / file, copy / file)
    others = set(re.findall(r"results/([a-z0-9_]+__[a-z0-9_]+)\.md#", (copy / f"{NOTEBOOK}.ipynb").read_text(encoding="utf-8"))) - {NAME}
    assert not others, "a notebook whose links are its own"
    return copy


def changed(path, pattern, new):
    text = path.read_text(encoding="utf-8")
    other = re.sub(pattern, new, text, count=1, flags=re.MULTILINE)
    assert other != text
    path.write_text(other, encoding="utf-8")


def test_what_is_stored_holds_together(folder):
    assert in_step.faults(folder) == []


CSV, TOML, PAGE, TEXT = f"results/{NAME}.csv", f"questions/{NAME}.toml", f"results/{NAME}.md", f"{NOTEBOOK}.ipynb"
TAMPERINGS = {
    "a row is deleted": (CSV, r"^t9-vx-max,.*\n", ""),
    "the last row is deleted": (CSV, r"\n[^\n]*\n\Z", "\n"),
    "a verdict is bettered": (CSV, r",not reproduced,", ",reproduced,"),
    "a verdict is worsened": (CSV, r",reproduced,", ",not reproduced,"),
    "an assumption is forgotten": (CSV, r",reproduced under an assumption,", ",reproduced,"),
    "a class is changed": (CSV, r",paper in error,", ",misprint,"),
    "a number is changed": (CSV, r"^(t9-vx-max),[^,]*,", r"\1,0.5,"),
    "a printed value is written by hand": (TOML, r"^printed = \{ table = [^}]*, row[^}]*\}", 'printed = "5.275"'),
    "another cell is asked for": (TOML, r'(printed = \{[^}]*column = )"max"', r'\1"min"'),
    "a question is deleted": (TOML, r"\[[a-z0-9-]+\]\n(?:[^\[\n][^\n]*\n)+", ""),
    "a rule is loosened": (TOML, r'^rule = "cell"', 'rule = "beyond"'),
    "a page says something else": (PAGE, r"not reproduced", "reproduced"),
    "a mark in the text": (TEXT, r"\[✓ reproduced\]\((\.\./results)", r"[✗ not reproduced](\1"),
    "the output's count": (TEXT, r"\| reproduced \| (\d)", r"| reproduced | 9\1"),
}


@pytest.mark.parametrize("what", TAMPERINGS)
def test_a_tampering_shows(folder, what):
    file, pattern, new = TAMPERINGS[what]
    changed(folder / file, pattern, new)
    assert in_step.faults(folder)


@pytest.mark.parametrize("what", [what for what, (file, *_) in TAMPERINGS.items() if file == CSV and what != "a number is changed"])
def test_it_shows_also_where_pages_and_marks_were_brought_in_step(folder, what):
    file, pattern, new = TAMPERINGS[what]
    changed(folder / file, pattern, new)
    records.write(folder)
    assert in_step.faults(folder)

"""A test run over the notebooks compares outputs strictly, skips by name, and holds the ledgers against the committed ones."""

import os
import shutil
import subprocess
import sys

import pytest

from trackhelpers.ledger.files import ANSWER_COLUMNS
from trackhelpers.suite import LONGEST, NEEDS, ROOT
from trackhelpers.suite.run import COLOUR, run

NOTEBOOK, SANITIZE = "1_thesis/1_first.ipynb", "sanitize.cfg"
WRITE = """import os, pathlib
row = {row!r}
_ = pathlib.Path(os.environ["TRACKHELPERS_RESULTS"], "1_thesis__1_first.csv").write_text(row)"""


@pytest.fixture(scope="module")
def refreshed(store_in, tmp_path_factory):
    """A project of one notebook, refreshed; returns its folder."""
    folder, row = tmp_path_factory.mktemp("project"), ",".join(ANSWER_COLUMNS) + "\na,1,,,reproduced,\n"
    path = store_in(folder, NOTEBOOK, "1 + 1", "object()", WRITE.format(row=row))
    (folder / "notebooks/results").mkdir()
    run([path], lambda p: p, folder=folder / "notebooks", results=folder / "notebooks/results")
    for name in ("conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    shutil.copy(ROOT / "tests/nbval_sanitize.cfg", folder / SANITIZE)
    (folder / "data").mkdir()
    for name in NEEDS.values():  # a file with wrong bytes is as good as none, and is found without the network
        (folder / "data" / name).touch()
    return folder


@pytest.fixture
def session(refreshed, tmp_path):
    """A copy of that project; returns the path of its notebook and a function that runs the tests of its notebooks."""
    shutil.copytree(refreshed, tmp_path, dirs_exist_ok=True)

    def test(*options):
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "TRACKHELPERS_"))}
        environment["TRACKHELPERS_DATA"] = str(tmp_path / "data")
        command = f"-m pytest --color=no --assert=plain --nbval --nbval-sanitize-with={SANITIZE} notebooks".split()
        return subprocess.run([sys.executable, *command, *options], cwd=tmp_path, env=environment, capture_output=True, text=True)

    return tmp_path / "notebooks" / NOTEBOOK, test


def test_notebooks_that_repeat_pass_and_those_without_data_are_skipped_by_name(session, store):
    name, needed = next(iter(NEEDS.items()))
    store(name, "1 / 0")
    done = session[1]("-n", "1", "--dist", "loadscope")
    assert done.returncode == 0, done.stdout
    assert "3 passed, 1 skipped" in done.stdout.splitlines()[-1]
    assert f"{name.split('/')[1]} needs {needed}" in done.stdout


def test_a_ledger_that_is_not_the_committed_one_fails_the_session(session):
    path, test = session
    ledger = path.parents[1] / "results/1_thesis__1_first.csv"
    ledger.write_text(ledger.read_text().replace("a,1,", "a,2,"))
    done = test()
    assert done.returncode == 1, done.stdout
    assert "1_thesis/1_first: a: ours: '2' against '1'" in done.stdout


def test_a_number_that_moved_and_a_warning_fail(session):
    path, test = session
    text = path.read_text()
    path.write_text(text.replace('"2"', '"3"').replace('"object()"', "\"import warnings; warnings.warn('mind')\""))
    done = test()
    assert done.returncode == 1, done.stdout
    assert "2 failed, 1 passed" in done.stdout.splitlines()[-1]
    assert "UserWarning: mind" in COLOUR.sub("", done.stdout)


def test_the_longest_notebooks_come_first_and_their_cells_in_order(session, store):
    _, test = session
    for name in reversed(LONGEST):
        store(name, *(f"{i}" for i in range(12)))
    found = [line for line in test("--collect-only", "-q").stdout.splitlines() if "::" in line]
    expected = [f"notebooks/{name}::Cell {i}" for name in LONGEST for i in range(12)]
    assert found == expected + [f"notebooks/1_thesis/1_first.ipynb::Cell {i}" for i in range(3)]

"""In which order things are run: the longest notebook first, tests in a random order where it is asked for."""

import re
import shutil
import subprocess
import sys

import pytest
from hypothesis import settings

from trackhelpers.suite import LONGEST, NOTEBOOKS, ROOT, longest_first, notebooks
from trackhelpers.suite import run as running


def test_the_longest_notebooks_are_there():
    assert [name for name in LONGEST if not (NOTEBOOKS / name).is_file()] == []


def test_the_longest_come_first_and_the_others_as_they_were():
    found = longest_first(notebooks())
    assert found[: len(LONGEST)] == [NOTEBOOKS / name for name in LONGEST]
    assert found[len(LONGEST) :] == [path for path in notebooks() if path not in found[: len(LONGEST)]]


def test_the_runner_starts_the_longest_first(store, tmp_path, monkeypatch):
    started = []

    async def execute(notebook, name, *_):
        started.append(name)

    monkeypatch.setattr(running, "_execute", execute)
    paths = [store(name, "1") for name in ("0_zero/1_first.ipynb", LONGEST[1], LONGEST[0])]
    running.run(paths, lambda path: path, folder=tmp_path / "notebooks", jobs=1)
    assert started == [LONGEST[0], LONGEST[1], "0_zero/1_first.ipynb"]


def test_no_example_of_hypothesis_has_a_deadline():
    assert settings().deadline is None


def test_tests_are_in_a_random_order_only_where_it_is_asked_for(tmp_path):
    pytest.importorskip("pytest_randomly")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "test_many.py").write_text("import pytest\n@pytest.mark.parametrize('i', range(40))\ndef test(i): pass\n")

    def order(*options):
        command = [sys.executable, "-m", "pytest", "--collect-only", "--assert=plain", "test_many.py", *options]
        out = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
        return out, [int(i) for i in re.findall(r"<Function test\[(\d+)\]>", out)]

    assert order()[1] == list(range(40))
    out, shuffled = order("-p", "randomly")
    assert re.search(r"Using --randomly-seed=\d+", out)
    assert shuffled != list(range(40)) and sorted(shuffled) == list(range(40))

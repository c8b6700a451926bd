"""Notebooks are run strictly and stored so that nothing moves that did not change."""

import re
import signal
import subprocess
import sys
import time

import nbformat
import psutil
import pytest
from matplotlib import rcParamsDefault

from trackhelpers import datasets
from trackhelpers.suite import NEEDS, ROOT
from trackhelpers.suite.kernel import ENVIRONMENT
from trackhelpers.suite.run import NotebookError, run

SLACK = 3  # a machine under load may take as many times as long
FIGURE = "import matplotlib.pyplot as plt\nfig, ax = plt.subplots(figsize=(1, 1))\nax.set_title({title!r})\nplt.show()"


def in_place(path):
    run([path], lambda p: p, folder=path.parents[1])


def test_a_second_refresh_changes_no_byte(store):
    path = store("1_one/1_first.ipynb", FIGURE.format(title="θ"), "object()", "# your code here", "print('a')", "")
    in_place(path)
    first = path.read_bytes()
    in_place(path)
    assert path.read_bytes() == first
    cells = nbformat.read(path, as_version=4).cells
    assert [cell.id for cell in cells] == ["title", "code-1", "code-2", "code-3", "code-4", "code-5"]
    assert [cell.execution_count for cell in cells[1:]] == [1, 2, 3, 4, 5]
    assert "image/png" in cells[1].outputs[0].data
    assert cells[4].outputs[0].text == "a\n"
    assert first.endswith(b"}\n")


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("import warnings\nwarnings.warn('mind the step')", "mind the step"),
        ("import warnings\nwarnings.warn('old ways', DeprecationWarning)", "old ways"),
        ("import numpy as np\nnp.float64(1) / 0", "divide by zero"),
        (FIGURE.format(title="\U0001f40d"), "Glyph 128013"),
    ],
    ids=["UserWarning", "DeprecationWarning", "RuntimeWarning", "missing glyph"],
)
def test_a_warning_in_a_cell_fails(store, code, named):
    path = store("1_one/1_first.ipynb", code)
    before = path.read_bytes()
    with pytest.raises(NotebookError, match=named):
        in_place(path)
    assert path.read_bytes() == before


def test_an_error_names_notebook_cell_and_traceback(store):
    path = store("1_one/1_first.ipynb", "a = 1", "b = a / 0")
    with pytest.raises(NotebookError, match=r"1_one/1_first\.ipynb, code cell 2 \(id code-2\)") as caught:
        in_place(path)
    assert "----> 1 b = a / 0" in str(caught.value)
    assert "ZeroDivisionError" in str(caught.value)


@pytest.mark.parametrize(
    ("code", "named"),
    [
        ("import sys\nprint('psst', file=sys.stderr)", "code cell 1 .* writes to stderr:\npsst"),
        ("import os\nos._exit(1)", "code cell 1 .*: Kernel died"),
    ],
    ids=["stderr", "dead kernel"],
)
def test_what_cannot_be_stored_names_notebook_and_cell(store, code, named):
    path = store("1_one/1_first.ipynb", code)
    with pytest.raises(NotebookError, match=named):
        in_place(path)


def test_an_endless_cell_is_named(store):
    path = store("1_one/1_first.ipynb", "import threading\nthreading.Event().wait()")
    with pytest.raises(NotebookError, match=r"code cell 1 .*: A cell timed out"):
        run([path], lambda p: p, folder=path.parents[1], timeout=1)


def test_the_map_runs_after_the_ledgers_are_written(store, tmp_path):
    code = "import os, pathlib\nledger = pathlib.Path(os.environ['TRACKHELPERS_RESULTS'], 'row')"
    start = store("00_start_here.ipynb", code, "ledger.read_text()")
    other = store("1_one/1_first.ipynb", code, "_ = ledger.write_text('found')")
    (tmp_path / "results").mkdir()
    run([start, other], lambda p: p, folder=start.parent, results=tmp_path / "results")
    assert nbformat.read(start, as_version=4).cells[2].outputs[0].data["text/plain"] == "'found'"


def test_a_notebook_without_its_data_is_named_and_keeps_its_outputs(store, monkeypatch, capsys):
    monkeypatch.setattr(datasets, "why_not", lambda name: "not to be had")
    name = next(iter(NEEDS))
    path = store(name, "1 / 0")
    before = nbformat.read(path, as_version=4)
    run([path], lambda p: p, folder=path.parents[1])
    assert nbformat.read(path, as_version=4) == before
    assert path.name in capsys.readouterr().out


def test_settings_of_matplotlib_beside_a_notebook_change_nothing(store):
    code = "import matplotlib as mpl\nmpl.rcParams['lines.linewidth'], mpl.get_backend()"
    path = store("1_one/1_first.ipynb", code)
    (path.parent / "matplotlibrc").write_text("lines.linewidth: 17\nno_such_setting: 1\n")
    in_place(path)
    (output,) = nbformat.read(path, as_version=4).cells[1].outputs
    assert output.data["text/plain"] == f"({rcParamsDefault['lines.linewidth']}, {ENVIRONMENT['MPLBACKEND']!r})"


INTERRUPTED = """
import sys
from pathlib import Path
from trackhelpers.suite import __main__ as main
from trackhelpers.suite.run import run

main.check_checkout = lambda here: None
main.records.write = lambda: run([Path(sys.argv[1])], lambda p: p, folder=Path(sys.argv[1]).parents[1])
sys.exit(main.main(["readme"]))
"""


@pytest.mark.parametrize("after", [0.3, 0.8, 1.4])
def test_ctrl_c_while_the_program_is_loaded_leaves_no_traceback(tmp_path, after):
    process = subprocess.Popen(
        [sys.executable, "-m", "trackhelpers.suite", "refresh", tmp_path / "elsewhere.ipynb"], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert "Traceback" not in told and process.returncode in (-signal.SIGINT, 130, 2), told  # 2: it was quicker, and refused the path


@pytest.mark.parametrize(
    "code", ["import time\nopen('begun', 'w').close()\ntime.sleep(600)", "open('begun', 'w').close()\nwhile True: pass"]
)
def test_ctrl_c_ends_a_run_in_one_line_within_two_seconds(store, tmp_path, code):
    path = store("1_one/1_first.ipynb", code)
    before = path.read_bytes()
    (tmp_path / "script.py").write_text(INTERRUPTED)
    process = subprocess.Popen(
        [sys.executable, tmp_path / "script.py", path],
        stderr=subprocess.PIPE,
        text=True,
    )
    while not (path.parent / "begun").exists():
        assert process.poll() is None
        time.sleep(0.05)
    kernels = psutil.Process(process.pid).children(recursive=True)
    start = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert time.monotonic() - start < 2 * SLACK
    assert process.returncode == 130, told
    lines = [line for line in re.split("[\r\n]+", told) if line.strip() and not line.startswith("Notebooks:")]
    assert len(lines) == 1 and lines[0].startswith("Interrupted"), told
    assert path.read_bytes() == before
    assert not psutil.wait_procs(kernels, timeout=10)[1]

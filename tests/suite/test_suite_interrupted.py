"""Ctrl-C while Sphinx builds the pages."""

import signal
import subprocess
import sys
import time

import psutil

BUILDING = """
import sys
from pathlib import Path
from trackhelpers.suite import __main__ as main
from trackhelpers.suite.book import pages

main.check_checkout = lambda here: None
main.book.build = lambda: pages(Path(sys.argv[1]), Path(sys.argv[2]))
sys.exit(main.main(["book"]))
"""


def test_ctrl_c_while_sphinx_builds_the_pages_ends_both_in_one_line(store, tmp_path):
    first = store("00_start_here.ipynb", "1 + 1")
    (tmp_path / "script.py").write_text(BUILDING)
    command = [sys.executable, tmp_path / "script.py", first.parent, tmp_path / "out"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    watched = psutil.Process(process.pid)
    while not (sphinx := [child for child in watched.children() if "sphinx" in child.cmdline()]):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130 and told.strip().startswith("Interrupted") and "\n" not in told.strip(), told
    assert not psutil.wait_procs(sphinx, timeout=10)[1]

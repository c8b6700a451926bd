"""``python -m tests_mutants``: the sample, each fault against its module's folder of tests; survivors are printed and written.

cosmic-ray's own session knows one test command for all files, starts Python and the libraries for each mutant, and writes into the checkout
that is being worked on. Its operators are used, but a fault is written into a copy, and a fork that has the libraries loaded runs the tests.
"""

import argparse
import importlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import hypothesis
import pytest

from tests_mutants.faults import faulty, sample, sources

ROOT = Path(__file__).parents[1]
OUT = ROOT / "build" / "mutants"
# Loaded once, before the forks. pytest would load nbval for each, which takes longer than most folders' tests.
LIBRARIES = "filterpy.kalman joblib matplotlib mpmath nbval.plugin numba numpy pandas pymap3d pytest_timeout scipy.linalg scipy.optimize"
LIBRARIES += " scipy.stats sgp4.api skyfield.api sympy tqdm xdist.plugin"
# Its tests start clusters and worker processes: they are asked about the file that they are for, and no other.
SLOW = {"test_monte_carlo.py": "montecarlo.py"}
UNSEEN = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # they were, before pytest could see them


class Quick:
    """Few examples, no search for smaller ones, and the quickest tests first."""

    def __init__(self, seconds):
        self.seconds, self.measured = seconds, {}

    def pytest_sessionstart(self, session):
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        hypothesis.settings.register_profile("mutants", max_examples=20, phases=phases, derandomize=True, database=None, deadline=None)
        hypothesis.settings.load_profile("mutants")

    def pytest_collection_modifyitems(self, items):
        items.sort(key=lambda item: self.seconds.get(item.nodeid, 0.0))

    def pytest_runtest_logreport(self, report):
        self.measured[report.nodeid] = self.measured.get(report.nodeid, 0.0) + report.duration


def tests(copy, folder, file, seconds, limit):
    """pytest's exit code in a fork, below zero where a signal ended it, and what each test took (s)."""
    kept = copy / "seconds.json"
    kept.unlink(missing_ok=True)
    pid = os.fork()
    if pid == 0:
        os.setsid()
        signal.alarm(limit)
        os.chdir(copy)
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
        sys.path[:] = [str(copy), *(p for p in sys.path if p not in ("", str(ROOT)))]
        os.environ["PYTHONPATH"] = str(copy)
        left_out = [f"--ignore=tests/{folder}/{test}" for test, of in SLOW.items() if Path(file).name != of]
        plugin = Quick(seconds)
        code = pytest.main([f"tests/{folder}", "-x", "-q", "-p", "no:cacheprovider", *UNSEEN, *left_out], plugins=[plugin])
        kept.write_text(json.dumps(plugin.measured))
        os._exit(int(code))
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    try:
        os.killpg(pid, signal.SIGKILL)  # what a test may have left behind
    except ProcessLookupError:
        pass
    return code, json.loads(kept.read_text()) if kept.exists() else {}


def forget(path):
    """Python's cache compares whole seconds: two faults of one second would be one."""
    for cached in (path.parent / "__pycache__").glob(f"{path.stem}.*"):
        cached.unlink()


def main():
    parser = argparse.ArgumentParser(prog="tests_mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=16)
    parser.add_argument("--only", nargs="*", help="folders of tests")
    parser.add_argument("--part", default="0/1", help="k/n: every n-th fault, from the k-th")
    args = parser.parse_args()
    for library in LIBRARIES.split():
        importlib.import_module(library)
    part, parts = map(int, args.part.split("/"))
    faults = [f for f in sample(ROOT, args.count, args.seed) if not args.only or f.folder in args.only][part::parts]
    OUT.mkdir(parents=True, exist_ok=True)
    measured = OUT / "seconds.json"  # what each test takes, by the first run of its folder
    seconds = json.loads(measured.read_text()) if measured.exists() else {}
    results = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = Path(folder)
        for name in subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True).stdout.split(
            "\n"
        ):
            if name and (ROOT / name).exists():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, copy / name)
        for k, fault in enumerate(faults):
            file = copy / fault.file
            if not any(test.startswith(f"tests/{fault.folder}/") for test in seconds):
                code, took = tests(copy, fault.folder, fault.file, {}, 1800)
                if code:
                    sys.exit(f"tests/{fault.folder} fails without a fault: nothing can be learnt from it ({code})")
                seconds |= took
                measured.write_text(json.dumps(seconds))
            code = file.read_text(encoding="utf-8")
            changed = faulty(code, fault)
            file.write_text(changed, encoding="utf-8")
            forget(file)
            limit = 60 + int(3 * sum(s for test, s in seconds.items() if test.startswith(f"tests/{fault.folder}/")))
            start = time.monotonic()
            status, _ = tests(copy, fault.folder, fault.file, seconds, limit)
            file.write_text(code, encoding="utf-8")
            forget(file)
            old, new = (text.split("\n")[fault.line - 1].strip() for text in (code, changed))
            took = time.monotonic() - start
            results.append({**fault._asdict(), "killed": status != 0, "status": status, "old": old, "new": new, "seconds": round(took, 1)})
            (OUT / f"results-{part}.json").write_text(json.dumps(results, indent=1))
            print(
                f"{k + 1}/{len(faults)} {took:5.1f} s {'killed' if status else 'SURVIVED'} {fault.file}:{fault.line}: {old}  ->  {new}",
                flush=True,
            )
    for name in dict.fromkeys(folder for folder, _ in sources(ROOT)):
        own = [r["killed"] for r in results if r["folder"] == name]
        if own:
            print(f"{name:12} {sum(own):4} of {len(own):4} killed")
    killed = sum(r["killed"] for r in results)
    print(f"{'all':12} {killed:4} of {len(results):4} killed ({killed / max(len(results), 1):.1%})")


if __name__ == "__main__":
    main()

"""Settings of every test run. With ``-n``: a file a worker, the longest first. Under ``--nbval``: strict kernels, longest notebooks first, those without data skipped, ledgers compared."""

import contextlib
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# An example may take its time: no test depends on the speed of the machine.
# Nothing is remembered of failed examples where the checkout cannot be written to.
WRITABLE = os.access(Path(__file__).parent, os.W_OK)
settings.register_profile(
    "patient", deadline=None, suppress_health_check=[HealthCheck.too_slow], **({} if WRITABLE else {"database": None})
)
settings.load_profile("patient")

os.environ.setdefault("MPLBACKEND", "Agg")  # the notebooks' kernels have their own setting

# Files of tests by their processor time, the longest first: with two workers both then finish at about the same time.
LONGEST = (
    "ensemble/test_monte_carlo.py",
    "suite/test_suite_book.py",
    "suite/test_suite_run.py",
    "suite/test_suite_nbval.py",
    "fused/test_fused.py",
    "benchmarks/test_benchmarks.py",
    "ensemble/test_missing_measurements.py",
    "ensemble/test_adaptive_and_switching.py",
    "play/test_play.py",
    "ensemble/test_ensemble.py",
    "contract/test_contract.py",
    "suite/test_suite_order.py",
    "suite/test_suite_student.py",
    "ledger/test_ledger_tampering.py",
    "suite/test_suite_records.py",
    "notebooks/test_committed.py",
    "whole/test_whole.py",
)

# What stands before other packages in the processes that the unit tests start: see there.
QUICK = Path(__file__).parent / "tests" / "quick"


def pytest_configure(config):
    if not WRITABLE:
        config.addinivalue_line("filterwarnings", "ignore::pytest.PytestCacheWarning")
    if config.getoption("dist", "no") == "load":  # what -n chooses by itself; a file's fixtures are then made once
        config.option.dist, config.option.loadscopereorder = "loadfile", False
    nbval = config.getoption("nbval", False)
    if not nbval and str(QUICK) not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(QUICK), os.environ.get("PYTHONPATH")]))
    if not nbval or hasattr(config, "workerinput"):  # pytest-xdist's workers inherit the environment
        return
    from trackhelpers.suite.kernel import strict_kernels

    stack = contextlib.ExitStack()
    config.add_cleanup(stack.close)
    results = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="trackhelpers-results-")))
    stack.enter_context(strict_kernels(results))
    config.pluginmanager.register(LedgersAreCommitted(config.rootpath, results))


def pytest_collection_modifyitems(config, items):
    if not config.getoption("nbval", False):
        place = {config.rootpath / "tests" / name: i for i, name in enumerate(LONGEST)}
        items.sort(key=lambda item: place.get(item.path, len(place)))
        return
    from trackhelpers.suite import longest_first, missing_data

    folder = config.rootpath / "notebooks"
    items[:] = longest_first(items, folder, path=lambda item: item.path)
    for item in items:
        item.output_timeout = 600  # s: nbval's own 5 for the outputs to arrive are few on a machine under load
        if item.path.suffix == ".ipynb" and item.path.is_relative_to(folder):
            reason = missing_data(item.path, folder)
            if reason:
                item.add_marker(pytest.mark.skip(reason=reason))


class LedgersAreCommitted:
    """Fails the session when a notebook that passed wrote another ledger than the committed one."""

    def __init__(self, root, results):
        self.root, self.results = root, results
        self.outcomes = {}
        self.differences = []

    def pytest_runtest_logreport(self, report):
        self.outcomes.setdefault(self.root / report.nodeid.split("::")[0], set()).add(report.outcome)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session):
        from trackhelpers.ledger import compare
        from trackhelpers.suite import notebooks

        folder = self.root / "notebooks"
        unfinished = [p for p in notebooks(folder) if self.outcomes.get(p) != {"passed"}]
        exclude = {p.relative_to(folder).with_suffix("").as_posix() for p in unfinished}
        self.differences = compare(folder / "results", self.results, exclude=exclude)
        if self.differences and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        if self.differences:
            terminalreporter.section("committed ledgers that are not what the notebooks write", red=True)
            terminalreporter.write_line("\n".join(self.differences))

"""The benchmark compares like with like. Nothing here looks at a time."""

import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import cloop, report, run, timing, workloads

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("workload", [w for w in run.WORKLOADS + run.SINGLES if w.same], ids=lambda w: w.key)
@pytest.mark.parametrize("runs", [1, 11, run.CHECKED])
def test_everyone_gives_our_results_on_the_same_data(workload, runs):
    found = run.check(workload, runs=runs, steps=12)
    assert set(found) == {label for label in workload.others if run.reason_to_skip(label) is None}
    assert set(workload.loops) <= set(found) | {"Stone Soup"}


@pytest.mark.parametrize("name", ["x", "P", "NEES"])
def test_a_contender_that_differs_is_named(name):
    def spoilt(problem):
        def call():
            result = workloads.ensemble_ekf(problem)()
            result[name][-1] += 1e-6
            return result

        return call

    with pytest.raises(ArithmeticError, match=r"EKF: someone differs from ours by 1e-06"):
        run.check(replace(run.EKF, loops={"someone": spoilt}, arrays={}), runs=3, steps=4)


def test_the_first_runs_of_a_problem_do_not_depend_on_how_many_follow():
    few, many = workloads.ctrv_problem(3, 5), workloads.ctrv_problem(9, 5).first(3)
    np.testing.assert_array_equal(few.x0, many.x0)
    for a, b in zip(few.zs, many.zs, strict=True):
        np.testing.assert_array_equal(a, b)


def test_without_a_compiler_the_c_loop_is_skipped_by_name(monkeypatch):
    cloop.compiler.cache_clear()
    monkeypatch.setattr(cloop.shutil, "which", lambda name: None)
    try:
        assert run.reason_to_skip("C") == "no C compiler (gcc) on this machine"
        assert "C" not in run.check(run.EKF, runs=2, steps=4)
    finally:
        cloop.compiler.cache_clear()


@pytest.mark.skipif(run.reason_to_skip("C") is not None, reason="no C compiler")
def test_the_c_loop_leaves_the_subnormal_numbers_of_its_process_alone():
    script = """
from benchmarks import cloop, workloads
least = 5e-324
cloop.c_loop(workloads.ctrv_problem(2, 3))()
print(least * 1.0, least + least)  # to be compared elsewhere: where subnormals are switched off, they equal zero
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("5e-324 1e-323\n", "")


def test_everyone_has_a_turn_in_every_round(monkeypatch):
    monkeypatch.setattr(timing, "LEAST", 0)
    turns = []
    costs = timing.interleaved({name: lambda name=name: turns.append(name) for name in "AB"}, rounds=3)
    assert turns == list("AB" + 3 * "AB")  # one to warm up, then the rounds
    assert {name: cost.shape for name, cost in costs.items()} == {"A": (3,), "B": (3,)}


def test_a_ratio_is_taken_within_a_round():
    costs = {"ours": np.array([1.0, 10.0, 2.0]), "other": np.array([8.0, 80.0, 160.0])}  # the machine slowed down for a while
    assert report.ratio(costs, "other") == 8
    assert [report.times(value) for value in (1234.5, 59.04, 1 / 8)] == ["×1,234", "×59", "÷8"]
    assert [report.duration(ns) for ns in (612.4, 36_100, 4.5e6, 123_456)] == ["612 ns", "36.1 µs", "4.50 ms", "123 µs"]


def test_the_quick_run_reports_all_contenders_and_writes_nothing(monkeypatch, capfd):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "TQDM_DISABLE"):
        monkeypatch.setenv(name, "1")  # and as it was afterwards
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--quick"])
    before = {path: path.stat().st_mtime_ns for path in (ROOT / "benchmarks").glob("*.*")}
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("benchmarks", run_name="__main__")  # as `python -m benchmarks`
    told = capfd.readouterr()
    assert (ended.value.code, told.err) == (0, "")
    for label in (
        "ensemble",
        *(
            label if run.reason_to_skip(label) else report.NAMES.get(label, label)
            for w in run.WORKLOADS + run.SINGLES
            for label in w.others
        ),
        *(w.key for w in run.SINGLES),
    ):
        assert label in told.out
    assert {path: path.stat().st_mtime_ns for path in (ROOT / "benchmarks").glob("*.*")} == before

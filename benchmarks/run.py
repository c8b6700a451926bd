"""Check, measure, report."""

import argparse
import importlib.util
import sys
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks import bound, report, workloads
from benchmarks.cloop import NotAvailable, c_loop, compiler
from benchmarks.peers import by_hand, cuthbert_ekf, jax_ekf, loops, simd, stone_soup
from benchmarks.timing import interleaved
from trackhelpers import angles, fused
from trackhelpers.ensemble import monte_carlo

TOLERANCE = 1e-9  # in x, P and NEES, SI units and rad: the filters are the same, only the order of the operations differs
CHECKED = 40  # runs on which everyone's results are compared: enough for the compiled loops
LOOPED = 2  # runs for which one filter after another is timed; the next ones cost the same


@dataclass(frozen=True)
class Workload:
    """What is compared: `ours` with `loops` (one run after another) and `arrays` (all runs at once)."""

    key: str
    title: str
    problem: callable
    ours: callable
    loops: dict
    arrays: dict = field(default_factory=dict)
    steps: int = 100
    required: float | None = None  # of a single target: the largest ratio of ours to the first loop that the project set itself
    same: bool = True  # whether the results must agree; another filter is compared in cost alone

    @property
    def others(self):
        return self.loops | self.arrays


EKF = Workload(
    "EKF",
    "EKF on CTRV, radar and lidar in turn, with NEES at every step",
    workloads.ctrv_problem,
    workloads.ensemble_ekf,
    {"filterpy": by_hand.filterpy_ekf, "MotionEKF": loops.motion_ekf, "Stone Soup": stone_soup.stone_soup_ekf},
    {
        "follow": workloads.ensemble_follow,
        "NumPy alone": workloads.numpy_alone(workloads.ensemble_ekf),
        "JAX": jax_ekf.jax_ekf,
        "cuthbert": cuthbert_ekf.cuthbert_ekf,
        "C": c_loop,
    },
)
KF = Workload(
    "KF",
    "Kalman filter on CV in the plane, the gain the same for all runs",
    workloads.cv_problem,
    workloads.ensemble_kf,
    {"filterpy": by_hand.filterpy_kf, "MotionKF": loops.motion_kf},
    {"NumPy alone": workloads.numpy_alone(workloads.ensemble_kf), "simdkalman": simd.simd_kalman},
    steps=200,
)
UKF = Workload(
    "UKF",
    "UKF on CTRV, radar and lidar in turn",
    workloads.ctrv_problem,
    workloads.ensemble_ukf,
    {"filterpy": by_hand.filterpy_ukf, "MotionUKF": loops.motion_ukf},
    steps=30,
)
WORKLOADS = (EKF, KF, UKF)


def of_size(n):
    """A linear model of n components under the EKF with NEES, each run with its own covariance."""
    return Workload(
        f"n = {n}",
        "",
        partial(workloads.chain_problem, n),
        workloads.ensemble_ekf,
        {"filterpy": by_hand.filterpy_kf},
        {"follow": workloads.ensemble_follow},
        same=False,
    )


SIZES = (4, 6, 9, 18)

_ekf, _by_hand = (partial(contender, with_nees=False) for contender in (loops.motion_ekf, by_hand.filterpy_ekf))
_redrawn = partial(by_hand.filterpy_ukf, redrawn=True)
SINGLES = (
    Workload("MotionEKF", "CTRV, radar and lidar in turn", workloads.ctrv_problem, _ekf, {"filterpy": _by_hand}, required=2.0),
    Workload("MotionEKF and NEES", "the same", workloads.ctrv_problem, loops.motion_ekf, {"filterpy": by_hand.filterpy_ekf}, required=2.0),
    Workload("MotionKF", "CV in the plane", workloads.cv_problem, loops.motion_kf, {"filterpy": by_hand.filterpy_kf}, required=1.5),
    Workload(
        "MotionUKF",
        "CTRV, radar and lidar in turn",
        workloads.ctrv_problem,
        loops.motion_ukf,
        {"filterpy redrawn": _redrawn, "filterpy": by_hand.filterpy_ukf},
        required=1.2,
    ),
    Workload("MotionUKF", "CTRA, radar", workloads.ctra_problem, loops.motion_ukf, {"MotionEKF": _ekf}, same=False),
    Workload(
        "ManoeuvreIMM",
        "CV and CA in the plane",
        workloads.imm_problem,
        loops.manoeuvre_imm,
        {"filterpy IMM": by_hand.filterpy_imm},
        required=0.8,
    ),
)


def reason_to_skip(label):
    """Why a contender cannot run here, or None."""
    package = {"Stone Soup": "stonesoup", "simdkalman": "simdkalman", "JAX": "jax", "cuthbert": "cuthbert"}.get(label)
    if package is not None and importlib.util.find_spec(package) is None:
        return f"the package {package} is not installed"
    if label == "NumPy alone" and fused.binding is None:
        return "llvmlite is not there, so the ensemble is NumPy alone"
    if label == "C":
        try:
            compiler()
        except NotAvailable as reason:
            return str(reason)
    return None


def largest_difference(ours, other, heading):
    """The largest difference between two results in any of their entries, angles the short way round."""
    differences = [angles.residual(ours[name], other[name], heading if name == "x" else ()) for name in ours]
    return max(float(np.max(np.abs(difference))) for difference in differences)


def check(workload, runs, steps):
    """Label -> `largest_difference` from ours on the same data, for all who can run here; ArithmeticError where it exceeds TOLERANCE."""
    if not workload.same:
        return {}
    problem = workload.problem(runs, steps)
    ours = workload.ours(problem)()
    found = {}
    for label, contender in workload.others.items():
        if reason_to_skip(label) is None:
            found[label] = largest_difference(ours, contender(problem)(), problem.model.angles)
            if not found[label] <= TOLERANCE:
                raise ArithmeticError(f"{workload.key}: {label} differs from ours by {found[label]:.2g}, more than {TOLERANCE}")
    return found


def measure(workload, shapes, rounds, labels=None):
    """(runs, steps) -> label -> ns a step and run, an array over the rounds; "ours" among the labels. All sizes take part in every round."""
    calls, units = {}, {}
    for runs, steps in shapes:
        problem = workload.problem(runs, steps)
        contenders = {"ours": workload.ours} | {k: v for k, v in workload.others.items() if labels is None or k in labels}
        for label, contender in contenders.items():
            if reason_to_skip(label) is None:
                part = problem.first(min(runs, LOOPED)) if label in workload.loops else problem
                calls[runs, steps, label], units[runs, steps, label] = contender(part), part.runs * steps
    costs = {shape: {} for shape in shapes}
    for (runs, steps, label), seconds in interleaved(calls, rounds).items():
        costs[runs, steps][label] = 1e9 * seconds / units[runs, steps, label]
    return costs


def filter_chunk(steps):
    """A Monte Carlo task: one chunk of runs through EnsembleEKF."""

    def task(rngs):
        result = workloads.ensemble_ekf(workloads.ctrv_problem(len(rngs), steps, rngs))()
        return {"NEES": result["NEES"] * len(rngs)}

    return task


def speed_up(chunks, chunk, steps, rounds):
    """Seconds a chunk on one core, and how much sooner two processes are done: the median over the rounds."""
    task, times = filter_chunk(steps), {1: [], 2: []}
    monte_carlo(task, 2 * chunk, workloads.SEED, n_jobs=2, chunk=chunk)  # starts the processes
    for _ in range(rounds):
        for n_jobs in times:
            begin = perf_counter()
            monte_carlo(task, chunks * chunk, workloads.SEED, n_jobs=n_jobs, chunk=chunk)
            times[n_jobs].append(perf_counter() - begin)
    return float(np.median(times[1])) / chunks, float(np.median(np.divide(times[1], times[2])))


def main(arguments=None):
    """The command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few runs and steps, nothing is written")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder for results.md and cost.png (this one)")
    parser.add_argument("--single", action="store_true", help="only the filters of one target, nothing is written")
    options = parser.parse_args(arguments)
    sizes, lengths, rounds, turns, runs = (1, 10, 100, 1000, 10_000), (50, 100, 200, 400, 800), 5, 15, 1000
    if options.quick:
        sizes, lengths, rounds, turns, runs = (8,), (10,), 1, 1, 8

    try:
        checked = SINGLES if options.single else WORKLOADS + SINGLES
        agreement = {
            (w.key, w.title): check(w, runs=2 if options.quick else CHECKED, steps=20 if options.quick else w.steps) for w in checked
        }
    except ArithmeticError as error:
        print(error, file=sys.stderr)
        return 1
    one = {(w.key, w.title): measure(w, [(1, w.steps)], turns)[1, w.steps] for w in SINGLES}
    if options.single:
        print("\n".join(report.single(SINGLES, agreement, one)))
        return 0
    by_runs, by_steps = {}, measure(EKF, [(runs, N) for N in lengths], rounds, labels=("follow", "filterpy", "JAX", "C"))
    by_steps = {N: cost for (_, N), cost in by_steps.items()}
    for w in WORKLOADS:
        costs = measure(w, [(M, 20 if options.quick else w.steps) for M in sizes], rounds)
        by_runs[w.key] = {M: cost for (M, _), cost in costs.items()}
    by_size = {}
    for n in (4,) if options.quick else SIZES:
        w = of_size(n)
        by_size[n] = measure(w, [(runs, 5 if options.quick else 50)], rounds)[runs, 5 if options.quick else 50]
    least = bound.operations(EKF.problem(1, 2)) * bound.nanoseconds_an_operation() if fused.binding else None
    parallel = speed_up(2, 5, 10, 1) if options.quick else speed_up(16, 1000, 200, 3)
    skipped = {label: reason_to_skip(label) for w in WORKLOADS for label in w.others if reason_to_skip(label)}

    text = report.markdown(WORKLOADS, SINGLES, agreement, one, by_runs, by_steps, by_size, least, runs, parallel, skipped)
    print(text)
    if not options.quick:
        (options.out / "results.md").write_text(text, encoding="utf-8")
        report.figure(WORKLOADS, by_runs, by_steps, least, runs).savefig(options.out / "cost.png")
    return 0

"""What was measured, as a table and as a figure."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from threadpoolctl import threadpool_info

from benchmarks.cloop import NotAvailable, compiler
from trackhelpers import fused
from trackhelpers.plots import COLOURS

NAMES = {
    "ours": "ensemble",
    "follow": "ensemble, all steps in one call",
    "filterpy": "filterpy, model by hand",
    "filterpy redrawn": "filterpy, model by hand, points redrawn, angles wrapped",
    "filterpy IMM": "filterpy's IMMEstimator on two KalmanFilters",
    "NumPy alone": "ensemble, nothing compiled",
    "C": "a loop in C",
    "JAX": "JAX, vmap and scan",
    "cuthbert": "cuthbert, vmap",
}
STYLES = {
    "ours": ("blue", "o"),
    "follow": ("blue", "*"),
    "NumPy alone": ("band", "o"),
    "filterpy": ("orange", "s"),
    "MotionEKF": ("vermillion", "^"),
    "MotionKF": ("vermillion", "^"),
    "MotionUKF": ("vermillion", "^"),
    "Stone Soup": ("purple", "v"),
    "simdkalman": ("purple", "v"),
    "C": ("green", "D"),
    "JAX": ("vermillion", "P"),
    "cuthbert": ("vermillion", "X"),
}


def machine():
    """Lines that say what this was measured on."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        cpu = next((line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")), cpu)
    found = np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", [])
    compiler_used = f"llvmlite {version('llvmlite')}" if fused.binding else "no llvmlite"
    lines = [
        f"{cpu}, {os.cpu_count()} cores, {platform.system()}",
        f"Python {platform.python_version()}, NumPy {np.__version__} ({found[-1] if found else 'its baseline'}), {compiler_used}, one thread",
    ]
    kernels = sorted({f"{pool['internal_api']} {pool['version']} ({pool.get('architecture', '?')})" for pool in threadpool_info()})
    lines.append(f"BLAS kernel: {', '.join(kernels) or 'none found'}")
    try:
        lines.append(f"C compiler: {compiler()[1]}, -O3 -march=native -ffast-math")
    except NotAvailable as reason:
        lines.append(f"C: {reason}")
    return lines


def duration(ns):
    """Nanoseconds with three digits, in ns, µs or ms."""
    for unit, size in (("ms", 1e6), ("µs", 1e3)):
        if ns >= size:
            return f"{ns / size:#.3g}".rstrip(".") + f" {unit}"
    return f"{ns:.0f} ns"


def ratio(costs, label):
    """How many times the ensemble's cost a contender costs: the median over the rounds of the ratio within a round."""
    return float(np.median(costs[label] / costs["ours"]))


def times(value):
    """×59 for what costs 59 times as much, ÷8.3 for what costs 1/8.3."""
    sign, value = ("×", value) if value >= 1 else ("÷", 1 / value)
    return f"{sign}{value:,.0f}" if value >= 100 else f"{sign}{value:.3g}"


def table(first, sizes, costs):
    """A Markdown table with one line for each of `sizes`; `costs`: size -> label -> ns over the rounds."""
    labels = [label for label in costs[sizes[0]] if label != "ours"]
    head = [first, "ensemble", *(NAMES.get(label, label) for label in labels)]
    lines = ["| " + " | ".join(head) + " |", "|" + " ---: |" * len(head)]
    for size in sizes:
        row = costs[size]
        cells = [f"{duration(np.median(row[label]))} · {times(ratio(row, label))}" for label in labels]
        lines.append("| " + " | ".join([f"{size:,}", duration(np.median(row["ours"])), *cells]) + " |")
    return lines


def single(singles, agreement, costs):
    """What one target's step costs, ours against each loop; `costs`: (key, title) -> label -> ns over the rounds."""
    lines = [
        "## One target",
        "",
        "A step of a filter that tracks one target, beside the loop over filterpy that a user would write by hand. Required is what this project set itself.",
        "",
        "| filter | a step | against | a step | ratio | required |",
        "| --- | ---: | --- | ---: | ---: | ---: |",
    ]
    for workload in singles:
        row = costs[workload.key, workload.title]
        for i, label in enumerate(workload.others):
            ours, other = (duration(np.median(row[name])) for name in ("ours", label))
            required = f"≤ {workload.required}" if i == 0 and workload.required else ""
            quotient = f"{np.median(row['ours'] / row[label]):.2f}"
            lines.append(f"| {workload.key}, {workload.title} | {ours} | {NAMES.get(label, label)} | {other} | {quotient} | {required} |")
    worst = max(max(agreement[workload.key, workload.title].values()) for workload in singles if workload.same)
    return [*lines, "", f"Largest difference from the same filter in x, P and NEES: {worst:.0e}.", ""]


def markdown(workloads, singles, agreement, one, by_runs, by_steps, by_size, least, runs_of_steps, parallel, skipped):
    """The whole report."""
    lines = [
        "# What the ensemble costs",
        "",
        "Cost a step and run, median over the rounds, and what that is beside the ensemble's: ×59 is 59 times as much, ÷8 an eighth. Only these ratios are",
        "claimed: each is taken within a round, in which everyone has a turn, and the median over the rounds is shown. A loop over single filters is timed on",
        "its first few runs, for the next ones cost the same. `make bench` measures anew; the figure is cost.png.",
        "",
        *(f"* {line}" for line in machine()),
        "",
    ]
    for workload in workloads:
        worst = agreement[workload.key, workload.title]
        lines += [f"## {workload.title}", ""]
        lines += table("runs M", list(by_runs[workload.key]), by_runs[workload.key])
        lines += [
            "",
            "Largest difference from the ensemble in x, P and NEES: " + ", ".join(f"{k} {v:.0e}" for k, v in worst.items()) + ".",
            "",
        ]
    lines += single(singles, agreement, one)
    lines += [f"## Cost against the number of steps ({workloads[0].key}, M = {runs_of_steps:,})", ""]
    lines += table("steps N", list(by_steps), by_steps)
    lines += ["", f"## Cost against the size of the state (linear models with an own covariance a run and NEES, M = {runs_of_steps:,})", ""]
    lines += table("components n", list(by_size), by_size)
    if least is not None:
        lines += ["", "## The bound", ""]
        lines += [
            f"The arithmetic of a step of the EKF with NEES alone takes {least:.0f} ns a run at the rate that this processor reaches on one core (benchmarks/bound.py)."
        ]
    seconds, gain = parallel
    lines += ["", "## Two processes", ""]
    lines += [f"`monte_carlo` on chunks of {seconds:.2g} s: ×{gain:.2f} as fast with `n_jobs=2` as with one process."]
    if skipped:
        lines += ["", "Not measured: " + "; ".join(f"{label}, for {reason}" for label, reason in skipped.items()) + "."]
    return "\n".join(lines) + "\n"


def figure(workloads, by_runs, by_steps, least, runs_of_steps):
    """Cost a step and run against M, one panel a workload, and time of a whole run against N."""
    fig = Figure(figsize=(11, 6.5), dpi=100, layout="constrained")
    axes = fig.subplots(2, 2).ravel()
    for ax, workload in zip(axes, workloads, strict=False):
        _lines(ax, by_runs[workload.key], lambda size: 1e-3)
        if least is not None and workload is workloads[0]:
            ax.axhline(least * 1e-3, color="#555555", linestyle="--", linewidth=1, label="its arithmetic")
        ax.set(title=workload.key, xlabel="runs M", ylabel="cost a step and run (µs)")
    _lines(axes[-1], by_steps, lambda N: N * 1e-9 * runs_of_steps)
    axes[-1].set(title=f"{workloads[0].key}, M = {runs_of_steps:,}", xlabel="steps N", ylabel="time of all runs (s)")
    return fig


def _lines(ax, costs, factor):
    sizes = list(costs)
    for label in costs[sizes[0]]:
        colour, mark = STYLES[label]
        values = [np.median(costs[size][label]) * factor(size) for size in sizes]
        ax.loglog(sizes, values, color=COLOURS[colour], marker=mark, markersize=4, linewidth=1.4, label=NAMES.get(label, label))
    ax.set_xticks(sizes, [f"{size:,}" for size in sizes])
    ax.minorticks_off()
    ax.grid(color="#DDDDDD", linewidth=0.6)
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8, frameon=False)

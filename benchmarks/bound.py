"""How long the arithmetic of a step takes at least: its operations, counted in the compiled step, at the rate that this processor reaches with nothing else to do."""

from time import perf_counter

import numpy as np

from trackhelpers import fused, kernels
from trackhelpers.symbols import Symbol, tracing

CHAINS, LENGTH, ROUNDS = 16, 60, 7  # independent chains of products and sums, so that none waits for another


def operations(problem):
    """Arithmetic operations of a step with NEES, a fused product and sum counted as one; the mean over the sensors that take turns."""
    return float(
        np.mean([_count(lambda s=s: fused._whole_step(problem.model, s, Symbol("dt"), "shared", False, False)) for s in problem.sensors])
    )


def _count(build):
    with tracing():
        code = kernels.Kernel(build()).operations
    sums = sum(op in ("fadd", "fsub") for op in code)
    products = sum(op == "fmul" for op in code)
    return max(sums, products) + sum(op == "fdiv" or op.startswith("llvm.") for op in code)


def nanoseconds_an_operation():
    """The least time that an operation takes a run here: measured on chains of fused products and sums that stay in the registers."""
    with tracing():
        values = [Symbol("load", 0, i) for i in range(CHAINS)]
        for _ in range(LENGTH):
            values = [value * value + value for value in values]
        kernel = kernels.Kernel([((CHAINS,), values)])
    data = np.full((CHAINS, 1024), 1e-3)
    kernel(1024, data)
    times = []
    for _ in range(ROUNDS):
        begin = perf_counter()
        for _ in range(20):
            kernel(1024, data)
        times.append((perf_counter() - begin) / 20)
    return 1e9 * min(times) / (1024 * CHAINS * LENGTH)

"""Kernels read and write the arrays that they are given, whatever their number of runs; without the compiler the package does without."""

import subprocess
import sys

import numpy as np
import pytest

from trackhelpers import kernels
from trackhelpers.symbols import Symbol, tracing

compiled = pytest.mark.skipif(kernels.binding is None, reason="llvmlite is not installed")


def kernel(*outputs):
    with tracing():
        return kernels.Kernel([((len(symbols),), symbols) for symbols in (make() for make in outputs)])


@compiled
@pytest.mark.parametrize("M", [1, 3, 8, 11, 64, 100])
def test_rows_of_several_arrays(M):
    made = kernel(
        lambda: [Symbol("load", 0, 1) + Symbol("load", 1, 0), Symbol("dt") * Symbol("load", 1, 2)], lambda: [Symbol("load", 0, 0)]
    )
    a, b = np.random.default_rng(0).normal(size=(2, 3, M))
    two, one = made(M, a, b, dt=0.5)
    np.testing.assert_array_equal(two, [a[1] + b[0], 0.5 * b[2]])
    np.testing.assert_array_equal(one, a[:1])


@compiled
def test_parts_of_arrays_and_arrays_that_are_not_to_be_written_are_read():
    made = kernel(lambda: [Symbol("load", 0, 0) * 2.0, Symbol("load", 0, 1) * 2.0])
    whole = np.arange(60.0).reshape(2, 30)
    part = whole[:, ::3]
    frozen = np.broadcast_to(np.array([[1.0], [2.0]]), (2, 10))
    np.testing.assert_array_equal(made(10, part)[0], 2 * part)
    np.testing.assert_array_equal(made(10, frozen)[0], 2 * frozen)
    assert kernels.address(whole) == whole.ctypes.data and kernels.address(part) == part.ctypes.data


@compiled
def test_a_row_that_is_not_written_is_left():
    made = kernel(lambda: [Symbol("load", 0, 1), None, Symbol("load", 0, 0)])
    out, given = np.full((3, 9), 7.0), np.arange(18.0).reshape(2, 9)
    kernels.many_steps([made], 9, [0.0], np.array([[(kernels.address(out), 9), (kernels.address(given), 9)]]))
    np.testing.assert_array_equal(out, [given[1], np.full(9, 7.0), given[0]])


@compiled
@pytest.mark.parametrize("M", [1, 7, 8, 63, 127, 128, 129, 300])
def test_many_steps_are_a_sum_over_time(M):
    """x ← x + dt z with what all runs share added: each array has its own distance between rows."""
    made = kernel(lambda: [Symbol("load", 0, i) + Symbol("dt") * Symbol("load", 1, i) + Symbol("shared", 2, i) for i in range(2)])
    rng, N = np.random.default_rng(1), 9
    z, shared, steps = rng.normal(size=(N, 2, M)), rng.normal(size=(2, N)), rng.uniform(size=N)
    start, history = rng.normal(size=(2, M)), np.empty((2, N, M))
    at = [(kernels.address(history) + 8 * M * k, N * M) for k in range(N)]
    before = [(kernels.address(start), M), *at[:-1]]
    table = [at, before, [(kernels.address(z) + 16 * M * k, M) for k in range(N)], [(kernels.address(shared) + 8 * k, N) for k in range(N)]]
    kernels.many_steps([made] * N, M, steps, np.stack(table, axis=1))
    moves = steps[:, None, None] * z + shared.T[..., None]
    np.testing.assert_allclose(history, np.moveaxis(start + np.cumsum(moves, axis=0), 0, 1), atol=1e-13)


@pytest.mark.parametrize(
    "how", ["import sys; sys.modules['llvmlite'] = sys.modules['numba'] = None", "import os; os.environ['TRACKHELPERS_COMPILED'] = '0'"]
)
def test_without_the_compiler_all_goes_by_numpy(how, capsys):
    script = f"""
{how}
import numpy as np
from trackhelpers import fused
from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.follow import follow
from trackhelpers.motion import CTRV
from trackhelpers.sensors import Lidar, Radar
assert fused.binding is None
ens = EnsembleEKF(CTRV(0.5, 0.1), np.ones((5, 12)) * np.linspace(1, 2, 12), np.eye(5))
history = follow(ens, [np.full((3 - k % 2, 12), 1.5) for k in range(20)], [Radar(), Lidar()] * 10, 0.1, truth=np.ones((5, 20)))
print(repr(float(history.nees.sum() + history.x.sum() + ens.K.sum())))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stderr == ""
    exec(script.replace(how, "").replace("assert", "#"), {})
    assert float(done.stdout) == pytest.approx(float(capsys.readouterr().out), rel=1e-11)

"""The C loop of cloop.c, compiled when it is wanted, for this processor."""

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

LANES = 8  # W in cloop.c
_DOUBLES = ctypes.POINTER(ctypes.c_double)


class NotAvailable(Exception):
    """A contender that cannot run here; the message says why."""


@cache
def compiler():
    """Path of a C compiler and its version line."""
    path = shutil.which("gcc") or shutil.which("cc")
    if path is None:
        raise NotAvailable("no C compiler (gcc) on this machine")
    return path, subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]


@cache
def _library():
    path, _ = compiler()
    source = Path(__file__).with_name("cloop.c")
    with tempfile.TemporaryDirectory(prefix="cloop-") as folder:
        compiled, target = (str(Path(folder) / f"cloop.{kind}") for kind in ("o", "so"))
        compiling = [path, "-O3", "-march=native", "-ffast-math", "-std=gnu11", "-fPIC", "-c", str(source), "-o", compiled]
        # not linked with -ffast-math: gcc would add start code that switches subnormals off for the whole process
        linking = [path, "-shared", compiled, "-o", target, "-lm"]
        for flags in (["-mprefer-vector-width=512"], []):  # full vectors where the compiler knows the flag
            made = subprocess.run([*compiling, *flags], capture_output=True, text=True)
            if made.returncode == 0:
                made = subprocess.run(linking, capture_output=True, text=True)
            if made.returncode == 0:
                return ctypes.CDLL(target)  # stays mapped when the file is gone
    raise NotAvailable(f"{path} does not compile cloop.c: {made.stderr.strip().splitlines()[0]}")


def c_loop(problem):
    """The EKF and its NEES in C, runs in the lanes of a vector; as an ensemble of a multiple of `LANES` runs, the last one repeated."""
    lidar, radar = problem.sensors[1], problem.sensors[0]
    library, n, runs = _library(), problem.model.n, problem.runs
    wanted = np.minimum(np.arange(-(-runs // LANES) * LANES), runs - 1)
    zs = [np.ascontiguousarray(z[:, wanted]) for z in problem.zs]
    pointers = (_DOUBLES * problem.steps)(*[_doubles(z) for z in zs])
    q_a, q_w = np.square(problem.model.sigmas)
    R_radar, R_lidar = (np.diag(sensor.R).copy() for sensor in (radar, lidar))
    counts = np.where(np.arange(len(wanted)) < runs, 1.0, 0.0)
    truth = np.ascontiguousarray(problem.truth)

    def run():
        x = np.ascontiguousarray(problem.x0[:, wanted])
        P = np.repeat(problem.P0[:, :, None], len(wanted), axis=2)
        total = np.zeros(problem.steps)
        library.ekf_ctrv(
            *map(ctypes.c_long, (len(wanted), problem.steps)),
            *map(ctypes.c_double, (problem.T, q_a, q_w)),
            *map(_doubles, (R_radar, R_lidar)),
            pointers,
            *map(_doubles, (truth, counts, x, P, total)),
        )
        return {"x": x[:, :runs].reshape(n, runs), "P": P[..., :runs], "NEES": total / runs}

    run.kept = zs  # what the pointers point at
    return run


def _doubles(array):
    return array.ctypes.data_as(_DOUBLES)

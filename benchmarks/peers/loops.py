"""The project's own filterpy subclasses, one run after the other."""

import numpy as np

from benchmarks.workloads import QUIET
from trackhelpers.consistency import nees
from trackhelpers.filters import ManoeuvreIMM, MotionEKF, MotionKF, MotionUKF


def one_by_one(problem, start, step, with_nees=False):
    """Run `start(i)`, then `step(filter, k, i)` for every step k, for each run i; the result as an ensemble's.

    Where NEES is asked for it is computed as a loop over filterpy would, by a solve.
    """
    heading = problem.model.angles
    x, P = np.empty_like(problem.x0), np.empty((*problem.P0.shape, problem.runs))
    total = np.zeros(problem.steps)
    for i in range(problem.runs):
        kf = start(i)
        for k in range(problem.steps):
            step(kf, k, i)
            if with_nees:
                error = problem.truth[:, k] - kf.x
                for j in heading:
                    error[j] = (error[j] + np.pi) % (2 * np.pi) - np.pi
                total[k] += error @ np.linalg.solve(kf.P, error)
        x[:, i], P[..., i] = kf.x, kf.P
    result = {"x": x, "P": P}
    return result | {"NEES": total / problem.runs} if with_nees else result


def _subclass(Filter, problem):
    def step(kf, k, i):
        kf.predict(problem.T)
        kf.update(problem.zs[k][:, i], problem.sensor(k))

    return lambda i: Filter(problem.model, problem.x0[:, i], problem.P0), step


def motion_ekf(problem, with_nees=True):
    """MotionEKF, NEES by trackhelpers.consistency.nees with all its checks."""
    start, step = _subclass(MotionEKF, problem)
    if not with_nees:
        return lambda: one_by_one(problem, start, step)
    total = np.empty((problem.steps, problem.runs))

    def step_and_judge(kf, k, i):
        step(kf, k, i)
        total[k, i] = nees(problem.truth[:, k], kf.x, kf.P, problem.model.angles)

    return lambda: one_by_one(problem, start, step_and_judge) | {"NEES": total.mean(axis=1)}


def motion_kf(problem):
    """MotionKF."""
    return lambda: one_by_one(problem, *_subclass(MotionKF, problem))


def motion_ukf(problem):
    """MotionUKF."""
    return lambda: one_by_one(problem, *_subclass(MotionUKF, problem))


def manoeuvre_imm(problem):
    """ManoeuvreIMM on QUIET and the problem's model."""
    (sensor,) = problem.sensors
    kept = [problem.model.state.index(name) for name in QUIET.state]
    P0 = problem.P0[np.ix_(kept, kept)]

    def step(kf, k, i):
        kf.predict()
        kf.update(problem.zs[k][:, i])

    return lambda: one_by_one(problem, lambda i: ManoeuvreIMM(QUIET, problem.model, sensor.R, problem.T, problem.x0[kept, i], P0), step)

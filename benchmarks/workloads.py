"""The workloads, and how the ensemble filters run them.

A `Problem` is data: a model, sensors that take turns, one true track and M noisy copies of its measurements. A *contender* is a function of a problem that
prepares what it likes (not timed) and returns another, without arguments, that runs all filters over all steps (timed) and returns a dict: the final estimates
``x`` (n, M), their covariance ``P`` (n, n, M), and, where the workload asks for it, ``NEES`` (N,), averaged over the runs.
"""

from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np

from trackhelpers import fused
from trackhelpers.consistency import nees
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, EnsembleUKF, shared
from trackhelpers.follow import follow
from trackhelpers.motion import CA, CTRA, CTRV, CV, LinearModel
from trackhelpers.motion.base import Model
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar, Sensor

SEED = 42
QUIET = CV(0.5, axes=2)


@dataclass(frozen=True)
class Problem:
    """N steps of M runs: predict by T, then measure ``zs[k]`` (m, M) by ``sensors[k % len(sensors)]``, beside the truth (n, N)."""

    model: Model
    sensors: tuple[Sensor, ...]
    T: float
    truth: np.ndarray
    zs: list[np.ndarray]
    x0: np.ndarray
    P0: np.ndarray

    @property
    def runs(self):
        return self.x0.shape[1]

    @property
    def steps(self):
        return len(self.zs)

    def sensor(self, k):
        return self.sensors[k % len(self.sensors)]

    def first(self, runs):
        """The same problem for the first `runs` runs."""
        return replace(self, zs=[z[:, :runs] for z in self.zs], x0=self.x0[:, :runs])


def generators(runs):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(SEED).spawn(runs)]


def ctrv_problem(runs, steps, rngs=None):
    """The thesis's section 4.2: a turning target, radar and lidar in turn."""
    rngs = generators(runs) if rngs is None else rngs
    track = lidar_radar.truth(steps + 1)
    zs = lidar_radar.measurements(rngs, track=track)
    deviation = np.array([0.15, 0.15, 1.0, 0.1, 0.1])
    x0 = track[:, :1] + deviation[:, None] * np.stack([rng.standard_normal(5) for rng in rngs], axis=-1)
    # the filter starts at the first sample; the second is the radar's
    return Problem(CTRV(2.0, 0.3), (Radar(), Lidar()), lidar_radar.T, track[:, 1:].copy(), zs[1:], x0, np.diag(deviation**2))


def ctra_problem(runs, steps):
    """The same target followed with an acceleration in the state, by the radar alone."""
    problem = ctrv_problem(runs, 2 * steps)
    zs, truth = problem.zs[::2], np.vstack([problem.truth[:, ::2], np.zeros(steps)])
    x0, P0 = np.vstack([problem.x0, np.zeros((1, runs))]), np.diag([*np.diag(problem.P0), 0.25])
    model = CTRA(1.0, 0.3)
    return Problem(model, (Radar(state=model.state),), 2 * problem.T, truth, zs, x0, P0)


def cv_problem(runs, steps):
    """A linear filter: position in the plane, constant velocity."""
    rng = np.random.default_rng(SEED)
    model, T = QUIET, 0.1
    time = T * np.arange(1, steps + 1)
    truth = np.stack([5 * time, np.full(steps, 5.0), -2 * time, np.full(steps, -2.0)])
    sensor = Position(1.0, model.state)
    zs = [sensor.h(truth[:, k])[:, None] + rng.standard_normal((2, runs)) for k in range(steps)]
    x0 = np.array([0.0, 5.0, 0.0, -2.0])[:, None] + rng.standard_normal((4, runs))
    return Problem(model, (sensor,), T, truth, zs, x0, np.eye(4))


def imm_problem(runs, steps):
    """The same target, perhaps in a manoeuvre: all in the state of CA, accelerations 0."""
    problem, model = cv_problem(runs, steps), CA(1.0, axes=2)
    E = np.array([[float(a == b) for b in QUIET.state] for a in model.state])
    sensor = Position(1.0, model.state)
    return replace(problem, model=model, sensors=(sensor,), truth=E @ problem.truth, x0=E @ problem.x0, P0=E @ problem.P0 @ E.T)


def chain_problem(n, runs, steps):
    """A linear model of n components, chains of position, velocity (and acceleration) side by side, as an EKF that does not know it: every run has its own covariance."""
    rng, T = np.random.default_rng(SEED), 0.1
    links = 2 if n % 3 else 3
    block = CV(0.5, axes=1) if links == 2 else CA(0.5, axes=1)
    nought = np.zeros(links)
    F, Q = (np.kron(np.eye(n // links), matrix) for matrix in (block.F(nought, T), block.Q(nought, T)))
    model = LinearModel(F, Q, T, [f"c{i}" for i in range(n)])
    sensor = LinearSensor(np.kron(np.eye(n // links), np.eye(1, links)), np.eye(n // links), model.state)
    truth = np.zeros((n, steps))
    zs = [rng.standard_normal((n // links, runs)) for _ in range(steps)]
    return Problem(model, (sensor,), T, truth, zs, rng.standard_normal((n, runs)), np.eye(n))


def ensemble_ekf(problem):
    """EnsembleEKF, NEES at every step."""

    def run():
        ens = EnsembleEKF(problem.model, problem.x0, problem.P0)
        scores = np.empty((problem.steps, problem.runs))
        for k, z in enumerate(problem.zs):
            ens.predict(problem.T)
            ens.update(z, problem.sensor(k))
            scores[k] = nees(problem.truth[:, k : k + 1], ens.x, ens.P, problem.model.angles)
        return {"x": ens.x, "P": ens.P, "NEES": scores.mean(axis=1)}

    return run


def ensemble_follow(problem):
    """EnsembleEKF, NEES at every step, all steps in one call."""
    sensors = [problem.sensor(k) for k in range(problem.steps)]

    def run():
        ens = EnsembleEKF(problem.model, problem.x0, problem.P0)
        history = follow(ens, problem.zs, sensors, problem.T, keep=(), truth=problem.truth)
        return {"x": ens.x, "P": ens.P, "NEES": history.nees.mean(axis=1)}

    return run


def ensemble_kf(problem):
    """EnsembleKF."""
    return lambda: _states_only(EnsembleKF, problem)


def ensemble_ukf(problem):
    """EnsembleUKF."""
    return lambda: _states_only(EnsembleUKF, problem)


def numpy_alone(contender):
    """The same contender with nothing compiled."""

    def prepare(problem):
        call = contender(problem)

        def run():
            with patch.object(fused, "binding", None), patch.object(shared, "_compiled", lambda: None):
                return call()

        return run

    return prepare


def _states_only(Ensemble, problem):
    ens = Ensemble(problem.model, problem.x0, problem.P0)
    for k, z in enumerate(problem.zs):
        ens.predict(problem.T)
        ens.update(z, problem.sensor(k))
    return {"x": ens.x, "P": ens.P}

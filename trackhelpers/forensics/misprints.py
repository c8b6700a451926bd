"""What each error of the thesis's chapter 3 does to the filter of section 4.2: filters compared on the same measurements."""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_array
from trackhelpers.consistency import nees, nis
from trackhelpers.ensemble import EnsembleEKF, monte_carlo
from trackhelpers.forensics.program import EnsembleUnsymmetricEKF
from trackhelpers.motion import CTRV
from trackhelpers.motion.arc import integrate_along_arc, unit
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, Radar

FAR = 10.0  # m: a run that ends farther from the truth is lost
LIDAR_ALONE = 0.15 * np.sqrt(2)  # m: distance error (RMS) of a lidar sample that nobody filters
EVERY = 5  # samples from one value of NEES and NIS to the next; odd, so that both sensors take part
START_SIGMA = {"Φ": 0.3, "c": 0.1}  # rad, 1/m: spread of the start in what the thesis has no number for; 1 for the rest, its P0 = I


def driven(x, dt, mu):
    """CTRV's state (5, ...) after `dt` seconds under a constant acceleration mu[0] and yaw acceleration mu[1]: what (3.12) approximates.

    The differential equation itself, integrated along the arc by quadrature; nothing in it is assumed small.
    """
    px, py, v, heading, w = np.broadcast_arrays(*np.asarray(x, dtype=float), *mu)[:5]
    a, alpha = mu

    def velocity(t):
        t = t.reshape(-1, *[1] * v.ndim)
        return (v + a * t) * unit(heading + w * t + alpha * t**2 / 2)

    way = integrate_along_arc(velocity, dt)
    return np.stack([px + way.real, py + way.imag, v + a * dt, heading + w * dt + alpha * dt**2 / 2, w + alpha * dt])


class Outcome(NamedTuple):
    """What a filter did in M runs of section 4.2."""

    position: np.ndarray  # (M,), root mean square over the samples of the distance from the truth, m
    velocity: np.ndarray  # (M,), the same of the velocity vector, m/s
    nees: np.ndarray  # (N // EVERY, M), NaN for a state that is not CTRV's
    nis: np.ndarray  # (N // EVERY, M), divided by the number of measured components
    lost: np.ndarray  # (M,), bool: ends more than `FAR` from the truth, or not finite

    @property
    def useless(self):
        """(M,), bool: the runs whose position is worse than a lidar sample that nobody filters."""
        return ~(self.position <= LIDAR_ALONE)


def compare(models, runs=1000, seed=0, start=None, track=None):
    """Run one EKF a model over section 4.2, all on the same measurements.

    Each starts at the first lidar point with P0 = I (see `START_SIGMA`) and takes a lidar and a radar sample in turn, as `lidar_radar.steps` gives them.

    Parameters
    ----------
    models : dict of str -> trackhelpers.model.Model or (Model, callable)
        Models whose state has x, y and either v, θ or vx, vy; with a process noise (x, dt) -> (n, n, M) in the place of the model's, such as (3.16), the filter is
        `EnsembleUnsymmetricEKF`.
    runs, seed : int
        As for `trackhelpers.ensemble.monte_carlo`; one seed gives one set of measurements, whatever the models.
    start : dict of str -> float, optional
        State component -> value at the start, where it is not 0.
    track : numpy.ndarray, shape (5, N), optional
        Truth (x, y, v, θ, ω); default `lidar_radar.truth()`.

    Returns
    -------
    dict of str -> Outcome
    """
    track = lidar_radar.truth() if track is None else check_array(track, "track", 5)
    if track.ndim != 2 or track.shape[1] < EVERY:
        raise ValueError(f"track: expected shape (5, N) with N ≥ {EVERY} samples, got {track.shape}")

    def task(rngs):
        zs = lidar_radar.measurements(rngs, track=track)
        outcomes = {name: _filtered(model, zs, track, start or {}) for name, model in models.items()}
        return {(name, field): value for name, outcome in outcomes.items() for field, value in outcome._asdict().items()}

    names = [(name, field) for name in models for field in Outcome._fields]
    parts = monte_carlo(task, runs, seed, reduce=dict.fromkeys(names, "concat"))
    return {name: Outcome(*(parts[name, field] for field in Outcome._fields)) for name in models}


def _filtered(model, zs, track, start):
    model, *Q = model if isinstance(model, tuple) else (model,)
    names, runs = list(model.state), zs[0].shape[1]
    x0 = np.zeros((model.n, runs))
    for name, value in (start | dict(zip("xy", zs[0], strict=True))).items():
        x0[names.index(name)] = value
    P0 = np.diag([START_SIGMA.get(name, 1.0) ** 2 for name in names])
    ens = EnsembleUnsymmetricEKF(model, x0, P0, *Q) if Q else EnsembleEKF(model, x0, P0)
    place, velocity = [names.index("x"), names.index("y")], lidar_radar.velocity(track)
    squares, consistency = np.zeros((2, runs)), []
    for k in lidar_radar.steps(ens, zs, Lidar(state=model.state), Radar(state=model.state)):
        with np.errstate(over="ignore", invalid="ignore"):  # what a lost run does
            errors = np.stack([ens.x[place] - track[:2, k - 1, None], _velocity(ens.x, names) - velocity[:, k - 1, None]])
            distances = np.sum(errors**2, axis=1)
            squares += distances
            if k % EVERY == 0:
                full = model.state == CTRV.state
                ratio = nees(track[:, k - 1], ens.x, ens.P, model.angles) if full else np.full(runs, np.nan)
                consistency.append((ratio, nis(ens.y, ens.S) / len(ens.y)))
    lost = ens.failed | ~(distances[0] <= FAR**2)
    return Outcome(*np.sqrt(squares / len(zs)), *np.moveaxis(consistency, 1, 0), lost)


def _velocity(x, names):
    if "vx" in names:
        return x[[names.index("vx"), names.index("vy")]]
    return x[names.index("v")] * np.stack([np.cos(x[names.index("θ")]), np.sin(x[names.index("θ")])])

"""Chapter 3 as printed, errors included, and what each error does to the filter of section 4.2.

A function with an equation's number transcribes that equation, entry by entry, for states of shape (n, ...). `PrintedCTRV` and `PrintedPolarCA` are
models that make the errors one asks for, so that each can be judged apart; `compare` runs filters on the same measurements.
"""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_array
from trackhelpers.consistency import nees, nis
from trackhelpers.ensemble import EnsembleEKF, monte_carlo
from trackhelpers.motion import CTRV, PolarCA
from trackhelpers.motion.arc import integrate_along_arc, unit
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, Radar

ERRORS = ("3.8", "3.9", "3.10 columns", "3.10 factor", "3.11", "3.16")
FAR = 10.0  # m: a run that ends farther from the truth is lost
LIDAR_ALONE = 0.15 * np.sqrt(2)  # m: distance error (RMS) of a lidar sample that nobody filters
EVERY = 5  # samples from one value of NEES and NIS to the next; odd, so that both sensors take part
START_SIGMA = {"Φ": 0.3, "c": 0.1}  # rad, 1/m: spread of the start in what the thesis has no number for; 1 for the rest, its P0 = I


def transition_36(x, dt):
    """(3.6): state (x, y, θ, v, a). Four increments are printed for five components; read row by row, the third one, aT, falls to θ."""
    px, py, heading, v, a = x
    way = v * dt + a / 2 * dt**2
    return np.stack([px + way * np.cos(heading), py + way * np.sin(heading), heading + a * dt, v, a])


def transition_38(x, dt):
    """(3.8), the first branch of (3.9) too: state (x, y, v, θ, ω); 0/0 at ω = 0."""
    px, py, v, heading, w = x
    east = px + v / w * np.sin(w * dt + heading) - v / w * np.sin(heading)
    north = py - v / w * np.cos(w * dt + heading) + v / w * np.cos(heading)
    return np.stack([east, north, v, w * dt + heading, w])


def transition_39_straight(x, dt):
    """(3.9), second branch. Four rows are printed for five components; read row by row, θ becomes the fourth one, ω, and ω itself has none and stays."""
    px, py, v, heading, w = x
    return np.stack([px + v * np.cos(heading) * dt, py + v * np.sin(heading) * dt, v, w, w])


def jacobian_310(x, dt):
    """(3.10) as printed in our copy, (5, 5, ...), "Δn" read as Δt: row 2 has columns 3 and 4 exchanged, the 1/ω² terms a factor Δt too many."""
    _, _, v, heading, w = np.asarray(x, dtype=float)
    s, c = np.sin(heading), np.cos(heading)
    s1, c1 = np.sin(dt * w + heading), np.cos(dt * w + heading)
    J = _identity(w)
    J[0, 2] = (-s + s1) / w
    J[0, 3] = v / w * (-c + c1)
    J[0, 4] = dt * v / w * c1 - dt * v / w**2 * (-s + s1)
    J[1, 2] = v / w * (-s + s1)
    J[1, 3] = (c - c1) / w
    J[1, 4] = dt * v / w * s1 - dt * v / w**2 * (c - c1)
    J[3, 4] = dt
    return J


def jacobian_310_repaired(x, dt):
    """(3.10) with the columns of row 2 in order and no Δt before the 1/ω² terms, (5, 5, ...): the derivative of (3.8), written as the thesis writes it."""
    _, _, v, heading, w = np.asarray(x, dtype=float)
    J = jacobian_310(x, dt)
    J[1, 2], J[1, 3] = J[1, 3].copy(), J[1, 2].copy()
    J[0, 4] = dt * v / w * np.cos(dt * w + heading) - v / w**2 * (-np.sin(heading) + np.sin(dt * w + heading))
    J[1, 4] = dt * v / w * np.sin(dt * w + heading) - v / w**2 * (np.cos(heading) - np.cos(dt * w + heading))
    return J


def jacobian_311(x, dt):
    """(3.11), (5, 5, ...): by its column 5 the turn rate does not move the position."""
    _, _, v, heading, w = np.asarray(x, dtype=float)
    J = _identity(w)
    J[0, 2], J[0, 3] = dt * np.cos(heading), -dt * v * np.sin(heading)
    J[1, 2], J[1, 3] = dt * np.sin(heading), dt * v * np.cos(heading)
    J[3, 4] = dt
    return J


def noise_312(x, dt, mu):
    """(3.12), (5, ...): what an acceleration mu[0] and a yaw acceleration mu[1] are said to add to the state."""
    heading, (a, w) = x[3], mu
    rows = [dt**2 / 2 * a * np.cos(heading), dt**2 / 2 * a * np.sin(heading), dt * a, dt**2 / 2 * w, dt * w]
    return np.stack(np.broadcast_arrays(*rows))


def covariance_316(x, dt, sigma_a, sigma_w):
    """(3.16), (5, 5, ...): the elements (5,4) and (5,5) lack the square of σ, so it is not symmetric."""
    heading = np.asarray(x, dtype=float)[3]
    c, s = np.cos(heading), np.sin(heading)
    Q = np.zeros((5, 5, *heading.shape))
    Q[0, 0], Q[1, 1] = (dt**2 / 2 * sigma_a * c) ** 2, (dt**2 / 2 * sigma_a * s) ** 2
    Q[0, 1] = Q[1, 0] = dt**4 / 4 * sigma_a**2 * s * c
    Q[0, 2] = Q[2, 0] = dt**3 / 2 * sigma_a**2 * c
    Q[1, 2] = Q[2, 1] = dt**3 / 2 * sigma_a**2 * s
    Q[2, 2] = dt**2 * sigma_a**2
    Q[3, 3], Q[3, 4] = (dt**2 / 2 * sigma_w) ** 2, dt**3 / 2 * sigma_w**2
    Q[4, 3], Q[4, 4] = dt**3 / 2 * sigma_w, dt**2 * sigma_w
    return Q


def _identity(w):
    J = np.zeros((5, 5, *w.shape))
    J[range(5), range(5)] = 1
    return J


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


class PrintedCTRV(CTRV):
    """CTRV with some of its equations as the thesis prints them.

    Parameters
    ----------
    sigma_a, sigma_w : float
        As for `CTRV`, m/s² and rad/s².
    errors : collection of str
        Which of `ERRORS` to make: ``"3.8"`` (it and its derivative evaluated as written, with no branch for ω = 0), ``"3.9"`` (second branch, read
        row by row), ``"3.10 columns"`` (exchanged in row 2), ``"3.10 factor"`` (the extra Δt), ``"3.11"`` (column 5 zero), ``"3.16"`` (two squares
        missing). All the rest is right.
    switch : float
        The branch for ω = 0 is taken where |ω| ≤ `switch`, rad/s; 0 in the thesis.
    """

    def __init__(self, sigma_a=0.0, sigma_w=0.0, errors=(), switch=0.0):
        if isinstance(errors, str) or not set(errors) <= set(ERRORS):
            raise ValueError(f"errors: expected a collection of some of {ERRORS}, got {errors!r}")
        if not switch >= 0:
            raise ValueError(f"switch: expected a turn rate ≥ 0 rad/s, got {switch!r}")
        super().__init__(sigma_a, sigma_w, checked="3.16" not in errors)
        self.errors, self.switch = frozenset(errors), switch

    def _rows(self, x, dt, arc):
        rows = super()._rows(x, dt, arc)
        if "3.8" in self.errors:
            with np.errstate(invalid="ignore", divide="ignore"):
                rows = tuple(transition_38(x, dt))
        if "3.9" in self.errors:
            rows = tuple(np.where(np.abs(x[4]) <= self.switch, transition_39_straight(x, dt), np.stack(rows)))
        return rows

    def _jacobian(self, x, dt, arc):
        entries = super()._jacobian(x, dt, arc)
        straight = np.abs(x[4]) <= self.switch
        with np.errstate(invalid="ignore", divide="ignore"):
            if "3.8" in self.errors:
                quotients = jacobian_310_repaired(x, dt)
                entries = {place: quotients[place] for place in entries}
            for error, places in (("3.10 columns", [(1, 2), (1, 3)]), ("3.10 factor", [(0, 4), (1, 4)])):
                if error in self.errors:
                    printed = jacobian_310(x, dt)
                    entries |= {place: np.where(straight, entries[place], printed[place]) for place in places}
        if "3.11" in self.errors:
            entries |= {place: np.where(straight, 0.0, entries[place]) for place in [(0, 4), (1, 4)]}
        return entries

    def Q(self, x, dt):
        """Process noise covariance (5, 5, ...), that of (3.16) where this error is asked for."""
        if "3.16" not in self.errors:
            return super().Q(x, dt)
        x, dt = self._arguments(x, dt)
        return covariance_316(x, dt, *self.sigmas)


class PrintedPolarCA(PolarCA):
    """`PolarCA` with (3.6) read row by row: the acceleration turns the heading and leaves the speed as it is."""

    def _rows(self, x, dt, arc):
        return tuple(transition_36(x, dt))

    def _jacobian(self, x, dt, arc):
        entries = super()._jacobian(x, dt, arc)
        entries[2, 4] = entries.pop((3, 4))
        return entries


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
    models : dict of str -> trackhelpers.motion.Model
        Models whose state has x, y and either v, θ or vx, vy.
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
    names, runs = list(model.state), zs[0].shape[1]
    x0 = np.zeros((model.n, runs))
    for name, value in (start | dict(zip("xy", zs[0], strict=True))).items():
        x0[names.index(name)] = value
    ens = EnsembleEKF(model, x0, np.diag([START_SIGMA.get(name, 1.0) ** 2 for name in names]))
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

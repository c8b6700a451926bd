"""What paper 3's introduction claims of single methods, as experiments: gates, delays of decisions, innovations that should be white, models that should be equal."""

from typing import NamedTuple

import numpy as np
from filterpy.common import Q_continuous_white_noise
from scipy import stats
from scipy.linalg import expm

from trackhelpers.consistency import nis
from trackhelpers.ensemble import EnsembleKF
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.ensemble.switching import EnsembleVariableDimensionKF
from trackhelpers.intervals import Interval, mean_interval, ratio_interval
from trackhelpers.motion import Singer
from trackhelpers.scenarios.augmented_bias import contenders as rivals
from trackhelpers.scenarios.augmented_bias.introduction import BEGIN, END, PARTS, STEPS, Errors, accelerations, draw, ratio
from trackhelpers.scenarios.augmented_bias.target import R, T, track_of
from trackhelpers.sensors import LinearSensor


def gated(linear, runs, probability=0.9999):
    """Which measurements (N + 1, M) a validation gate refuses when it holds a true one with this probability: what tells a tracker that its target is lost."""
    ens = EnsembleMatrixKF(linear.F, linear.H, linear.Q, R, linear.from_start @ runs.start, linear.P0)
    limit, refused = stats.chi2.ppf(probability, len(R)), [np.zeros(ens.runs, dtype=bool)]
    for z in np.moveaxis(runs.z, 1, 0):
        ens.predict()
        outside = nis(z - linear.H @ ens.x, ens.matrices.innovation_covariance(ens.P)) > limit
        x, P = ens.x, ens.P
        ens.update(z)
        ens.x, ens.P = np.where(outside, x, ens.x), np.where(outside, P, ens.P)
        refused.append(outside)
    return np.array(refused)


def share(hits, level=0.95):
    """Share of runs (M,) for which something is true, with the interval of Clopper and Pearson."""
    count, tail = int(np.sum(hits)), (1 - level) / 2
    low = stats.beta.ppf(tail, count, len(hits) - count + 1) if count else 0.0
    high = stats.beta.ppf(1 - tail, count + 1, len(hits) - count) if count < len(hits) else 1.0
    return Interval(count / len(hits), float(low), float(high))


def switching(contender, runs):
    """Whether each run was thought to manoeuvre, (N + 1, M): the filter's decision, or for an IMM a probability above one half."""
    return _modes(contender, runs)[0]


def dropped(contender, runs):
    """Acceleration in x, (M,), that a variable-dimension filter held when it first left CA after sample `END`; NaN where it was in CV there already."""
    modes, held = _modes(contender, runs)
    delay = delays(modes, END, STEPS) / T
    at = END + np.nan_to_num(delay).astype(int)
    return np.where(np.isfinite(delay), held[at, np.arange(len(delay))], np.nan)


def _modes(contender, runs):
    ens = contender.ensemble(runs.start)
    modes, held = [np.zeros(ens.runs, dtype=bool)], [np.zeros(ens.runs)]
    for z in np.moveaxis(runs.z, 1, 0):
        ens.predict()
        ens.update(z)
        modes.append(ens.mu[1] > 0.5 if hasattr(ens, "mu") else ens.manoeuvring.copy())
        held.append(ens.x[2].copy() if isinstance(ens, EnsembleVariableDimensionKF) else held[0])
    return np.array(modes), np.array(held)


def delays(modes, change, until):
    """Seconds (M,) from sample `change`, `BEGIN` or `END`, to the first sample at which a run has the mode that is right from then on.

    NaN for a run that had it at `change` already, by a false decision before; `until` − `change` for one that did not get it before sample `until`.
    """
    right = modes[change : until + 1] == (change == BEGIN)
    first = np.where(right.any(axis=0), right.argmax(axis=0), until - change) * T
    return np.where(right[0], np.nan, first)


class Delays(NamedTuple):
    """Delays of both decisions, s, (M,) each, and the share of the runs that were once not in the manoeuvre's mode during its last 20 s."""

    begin: np.ndarray
    end: np.ndarray
    early: float

    @property
    def later(self):
        """Delay of the end − delay of the beginning, mean with its interval over the runs that have both, s."""
        return finite_mean(self.end - self.begin)

    @property
    def left_out(self):
        """Share of the runs without a delay of the end: at its true time they were in the mode of rest already."""
        return float(np.mean(np.isnan(self.end)))


def delays_by_size(contender, sizes, runs=500):
    """Size of the acceleration -> `Delays`."""
    found = {}
    for a in sizes:
        modes = switching(contender, draw(track_of(accelerations(a)), runs))
        early = np.mean(~modes[END - 20 : END + 1].all(axis=0))
        found[a] = Delays(delays(modes, BEGIN, END), delays(modes, END, STEPS), float(early))
    return found


def innovations(contender, runs):
    """Innovations (2, N + 1, M) of a contender that predicts by CV, from its estimates; NaN at k = 0."""
    before = [runs.start, *(x.copy() for x, _ in contender.follow(runs.start, runs.z))][:-1]
    y = [z - rivals.H @ rivals.F @ x for z, x in zip(np.moveaxis(runs.z, 1, 0), before, strict=True)]
    return np.stack([np.full_like(y[0], np.nan), *y], axis=1)


def autocorrelation(y, lag, part, component=0):
    """Σ y_k y_{k+lag} / Σ y_k² over a part and all runs, with its interval: 0 for orthogonal innovations. No mean is taken off, for a mean is no innovation."""
    window = y[component, PARTS[part]]
    return ratio_interval(np.mean(window[lag:] * window[: len(window) - lag], axis=0), np.mean(window**2, axis=0))


def left_at(sample, runs):
    """Errors (4, N + 1, M) of a filter on CA that goes over to CV after a given sample, told from outside, and the acceleration (M,) it then drops."""
    ca, H = rivals.accelerating(), LinearSensor(rivals.H, R, rivals.MODEL.state)
    ens, kept, sensor = EnsembleKF(ca.model, ca.from_start @ runs.start, ca.P0), ca.to_estimate, ca.sensor
    values, dropped = [runs.start - runs.track[:, 0]], None
    for k, z in enumerate(np.moveaxis(runs.z, 1, 0), 1):
        ens.predict(T)
        ens.update(z, sensor)
        values.append(kept @ ens.x - runs.track[:, k])
        if k == sample:
            dropped = ens.x[2].copy()
            P = ens.P.reshape(6, 6, -1)[..., 0]
            ens, kept, sensor = EnsembleKF(rivals.MODEL, kept @ ens.x, kept @ P @ kept.T), np.eye(4), H
    return Errors(np.stack(values, axis=1), np.full(len(values), np.nan)), dropped


def difference(first, second):
    """Interval of the difference of two numbers with intervals: from end to end, so not too narrow whatever their correlation."""
    return Interval(first.value - second.value, first.low - second.high, first.high - second.low)


def cost_of_fixing(candidates, picked, parts):
    """What one setting for all parts costs: setting -> ratio of its RMSE of x to the best setting's, in the part where this is larger.

    Parameters
    ----------
    candidates, picked : dict
        Setting -> `Errors`; the best of each part is picked on the runs of `picked` and compared on those of `candidates`, so that luck does not do the picking.
    parts : sequence of str

    Returns
    -------
    dict of setting -> Interval, dict of part -> best setting
    """
    best = {part: min(picked, key=lambda setting, part=part: picked[setting].rmse(part)) for part in parts}
    costs = {s: [ratio(e, candidates[best[part]], part) for part in parts] for s, e in candidates.items()}
    return {s: max(intervals, key=lambda interval: interval.low) for s, intervals in costs.items()}, best


def singer_residuals(points=25, seed=1970):
    """Largest differences of `Singer`'s F and Q (divided by σ_m²) from Van Loan's matrix exponential, and of its Q in both limits from filterpy's white noise.

    At random steps 0.2 … 2 s, τ 1 … 50 s and σ_m 0.1 … 5 m/s². The limits are taken at τ = 1e12 s and 1e-12 s, with the spectral density of the jerk, 2σ_m²/τ, and of the
    acceleration, 2σ_m²τ, kept.
    """
    apart, nought = {"model": 0.0, "slow": 0.0, "fast": 0.0}, np.zeros(3)
    for dt, tau, density in np.random.default_rng(seed).uniform([0.2, 1.0, 0.1], [2.0, 50.0, 5.0], (points, 3)):
        A, G = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -1 / tau]]), np.diag([0, 0, 2 / tau])
        wide = expm(np.block([[-A, G], [np.zeros((3, 3)), A.T]]) * dt)
        F = wide[3:, 3:].T
        model = Singer(density, tau, axes=1)  # the number serves as σ_m here and as a density below
        slow, fast = Singer(np.sqrt(density * 0.5e12), 1e12, axes=1), Singer(np.sqrt(density * 0.5e12), 1e-12, axes=1)
        differences = {
            "model": np.stack([model.F(nought, dt) - F, model.Q(nought, dt) / density**2 - F @ wide[:3, 3:]]),
            "slow": slow.Q(nought, dt) - Q_continuous_white_noise(3, dt, density),
            "fast": fast.Q(nought, dt)[:2, :2] - Q_continuous_white_noise(2, dt, density),
        }
        apart = {name: max(apart[name], float(np.max(np.abs(d)))) for name, d in differences.items()}
    return apart


def component(linear, runs, row):
    """One component, (N + 1, M), of the state that a contender with known gains estimates."""
    x0 = linear.from_start @ runs.start
    ens, found = EnsembleKF(linear.model, x0, linear.P0), [x0[row]]
    for z in np.moveaxis(runs.z, 1, 0):
        ens.predict(T)
        ens.update(z, linear.sensor)
        found.append(ens.x[row].copy())
    return np.array(found)


def finite_mean(values, level=0.95):
    """Mean over the runs, (M,), with its interval; NaN entries are left out."""
    return mean_interval(values[np.isfinite(values)], level)


def gain_by_step(contender, runs):
    """Gain with which the innovation in x corrects x, (N + 1, M), of a contender whose ensemble keeps its gain; NaN at k = 0."""
    ens = contender.ensemble(runs.start)
    gains = [np.full(ens.runs, np.nan)]
    for z in np.moveaxis(runs.z, 1, 0):
        ens.predict()
        ens.update(z)
        gains.append(ens.K[0, 0].copy())
    return np.array(gains)

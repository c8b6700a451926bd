"""Recorded flights on a grid of seconds: reports, their noise turned into the track, the smoothed path, and blocks of it."""

from typing import NamedTuple

import numpy as np

from trackhelpers.charts import LocalENU, ecef
from trackhelpers.filters import MotionKF
from trackhelpers.follow import follow, smooth
from trackhelpers.motion import CA
from trackhelpers.recordings import aircraft, heading_of
from trackhelpers.reports import clean
from trackhelpers.sensors import LinearSensor

FASTEST = {"circuits": 250.0, "parabolas": 300.0, "tree": 350.0, "helicopter": 100.0}  # m/s over ground
STRETCHES = {  # name -> recording, first and last second
    "737 (tuning)": ("circuits", 8351, 11812),
    "737": ("circuits", 0, 6588),
    "A310 (tuning)": ("parabolas", 0, 5000),
    "A310": ("parabolas", 5000, 10066),
    "A380": ("tree", 17078, 19285),
    "helicopter": ("helicopter", 123, 1186),
}
LIVELY, CALM = 0.5, 40  # m/s², s
LENGTH, RUN_IN, AHEAD = 300, 120, 30  # of a block, s: what is scored, what is filtered before it, the farthest prediction


class Flight(NamedTuple):
    """One stretch of a recording on a grid of whole seconds, N of them; NaN where there was no report.

    t (N,), s; z (2, N), east and north, m; v (2, N), reported velocity, m/s; reports: the cleaned table, N rows; chart: of the plane; faults: what `clean` found.
    """

    t: np.ndarray
    z: np.ndarray
    v: np.ndarray
    reports: object
    chart: LocalENU
    faults: object


def flight(stretch):
    """The `Flight` of one of the `STRETCHES`."""
    name, first, last = STRETCHES[stretch]
    whole = aircraft(name)
    part = whole[(whole["t"] >= first) & (whole["t"] <= last)]
    cleaned, faults = clean(part, FASTEST[name])
    t = np.arange(first, last + 1.0)
    reports = cleaned.set_index("t").reindex(t)  # whole seconds, so that nothing is moved
    lat, lon = np.radians(reports[["lat", "lon"]].to_numpy().T)
    chart = LocalENU(np.nanmean(lat), np.nanmean(lon))
    heading, speed = heading_of(reports["course"]), reports["speed"].to_numpy()
    v = speed * np.stack([np.cos(heading), np.sin(heading)])
    seen = np.isfinite(lat)
    z = np.full((2, len(t)), np.nan)
    z[:, seen] = chart.to_chart(ecef(lat[seen], lon[seen], reports["altitude"].to_numpy()[seen]))
    return Flight(t, z, v, reports, chart, faults)


def turned(v, sigma, sigma_t):
    """Noise covariances (2, 2, N) of positions that are good to `sigma`, m, and whose times to `sigma_t`, s, at velocities v (2, N): σ²I + σ_t² v vᵀ."""
    still = np.nan_to_num(v)
    return sigma**2 * np.eye(2)[..., None] + sigma_t**2 * still[:, None] * still


class Smooth(NamedTuple):
    """x (6, N): east, its rate and acceleration, north, its rate and acceleration; P (6, 6, N); outliers: seconds whose report the gate kept out."""

    x: np.ndarray
    P: np.ndarray
    outliers: tuple


def smoothed(flight, R, sigma_v=None, sigma_j=1.0, left_out=None, gate=0.9999):
    """The path given all reports: a Rauch–Tung–Striebel smoother on a white jerk.

    Parameters
    ----------
    flight : Flight
    R : numpy.ndarray, shape (2, 2, N)
        Of the reported positions.
    sigma_v : float, optional
        Of the reported velocities, m/s, an axis; None leaves them out.
    sigma_j : float
        White jerk, m/s³·√s.
    left_out : numpy.ndarray of bool, shape (N,), optional
        Reports that are not used.
    gate : float
        As for `trackhelpers.follow.follow`.

    Returns
    -------
    Smooth
    """
    model = CA(sigma_j, axes=2, noise="continuous")
    seen = np.isfinite(flight.z[0]) if left_out is None else np.isfinite(flight.z[0]) & ~left_out
    rows = [0, 3] if sigma_v is None else [0, 3, 1, 4]
    sensor = LinearSensor(np.eye(6)[rows], np.eye(len(rows)), model.state)
    z = flight.z if sigma_v is None else np.concatenate([flight.z, flight.v])
    whole = np.zeros((len(rows), len(rows), len(flight.t)))
    whole[:2, :2] = R
    for i in range(2, len(rows)):
        whole[i, i] = sigma_v**2
    first = int(np.argmax(seen))
    x0 = np.zeros(6)
    x0[[0, 3]], x0[[1, 4]] = flight.z[:, first], flight.v[:, first]
    zs = [z[:, k] if seen[k] else None for k in range(len(seen))]
    steps = np.r_[0.0, np.ones(len(zs) - 1)]
    kf = MotionKF(model, x0, np.diag([1e4, 400, 25, 1e4, 400, 25.0]))
    history = follow(kf, zs, sensor, steps, Rs=list(np.moveaxis(whole, -1, 0)), keep=("x",), gate=gate)
    return Smooth(*smooth(history), history.outliers)


class Blocks(NamedTuple):
    """Blocks of flights, run-in included, as runs of an ensemble: K steps of T seconds, M = blocks × draws runs, the draws of a block side by side.

    T: step, s; z (2, K, M); mask (K, M): measured; R (2, 2) or (2, 2, K, M); start (4, M): x, vx, y, vy at the start, P0 (4, 4);
    truth: seconds ahead -> (2, K, B); weight (K, B): 1 where a step is scored; flight (B,): name of each block's stretch; index (K, B): second of its stretch of each step;
    manoeuvre, quiet (K, B): whether the smoothed acceleration exceeds `LIVELY`, and whether it has not for `CALM` seconds; draws: of each block.
    """

    T: int
    z: np.ndarray
    mask: np.ndarray
    R: np.ndarray
    start: np.ndarray
    P0: np.ndarray
    truth: dict
    weight: np.ndarray
    flight: np.ndarray
    index: np.ndarray
    manoeuvre: np.ndarray
    quiet: np.ndarray
    draws: int


P0 = np.diag([100.0, 10, 100, 10]) ** 2  # of a start, m and m/s
HORIZONS = (0, 5, 10, 30)


def seconds(N, T=1, length=LENGTH, run_in=RUN_IN):
    """Index of each block's steps in a path of N seconds, (K, B): a step every T seconds, blocks side by side, run-in before and predictions after them within the path."""
    firsts = np.arange(0, N - run_in - length - AHEAD, length)
    return np.arange(T, run_in + length + T, T)[:, None] + firsts


def reported(paths, length=LENGTH, run_in=RUN_IN):
    """`Blocks` of the reports themselves; paths: name -> (flight, R, `Smooth` that they are held against), whose outliers are left out."""
    parts = []
    for name, (flown, R, (x, _, outliers)) in paths.items():
        k = seconds(len(flown.t), 1, length, run_in)
        seen = np.isfinite(flown.z[0])
        seen[list(outliers)] = False
        parts.append((name, k, x, flown.z[:, k], seen[k], R[:, :, k], near(seen)))
    return _blocks(parts, 1, run_in, 1, 0)


def radar(paths, T, sigma, draws, rng, length=LENGTH, run_in=RUN_IN):
    """`Blocks` of a radar's positions, σ in x and y, on the smoothed path; paths as for `reported`, rng: Generator of the noise."""
    parts = []
    for name, (flown, _, (x, *_)) in paths.items():
        k = seconds(len(flown.t), T, length, run_in)
        noise = sigma * rng.standard_normal((2, *k.shape, draws))
        z = (x[[0, 3]][:, k][..., None] + noise).reshape(2, len(k), -1)
        parts.append((name, k, x, z, np.ones(z.shape[1:], dtype=bool), None, near(np.isfinite(flown.z[0]))))
    return _blocks(parts, T, run_in, draws, sigma)


def near(seen, seconds=5):
    """Where a second with a report is at most `seconds` away: (N,) bool; elsewhere the path is guessed and nothing is held against it."""
    return np.convolve(seen, np.ones(2 * seconds + 1), "same") > 0.5


def _blocks(parts, T, run_in, draws, sigma):
    names, ks, xs, zs, masks, Rs, knowns = zip(*parts, strict=True)
    pairs = list(zip(xs, ks, strict=True))
    whole = sigma**2 * np.eye(2) if Rs[0] is None else np.concatenate(Rs, axis=3)
    known = [np.all([is_known[k + h] for h in HORIZONS], axis=0) for is_known, k in zip(knowns, ks, strict=True)]
    scored = (np.arange(1, len(ks[0]) + 1) * T > run_in)[:, None] * np.concatenate(known, axis=1)
    lively = [np.hypot(x[2], x[5]) > LIVELY for x in xs]
    recent = [np.convolve(each, np.ones(CALM + 1))[: len(each)] > 0.5 for each in lively]
    return Blocks(
        T=T,
        z=np.concatenate(zs, axis=2),
        mask=np.concatenate(masks, axis=1),
        R=whole,
        start=np.repeat(np.concatenate([x[[0, 1, 3, 4]][:, k[0] - T] for x, k in pairs], axis=1), draws, axis=1),
        P0=P0,
        truth={h: np.concatenate([x[[0, 3]][:, k + h] for x, k in pairs], axis=2) for h in HORIZONS},
        weight=scored * (1.0 if Rs[0] is None else np.concatenate(masks, axis=1)),
        flight=np.concatenate([[name] * k.shape[1] for name, k in zip(names, ks, strict=True)]),
        index=np.concatenate(ks, axis=1),
        manoeuvre=np.concatenate([each[k] for each, k in zip(lively, ks, strict=True)], axis=1),
        quiet=~np.concatenate([each[k] for each, k in zip(recent, ks, strict=True)], axis=1),
        draws=draws,
    )

"""What a filter did on the blocks: errors now and ahead, NIS, likelihood; and intervals from blocks drawn anew."""

from typing import NamedTuple

import numpy as np

from trackhelpers.follow import follow
from trackhelpers.intervals import Interval
from trackhelpers.scenarios.real_aircraft.cast import CAST
from trackhelpers.scenarios.real_aircraft.paths import HORIZONS
from trackhelpers.sensors import Position

SAMPLES = 2000


class Score(NamedTuple):
    """errors: seconds ahead -> squared position error (K, B), m², mean over the draws; nis and evidence (K, B), likewise: of the measurement of each step, NIS and log-likelihood, NaN where there is none; x (n, K, M) and ensemble: as run."""

    errors: dict
    nis: np.ndarray
    evidence: np.ndarray
    x: np.ndarray
    ensemble: object


def run(name, setting, blocks):
    """Run the contender `name` of the `CAST` with one of its settings over `Blocks`: its `Score`."""
    method = CAST[name]
    ens = method.build(setting, blocks)
    driven = hasattr(ens, "model")
    zs, fixed = list(np.moveaxis(blocks.z, 1, 0)), blocks.R.ndim == 2
    sensor = Position(R=blocks.R if fixed else np.eye(2), state=ens.model.state) if driven else None
    history = follow(
        ens, zs, sensor, blocks.T if driven else None, keep=("x", "y", "S"),
        Rs=None if fixed else list(np.moveaxis(blocks.R, 2, 0)), masks=None if blocks.mask.all() else list(blocks.mask),
    )  # fmt: skip
    errors = {
        h: over_draws(np.sum((method.ahead(ens, history.x, h) - spread(blocks.truth[h], blocks)) ** 2, axis=0), blocks) for h in HORIZONS
    }
    nis, log_det = normalised(history.y, history.S)
    evidence = -0.5 * (nis + log_det) - np.log(2 * np.pi)
    return Score(errors, over_draws(nis, blocks), over_draws(evidence, blocks), history.x, ens)


def spread(values, blocks):
    """(…, B) for each draw: (…, M)."""
    return np.repeat(values, blocks.draws, axis=-1)


def over_draws(values, blocks):
    """Mean over the draws of each block: (…, M) to (…, B)."""
    return values.reshape(*values.shape[:-1], -1, blocks.draws).mean(axis=-1)


def normalised(y, S):
    """NIS and log det S, both (K, M), of innovations y (2, K, M); NaN where nothing was measured."""
    det = S[0, 0] * S[1, 1] - S[0, 1] ** 2
    return (S[1, 1] * y[0] ** 2 - 2 * S[0, 1] * y[0] * y[1] + S[0, 0] * y[1] ** 2) / det, np.log(det)


def tried(blocks):
    """Every contender with every setting on the blocks that it is tuned on: name -> setting -> `Score`. The UKF takes what the EKF found for the same model."""
    found = {name: {setting: run(name, setting, blocks) for setting in method.grid} for name, method in CAST.items() if name != "UKF–CTRA"}
    return {name: found["CTRA" if name == "UKF–CTRA" else name] for name in CAST}


def tuned(found, blocks, flights, by="likelihood"):
    """The setting of each contender that is best on some flights, name -> setting; found: as `tried` gives it; by: "likelihood", or seconds ahead for the least RMS error."""
    weight = blocks.weight * np.isin(blocks.flight, flights)

    def worth(score):
        if by == "likelihood":
            return np.sum(weight * np.nan_to_num(score.evidence))
        return -np.sum(weight * score.errors[by])

    return {name: max(scores, key=lambda setting: worth(scores[setting])) for name, scores in found.items()}


def drawn_blocks(blocks, flight, rng, samples=SAMPLES):
    """Blocks of one flight drawn anew with replacement: how often each is taken, (samples + 1, B); the first sample is the flight itself."""
    own = np.flatnonzero(blocks.flight == flight)
    counts = np.zeros((samples + 1, len(blocks.flight)))
    counts[0, own] = 1
    picks = rng.integers(len(own), size=(samples, len(own)))
    for j in range(len(own)):
        counts[1:, own[j]] = (picks == j).sum(axis=1)
    return counts


def rms(score, blocks, counts, h, where=1.0):
    """RMS error h seconds ahead, (samples + 1,), m; `where` (K, B) takes a part of the steps."""
    weight = blocks.weight * where
    total, steps = np.sum(weight * score.errors[h], axis=0), weight.sum(axis=0)
    return np.sqrt(counts @ total / (counts @ steps))


def average_nis(score, blocks, counts):
    """Average NIS, (samples + 1,); 2 is expected."""
    weight = blocks.weight * np.isfinite(score.nis)
    return counts @ np.sum(np.where(weight > 0, score.nis, 0.0), axis=0) / (counts @ weight.sum(axis=0))


def interval(samples):
    """The first of the samples, with the central 95 % of the others: `Interval`."""
    low, high = np.quantile(samples[1:], [0.025, 0.975])
    return Interval(float(samples[0]), float(min(low, samples[0])), float(max(high, samples[0])))

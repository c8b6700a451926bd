"""Section 4.1: a source that accelerates along a line, s(t) = 3t² − 2t + 5, and a sensor of its position.

A sequence over time has its samples on the first axis and Monte Carlo runs on the last: measurements (N, M), states (N, 3, M).
"""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.consistency import nees, nis
from trackhelpers.ensemble import EnsembleKF, standard_normal
from trackhelpers.motion import CA
from trackhelpers.published import published
from trackhelpers.sensors import Position

T = 0.05  # s
STEPS = 200  # samples k = 0 … 199, the first at t = 0
SIGMA = 0.5  # m, of the noise that is added to s
VARIANCE = 0.25  # its square, the filter's R, and the number on the diagonal of its Q
ACCELERATION = 6.0  # m/s²
EVERY = 5  # samples from one row of Table 3 to the next
COLUMNS = ("x_filtered", "v_filtered", "a_filtered")  # of Table 3


class Run(NamedTuple):
    """What a filter made of the measurements of M runs."""

    x: np.ndarray  # (N, 3, M) estimates after each sample, the start at sample 0
    P: np.ndarray  # (N, 3, 3) covariance, the same in every run
    prior: np.ndarray  # (N, M) predicted position
    nees: np.ndarray  # (N, M), NaN where P is singular
    nis: np.ndarray  # (N, M), NaN at sample 0, which is not used


def times(steps=STEPS):
    """Sampling times (steps,), s."""
    if not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"steps: expected a whole number ≥ 1, got {steps!r}")
    return T * np.arange(steps)


def truth(steps=STEPS):
    """Position (m), velocity (m/s) and acceleration (m/s²) of the source, shape (3, steps)."""
    t = times(steps)
    return np.stack([3 * t**2 - 2 * t + 5, 6 * t - 2, np.full(steps, ACCELERATION)])


def measurements(rngs, sigma=SIGMA, steps=STEPS):
    """Measured positions (steps, M), m, for M generators; each draws its run's noise in one block."""
    return truth(steps)[0][:, None] + check_scale(sigma, "sigma") * standard_normal(rngs, (steps,))


def textbook_noise(steps=STEPS, seed=0):
    """Noise of the example program in Xu Shiliang's collection of algorithms (the thesis's reference [9]), shape (steps,) or (steps, M), m.

    Each number is half the sum of twelve uniform ones, less 3, so its variance is 0.25. The uniform numbers come from the congruential generator
    r ← (2053 r + 13849) mod 65536, which the program starts at 0.

    Parameters
    ----------
    steps : int
    seed : int or array_like of int, shape (M,)
        Where the generator starts, 0 … 65535.

    Raises
    ------
    ValueError
        For a start outside this range.
    """
    r = np.asarray(seed)
    if r.dtype.kind not in "iu" or np.any(r < 0) or np.any(r > 65535):
        raise ValueError(f"seed: expected whole numbers from 0 to 65535, got {seed!r}")
    r, noise = r.astype(np.int64), np.zeros((len(times(steps)), *r.shape))
    for k in range(steps):
        for _ in range(12):
            r = (2053 * r + 13849) % 65536
            noise[k] += r / 65536
    return 0.5 * (noise - 6)


def run(z, model=None, x0=(0.0, 0.0, 0.0), P0=None, sigma=SIGMA):
    """Filter the measurements of M runs; by default with the thesis's settings.

    Parameters
    ----------
    z : array_like, shape (N, M)
        Measured positions; the first is not used, for the start stands for sample 0.
    model : trackhelpers.motion.CA, optional
        One axis; default ``CA(axes=1, Q=0.25 I)``.
    x0 : array_like, shape (3,) or (3, M)
    P0 : array_like, shape (3, 3), optional
        Default 0.
    sigma : float
        The filter's standard deviation of a measurement, m.

    Returns
    -------
    Run
    """
    z = np.asarray(z, dtype=float)
    if z.ndim != 2 or 0 in z.shape:
        raise ValueError(f"z: expected shape (N, M), samples on the first axis and runs on the last, got {z.shape}")
    model = CA(axes=1, Q=VARIANCE * np.eye(3)) if model is None else model
    sensor, x_true = Position(sigma=sigma, state=model.state), truth(len(z))
    start = np.array(np.broadcast_to(np.reshape(x0, (3, -1)), (3, z.shape[1])))
    kf = EnsembleKF(model, start, np.zeros((3, 3)) if P0 is None else P0)
    rows = []
    for k in range(len(z)):
        if k > 0:
            kf.predict(T)
        prior = kf.x[0]
        if k > 0:
            kf.update(z[k : k + 1], sensor)
        P = kf.P[..., 0]
        rows.append((kf.x, P, prior, _nees(x_true[:, k], kf.x, P), nis(kf.y, kf.S) if k > 0 else np.full(z.shape[1], np.nan)))
    return Run(*map(np.array, zip(*rows, strict=True)))


def _nees(x_true, x, P):
    if np.linalg.matrix_rank(P) < len(P):
        return np.full(x.shape[1], np.nan)
    return nees(x_true[:, None], x, P)


class Printed(NamedTuple):
    """Table 3 without its headings: what was measured and filtered at samples 0, 5, …, 60, and how finely it was printed."""

    samples: np.ndarray  # (13,)
    measured: np.ndarray  # (13,), m
    measured_rounding: float  # half a unit of the last digit
    filtered: np.ndarray  # (12, 3) x, v, a; row 0 is the start and tells nothing
    rounding: np.ndarray  # (12, 3) half a unit of the last digit of each


def table_3():
    """Return Table 3 as numbers, a `Printed`. Its measured column has two decimals, of which trailing zeros are not printed."""
    frame = published("thesis", 3, numeric=True)
    filtered = frame[list(COLUMNS)].to_numpy()[1:]
    rounding = 0.5 * 10.0 ** (np.floor(np.log10(filtered)) - 2)  # three significant digits
    return Printed(EVERY * np.arange(len(frame)), frame["y_measured"].to_numpy(), 0.005, filtered, rounding)


def condition(response, printed, variance=VARIANCE):
    """Distribution of the filtered columns of Table 3, given its measured column.

    A linear filter started at zero makes of the measurements z the row values L z. Of the 61 measurements up to t = 3 s thirteen are printed; the others are
    the truth and independent Gaussian noise, so the rows are Gaussian, and nothing has to be drawn. What rounding hides, of z as of the rows, is taken as
    independent and uniform and enters with its variance.

    Parameters
    ----------
    response : array_like, shape (36, 61, ...)
        L: rows x, v, a of the second printed row, of the third, and so on; one column a measurement.
    printed : Printed
    variance : float
        Of the noise, m².

    Returns
    -------
    mean : numpy.ndarray, shape (36, ...)
    covariance : numpy.ndarray, shape (36, 36, ...)
        Positive definite, if only by the rounding.
    """
    L, samples = np.asarray(response, dtype=float), printed.samples
    rows, steps = printed.filtered.size, samples[-1] + 1
    if L.shape[:2] != (rows, steps):
        raise ValueError(f"response: expected shape ({rows}, {steps}, ...), got {L.shape}")
    hidden = np.setdiff1d(np.arange(steps), samples)
    mean = np.einsum("ij...,j->i...", L[:, samples], printed.measured) + np.einsum("ij...,j->i...", L[:, hidden], truth(steps)[0, hidden])
    weight = np.where(np.isin(np.arange(steps), samples), printed.measured_rounding**2 / 3, variance)
    spread = L * np.sqrt(weight).reshape(-1, *[1] * (L.ndim - 2))
    covariance = np.einsum("ij...,kj...->ik...", spread, spread)
    covariance[range(rows), range(rows)] += (printed.rounding.ravel() ** 2 / 3).reshape(-1, *[1] * (L.ndim - 2))
    return mean, covariance

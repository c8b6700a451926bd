"""Section 4.1: which filter printed Tables 3 and 4? The variants of `ca_variants`, scored against both tables.

Variants are taken in blocks, which stay within the processor's cache.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from trackhelpers.forensics.ca_variants import gains, outputs, respond, variants_of
from trackhelpers.published import published
from trackhelpers.scenarios.thesis.ca_source import SIGMA, truth

EVERY = 5  # samples from one row of Table 3 to the next
COLUMNS = ("x_filtered", "v_filtered", "a_filtered")  # of Table 3


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


def condition(response, printed, variance=SIGMA**2):
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


def _blocks(variants, size, steps):
    K = gains(variants, steps)
    for first in range(0, len(variants.settings), size):
        yield variants_of(variants.settings.iloc[first : first + size]), K[..., first : first + size]


def response(variants, K=None):
    """The rows of Table 3 as linear maps of the measurements up to t = 3 s, shape (36, 61, V): what `condition` takes.

    The filters are linear and start at zero, so the map's columns are what they make of unit pulses. `K` as for `respond`.
    """
    rows = table_3().samples[1:]
    posterior = respond(variants, np.eye(rows[-1] + 1), K)[1][rows]
    return np.moveaxis(posterior.reshape(3 * len(rows), -1, posterior.shape[-1]), -1, 1)


def chi_square(mean, covariance, filtered, rounding, columns=(0, 1, 2)):
    """(y − mean)ᵀ covariance⁻¹ (y − mean) and the log density of printed rows y, each of shape (V,); arguments as from `condition`.

    Parameters
    ----------
    mean, covariance : numpy.ndarray, shapes (36, V), (36, 36, V)
    filtered, rounding : numpy.ndarray, shape (12, 3)
        Of `Printed`.
    columns : sequence of int
        Which of x, v, a to judge.
    """
    pick = np.arange(filtered.size).reshape(filtered.shape)[:, list(columns)].ravel()
    unit = rounding.ravel()[pick] / np.sqrt(
        3
    )  # in these units no eigenvalue is below 1, however close to singular the noise leaves the covariance
    y = ((filtered.ravel()[pick, None] - mean[pick]) / unit[:, None]).T
    L = np.linalg.cholesky(np.moveaxis(covariance[np.ix_(pick, pick)] / np.multiply.outer(unit, unit)[..., None], -1, 0))
    squares = np.sum(np.linalg.solve(L, y[..., None])[..., 0] ** 2, axis=-1)
    scale = np.sum(np.log(np.einsum("vii->vi", L)), axis=-1) + np.sum(np.log(unit)) + len(pick) / 2 * np.log(2 * np.pi)
    return squares, -squares / 2 - scale


def score_table_3(variants, block=200):
    """The settings of each variant with the chi-square of its columns x, v, a (12 degrees of freedom each), of all three (36), p-value and log density."""
    printed, parts = table_3(), []
    for part, K in _blocks(variants, block, printed.samples[-1] + 1):
        mean, covariance = condition(response(part, K), printed)
        scores = {}
        for name, columns in (("χ² x", (0,)), ("χ² v", (1,)), ("χ² a", (2,)), ("χ²", (0, 1, 2))):
            scores[name], density = chi_square(mean, covariance, printed.filtered, printed.rounding, columns)
        parts.append(part.settings.assign(**scores, p=stats.chi2.sf(scores["χ²"], printed.filtered.size), density=density))
    return pd.concat(parts)


ERRORS = ("truth − x", "truth − x⁻", "measured − x", "measured − x⁻", "next truth − x", "whole state")
SAMPLES = ("all", "but the first", "every fifth")


def error_statistics(variants, z):
    """What Table 4 prints, by each meaning of "error" and each choice of samples, for measurements z (N, M).

    Returns
    -------
    dict
        (name of `ERRORS`, name of `SAMPLES`) -> largest, mean and root-mean-square absolute error, shape (3, V, M).
    """
    found = _statistics(variants, z, gains(variants, len(z)))
    return {(error, samples): found[:, i, j] for i, error in enumerate(ERRORS) for j, samples in enumerate(SAMPLES)}


def _statistics(variants, z, K):
    """Largest, mean and root-mean-square size of the errors, shape (3, errors, samples, V, M).

    They are summed up while the variants run, in a tenth of the memory that their histories would take.
    """
    N, s = len(z), truth(len(z))
    later, fifth = np.zeros((2, 3, len(ERRORS), len(variants.settings), z.shape[1]))
    size, square = np.zeros((2, *later.shape[1:]))
    for k, (prior, posterior) in enumerate(outputs(variants, z, K)):
        for error, (of, estimate) in enumerate(((s[0, k], posterior), (s[0, k], prior), (z[k], posterior), (z[k], prior))):
            np.subtract(of, estimate[0], out=size[error])
        size[4] = s[0, k + 1] - posterior[0] if k + 1 < N else 0.0  # the last sample has no next truth
        np.multiply(size, size, out=square)
        square[5] = square[0] + (s[1, k] - posterior[1]) ** 2 + (s[2, k] - posterior[2]) ** 2
        np.abs(size, out=size)
        np.sqrt(square[5], out=size[5])
        if k == 0:
            first = np.stack([size, size, square])
        for sums in (later,) * (k > 0) + (fifth,) * (k % EVERY == 0):
            np.maximum(sums[0], size, out=sums[0])
            sums[1] += size
            sums[2] += square
    every = np.concatenate([np.maximum(later[:1], first[:1]), later[1:] + first[1:]])
    found = np.stack([every, later, fifth], axis=2)
    ends = [N - 1 if error == "next truth − x" else N for error in ERRORS]
    found[1:] /= np.array([[end, end - 1, len(range(0, end, EVERY))] for end in ends])[..., None, None]
    found[2] = np.sqrt(found[2])
    return found


def score_table_4(variants, z, printed=(5.0, 2.0475, 2.4071), block=20):
    """How Table 4 lies among what M runs give, one row for each variant, each error of `errors` and each choice of `SAMPLES`.

    Parameters
    ----------
    z : array_like, shape (N, M)
        Measurements, the same for all variants.
    printed : sequence of float
        Largest, mean and RMS error.

    Returns
    -------
    pandas.DataFrame
        The settings; ``max``, ``mean``, ``RMS``: medians; ``% max``, ``% mean``, ``% RMS``: percentiles of the printed values (ties count half);
        ``d``: Mahalanobis distance of the printed (mean, RMS) from the runs, which for a Gaussian pair exceeds 2.45 in 5 % of the cases.
    """
    places = [_place(_statistics(part, z, K), np.asarray(printed)) for part, K in _blocks(variants, block, len(z))]
    places = np.concatenate(places, axis=-1)  # (7, errors, samples, V)
    columns = [*_STATISTICS, *(f"% {name}" for name in _STATISTICS), "d"]
    tables = [
        variants.settings.assign(error=error, samples=samples, **dict(zip(columns, places[:, i, j], strict=True)))
        for i, error in enumerate(ERRORS)
        for j, samples in enumerate(SAMPLES)
    ]
    return pd.concat(tables, ignore_index=True)


_STATISTICS = ("max", "mean", "RMS")


def _place(values, printed):
    """Medians, percentiles of the printed three, and Mahalanobis distance, of statistics (3, ..., M): shape (7, ...)."""
    beside = printed.reshape(3, *[1] * (values.ndim - 1))
    percent = 50 * (np.mean(values < beside - 1e-9, axis=-1) + np.mean(values <= beside + 1e-9, axis=-1))
    pair = values[1:] - beside[1:]
    off = pair.mean(axis=-1)
    pair -= off[..., None]
    C = np.einsum("i...m,j...m->...ij", pair, pair) / (values.shape[-1] - 1)
    C[..., [0, 1], [0, 1]] += 0.00005**2 / 3  # rounding to four decimals; without it an output that does not depend on z has none
    off = np.moveaxis(off, 0, -1)[..., None]
    d = np.sqrt(np.sum(off * np.linalg.solve(C, off), axis=(-2, -1)))
    return np.concatenate([np.median(values, axis=-1), percent, d[None]])

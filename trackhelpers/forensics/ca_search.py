"""Section 4.1: which filter printed Tables 3 and 4? Thousands of variants of the printed one, run as one ensemble and scored against both tables.

A variant is a place on an axis; only time is a Python loop (and blocks of variants, to stay within the processor's cache).
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from trackhelpers.scenarios.thesis.ca_source import STEPS, T, condition, table_3, truth


def _transition(half, column=True):
    A = np.array([[1.0, T, half], [0, 1, T], [0, 0, 1]])
    A[:2, 2] *= column
    return A


A = _transition(T**2 / 2)
_LEFT_OUT, _TWICE_T, _NO_HALF, _NO_COLUMN = np.eye(3), _transition(T / 2), _transition(T**2), _transition(0.0, column=False)

STATE = {  # x⁻ from the last x; "prior" is (2.9) as printed, from the last x⁻
    "A": A,
    "left out": _LEFT_OUT,
    "T/2 for T²/2": _TWICE_T,
    "T² for T²/2": _NO_HALF,
    "no acceleration": _NO_COLUMN,
    "prior (2.9)": A,
}
COVARIANCE = {  # P⁻ − Q from the last P: the factor before it, whether it is transposed, the factor behind it
    "A P Aᵀ": (A, False, A.T),
    "left out": (_LEFT_OUT, False, _LEFT_OUT),
    "T/2 for T²/2": (_TWICE_T, False, _TWICE_T.T),
    "T² for T²/2": (_NO_HALF, False, _NO_HALF.T),
    "no acceleration": (_NO_COLUMN, False, _NO_COLUMN.T),
    "A P A": (A, False, A),
    "Aᵀ P A": (A.T, False, A),
    "Aᵀ P Aᵀ": (A.T, False, A.T),
    "A (P Aᵀ)ᵀ": (A @ A, True, np.eye(3)),
}
QUOTIENTS = tuple(
    4.0**k for k in np.arange(-2, 2.5, 0.5)
)  # of Q and R, each scaled by 1/4, 1/2, 1, 2, 4: only Q/R enters the gain, for P0 is 0
GAIN = {"from P⁻": False, "from P": True}
LATE = (0, 1)  # samples by which the measurement is late


class Family(NamedTuple):
    """Variants of the filter, V of them."""

    settings: pd.DataFrame  # V rows: state, covariance, Q/R, gain, late
    F: np.ndarray  # (3, 3, V)
    open_loop: np.ndarray  # (V,) bool
    left: np.ndarray  # (3, 3, V)
    transposed: np.ndarray  # (V,) bool
    right: np.ndarray  # (3, 3, V)


def family(state=tuple(STATE), covariance=tuple(COVARIANCE), quotients=QUOTIENTS, gain=tuple(GAIN), late=LATE):
    """All combinations of the settings that are named, a `Family`; by default the whole grid.

    Raises
    ------
    ValueError
        For a setting that is none of `STATE`, `COVARIANCE`, `GAIN`, `LATE`, or a quotient Q/R that is not positive.
    """
    for name, wanted, known in (
        ("state", state, STATE),
        ("covariance", covariance, COVARIANCE),
        ("gain", gain, GAIN),
        ("late", late, LATE),
    ):
        if isinstance(wanted, str) or not wanted or not set(wanted) <= set(known):
            raise ValueError(f"{name}: expected some of {list(known)}, got {wanted!r}")
    if len(quotients) == 0 or not all(np.isfinite(q) and q > 0 for q in quotients):
        raise ValueError(f"quotients: expected positive numbers, got {quotients!r}")
    return _family(pd.DataFrame(product(state, covariance, quotients, gain, late), columns=["state", "covariance", "Q/R", "gain", "late"]))


def _family(settings):
    left, transposed, right = zip(*(COVARIANCE[name] for name in settings["covariance"]), strict=True)
    F = [STATE[name] for name in settings["state"]]
    open_loop = settings["state"].to_numpy() == "prior (2.9)"
    return Family(settings, np.stack(F, -1), open_loop, np.stack(left, -1), np.array(transposed), np.stack(right, -1))


def gains(variants, steps=STEPS):
    """Gain of each variant at samples 0 … steps − 1, the first zero, for there the filter only starts; shape (steps, 3, V)."""
    Q = np.eye(3)[..., None]
    R = 1 / variants.settings["Q/R"].to_numpy()
    posterior = np.array([GAIN[name] for name in variants.settings["gain"]])
    P, K = np.zeros((3, 3, len(R))), np.zeros((steps, 3, len(R)))
    for k in range(1, steps):
        P = np.where(variants.transposed, P.swapaxes(0, 1), P)
        P = np.einsum("ijv,jkv,klv->ilv", variants.left, P, variants.right, optimize=True) + Q
        K[k] = P[:, 0] / (P[0, 0] + R)
        P = P - K[k][:, None] * P[0]  # (I − K H) P⁻, (2.13)
        K[k] = np.where(posterior, P[:, 0] / (P[0, 0] + R), K[k])
    return K


def respond(variants, z, K=None):
    """Predictions and estimates that the variants make of measurements z (N, M): two arrays (N, 3, V, M). All start at zero, at sample 0.

    `K`, shape (N, 3, V), spares the computation of `gains`.
    """
    z = np.asarray(z, dtype=float)
    if z.ndim != 2 or 0 in z.shape:
        raise ValueError(f"z: expected shape (N, M), samples on the first axis and runs on the last, got {z.shape}")
    K = gains(variants, len(z)) if K is None else K
    F, late = variants.F[..., None], variants.settings["late"].to_numpy()[:, None]
    prior = np.zeros((len(z), 3, F.shape[2], z.shape[1]))
    posterior = np.zeros_like(prior)
    for k in range(1, len(z)):
        last = np.where(variants.open_loop[:, None], prior[k - 1], posterior[k - 1])
        prior[k] = last  # every F of the grid is the identity but for three entries
        prior[k, 0] += F[0, 1] * last[1] + F[0, 2] * last[2]
        prior[k, 1] += F[1, 2] * last[2]
        innovation = np.where(late, z[k - 1], z[k]) - prior[k, 0]
        posterior[k] = prior[k] + K[k][..., None] * innovation
    return prior, posterior


def _blocks(variants, size, steps):
    K = gains(variants, steps)
    for first in range(0, len(variants.settings), size):
        yield _family(variants.settings.iloc[first : first + size]), K[..., first : first + size]


def response(variants, K=None):
    """The rows of Table 3 as linear maps of the measurements up to t = 3 s, shape (36, 61, V): what `ca_source.condition` takes.

    The filters are linear and start at zero, so the map's columns are what they make of unit pulses. `K` as for `respond`.
    """
    rows = table_3().samples[1:]
    posterior = respond(variants, np.eye(rows[-1] + 1), K)[1][rows]
    return np.moveaxis(posterior.reshape(3 * len(rows), -1, posterior.shape[-1]), -1, 1)


def chi_square(mean, covariance, filtered, rounding, columns=(0, 1, 2)):
    """(y − mean)ᵀ covariance⁻¹ (y − mean) and the log density of printed rows y, each of shape (V,); arguments as from `ca_source.condition`.

    Parameters
    ----------
    mean, covariance : numpy.ndarray, shapes (36, V), (36, 36, V)
    filtered, rounding : numpy.ndarray, shape (12, 3)
        Of `ca_source.Printed`.
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


def errors(prior, posterior, z):
    """What "error" may mean in Table 4, name -> (N', V, M): each between outputs as from `respond`, the truth and measurements z (N, M), at all samples."""
    s = truth(len(z)).T[..., None, None]
    return {
        "truth − x": s[:, 0] - posterior[:, 0],
        "truth − x⁻": s[:, 0] - prior[:, 0],
        "measured − x": z[:, None] - posterior[:, 0],
        "measured − x⁻": z[:, None] - prior[:, 0],
        "next truth − x": s[1:, 0] - posterior[:-1, 0],
        "whole state": np.sqrt(np.sum((s - posterior) ** 2, axis=1)),
    }


SAMPLES = ("all", "but the first", "every fifth")


def error_statistics(error):
    """Largest, mean and root-mean-square absolute error over the samples, the first axis; name of `SAMPLES` -> (3, ...)."""
    size = np.abs(error)
    later, fifth = _statistics(size[1:]), _statistics(size[::5])
    n, first = len(size), size[0]
    mean, square = ((later[i] * (n - 1) + first**i) / n for i in (1, 2))
    both = np.stack([np.maximum(later[0], first), mean, square])
    for statistics in (both, later, fifth):
        statistics[2] = np.sqrt(statistics[2])
    return dict(zip(SAMPLES, (both, later, fifth), strict=True))


def _statistics(size):
    return np.stack([size.max(axis=0), size.mean(axis=0), np.einsum("k...,k...->...", size, size) / len(size)])


def score_table_4(variants, z, printed=(5.0, 2.0475, 2.4071), block=40):
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
    places = {}
    for part, K in _blocks(variants, block, len(z)):
        for name, error in errors(*respond(part, z, K), z).items():
            for samples, values in error_statistics(error).items():
                places.setdefault((name, samples), []).append(_place(values, np.asarray(printed)))
    columns = [*_STATISTICS, *(f"% {name}" for name in _STATISTICS), "d"]
    tables = [
        variants.settings.assign(error=name, samples=samples, **dict(zip(columns, np.concatenate(rows, axis=1), strict=True)))
        for (name, samples), rows in places.items()
    ]
    return pd.concat(tables, ignore_index=True)


_STATISTICS = ("max", "mean", "RMS")


def _place(values, printed):
    """Medians, percentiles of the printed three, and Mahalanobis distance, of statistics (3, V, M): shape (7, V)."""
    beside = printed[:, None, None]
    percent = 50 * (np.mean(values < beside - 1e-9, axis=-1) + np.mean(values <= beside + 1e-9, axis=-1))
    pair = values[1:] - beside[1:]
    off = pair.mean(axis=-1)
    C = np.einsum("ivm,jvm->vij", pair - off[..., None], pair - off[..., None]) / (values.shape[-1] - 1)
    C[:, [0, 1], [0, 1]] += 0.00005**2 / 3  # rounding to four decimals; without it an output that does not depend on z has none
    d = np.sqrt(np.einsum("iv,vi->v", off, np.linalg.solve(C, off.T[..., None])[..., 0]))
    return np.concatenate([np.median(values, axis=-1), percent, d[None]])

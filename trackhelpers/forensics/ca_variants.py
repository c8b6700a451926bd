"""Section 4.1: thousands of variants of the printed filter, run as one ensemble.

A variant is a place on an axis; only time is a Python loop.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from trackhelpers.scenarios.thesis.ca_source import STEPS, T


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
    return variants_of(
        pd.DataFrame(product(state, covariance, quotients, gain, late), columns=["state", "covariance", "Q/R", "gain", "late"])
    )


def variants_of(settings):
    """The `Family` of a table of settings, such as some rows of another family's."""
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


def outputs(variants, z, K=None):
    """Yield the prediction and the estimate of the variants, two arrays (3, V, M), at each sample of z (N, M). All start at zero, at sample 0.

    `K`, shape (N, 3, V), spares the computation of `gains`.
    """
    z = np.asarray(z, dtype=float)
    if z.ndim != 2 or 0 in z.shape:
        raise ValueError(f"z: expected shape (N, M), samples on the first axis and runs on the last, got {z.shape}")
    K = gains(variants, len(z)) if K is None else K
    F, late = variants.F[..., None], variants.settings["late"].to_numpy()[:, None]
    prior = posterior = np.zeros((3, F.shape[2], z.shape[1]))
    yield prior, posterior
    for k in range(1, len(z)):
        last = np.where(variants.open_loop[:, None], prior, posterior) if variants.open_loop.any() else posterior
        prior = last.copy()  # every F of the grid is the identity but for three entries
        prior[0] += F[0, 1] * last[1] + F[0, 2] * last[2]
        prior[1] += F[1, 2] * last[2]
        posterior = prior + K[k][..., None] * (np.where(late, z[k - 1], z[k]) - prior[0])
        yield prior, posterior


def respond(variants, z, K=None):
    """`outputs` of all samples together: predictions and estimates, two arrays (N, 3, V, M)."""
    return tuple(np.stack(each) for each in zip(*outputs(variants, z, K), strict=True))

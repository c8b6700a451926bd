"""Equations (1) to (31) of paper 3: what our copy kept of each, our reading, and opponents that use none of the readings.

A fragment cannot prove a reading, it can only contradict one: see `surplus`. What proves the rebuilt equations is an opponent, and the only things that the opponents here take
from the paper are (1), (7), the definition (8) and the random walk (12).
"""

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

import trackhelpers.published
from trackhelpers.filters import augmented_matrices
from trackhelpers.scenarios.thesis.equations import random_systems

_FILE = Path(trackhelpers.published.__file__).parent / "augmented_bias_equations.csv"
_GLYPHS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789,/+=")

# What another reading would have printed in place of ours, in the manner of the file's column `reading`.
RIVALS = {
    "R1": {},
    "R2": {
        15: "Z_k=[H_k 0][X_k Λ_k]+v_k",
        16: "[X_k Λ_k]=[Φ_k,k-1 Φ_k,k-1; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]; Z_k=[H_k 0][X_k Λ_k]+v_k",
    },
    "R2 uncorrected": {
        15: "Z_k=[H_k 0][X_k Λ_k]+v_k",
        16: "[X_k Λ_k]=[Φ_k,k-1 Φ_k,k-1; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]; Z_k=[H_k 0][X_k Λ_k]+v_k",
        23: "X_k=X_k",
    },
    "R3": {
        10: "X_k=[Φ_k,k-1 I][X_k-1 Λ_k-1]+W_k-1",
        13: "[X_k Λ_k]=[Φ_k,k-1 I; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]",
        15: "Z_k=[H_k 0][X_k Λ_k]+v_k",
        16: "[X_k Λ_k]=[Φ_k,k-1 I; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]; Z_k=[H_k 0][X_k Λ_k]+v_k",
        23: "X_k=X_k",
    },
    "R4": {
        10: "X_k=[Φ_k,k-1 Φ_k,k-1-I][X_k-1 Λ_k-1]+W_k-1",
        13: "[X_k Λ_k]=[Φ_k,k-1 Φ_k,k-1-I; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]",
        16: "[X_k Λ_k]=[Φ_k,k-1 Φ_k,k-1-I; 0 I][X_k-1 Λ_k-1]+[W_k-1 N_k-1]; Z_k=[H_k H_k][X_k Λ_k]+v_k",
    },
}


def equations():
    """All 31 equations: columns ``fragment`` (our copy's) and ``reading`` (ours, as plain text), by number."""
    return pd.read_csv(_FILE, comment="#", dtype={"fragment": str, "reading": str}).set_index("number")


def glyphs(text):
    """How often each Latin letter, digit, comma, slash, plus and equals sign occurs in `text`."""
    return Counter(character for character in text if character in _GLYPHS)


def surplus(fragment, reading):
    """What a fragment shows more often than a reading has it, as a string of glyphs; empty when the reading may have been printed.

    The copy loses glyphs (of (1) it keeps one X in three) and invents none. So a surplus refutes a reading, and no surplus proves nothing.
    """
    return "".join(sorted((glyphs(fragment) - glyphs(reading)).elements()))


class Point(NamedTuple):
    """One random system with n states and one value of everything: x (2n,) is [X̃; Λ], P (2n, 2n) its covariance."""

    F: np.ndarray  # (n, n), invertible
    H: np.ndarray  # (m, n)
    Q: np.ndarray  # (n, n)
    Q_bias: np.ndarray  # (n, n)
    R: np.ndarray  # (m, m)
    P: np.ndarray  # (2n, 2n)
    x: np.ndarray  # (2n,)
    w: np.ndarray  # (n,)
    n: np.ndarray  # (n,)
    v: np.ndarray  # (m,)
    guess: np.ndarray  # (2n,), an estimate of x
    z: np.ndarray  # (6, m), measurements of six steps


def random_points(rng, count=25, n=3, m=2):
    """Random systems with full matrices, `count` of them."""
    points = []
    for plain, bias, both in zip(*(random_systems(rng, count, size, m) for size in (n, n, 2 * n)), strict=True):
        F = np.eye(n) + 0.3 * np.linalg.qr(plain.A)[0]  # eigenvalues at a distance of 0.3 from 1
        points.append(
            Point(F, plain.H, plain.Q, bias.Q, plain.R, both.P, both.x, plain.w, bias.w, plain.v, both.w, rng.normal(size=(6, m)))
        )
    return points


def moved(point, x, w, n):
    """[X̃; Λ] one step later, by (7), (8) and (12) alone; any trailing axes."""
    size = len(point.F)
    before = x[:size] + x[size:]  # X = X̃ + Λ: (8)
    bias = x[size:] + n  # (12)
    return np.concatenate([point.F @ before + bias + w - bias, bias])  # (7), (8)


def step_map(point):
    """The same as a matrix on the stack [X̃; Λ; W; N], shape (2n, 4n), found by moving unit vectors."""
    size = len(point.F)
    units = np.eye(4 * size)
    return moved(point, units[: 2 * size], units[2 * size : 3 * size], units[3 * size :])


def step_covariance(point):
    """Covariance of [X̃; Λ] one step later: the image of what is independent before it."""
    J = step_map(point)
    return J @ block_diag(point.P, point.Q, point.Q_bias) @ J.T


def batch(point, z):
    """Mean and covariance of the last [X̃; Λ], given all measurements at once: no filter, but one conditional Gaussian.

    Parameters
    ----------
    point : Point
        x and P are the prior of [X̃; Λ] one step before the first measurement.
    z : array_like, shape (N, m)

    Returns
    -------
    x : numpy.ndarray, shape (2n,)
    P : numpy.ndarray, shape (2n, 2n)
    """
    z = np.asarray(z, dtype=float)
    n, N = len(point.F), len(z)
    total = 2 * n + 2 * n * N
    sources = np.eye(total)  # the prior's 2n, then w and n of each step
    covariance = block_diag(point.P, *[block_diag(point.Q, point.Q_bias)] * N)
    mean = np.concatenate([point.x, np.zeros(2 * n * N)])
    x, seen = sources[: 2 * n], []
    for noise in np.split(sources[2 * n :], N):
        x = moved(point, x, noise[:n], noise[n:])
        seen.append(point.H @ (x[:n] + x[n:]))  # (1): the measurement is of X
    B = np.vstack(seen)
    gain = np.linalg.solve(B @ covariance @ B.T + np.kron(np.eye(N), point.R), B @ covariance @ x.T).T
    rest = x - gain @ B
    P = rest @ covariance @ rest.T + gain @ np.kron(np.eye(N), point.R) @ gain.T
    return x @ mean + gain @ (z.ravel() - B @ mean), P


def recursion(point, z):
    """The paper's recursion (18)–(21) on its system (17): [X̃; Λ] and its covariance after the measurements z (N, m)."""
    A = augmented_matrices(point.F, point.H, point.Q, point.Q_bias, "R1")
    x, P = point.x, point.P
    for value in np.asarray(z, dtype=float):
        P = A.F @ P @ A.F.T + A.Q  # (20)
        K = P @ A.H.T @ np.linalg.inv(A.H @ P @ A.H.T + point.R)  # (19)
        x = A.F @ x + K @ (value - A.H @ A.F @ x)  # (18)
        P = (P - K @ A.H @ P + (P - K @ A.H @ P).T) / 2  # (21)
    return x, P

"""The rebuilt equations (13) to (31) of paper 3, and beside each an opponent that was derived without it.

The opponents of (13)–(17) and (26)–(31) move points, unit vectors and outcomes of the noise by (7), (8), (12) and (1) alone; those of (18)–(21) are a Kalman filter's on any matrices (least squares by QR, a
minimisation, the image of the roots, the information form); those of (22), (23) and (25) are one conditional Gaussian without a recursion.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from trackhelpers.filters import augmented_matrices
from trackhelpers.scenarios.augmented_bias import equations as eqs
from trackhelpers.scenarios.augmented_bias.readings import blocks
from trackhelpers.scenarios.thesis.equations import largest_difference, minimise_quadratic, random_systems


class Pair(NamedTuple):
    """What is compared, and what had to be assumed to read the fragment: empty where the fragment and the sentence around it leave no doubt."""

    printed: callable
    opponent: callable
    what: str
    assumed: str = ""
    note: str = ""


def _halves(x):
    return np.split(np.asarray(x), 2)


def _transition(p):
    n = len(p.F)
    return np.block([[p.F, p.F], [np.zeros((n, n)), np.eye(n)]])


def _step(p):  # (13)
    return _transition(p) @ p.x + np.concatenate([p.w, p.n])


def _step_by_definition(p):
    return eqs.moved(p, p.x, p.w, p.n)


def _measured(p):  # X by (12) and (7), Z by (1)
    X, bias = sum(_halves(p.x)), _halves(p.x)[1] + p.n
    return p.H @ (p.F @ X + bias + p.w) + p.v


def _matrices(p):
    A = augmented_matrices(p.F, p.H, p.Q, p.Q_bias, "R1")
    return A.F, A.H


def _matrices_found(p):  # by moving and measuring unit vectors
    n = len(p.F)
    return np.vstack([eqs.step_map(p)[:, : 2 * n], p.H @ sum(_halves(np.eye(2 * n)))])


def _gain(P, H, R):  # (19)
    return P @ H.T @ np.linalg.inv(H @ P @ H.T + R)


def _variance(s, K):
    A = np.eye(len(s.A)) - K @ s.H
    return np.trace(A @ s.P @ A.T + K @ s.R @ K.T)


def _least_squares(s):
    P, R = (np.linalg.inv(np.linalg.cholesky(covariance)) for covariance in (s.P, s.R))
    return np.linalg.lstsq(np.vstack([P, R @ s.H]), np.concatenate([P @ s.A @ s.x, R @ s.z]))[0]


def _half_sum(s):  # (21)
    P = (np.eye(len(s.A)) - _gain(s.P, s.H, s.R) @ s.H) @ s.P
    return (P + P.T) / 2


def _image(s):
    J = np.hstack([s.A @ np.linalg.cholesky(s.P), np.linalg.cholesky(s.Q)])
    return J @ J.T


def _error(p):  # (24)
    F, L = _matrices(p)
    return _step_by_definition(p) - (F @ p.guess + _gain(p.P, L, p.R) @ (_measured(p) - L @ F @ p.guess))


def _error_recursion(p):
    F, L = _matrices(p)
    K = _gain(p.P, L, p.R)
    return (np.eye(len(F)) - K @ L) @ (F @ (p.x - p.guess) + np.concatenate([p.w, p.n])) - K @ p.v


def _noise(p):  # (27)
    return block_diag(p.Q, p.Q_bias)


def _moments_of_noise(p):
    """E[Wᴬ Wᴬᵀ] as a mean over outcomes: W and N are roots of their covariances times ±1, in all combinations, and Wᴬ is what they add to a step."""
    n = len(p.F)
    signs = np.array(list(product((-1.0, 1.0), repeat=2 * n))).T  # (2n, 2^(2n))
    w, steps = np.linalg.cholesky(p.Q) @ signs[:n], np.linalg.cholesky(p.Q_bias) @ signs[n:]
    x = np.broadcast_to(p.x[:, None], signs.shape)
    added = eqs.moved(p, x, w, steps) - eqs.moved(p, x, 0 * w, 0 * steps)
    return added @ added.T / signs.shape[1]


def _image_of_prior(p):
    J = eqs.step_map(p)[:, : len(p.P)]
    return J @ p.P @ J.T


def _first(P):
    return blocks(P)[0]


def _names(p):  # (29)
    F, (X, XL, LX, L) = p.F, blocks(p.P)
    first = F @ X @ F.T + F @ XL @ F.T + F @ LX @ F.T + F @ L @ F.T
    cross = F @ XL + F @ L
    return np.block([[first, cross], [cross.T, L]])


def fading(F, P):
    """λ as (30) prints it: I + [Φ P_XΛ Φᵀ + Φ P_ΛX Φᵀ + Φ P_Λ Φᵀ](Φ P_X Φᵀ)⁻¹."""
    X, XL, LX, L = blocks(P)
    return np.eye(len(F)) + (F @ XL @ F.T + F @ LX @ F.T + F @ L @ F.T) @ np.linalg.inv(F @ X @ F.T)


def _faded(p):
    return fading(p.F, p.P) @ p.F @ _first(p.P) @ p.F.T


def _ratio(p):
    """Φ P_s P_X⁻¹ Φ⁻¹ with the covariance P_s of X̃ + Λ."""
    S = np.hstack([np.eye(len(p.F))] * 2)
    return p.F @ S @ p.P @ S.T @ np.linalg.inv(p.F @ _first(p.P))


PAIRS = {
    13: Pair(_step, _step_by_definition, "one step − (7), (8), (12)", "Φ twice (two commas), 0 and I in the second row"),
    14: Pair(
        lambda p: p.H @ sum(_halves(_step(p))) + p.v,
        _measured,
        "Z − Z of X by (7), (12), (1)",
        "Z sees X̃ + Λ, by (8); the letters allow X̃ alone too",
    ),
    15: Pair(
        lambda p: np.hstack([p.H, p.H]) @ _step(p) + p.v, _measured, "Z − Z of X by (7), (12), (1)", "[H H]; the letters allow [H 0] too"
    ),
    16: Pair(
        lambda p: np.concatenate([_step(p), np.hstack([p.H, p.H]) @ _step(p) + p.v]),
        lambda p: np.concatenate([_step_by_definition(p), _measured(p)]),
        "state and measurement − (7), (8), (12), (1)",
        "(13) and (15) together",
    ),
    17: Pair(lambda p: np.vstack(_matrices(p)), _matrices_found, "Φᴬ and L − the images of unit vectors", "L = [H H]"),
    18: Pair(lambda s: s.A @ s.x + _gain(s.P, s.H, s.R) @ (s.z - s.H @ s.A @ s.x), _least_squares, "state − weighted least squares by QR"),
    19: Pair(
        lambda s: _gain(s.P, s.H, s.R),
        lambda s: minimise_quadratic(lambda K: _variance(s, K), s.H.T.shape)[0],
        "gain − the one with the least trace",
    ),
    20: Pair(lambda s: s.A @ s.P @ s.A.T + s.Q, _image, "predicted covariance − image of the roots"),
    21: Pair(
        _half_sum,
        lambda s: np.linalg.inv(np.linalg.inv(s.P) + s.H.T @ np.linalg.inv(s.R) @ s.H),
        "covariance − information form",
        "half the sum with the transpose, which accounts for the 2",
    ),
    22: Pair(
        lambda p: eqs.recursion(p, p.z)[0], lambda p: eqs.batch(p, p.z)[0], "six steps − one conditional Gaussian", "X̃ above Λ; system R1"
    ),
    23: Pair(
        lambda p: sum(_halves(eqs.recursion(p, p.z)[0])),
        lambda p: sum(_halves(eqs.batch(p, p.z)[0])),
        "X̃ + Λ after six steps − the Gaussian's X",
    ),
    24: Pair(_error, _error_recursion, "error by its definition − its own recursion"),
    25: Pair(lambda p: eqs.recursion(p, p.z)[1], lambda p: eqs.batch(p, p.z)[1], "covariance after six steps − the Gaussian's"),
    26: Pair(
        lambda p: _transition(p) @ p.P @ _transition(p).T + _noise(p),
        eqs.step_covariance,
        "predicted covariance − image of the sources",
        "Φᴬ of (13), multiplied out",
    ),
    27: Pair(_noise, _moments_of_noise, "Q − mean over all outcomes of ±1", "of the augmented noise; W and N independent, by (12)"),
    28: Pair(lambda p: _names(p) + _noise(p), eqs.step_covariance, "blocks + Q − image of the sources", "the blocks of (26)"),
    29: Pair(_names, _image_of_prior, "blocks − image of the prior", "multiplied out: ten commas, ten Φ in the first two blocks"),
    30: Pair(
        lambda p: np.hstack([fading(p.F, p.P), _faded(p)]),
        lambda p: np.hstack([_ratio(p), _first(_image_of_prior(p))]),
        "λ − Φ P_s P_X⁻¹ Φ⁻¹, λ Φ P_X Φᵀ − first block of the image",
        "multiplied out: seven commas, eight Φ",
        "a definition of λ: what is tested is that both forms are one, and that (31) follows",
    ),
    31: Pair(
        lambda p: _faded(p) + p.Q, lambda p: _first(eqs.step_covariance(p)), "λ Φ P_X Φᵀ + Q − first block", "the second P is λ Φ P_X Φᵀ"
    ),
}
GENERAL = (18, 19, 20, 21)  # a Kalman filter on any matrices


def residuals(rng, count=25):
    """Largest difference between each equation and its opponent over `count` random systems, by number."""
    points, systems = eqs.random_points(rng, count), random_systems(rng, count, n=4, m=2)
    return {n: largest_difference(systems if n in GENERAL else points, pair.printed, pair.opponent) for n, pair in PAIRS.items()}

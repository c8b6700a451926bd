"""Does a filter know how good it is? NEES, NIS, their chi-square bands, and the Cramér–Rao bound."""

import numpy as np
from scipy import stats
from scipy.linalg.lapack import dposv

from trackhelpers import angles as _angles
from trackhelpers import fused
from trackhelpers.arrays import congruence, inverse, mahalanobis, transpose
from trackhelpers.checks import (
    all_finite,
    check_angles,
    check_array,
    check_count,
    check_covariance,
    check_matrix,
    check_probability,
    correlations,
    deviations,
)


def nees(x_true, x, P, angles=()):
    """Normalised estimation error squared, (x_true − x)ᵀ P⁻¹ (x_true − x).

    Of a consistent filter it is chi-square distributed with n degrees of freedom, so its mean is n (Bar-Shalom, Li and Kirubarajan,
    *Estimation with Applications to Tracking and Navigation*, 2001, section 5.4).

    Parameters
    ----------
    x_true, x : array_like, shape (n,) or (n, M)
        Truth and estimate; a common truth (n, 1) may stand beside an ensemble.
    P : array_like, shape (n, n) or (n, n, M)
        The filter's covariance. Whole histories serve too, x (n, N, M) with P (n, n, N, M), or (n, n, N, 1) where it is the same in all runs.
    angles : sequence of int
        Indices of the angular components, whose difference is wrapped.

    Returns
    -------
    float or numpy.ndarray, shape (M,)
        NaN in the runs whose P is not positive definite.

    Raises
    ------
    ValueError
        Shapes that do not fit; for one run, numbers that are not finite or a P that is not positive definite.
    """
    x = check_array(x, "x", None)
    x_true = check_array(x_true, "x_true", len(x))
    shapes = x_true.shape, x.shape
    if shapes[0] != shapes[1] or x.ndim != 1 or not len(x):
        fit = all(1 in pair or pair[0] == pair[1] for pair in zip(shapes[0][:0:-1], shapes[1][:0:-1], strict=False))
        if 0 in x.shape or not fit:
            raise ValueError(f"x_true, x: expected shapes (n,) or (n, M), got {x_true.shape} and {x.shape}")
    if x_true.ndim == 1 and x.ndim == 2:
        x_true = x_true[:, None]
    angles, n = check_angles(angles, len(x)), len(x)
    if x.ndim == 2 and x_true.shape[1] in (1, x.shape[1]):
        P = check_array(P, "P", n)
        if P.shape == (n, *x.shape) and (scores := fused.nees(x_true, x, P, angles)) is not None:
            return scores
    return _normalised(_angles.wrap_rows(x_true - x, angles), P, "P")


def nis(y, S):
    """Normalised innovation squared, yᵀ S⁻¹ y; chi-square with m degrees of freedom for a consistent filter.

    Parameters
    ----------
    y : array_like, shape (m,) or (m, M)
        Innovation.
    S : array_like, shape (m, m) or (m, m, M)
        The filter's covariance of it.

    Returns
    -------
    float or numpy.ndarray, shape (M,)

    Raises
    ------
    ValueError
        As for `nees`.
    """
    y = check_array(y if isinstance(y, (list, tuple)) or getattr(y, "ndim", 0) else [y], "y", None)
    if 0 in y.shape:
        raise ValueError(f"y: expected shape (m,) or (m, M), got {y.shape}")
    return _normalised(y, S, "S")


def _normalised(error, P, name):
    n = len(error)
    if error.ndim == 1:
        P = check_covariance(P, name, n, definite=True)
        _, solution, failed = dposv(P, error)
        if failed:  # by rounding, in these units
            sigma = deviations(P)
            solution = dposv(correlations(P), error / sigma)[1] / sigma
        return error @ solution
    P = check_array(P, name, n)
    runs = P.shape[2:]
    if P.shape[:2] != (n, n) or (
        runs and not (len(runs) == error.ndim - 1 and all(p in (1, e) for p, e in zip(runs, error.shape[1:], strict=True)))
    ):
        raise ValueError(f"{name}: expected shape {(n, n)} or {(n, n, *error.shape[1:])}, got {P.shape}")
    return mahalanobis(error, P.reshape(*P.shape, *[1] * (error.ndim + 1 - P.ndim)))


def chi2_band(dim, runs=1, level=0.95):
    """Central interval of the average of `runs` independent chi-square variables of `dim` degrees of freedom.

    Parameters
    ----------
    dim : int
        Degrees of freedom: n for NEES, m for NIS.
    runs : int
        How many independent values were averaged.
    level : float
        Probability inside, between 0 and 1.

    Returns
    -------
    low, high : float

    Raises
    ------
    ValueError
        For numbers that are not whole or not positive, and a level that is no probability.
    """
    dim, runs, level = check_count(dim, "dim"), check_count(runs, "runs"), check_probability(level, "level")
    low, high = stats.chi2.interval(level, dim * runs)
    return low / runs, high / runs


def cramer_rao(Fs, Qs, Hs, Rs, P0):
    """Posterior Cramér–Rao bound on the error covariance along a track, for Jacobians taken at the truth.

    The recursion of Tichavský, Muravchik and Nehorai (IEEE Trans. Signal Processing 46, 1998) for additive Gaussian noise is the covariance recursion of
    an EKF that is linearised at the truth. With Q = 0 it is the bound for a deterministic track.

    Parameters
    ----------
    Fs, Qs : sequences of (n, n) arrays
        Transition into step k and its process noise.
    Hs, Rs : sequences of (m, n) and (m, m) arrays
        Measurement at step k; an H of None is a step without one.
    P0 : array_like, shape (n, n)
        Covariance of the start, positive definite.

    Returns
    -------
    numpy.ndarray, shape (len(Fs), n, n)
        The bound after each step's measurement.

    Raises
    ------
    ValueError
        Lengths that differ, or a matrix of the wrong shape, not finite, or no covariance: the message names it with its index.
    """
    P = check_covariance(P0, "P0", len(check_array(P0, "P0", None)), definite=True)
    n = len(P)
    for name, value in (("Fs", Fs), ("Qs", Qs), ("Hs", Hs), ("Rs", Rs)):
        if not isinstance(value, (list, tuple, np.ndarray)):
            raise ValueError(f"{name}: expected a sequence, one a step, got {value!r}")
    if not len(Fs) == len(Qs) == len(Hs) == len(Rs):
        raise ValueError(f"Fs, Qs, Hs, Rs: expected equal lengths, got {len(Fs)}, {len(Qs)}, {len(Hs)}, {len(Rs)}")
    bound, step, noise = [], (None, None), (None, None)  # what was given, and is checked: the same one again needs no check
    for k, (F, Q, H, R) in enumerate(zip(Fs, Qs, Hs, Rs, strict=True)):
        if F is not step[0] or Q is not step[1] or k == 0:
            step = F, Q, check_matrix(F, f"Fs[{k}]", (n, n)), check_covariance(Q, f"Qs[{k}]", n)
        P = congruence(step[2], P) + step[3]
        if H is not None:
            H = check_matrix(H, f"Hs[{k}]", (None, n))
            if R is None or R is not noise[0] or len(H) != len(noise[1]):
                noise = R, check_covariance(R, f"Rs[{k}]", len(H))
            R = noise[1]
            S_inverse = inverse(congruence(H, P) + R)
            if not all_finite(S_inverse):
                raise ValueError(f"Rs[{k}]: expected one that leaves H P Hᵀ + R positive definite, got {R}")
            K = P @ transpose(H) @ S_inverse
            A = np.eye(n) - K @ H
            P = congruence(A, P) + congruence(K, R)
        bound.append(P)
    return np.array(bound)

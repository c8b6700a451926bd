"""Chapters 1 and 2: ensembles of runs of one linear system, which share one sequence of gains.

The gain of a Kalman filter does not depend on the data, so one covariance recursion serves all runs, and a step of all of them is a matrix product.
A sequence over time has its steps on the first axis: states (N, n, M), covariances (N, n, n).
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

from trackhelpers.arrays import check_array, matvec
from trackhelpers.exact import gains


class Covariances(NamedTuple):
    """What a Kalman filter knows before it sees any data, a step a row."""

    prior: np.ndarray  # (N, n, n)
    S: np.ndarray  # (N, m, m)
    K: np.ndarray  # (N, n, m)
    posterior: np.ndarray  # (N, n, n)


class Estimates(NamedTuple):
    """An ensemble of filtered runs."""

    prior: np.ndarray  # (N, n, M)
    innovation: np.ndarray  # (N, m, M)
    posterior: np.ndarray  # (N, n, M)


def covariances(A, H, Q, R, P0, steps, joseph=True):
    """The recursion of the covariances and the gain, (2.10), (2.11) and the Joseph form of (2.13), which needs no data.

    Parameters
    ----------
    A, H, Q, R : array_like, shapes (n, n), (m, n), (n, n), (m, m)
        The constant matrices of (2.8).
    P0 : array_like, shape (n, n)
        Posterior covariance at step 0.
    steps : int
        Number N of steps, ≥ 1.
    joseph : bool
        False takes (2.13) as printed, which round-off can make indefinite.

    Returns
    -------
    Covariances

    Raises
    ------
    ValueError
        For shapes that do not fit, a Q, R or P0 that is no covariance, ``steps`` below 1, and a singular H P⁻ Hᵀ + R.
    """
    A, H = _system(A, H)
    known = gains(A, H, Q, R, P0, _whole(steps, "steps"), joseph)
    prior, S, K, posterior = (np.moveaxis(each, -1, 0) for each in (known.prior, known.S, known.K, known.P))
    return Covariances(prior, S, K, posterior[1:])


def simulate(A, H, x0, w, v, Bu=None):
    """Truth and measurements of M runs of (2.8).

    Parameters
    ----------
    A, H : array_like, shapes (n, n), (m, n)
    x0 : array_like, shape (n, M)
        States at step 0.
    w, v : array_like, shapes (N, n, M), (N, m, M)
        Noise of each step; w[k−1] leads to x_k, v[k−1] is in z_k.
    Bu : array_like, shape (N, n), optional
        The known input's share of each step.

    Returns
    -------
    x, z : numpy.ndarray, shapes (N, n, M), (N, m, M)
        Steps 1 to N.

    Raises
    ------
    ValueError
        For shapes that do not fit each other.
    """
    A, H = _system(A, H)
    w = np.asarray(w, dtype=float)
    if w.ndim != 3 or w.shape[1] != len(A):
        raise ValueError(f"w: expected shape (N, {len(A)}, M), got {w.shape}")
    v = check_array(v, "v", len(w), (len(H), w.shape[2]))
    x = check_array(x0, "x0", len(A), w.shape[2:])
    known = _inputs(Bu, w.shape)
    truth = np.empty_like(w)
    for k in range(len(w)):
        x = truth[k] = A @ x + known[k] + w[k]  # (2.6)
    return truth, np.einsum("ij,kjr->kir", H, truth) + v  # (2.7)


def estimate(z, K, A, H, x0, Bu=None, as_printed=False):
    """Filter M runs with given gains.

    Parameters
    ----------
    z : array_like, shape (N, m, M)
        Measurements.
    K : array_like, shape (N, n, m) or (n, m)
        The gain of each step, or a constant one.
    A, H : array_like, shapes (n, n), (m, n)
    x0 : array_like, shape (n,) or (n, M)
        Estimate at step 0.
    Bu : array_like, shape (N, n), optional
        The known input's share of each step.
    as_printed : bool
        Predict by (2.9) as the thesis prints it, from the *prior* estimate of the step before.

    Returns
    -------
    Estimates

    Raises
    ------
    ValueError
        For shapes that do not fit each other.
    """
    A, H = _system(A, H)
    z, K, x = (np.asarray(value, dtype=float) for value in (z, K, x0))
    if z.ndim != 3 or z.shape[1] != len(H):
        raise ValueError(f"z: expected shape (N, {len(H)}, M), got {z.shape}")
    steps, _, runs = z.shape
    gain = (len(A), len(H))
    if K.shape not in (gain, (steps, *gain)):
        raise ValueError(f"K: expected shape {gain} or {(steps, *gain)}, got {K.shape}")
    K = np.broadcast_to(K, (steps, *gain))
    x = check_array(np.repeat(x[:, None], runs, axis=1) if x.ndim == 1 else x, "x0", len(A), (runs,))
    known = _inputs(Bu, (steps, len(A), runs))
    result = Estimates(np.empty((steps, len(A), runs)), np.empty_like(z), np.empty((steps, len(A), runs)))
    for k in range(steps):
        prior = result.prior[k] = A @ x + known[k]  # (2.9)
        y = result.innovation[k] = z[k] - H @ prior
        posterior = result.posterior[k] = prior + matvec(K[k], y)  # (2.12)
        x = prior if as_printed else posterior
    return result


def paired_noises(rng, shape):
    """White noise of mean 0 and variance 1 from three distributions, made of the same uniform numbers.

    Returns
    -------
    dict
        ``"Gaussian"``, ``"uniform"`` and ``"Laplace"`` -> numpy.ndarray of `shape`. The three are increasing functions of each other, so that
        differences between runs that differ only in the distribution are small.
    """
    chance = rng.random(shape)
    families = {
        "Gaussian": stats.norm(),
        "uniform": stats.uniform(-np.sqrt(3), 2 * np.sqrt(3)),
        "Laplace": stats.laplace(scale=np.sqrt(0.5)),
    }
    return {name: family.ppf(chance) for name, family in families.items()}


def _whole(value, name):
    if value != int(value) or value < 1:
        raise ValueError(f"{name}: expected a whole number ≥ 1, got {value!r}")
    return int(value)


def _system(A, H):
    A, H = np.asarray(A, dtype=float), np.asarray(H, dtype=float)
    if A.ndim != 2 or A.shape[0] != A.shape[1]:
        raise ValueError(f"A: expected a square matrix, got shape {A.shape}")
    if H.ndim != 2 or H.shape[1] != len(A):
        raise ValueError(f"H: expected shape (m, {len(A)}), got {H.shape}")
    return A, H


def _inputs(Bu, shape):
    steps, n, _ = shape
    if Bu is None:
        return np.zeros((steps, n, 1))
    return check_array(Bu, "Bu", steps, (n,))[:, :, None]

"""When has a target begun to manoeuvre? The statistics on which switching filters decide, for one target or for runs on the last axis."""

import numpy as np
from scipy import stats

from trackhelpers.arrays import inverse, matmul, matvec


def check_probability(value, name):
    """`value` as a float; ValueError unless it lies between 0 and 1."""
    if not (np.isscalar(value) and np.isreal(value) and 0 < value < 1):
        raise ValueError(f"{name}: expected a probability between 0 and 1, got {value!r}")
    return float(value)


def check_window(value, name="window", least=1):
    """`value` as an int; ValueError unless it is a whole number ≥ `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name}: expected a whole number ≥ {least}, got {value!r}")
    return int(value)


def fading_limit(dim, window, probability):
    """What a fading sum of NIS stays below with the given probability while the model is right.

    The sum s ← (1 − 1/window) s + NIS remembers about `window` innovations. It has the mean and, for white innovations, the variance of c times a chi-square
    variable with ν degrees of freedom, α = 1 − 1/window, c = 1/(1 + α), ν = dim (1 + α)/(1 − α) (Bar-Shalom, Li and Kirubarajan, 2001, section 11.3).

    Parameters
    ----------
    dim : int
        Number of measured components.
    window : int
        Effective length of the memory, steps, ≥ 1.
    probability : float
        Of staying below the limit.
    """
    alpha = 1 - 1 / check_window(window)
    quantile = stats.chi2.ppf(check_probability(probability, "probability"), dim * (1 + alpha) / (1 - alpha))
    return float(quantile) / (1 + alpha)


def position_rows(model):
    """H (axes, n) that sees the positions of a Cartesian model, axis after axis."""
    return np.eye(model.n)[[i for i, name in enumerate(model.state) if name in ("x", "y", "z")]]


def constant_input(y, S, K, F, G, H):
    """Least squares estimate of an input that entered at every step of a window, from the innovations of a filter that did not know of it.

    An input u moves the filter's error by −b_j u, with b⁻ = F b + G and b = (I − KH) b⁻ from b = 0 at the window's beginning, and so each innovation by H b⁻ u
    (Chan, Hu and Plant, IEEE Transactions on Aerospace and Electronic Systems AES-15, 1979).

    Parameters
    ----------
    y, S, K : sequences of arrays (m, ...), (m, m, ...) and (n, m, ...)
        Innovations, their covariances, and gains of the window's steps, the oldest first.
    F, G, H : numpy.ndarray, shapes (n, n), (n, q) and (m, n)

    Returns
    -------
    u : numpy.ndarray, shape (q, ...)
    covariance : numpy.ndarray, shape (q, q, ...)
    shift : numpy.ndarray, shape (n, q, ...)
        b at the window's end: what one unit of input has moved the state by, unseen by the filter.
    significance : numpy.ndarray, shape (...)
        uᵀ covariance⁻¹ u, chi-square with q degrees of freedom when there is no input.
    """
    ahead = G.reshape(*G.shape, *[1] * (S[0].ndim - 2))
    b = np.zeros((*G.shape, *S[0].shape[2:]))
    information, weighted = 0.0, 0.0
    for innovation, cov, gain in zip(y, S, K, strict=True):
        b = matmul(F, b) + ahead
        seen = matmul(H, b)
        whitened = matmul(inverse(cov), seen)
        information = information + np.einsum("ki...,kj...->ij...", seen, whitened)
        weighted = weighted + np.einsum("ki...,k...->i...", whitened, innovation)
        b = b - matmul(gain, seen)
    covariance = inverse(information)
    u = matvec(covariance, weighted)
    return u, covariance, b, np.einsum("i...,i...->...", u, weighted)


def manoeuvre_start(x, P, z, R, dt):
    """A state with acceleration for a manoeuvre that began one step ago, from the estimate before it and the first measurement in it.

    Bar-Shalom and Birmiwal, IEEE Transactions on Aerospace and Electronic Systems AES-18 (1982): an axis with position p, velocity v and a measured z gets the
    acceleration 2(z − p − vT)/T², the velocity v + T times that, and the position z. The covariance is that of these linear functions.

    Parameters
    ----------
    x : numpy.ndarray, shape (2k, ...)
        Position and velocity of k axes, axis after axis, before the manoeuvre.
    P : numpy.ndarray, shape (2k, 2k, ...)
    z : numpy.ndarray, shape (k, ...)
        Position measured `dt` later, with noise covariance R (k, k).
    dt : float
        Step, s, > 0.

    Returns
    -------
    x (3k, ...), P (3k, 3k, ...) : numpy.ndarray
        Position, velocity and acceleration, axis after axis.
    """
    axes = np.eye(len(z))
    B = np.kron(axes, [[0, 0], [-2 / dt, -1], [-2 / dt**2, -2 / dt]])
    A = np.kron(axes, [[1], [2 / dt], [2 / dt**2]])
    spread = (A @ R @ A.T).reshape(len(A), len(A), *[1] * (P.ndim - 2))
    return matvec(A, z) + matvec(B, x), matmul(matmul(B, P), B.T) + spread

"""The covariance algebra of the ensemble filters, on the entries of F, G and H that are not trivially zero or one.

Runs are the last axis, so every line below is a loop over contiguous memory. The products use what the matrices are: F is the identity plus a few entries,
H has a few entries, and K has as many columns as the sensor has components.
"""

import numpy as np

from trackhelpers import fused, matrix_steps
from trackhelpers.arrays import eliminate


def propagate(P, transition, noise):
    """F P Fᵀ + Q.

    Parameters
    ----------
    P : numpy.ndarray, shape (n, n, M)
    transition : dict (i, j) -> number or (M,)
        Entries by which F differs from the identity; a diagonal entry replaces the one.
    noise : dict (i, j) -> number or (M,)
        Entries of Q on and below the diagonal.

    Returns
    -------
    numpy.ndarray, shape (n, n, M)
        Exactly symmetric.
    """
    difference = {(i, j): value - 1 if i == j else value for (i, j), value in transition.items()}  # F − I
    if (propagated := fused.propagate(P, difference, noise)) is not None:
        return propagated
    D, whole = gathered(difference, P.shape[2:]), P.copy()
    _add_left(whole, D, P)
    _add_right(whole, whole.copy(), D)
    for (i, j), value in noise.items():
        whole[i, j] += value
    copy_lower(whole)
    return whole


def gathered(entries, runs):
    """A matrix ready for products: the rows and columns of the block that holds all entries which differ from run to run, this block dense, and the rest.

    For NumPy a call costs more than a few products with zero.
    """
    single = {place: value for place, value in entries.items() if not np.ndim(value)}
    varying = [place for place in entries if place not in single]
    if not varying:
        return None, None, None, single
    rows, columns = (slice(min(axis), max(axis) + 1) for axis in zip(*varying, strict=True))
    block = np.zeros((rows.stop - rows.start, columns.stop - columns.start, *runs))
    for i, j in varying:
        block[i - rows.start, j - columns.start] = entries[i, j]
    return rows, columns, block, single


def _add_left(out, A, P):
    """out += A P for a `gathered` A."""
    rows, columns, block, single = A
    if block is not None:
        out[rows] += np.einsum("ik...,kj...->ij...", block, P[columns])
    for (i, k), value in single.items():
        out[i] += value * P[k]


def _add_right(out, P, A):
    """out += P Aᵀ for a `gathered` A."""
    rows, columns, block, single = A
    if block is not None:
        out[:, rows] += np.einsum("jk...,ik...->ji...", P[:, columns], block)
    for (i, k), value in single.items():
        out[:, i] += value * P[:, k]


def copy_lower(P):
    """Make P (n, n, M) exactly symmetric in place: the lower half replaces the upper one."""
    for i in range(1, len(P)):
        P[:i, i] = P[i, :i]


def mirror(P):
    """Make P (n, n, M) exactly symmetric in place: (P + Pᵀ)/2, computed once for each pair."""
    for i in range(1, len(P)):
        P[i, :i] += P[:i, i]
        P[i, :i] *= 0.5
        P[:i, i] = P[i, :i]


def correct(P, entries, R):
    """Gain and posterior covariance of one update, in Joseph's form.

    (I − KH) P (I − KH)ᵀ + K R Kᵀ is evaluated as B − (B Hᵀ − K R) Kᵀ with B = P − K (P Hᵀ)ᵀ: the same two-sided product, with H's zeros left out, and so as
    forgiving of a gain that is not optimal as the usual form.

    Parameters
    ----------
    P : numpy.ndarray, shape (n, n, M)
    entries : dict (row, column) -> number or (M,)
        Entries of H.
    R : numpy.ndarray, shape (m, m) or (m, m, M)

    Returns
    -------
    K (n, m, M), S (m, m, M), P (n, n, M) : numpy.ndarray
        NaN in the runs whose S is not positive definite.
    """
    R = R.reshape(*R.shape, *[1] * (3 - R.ndim))
    if (corrected := fused.correct(P, entries, R)) is not None:
        return corrected
    H, m = gathered(entries, P.shape[2:]), len(R)
    PHt, S = np.zeros((len(P), m, *P.shape[2:])), np.empty((m, m, *P.shape[2:]))
    S[:] = R
    _add_right(PHt, P, H)
    _add_left(S, H, PHt)
    copy_lower(S)
    K = gain(PHt, S)
    B = np.einsum("ik...,jk...->ij...", K, PHt)  # a large temporary array costs more than the arithmetic: what can be is done in place
    np.subtract(P, B, out=B)
    slack = np.zeros_like(PHt)
    for k, l in np.argwhere(R.any(axis=2)).tolist():
        slack[:, l] -= K[:, k] * R[k, l]
    _add_right(slack, B, H)
    B -= np.einsum("ik...,jk...->ij...", slack, K)
    copy_lower(B)
    return K, S, B


def gain(PHt, S):
    """K = P Hᵀ S⁻¹ by symmetric elimination, shape (n, m, M); NaN where S is not positive definite."""
    m = len(S)
    A, _ = eliminate(S, PHt)
    L, K = A[:m], A[m:]
    for k in reversed(range(m - 1)):
        K[:, k] -= np.einsum("ij...,j...->i...", K[:, k + 1 :], L[k + 1 :, k])
    return K


def log_density(y, S):
    """−½ (yᵀS⁻¹y + log det S) for y (m, M) and S (m, m, M): the logarithm of N(y; 0, S) up to a constant; NaN where S is not positive definite."""
    if (found := matrix_steps.log_density(y, S)) is not None:
        return found
    A, D = eliminate(S, y[None])
    return -0.5 * (np.einsum("jr,jr->r", A[-1] * D, A[-1]) + np.log(D).sum(axis=0))

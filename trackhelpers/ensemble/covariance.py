"""The covariance algebra of the ensemble filters, on the entries of F, G and H that are not trivially zero or one.

Runs are the last axis, so every line below is a loop over contiguous memory. The products use what the matrices are: F is the identity plus a few entries,
H has a few entries, and K has as many columns as the sensor has components.
"""

import numpy as np

from trackhelpers import compiled
from trackhelpers.arrays import cholesky, congruence, matmul, solve_lower


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
    if compiled.serves(P):
        runs = P.shape[2]
        return compiled.propagate(P, *compiled.stacked(difference, runs), *compiled.stacked(noise, runs))
    half = P.copy()
    for (i, j), value in difference.items():
        half[i] += value * P[j]
    whole = half.copy()
    for (i, j), value in difference.items():
        whole[:, i] += value * half[:, j]
    for (i, j), value in noise.items():
        whole[i, j] += value
        if i != j:
            whole[j, i] += value
    mirror(whole)
    return whole


def mirror(P):
    """Make P (n, n, M) exactly symmetric in place: (P + Pᵀ)/2, computed once for each pair."""
    for i in range(1, len(P)):
        P[i, :i] += P[:i, i]
        P[i, :i] *= 0.5
        P[:i, i] = P[i, :i]


def apply_right(P, entries, m):
    """P Hᵀ, shape (n, m, M), from the entries (row, column) -> value of H."""
    product = np.zeros((len(P), m, *P.shape[2:]))
    for (row, column), value in entries.items():
        product[:, row] += value * P[:, column]
    return product


def correct(P, entries, R):
    """Gain and posterior covariance of one update, in Joseph's form.

    (I − KH) P (I − KH)ᵀ + K R Kᵀ is evaluated as B − (B Hᵀ − K R) Kᵀ with B = P − K (P Hᵀ)ᵀ: the same two-sided product, with H's zeros left out, and so as
    forgiving of a gain that is not optimal as the usual form.

    Parameters
    ----------
    P : numpy.ndarray, shape (n, n, M)
    entries : dict (row, column) -> number or (M,)
        Entries of H.
    R : numpy.ndarray, shape (m, m)

    Returns
    -------
    K (n, m, M), S (m, m, M), P (n, n, M) : numpy.ndarray
        NaN in the runs whose S is not positive definite.
    """
    if compiled.serves(P):
        return compiled.correct(P, *compiled.stacked(entries, P.shape[2]), R)
    n, m = len(P), len(R)
    PHt = apply_right(P, entries, m)
    S = np.zeros((m, m, *P.shape[2:]))
    S += R.reshape(m, m, *[1] * (P.ndim - 2))
    for (row, column), value in entries.items():
        S[row] += value * PHt[column]
    mirror(S)
    K = gain(PHt, S)
    B = P.copy()
    for k in range(m):
        for i in range(n):
            B[i] -= K[i, k] * PHt[:, k]
    slack = apply_right(B, entries, m) - np.einsum("ik...,kl->il...", K, R)
    for k in range(m):
        for i in range(n):
            B[i, : i + 1] -= slack[i, k] * K[: i + 1, k]
    for i in range(1, n):
        B[:i, i] = B[i, :i]
    return K, S, B


def correct_unsymmetric(P, H, R):
    """`correct` for a P that is no covariance (an asymmetric Q went into it): dense, as filterpy does it, with no symmetry assumed or made.

    H is dense, (m, n, M); returns K, S, P as `correct`.
    """
    PHt = np.einsum("ij...,kj...->ik...", P, H)
    S = matmul(H, PHt) + R.reshape(*R.shape, *[1] * (P.ndim - 2))
    stack = np.moveaxis(S, -1, 0).copy()
    stack[~(np.abs(np.linalg.det(stack)) > 0)] = np.nan  # one lost run must not stop the others: inv refuses a singular matrix, not NaN
    K = matmul(PHt, np.moveaxis(np.linalg.inv(stack), 0, -1))
    A = np.eye(len(P))[..., None] - matmul(K, H)
    return K, S, congruence(A, P) + congruence(K, R)


def gain(PHt, S):
    """K = P Hᵀ S⁻¹ by Cholesky's factor of S, shape (n, m, M)."""
    L = cholesky(S)
    half = solve_lower(L, np.swapaxes(PHt, 0, 1))
    K = np.empty_like(PHt)
    for k in reversed(range(len(S))):
        K[:, k] = (half[k] - sum(L[j, k] * K[:, j] for j in range(k + 1, len(S)))) / L[k, k]
    return K

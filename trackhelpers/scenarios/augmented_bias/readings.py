"""Paper 3's equations came through as fragments: what each reading of them can observe, and the fading matrix of (26)–(31)."""

import numpy as np


def observability(F, H):
    """The observability matrix [H; HF; …; HFⁿ⁻¹], its rank, and an orthonormal basis of what it does not see.

    Parameters
    ----------
    F, H : array_like, shapes (n, n) and (m, n)

    Returns
    -------
    matrix : numpy.ndarray, shape (m n, n)
    rank : int
    unseen : numpy.ndarray, shape (n, n − rank)
        One column a direction; empty for an observable pair.
    """
    F, row = np.asarray(F, dtype=float), np.atleast_2d(np.asarray(H, dtype=float))
    rows = []
    for _ in range(len(F)):
        rows.append(row)
        row = row @ F
    matrix = np.vstack(rows)
    rank = int(np.linalg.matrix_rank(matrix))
    return matrix, rank, np.linalg.svd(matrix)[2][rank:].T


def blocks(P):
    """P_X, P_XΛ, P_ΛX and P_Λ of an augmented covariance (2n, 2n): (25)."""
    n = len(P) // 2
    return P[:n, :n], P[:n, n:], P[n:, :n], P[n:, n:]


def fading_matrix(P, F):
    """λ = I + F (P_XΛ + P_ΛX + P_Λ) P_X⁻¹ F⁻¹, for which λ F P_X Fᵀ is the first block of the predicted covariance without Q: (30).

    Parameters
    ----------
    P : array_like, shape (2n, 2n)
        Posterior covariance of [X̃; Λ].
    F : array_like, shape (n, n)

    Returns
    -------
    numpy.ndarray, shape (n, n)
    """
    P_X, cross, back, P_bias = blocks(np.asarray(P, dtype=float))
    return np.eye(len(F)) + F @ np.linalg.solve(P_X, (cross + back + P_bias).T).T @ np.linalg.inv(F)

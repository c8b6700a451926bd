"""Small matrices with the Monte Carlo runs on the last axis, and (re-exported from `checks`) the argument checks that everyone uses.

A matrix is ``(n, n)`` for one run or ``(n, n, M)`` for M runs; every function takes both, and a constant ``(n, n)`` matrix broadcasts over the runs.
With the runs last each operation is a plain loop over a few components whose every step works on M contiguous numbers.
"""

import numpy as np

from trackhelpers import fused
from trackhelpers.checks import all_finite as all_finite
from trackhelpers.checks import check_angles as check_angles
from trackhelpers.checks import check_array as check_array
from trackhelpers.checks import check_covariance as check_covariance
from trackhelpers.checks import check_dt as check_dt
from trackhelpers.checks import check_matrix as check_matrix
from trackhelpers.checks import check_numbers
from trackhelpers.checks import check_scale as check_scale


def matmul(A, B):
    """Matrix product of (p, q, ...) and (q, r, ...): shape (p, r, ...). ValueError, as from all of these, for shapes that do not fit and what is no number."""
    A, B = check_numbers(A, "A"), check_numbers(B, "B")
    _fit(A.ndim > 1 and B.ndim > 1 and A.shape[1] == B.shape[0], "A, B: expected shapes (p, q, ...) and (q, r, ...)", A, B, 2, 2)
    return np.einsum("ij...,jk...->ik...", A, B)


def matvec(A, x):
    """Matrix times vector, (p, q, ...) and (q, ...): shape (p, ...)."""
    A, x = check_numbers(A, "A"), check_numbers(x, "x")
    _fit(A.ndim > 1 and x.ndim > 0 and A.shape[1] == x.shape[0], "A, x: expected shapes (p, q, ...) and (q, ...)", A, x, 2, 1)
    return np.einsum("ij...,j...->i...", A, x)


def transpose(A):
    """Transpose of the first two axes, (p, q, ...) to (q, p, ...)."""
    A = check_numbers(A, "A")
    if A.ndim < 2:
        raise ValueError(f"A: expected shape (p, q, ...), got {A.shape}")
    return np.swapaxes(A, 0, 1)


def congruence(A, P):
    """A P Aᵀ for A (p, q, ...) and P (q, q, ...): shape (p, p, ...)."""
    A, P = check_numbers(A, "A"), _square(P, "P")
    _fit(A.ndim > 1 and A.shape[1] == P.shape[0], "A, P: expected shapes (p, q, ...) and (q, q, ...)", A, P, 2, 2)
    return np.einsum("ij...,kj...->ik...", matmul(A, P), A)


def symmetrised(P):
    """(P + Pᵀ)/2 of P (n, n, ...)."""
    P = _square(P, "P")
    return 0.5 * (P + (P.T if P.ndim == 2 else np.swapaxes(P, 0, 1)))


def cholesky(P):
    """Lower Cholesky factor of P (n, n, ...).

    A run whose matrix is not positive definite gets NaN and leaves its neighbours alone; `numpy.linalg.cholesky` would refuse the whole stack.
    """
    L = np.array(_square(P, "P"))
    with np.errstate(invalid="ignore", divide="ignore"):
        for j in range(len(L)):
            L[j, j] = np.sqrt(_positive(L[j, j]))
            L[j + 1 :, j] /= L[j, j]
            for i in range(j + 1, len(L)):
                L[i, j + 1 : i + 1] -= L[i, j] * L[j + 1 : i + 1, j]
            L[j, j + 1 :] = 0
    return L


def _square(P, name):
    """`P` as floats of shape (n, n, ...); ValueError unless it has it."""
    P = check_numbers(P, name)
    if P.ndim < 2 or P.shape[0] != P.shape[1]:
        raise ValueError(f"{name}: expected shape (n, n, ...), got {P.shape}")
    return P


def _fit(fits, expected, A, B, a, b):
    """ValueError unless two arrays fit, and their axes from `a` and `b` on broadcast."""
    runs, others = A.shape[a:], B.shape[b:]
    if fits and runs and others and runs != others:
        fits = all(1 in pair or pair[0] == pair[1] for pair in zip(reversed(runs), reversed(others), strict=False))
    if not fits:
        raise ValueError(f"{expected}, got {A.shape} and {B.shape}")


def _positive(pivot):
    """`pivot` with NaN for what is not positive."""
    positive = pivot > 0
    return pivot if positive.all() else np.where(positive, pivot, np.nan)


def solve_lower(L, B):
    """L⁻¹B for lower triangular L (n, n, ...) and B (n, ...) or (n, r, ...); trailing axes broadcast."""
    L, B = _square(L, "L"), check_numbers(B, "B")
    _fit(B.ndim > 0 and len(B) == len(L), "L, B: expected shapes (n, n, ...) and (n, ...)", L, B, 2, B.ndim)
    rows = []
    for i in range(len(L)):
        row = B[i]
        for k in range(i):
            row = row - L[i, k] * rows[k]
        rows.append(row / L[i, i])
    return np.stack(rows)


def inverse(P):
    """Inverse of symmetric positive definite P (n, n, ...); NaN in the runs where it is not positive definite."""
    P = _square(P, "P")
    half = solve_lower(cholesky(P), np.eye(len(P)).reshape(len(P), len(P), *[1] * (np.ndim(P) - 2)))
    return np.einsum("ki...,kj...->ij...", half, half)


def divide(A, P):
    """A P⁻¹ for A (m, n, ...) and covariances P (n, n, ...), their pseudo-inverse where they are singular; decided on the correlations, so that no unit decides it."""
    P = check_numbers(P, "P")
    A = check_matrix(A, "A", (None, len(P) if P.ndim else 0, *P.shape[2:]))
    P = check_matrix(P, "P", (len(P), len(P), *P.shape[2:]))
    if P.ndim > 2:
        A, P = (np.moveaxis(matrix, (0, 1), (-2, -1)) for matrix in (A, P))
    variances = np.diagonal(P, axis1=-2, axis2=-1)
    if (variances < 0).any():
        raise ValueError(f"P: expected a covariance, got a variance of {variances.min():.3g}")
    scale = np.sqrt(variances)[..., None, :]
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(P / (np.swapaxes(scale, -1, -2) * scale), rcond=1e-14, hermitian=True)
    quotient = (A / scale) @ inverse / scale
    return quotient if quotient.ndim == 2 else np.moveaxis(quotient, (-2, -1), (0, 1))


def eliminate(S, below):
    """Symmetric elimination, S = L D Lᵀ, carried on through further rows.

    Parameters
    ----------
    S : numpy.ndarray, shape (m, m, ...)
        Only the lower half is read.
    below : numpy.ndarray, shape (q, m, ...)

    Returns
    -------
    A : numpy.ndarray, shape (m + q, m, ...)
        L below its diagonal of ones (what stands on and above that means nothing), and below it `below` L⁻ᵀ D⁻¹.
    D : numpy.ndarray, shape (m, ...)
        Both NaN in the runs where S is not positive definite.
    """
    S, below = _square(S, "S"), check_numbers(below, "below")
    m = len(S)
    _fit(below.ndim > 1 and below.shape[1] == m, "S, below: expected shapes (m, m, ...) and (q, m, ...)", S, below, 2, 2)
    A = np.empty((m + len(below), m, *np.broadcast_shapes(S.shape[2:], below.shape[2:])))
    A[:m], A[m:] = S, below
    D = np.empty_like(A[0])
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for j in range(m):
            column = A[j:, j]
            if j > 0:
                column -= np.einsum("ik...,k...->i...", A[j:, :j], A[j, :j] * D[:j])
            D[j] = column[0]
            column[1:] /= D[j]
        positive = D > 0
        if not positive.all():
            lost = np.where(positive.all(axis=0), 0.0, np.nan)
            A += lost
            D += lost
    return A, D


def mahalanobis(y, S):
    """yᵀS⁻¹y for y (m, ...) and S (m, m, ...); NaN where S is not positive definite."""
    y, S = check_numbers(y, "y"), _square(S, "S")
    _fit(y.ndim > 0 and len(y) == len(S), "y, S: expected shapes (m, ...) and (m, m, ...)", y, S, 1, 2)
    if y.ndim > 1 and y.size and y.shape == S.shape[1:]:
        total = fused.mahalanobis(y.reshape(len(y), -1), S.reshape(len(y), len(y), -1))
        if total is not None:
            return total.reshape(y.shape[1:])
    with np.errstate(invalid="ignore", over="ignore"):
        if S.shape[2:] != y.shape[1:]:  # a common S: its root is found once
            whitened = matvec(solve_lower(cholesky(S), np.eye(len(S)).reshape(*S.shape[:2], *[1] * (S.ndim - 2))), y)
            return np.einsum("j...,j...->...", whitened, whitened)
        A, D = eliminate(S, y[None])
        return np.einsum("j...,j...->...", A[-1] * D, A[-1])

"""Triangular factors of covariances: what a square-root filter computes with."""

import numpy as np
from scipy.linalg.lapack import dgeqrf, dpotrf

from trackhelpers.arrays import all_finite, check_array, check_covariance
from trackhelpers.checks import check_number, correlations, deviations


def cholupdate(L, x, sign=1):
    """The Cholesky factor of L Lᵀ ± x xᵀ from that of L Lᵀ.

    Parameters
    ----------
    L : array_like, shape (n, n)
        Lower triangular.
    x : array_like, shape (n,)
    sign : {1, -1}
        1 adds x xᵀ, −1 takes it away.

    Returns
    -------
    numpy.ndarray, shape (n, n)
        Lower triangular, a new array.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, another sign, or a downdate that leaves nothing positive definite.

    References
    ----------
    A. W. Bojanczyk, R. P. Brent, P. Van Dooren, F. R. de Hoog, SIAM J. Sci. Stat. Comput. 8 (1987) 210–221: the mixed form of the rotations, which is stable.
    """
    x = check_array(x, "x", None, ()).copy()
    n = len(x)
    L = check_array(L, "L", n, (n,)).copy()
    if not all_finite(L):
        raise ValueError(f"L: expected finite numbers, got {L.tolist()}")
    if check_number(sign, "sign", "1 or -1") not in (1, -1):
        raise ValueError(f"sign: expected 1 or -1, got {sign!r}")
    for k in range(n):
        if x[k] == 0:
            continue
        old, below = L[k, k], L[k + 1 :, k]
        if sign > 0:
            L[k, k] = np.hypot(old, x[k])
            c, s = old / L[k, k], x[k] / L[k, k]
            below[:], x[k + 1 :] = c * below + s * x[k + 1 :], c * x[k + 1 :] - s * below
            continue
        if not abs(x[k]) < abs(old):
            raise ValueError(
                f"x: expected one that leaves L Lᵀ − x xᵀ positive definite, got one that takes away more than there is in component {k}"
            )
        L[k, k] = np.sqrt((abs(old) - abs(x[k])) * (abs(old) + abs(x[k])))
        c, s = L[k, k] / old, x[k] / old
        below[:] = (below - s * x[k + 1 :]) / c
        x[k + 1 :] = c * x[k + 1 :] - s * below
    return L


def triangular(rows):
    """Lower triangular L (n, n), its diagonal ≥ 0, with L Lᵀ = AᵀA for the rows A (k, n), k ≥ n: one QR decomposition."""
    n = rows.shape[1]
    R = np.triu(dgeqrf(rows)[0][:n])
    return (R * np.where(R.diagonal() < 0, -1.0, 1.0)[:, None]).T


def lower_root(P, name, n, sqrt_fn=None):
    """Lower triangular L with L Lᵀ = P (n, n); ValueError that calls it `name` unless P is a covariance.

    Cholesky's where P is definite, else from an eigenvalue root of the correlations, so that no unit decides what is rounding, without what rounding left.
    """
    P = check_covariance(P, name, n)
    if sqrt_fn is not None:
        U = np.asarray(sqrt_fn(P), dtype=float)
        if not np.allclose(U.T @ U, P, rtol=1e-9, atol=1e-12 * np.abs(P).max()):
            raise ValueError(f"sqrt_fn: expected U with UᵀU = {name}, upper triangular if triangular at all, got {U.tolist()}")
        return triangular(U)
    L, failed = dpotrf(P, lower=True, clean=True)
    if not failed and (L.diagonal() > 1e-7 * np.sqrt(P.diagonal())).all():
        return L
    sigma = deviations(P)
    values, vectors = np.linalg.eigh(correlations(P))
    values[values < 1e-14] = 0.0
    return triangular((sigma[:, None] * vectors * np.sqrt(values)).T)

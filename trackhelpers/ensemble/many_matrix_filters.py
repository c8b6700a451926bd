"""What the ensembles of matrix filters share: constant F, H, Q and R, and a covariance of its own for every run."""

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, matmul, matvec
from trackhelpers.ensemble.covariance import correct, propagate


def entries(A):
    """(i, j) -> number, the entries of A that are not zero."""
    return {(int(i), int(j)): float(A[i, j]) for i, j in zip(*np.nonzero(A), strict=True)}


class Matrices:
    """F, H, Q and R of one model, and the products that a filter on M runs makes with them."""

    def __init__(self, F, H, Q, R):
        n = len(F)
        self.F, self.H, self.Q, self.R = F, H, Q, R
        self._seen = entries(H)
        self._transition = {(i, i): float(F[i, i]) for i in range(n) if F[i, i] != 1} | {
            k: v for k, v in entries(F).items() if k[0] != k[1]
        }
        self._noise = entries(np.tril(Q))

    def predict(self, x, P):
        """F x and F P Fᵀ + Q for x (n, M) and P (n, n, M)."""
        return self.F @ x, propagate(P, self._transition, self._noise)

    def moved(self, P):
        """F P Fᵀ."""
        return propagate(P, self._transition, {})

    def correct(self, x, P, z):
        """x, P, y, S, K after the measurement z (m, M); NaN in a run whose S is not positive definite."""
        K, S, P = correct(P, self._seen, self.R)
        y = z - self.H @ x
        return x + matvec(K, y), P, y, S, K

    def innovation_covariance(self, P):
        """H P Hᵀ + R, shape (m, m, M)."""
        seen = matmul(self.H, P)
        return matmul(seen, self.H.T) + self.R[..., None]


def check_runs(value, name, components, runs=None):
    """`value` as finite floats of shape (components, M), runs on the last axis; ValueError otherwise."""
    array = np.asarray(value, dtype=float)
    if array.ndim != 2 or len(array) != components or array.shape[1] == 0 or runs not in (None, array.shape[1]):
        wanted = f"({components}, {'M' if runs is None else runs})"
        raise ValueError(f"{name}: expected shape {wanted}, runs on the last axis, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(array))} that are not")
    return array


class EnsembleMatrixKF:
    """The Kalman filter on constant matrices over M runs, `trackhelpers.filters.MatrixKF` for each: base of the ensembles whose gain depends on the data.

    Parameters
    ----------
    F, H, Q, R : array_like, shapes (n, n), (m, n), (n, n) and (m, m)
    x0 : array_like, shape (n, M)
    P0 : array_like, shape (n, n)
        The same for all runs.

    Attributes
    ----------
    x (n, M), P (n, n, M), y (m, M), S (m, m, M), K (n, m, M)

    Raises
    ------
    ValueError
        Wrong shapes, numbers that are not finite, Q, R or P0 that are no covariances; from `update` a measurement that is not (m, M) finite numbers.
    """

    def __init__(self, F, H, Q, R, x0, P0):
        F, H = np.asarray(F, dtype=float), np.atleast_2d(np.asarray(H, dtype=float))
        n, m = len(F), len(H)
        x0 = check_runs(x0, "x0", n)
        F, H = check_array(F, "F", n, (n,)), check_array(H, "H", m, (n,))
        for name, matrix in (("F", F), ("H", H)):
            if not np.all(np.isfinite(matrix)):
                raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(matrix))} that are not")
        self.matrices = Matrices(F, H, check_covariance(Q, "Q", n), check_covariance(R, "R", m))
        self.runs, self.m = x0.shape[1], m
        self.x = x0.copy()
        self.P = np.repeat(check_covariance(P0, "P0", n)[..., None], self.runs, axis=2)
        self.y, self.S, self.K = np.zeros((m, self.runs)), np.zeros((m, m, self.runs)), np.zeros((n, m, self.runs))

    @property
    def failed(self):
        """Which runs have diverged: shape (M,), True where x or P is not finite."""
        return ~(np.isfinite(self.x).all(axis=0) & np.isfinite(self.P).all(axis=(0, 1)))

    def predict(self):
        """Predict all runs."""
        self.x, self.P = self.matrices.predict(self.x, self.P)

    def update(self, z):
        """Correct all runs by z, shape (m, M)."""
        self._correct(self._measurement(z))

    def _measurement(self, z):
        return check_runs(z, "z", self.m, self.runs)

    def _correct(self, z):
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            self.x, self.P, self.y, self.S, self.K = self.matrices.correct(self.x, self.P, z)

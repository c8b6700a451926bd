"""filterpy's KalmanFilter with its matrices given at once and checked: what the filters for manoeuvring targets are built on."""

import numpy as np
from filterpy.kalman import KalmanFilter

from trackhelpers.arrays import check_array, check_covariance


def check_matrix(value, name, shape):
    """`value` as a float array of the given shape; ValueError unless it has it and is finite."""
    matrix = check_array(value, name, shape[0], tuple(shape[1:]))
    if not np.all(np.isfinite(matrix)):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(matrix))} that are not")
    return matrix


class MatrixKF(KalmanFilter):
    """filterpy's KalmanFilter on constant matrices.

    Parameters
    ----------
    F : array_like, shape (n, n)
    H : array_like, shape (m, n)
    Q : array_like, shape (n, n)
    R : array_like, shape (m, m)
    x0 : array_like, shape (n,)
    P0 : array_like, shape (n, n)

    Raises
    ------
    ValueError
        Wrong shapes, numbers that are not finite, Q, R or P0 that are no covariances; from `update` a measurement that is not m finite numbers. The filter is
        then as it was.
    """

    def __init__(self, F, H, Q, R, x0, P0):
        x0 = np.atleast_1d(np.asarray(x0, dtype=float))
        n, m = len(x0), len(np.atleast_2d(H))
        super().__init__(dim_x=n, dim_z=m)
        self.x = check_array(x0, "x0", n, ()).copy()
        self.P = check_covariance(P0, "P0", n)
        self.F, self.H = check_matrix(F, "F", (n, n)), check_matrix(np.atleast_2d(H), "H", (m, n))
        self.Q, self.R = check_covariance(Q, "Q", n), check_covariance(R, "R", m)
        self.x_prior = self.x_post = self.x.copy()
        self.P_prior = self.P_post = self.P.copy()
        self.y = np.zeros(m)

    def update(self, z):
        """Correct by measurement `z`, shape (m,); None leaves the prediction, and no old innovation to be read by mistake."""
        if z is None:
            self._no_measurement()
        else:
            super().update(self._measurement(z))

    def _measurement(self, z):
        return check_array(np.atleast_1d(z), "z", self.dim_z, ())

    def _no_measurement(self):
        self.z, self.y = None, np.zeros(0)
        self.S = self.SI = np.zeros((0, 0))
        self.K = np.zeros((self.dim_x, 0))
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

"""filterpy's KalmanFilter with its matrices given at once and checked: what the filters for manoeuvring targets are built on."""

import numpy as np
from filterpy.kalman import KalmanFilter

from trackhelpers.arrays import check_covariance, check_matrix
from trackhelpers.checks import check_numbers, check_vector
from trackhelpers.filters.base import OneTarget, atomic, inverse_of_S, refused


@refused(
    batch_filter="trackhelpers.follow.follow",
    update_sequential="update(z, R=…)",
    update_correlated="update(z, R=…)",
    predict_steadystate="predict()",
    update_steadystate="update(z)",
    log_likelihood_of="log_likelihood after update(z)",
)
class MatrixKF(OneTarget, KalmanFilter):
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
        Wrong shapes, numbers that are not finite, Q, R or P0 that are no covariances; from `update` a measurement that is not m finite numbers, an R that is no
        covariance, a singular S. The filter is then as it was.
    """

    def __init__(self, F, H, Q, R, x0, P0):
        x0, H = check_vector(x0, "x0"), np.atleast_2d(check_numbers(H, "H"))
        n, m = len(x0), len(H)
        if not n or not m:
            raise ValueError(f"x0, H: expected a state and a measurement of one component or more, got {n} and {m}")
        super().__init__(dim_x=n, dim_z=m)
        self.x = x0.copy()
        self.P = check_covariance(P0, "P0", n)
        self.F, self.H = check_matrix(F, "F", (n, n)).copy(), check_matrix(H, "H", (m, n)).copy()
        self.Q, self.R = check_covariance(Q, "Q", n), check_covariance(R, "R", m)
        self.inv = inverse_of_S
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()
        self._no_measurement()

    smoothable = True
    predict = atomic(KalmanFilter.predict)

    @atomic
    def update(self, z, R=None):
        """Correct by measurement `z`, shape (m,), with the noise covariance `R`, shape (m, m), in this call only; None leaves the prediction, and no older evidence."""
        if z is None:
            self._no_measurement()
        else:
            self._update(*self._arguments(z, R))

    def _arguments(self, z, R):
        """z (m,) and R (m, m), checked."""
        return check_vector(z, "z", self.dim_z), self.R if R is None else check_covariance(R, "R", self.dim_z)

    def _update(self, z, R):
        """What a filter does with a checked measurement: here filterpy's update."""
        super().update(z, None if R is self.R else R)


ON_A_COPY = "copy.deepcopy(kf) and its predict() or update(z)"


@refused(get_prediction=ON_A_COPY, get_update=ON_A_COPY, rts_smoother="trackhelpers.follow.smooth on a filter of one model")
class AdaptiveKF(MatrixKF):
    """A `MatrixKF` that changes its covariance, its input or its model with the data: base of the filters for manoeuvring targets."""

    smoothable = False

    @property
    def alpha(self):
        """1: filterpy's fading memory is not offered, for the filter has its own way of forgetting."""
        return 1.0

    @alpha.setter
    def alpha(self, value):
        raise NotImplementedError(
            f"{type(self).__name__}.alpha: filterpy's fading memory would go past what this filter adapts; use MatrixKF"
        )

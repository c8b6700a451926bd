"""Paper 3's augmented bias model: the state's own error as further states, estimated and put back in (paper 3, section 2)."""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_covariance, check_matrix
from trackhelpers.checks import check_choice, check_numbers, check_vector
from trackhelpers.filters.matrix_filter import MatrixKF


class AugmentedMatrices(NamedTuple):
    """Matrices of the augmented system [X̃; Λ]; `estimate` (n, 2n) turns its state into the estimate of X."""

    F: np.ndarray
    H: np.ndarray
    Q: np.ndarray
    estimate: np.ndarray


# reading -> blocks of the transition's first row, of H, and of the estimate, in terms of F (or H) and the identity (or zero)
READINGS = {
    "R1": "(13), (15) and (23) as we read them: [F F; 0 I], [H H], X̃ + Λ",
    "R2": "the measurement sees X̃ alone: [F F; 0 I], [H 0], X̃ + Λ",
    "R2 uncorrected": "the same without (23): the estimate is X̃",
    "R3": "a bias that enters the dynamics (Friedland): [F I; 0 I], [H 0], X̃",
    "R4": "the plain filter in disguise: [F F−I; 0 I], [H H], X̃ + Λ",
}


def augmented_matrices(F, H, Q, Q_bias, reading="R1"):
    """The augmented system of paper 3's (13)–(17), as one of its `READINGS`.

    Parameters
    ----------
    F, H, Q : array_like, shapes (n, n), (m, n) and (n, n)
    Q_bias : array_like, shape (n, n)
        Covariance of the bias's random walk (12), symmetric positive semidefinite.
    reading : str
        A key of `READINGS`.

    Returns
    -------
    AugmentedMatrices

    Raises
    ------
    ValueError
        An unknown reading, wrong shapes, Q or Q_bias that are no covariances.
    """
    check_choice(reading, "reading", READINGS)
    F, H = np.atleast_2d(check_numbers(F, "F")), np.atleast_2d(check_numbers(H, "H"))
    n = len(F)
    F, H = check_matrix(F, "F", (n, n)), check_matrix(H, "H", (len(H), n))
    eye, nought = np.eye(n), np.zeros((n, n))
    coupling = {"R3": eye, "R4": F - eye}.get(reading, F)
    sees_bias = reading in ("R1", "R4")
    corrected = reading in ("R1", "R2", "R4")
    return AugmentedMatrices(
        np.block([[F, coupling], [nought, eye]]),
        np.hstack([H, H if sees_bias else 0 * H]),
        np.block([[check_covariance(Q, "Q", n), nought], [nought, check_covariance(Q_bias, "Q_bias", n)]]),
        np.hstack([eye, eye if corrected else nought]),
    )


class AugmentedBiasKF(MatrixKF):
    """The augmented bias model algorithm (ABMA): a plain Kalman filter of dimension 2n on [X̃; Λ], whose estimate of X is X̃ + Λ.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        The filter's model of X and its start, as for `MatrixKF`, of dimension n.
    Q_bias : array_like, shape (n, n)
        Covariance of a step of the bias, symmetric positive semidefinite.
    reading : str
        A key of `READINGS`: how the paper's fragments are put together.
    P_bias0 : array_like, shape (n, n), optional
        Covariance of the bias at the start; default 0, as the reconstruction has it.

    Attributes
    ----------
    x : numpy.ndarray, shape (2n,)
        The augmented state; P, shape (2n, 2n), is its covariance.
    estimate : numpy.ndarray, shape (n,)
        Of X, (23); estimate_P, shape (n, n), is its covariance.
    bias : numpy.ndarray, shape (n,)
        Λ.

    Raises
    ------
    ValueError
        As for `MatrixKF`, and for an unknown reading or a Q_bias or P_bias0 that is no covariance.

    References
    ----------
    B. Ge, H. Zhang, X. Wang, "Augmented bias model algorithm with application to target tracking" (2018), (7)–(23).
    """

    def __init__(self, F, H, Q, R, Q_bias, x0, P0, reading="R1", P_bias0=None):
        x0 = check_vector(x0, "x0")
        n = len(x0)
        check_matrix(F, "F", (n, n))
        F_A, H_A, Q_A, to_estimate = augmented_matrices(F, H, Q, Q_bias, reading)
        P0 = check_covariance(P0, "P0", n)
        bias_P = np.zeros((n, n)) if P_bias0 is None else check_covariance(P_bias0, "P_bias0", n)
        nought = np.zeros((n, n))
        super().__init__(F_A, H_A, Q_A, R, np.concatenate([x0, np.zeros(n)]), np.block([[P0, nought], [nought, bias_P]]))
        self.reading, self._to_estimate = reading, to_estimate

    @property
    def estimate(self):
        """Estimate of X, equation (23), shape (n,)."""
        return self._to_estimate @ self.x

    @property
    def estimate_P(self):
        """Covariance that the filter believes of `estimate`, shape (n, n)."""
        return self._to_estimate @ self.P @ self._to_estimate.T

    @property
    def bias(self):
        """Estimate of the model's error Λ, shape (n,)."""
        return self.x[self.dim_x // 2 :]

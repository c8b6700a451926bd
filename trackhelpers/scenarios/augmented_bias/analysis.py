"""What paper 3's filter is: the same estimates from filters in other clothes, what its fading matrix would do alone, and how white innovations are."""

from typing import NamedTuple

import numpy as np
from scipy import stats

from trackhelpers import exact
from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.ensemble import EnsembleKF
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.intervals import mean_interval
from trackhelpers.scenarios.augmented_bias.contenders import POSITION_VELOCITY, SIGMA_A, H, Linear
from trackhelpers.scenarios.augmented_bias.target import R, T


def estimates(kf, z, of=None):
    """Run a filterpy filter over z (2, N): estimates (4, N), which are `kf.estimate`, or the matrix `of` times its state."""
    found = []
    for column in np.asarray(z).T:
        kf.predict()
        kf.update(column)
        found.append(kf.estimate if of is None else of @ kf.x)
    return np.stack(found, axis=-1)


def constant_acceleration(Q_bias, name="CA in disguise"):
    """The constant-acceleration filter whose positions are those of the augmented filter (reading R1) with the same Q_Λ.

    Per axis with n = (n_p, n_v), a step of the bias: state (p, v, a), transition [[1, T, T²/2], [0, 1, T], [0, 0, 1]], noise [T²/2, T, 0] w_a + [1, 1/T, 0] n_p + [0, ½, 1/T] n_v. Its
    v + (T/2 − κ) a with κ = cov(n_p, n_v)/var(n_v) is the augmented filter's velocity too, when the n_p that n_v does not explain is zero.

    Parameters
    ----------
    Q_bias : array_like, shape (4, 4)
        Covariance of a step of (Λ_x, Λ_vx, Λ_y, Λ_vy); the axes must not be coupled, and the variances of the velocity components must be positive.

    Returns
    -------
    trackhelpers.scenarios.augmented_bias.contenders.Linear
        Its estimate's velocities are v + (T/2 − κ) a.
    """
    Q_bias = check_array(Q_bias, "Q_bias", 4, (4,))
    blocks = Q_bias[:2, :2], Q_bias[2:, 2:]
    if np.any(Q_bias[:2, 2:]) or np.any(Q_bias[2:, :2]) or min(block[1, 1] for block in blocks) <= 0:
        raise ValueError(f"Q_bias: expected axes that are not coupled and positive variances of the velocities, got {Q_bias.tolist()}")
    F3 = np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]])
    enters = np.array([[1, 0], [1 / T, 0.5], [0, 1 / T]])
    w = np.array([T**2 / 2, T, 0])
    Q, to_estimate = np.zeros((6, 6)), POSITION_VELOCITY.copy()
    for axis, block in enumerate(blocks):
        one = slice(3 * axis, 3 * axis + 3)
        Q[one, one] = SIGMA_A**2 * np.outer(w, w) + enters @ block @ enters.T
        to_estimate[2 * axis + 1, 3 * axis + 2] = T / 2 - block[0, 1] / block[1, 1]
    return Linear(name, np.kron(np.eye(2), F3), POSITION_VELOCITY[[0, 2]], Q, to_estimate, POSITION_VELOCITY.T)


class TwoStageKF(MatrixKF):
    """Friedland's two-stage filter: one filter that knows of no bias, and a second one that estimates a constant bias from its innovations.

    x_k = F x_{k−1} + b + w with a constant b of the dimension of x, which is reading R3 with Q_Λ = 0.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        As for `MatrixKF`: the bias-free filter, whose state is `x`.
    P_bias0 : array_like, shape (n, n)
        Covariance of b, symmetric positive semidefinite; its mean is 0.

    Attributes
    ----------
    bias (n,), bias_P (n, n) : b and its covariance
    V (n, n) : what a unit of b adds to the bias-free filter's error
    estimate (n,), estimate_P (n, n) : x + V b

    Raises
    ------
    ValueError
        As for `MatrixKF`, and for a P_bias0 that is no covariance.

    References
    ----------
    B. Friedland, "Treatment of bias in recursive filtering", IEEE Transactions on Automatic Control AC-14 (1969) 359–367.
    """

    def __init__(self, F, H, Q, R, x0, P0, P_bias0):
        super().__init__(F, H, Q, R, x0, P0)
        self.bias, self.bias_P = np.zeros(self.dim_x), check_covariance(P_bias0, "P_bias0", self.dim_x)
        self.V = np.zeros((self.dim_x, self.dim_x))

    def predict(self):
        """Predict the bias-free filter, and how far the bias has carried it off."""
        super().predict()
        self.V = self.F @ self.V + np.eye(self.dim_x)

    def _update(self, z, R):
        super()._update(z, R)
        shown = self.H @ self.V  # what a unit of b adds to the innovation
        S = self.S + shown @ self.bias_P @ shown.T
        K = np.linalg.solve(S, shown @ self.bias_P).T
        self.bias = self.bias + K @ (self.y - shown @ self.bias)
        self.bias_P = self.bias_P - K @ S @ K.T
        self.V = self.V - self.K @ shown

    @property
    def estimate(self):
        """Estimate of the state that the bias drives, shape (n,)."""
        return self.x + self.V @ self.bias

    @property
    def estimate_P(self):
        """Its covariance, shape (n, n)."""
        return self.P + self.V @ self.bias_P @ self.V.T


def mean_error(K, linear, track):
    """Mean error (4, N + 1) on a fixed track of x̂_k = F x̂_{k−1} + K_k (z_k − H F x̂_{k−1}), for given gains K (4, 2, N) and F and H of the plain `linear`."""
    A = np.eye(4)[..., None] - np.einsum("ijk,jl->ilk", K, linear.H)
    return exact.errors(linear.F, A, K, R, track[:, 1:] - linear.F @ track[:, :-1])[0]


def innovations(contender, x0, z):
    """Innovations (2, N, M) of a contender on z (2, N, M) from x0 (4, M)."""
    if isinstance(contender, Linear):
        ensemble = EnsembleKF(contender.model, contender.from_start @ x0, contender.P0)
        predict, update = (T,), (contender.sensor,)
    else:
        ensemble, predict, update = contender.ensemble(x0), (), ()
    found = np.empty(z.shape)
    for k in range(z.shape[1]):
        ensemble.predict(*predict)
        ensemble.update(z[:, k], *update)
        found[:, k] = ensemble.y
    return found


class Correlation(NamedTuple):
    """Normalised E[y_k y_{k+lag}] over a window: its value in [−1, 1], and each run's influence on it, (M,), with mean 0."""

    value: float
    influence: np.ndarray

    @property
    def interval(self):
        """95 % interval over the runs, (low, high)."""
        half = stats.norm.ppf(0.975) * self.influence.std(ddof=1) / np.sqrt(self.influence.size)
        return self.value - half, self.value + half


def correlation(y, lag=1):
    """Correlation of innovations y (N, M) with those `lag` samples later: nothing is centred, for orthogonality asks E[y_k y_{k+lag}] to vanish, mean included."""
    early, late = y[:-lag], y[lag:]
    cross, one, other = ((a * b).sum(axis=0) for a, b in ((early, late), (early, early), (late, late)))
    scale = np.sqrt(one.mean() * other.mean())
    value = cross.mean() / scale
    influence = cross / scale - value * (one / one.mean() + other / other.mean()) / 2
    return Correlation(float(value), influence - influence.mean())


def farther_from_white(one, other):
    """|one| − |other| of two `Correlation` over the same runs, with its 95 % interval: (difference, low, high)."""
    influence = np.sign(one.value) * one.influence - np.sign(other.value) * other.influence
    difference = abs(one.value) - abs(other.value)
    _, low, high = mean_interval(influence)
    return float(difference), float(difference + low), float(difference + high)


def bias_step(variances=(0.01, 0.01), covariance=0.0):
    """Q_Λ (4, 4), equal on both axes, from the variances of a step of Λ's position and velocity components and their covariance."""
    return np.kron(np.eye(2), [[variances[0], covariance], [covariance, variances[1]]])


def fading_of_estimate(P, linear, F, Q):
    """λ for which λ F P Fᵀ + Q is the *estimate's* predicted covariance, P being the estimate's own: what (30) would be for X̃ + Λ instead of X̃.

    Parameters
    ----------
    P : array_like, shape (2n, 2n)
        Posterior covariance of the augmented state.
    linear : trackhelpers.scenarios.augmented_bias.contenders.Linear
        The augmented filter.
    F, Q : array_like, shape (n, n)
        Of the model of X.
    """
    L = linear.to_estimate
    predicted = L @ (linear.F @ P @ linear.F.T + linear.Q) @ L.T
    return np.linalg.solve(F @ L @ P @ L.T @ F.T, predicted - Q).T


def gains_from(predicted):
    """Kalman gains (4, 2, N) of the plain filter's H and R for given predicted covariances, N of shape (4, 4)."""
    return np.stack([exact.gain(P, H, R)[1] for P in predicted], axis=-1)

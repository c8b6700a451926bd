"""The strong tracking filter of Zhou and Frank: a fading factor from the innovations keeps the gain up when they grow (paper 3, introduction)."""

import numpy as np

from trackhelpers.arrays import check_scale, congruence
from trackhelpers.checks import check_choice, check_numbers
from trackhelpers.filters.base import atomic
from trackhelpers.filters.matrix_filter import AdaptiveKF
from trackhelpers.manoeuvre import check_forgetting, with_runs


def innovation_spread(V, innovation, rho):
    """V after another innovation (m, ...): γγᵀ at first, where V (m, m, ...) is None or NaN, (ρV + γγᵀ)/(1 + ρ) later."""
    square = innovation[:, None] * innovation[None]
    if V is None:
        return square
    first, later = np.isnan(V), (rho * V + square) / (1 + rho)
    return np.where(first, square, later) if first.any() else later


def fading_factor(N, M):
    """max(1, N/M), elementwise; 1 where M is not positive, for nothing can fade there."""
    N, M = np.asarray(N, dtype=float), np.asarray(M, dtype=float)
    return np.maximum(1.0, np.divide(N, M, out=np.ones_like(M), where=M > 0))[()]


def faded(moved, V, H, Q, R, beta, axis=None):
    """λ and the predicted covariance with it.

    Parameters
    ----------
    moved : numpy.ndarray, shape (n, n, ...)
        F P Fᵀ.
    V : numpy.ndarray, shape (m, m, ...)
        `innovation_spread`.
    H, Q, R : numpy.ndarray, shapes (m, n), (n, n), and (m, m) or (m, m, ...)
    beta : float
    axis : None or numpy.ndarray of int, shape (n,)
        The measurement that sees each component, for one factor an axis: `axes_seen`.

    Returns
    -------
    fading : float or numpy.ndarray, shape (...) or (m, ...)
    P : numpy.ndarray, shape (n, n, ...)
    """
    seen, noise, R, M = (np.einsum("ii...->i...", matrix) for matrix in (V, H @ Q @ H.T, R, congruence(H, moved)))
    N = seen - with_runs(noise, seen) - beta * with_runs(R, seen)
    if axis is None:
        fading = fading_factor(N.sum(axis=0), M.sum(axis=0))
        return fading, fading * moved + with_runs(Q, moved)
    fading = fading_factor(N, M)
    root = np.sqrt(fading)[axis]
    return fading, root[:, None] * moved * root + with_runs(Q, moved)


def axes_seen(F, H, factors="per axis"):
    """For each state component the one measurement that sees it, now or through F later: shape (n,). None for ``factors="one"``.

    ValueError for other `factors`, and where a component is seen by several measurements or by none, so that it belongs to no axis.
    """
    if check_choice(factors, "factors", ("one", "per axis")) == "one":
        return None
    F, H = check_numbers(F, "F"), check_numbers(H, "H")
    seen, row = np.zeros(H.shape, dtype=bool), H
    for _ in range(len(F)):
        seen |= row != 0
        row = row @ F
    if np.any(seen.sum(axis=0) != 1):
        raise ValueError(f"factors: 'per axis' expected each state component to be seen by one measurement, got {seen.sum(axis=0)}")
    return np.argmax(seen, axis=0)


class StrongTrackingKF(AdaptiveKF):
    """Kalman filter whose predicted covariance is λFPFᵀ + Q, λ ≥ 1 chosen so that the innovations are as large as it believes.

    With the innovation γ, V = γγᵀ at first and (ρV + γγᵀ)/(1 + ρ) later, N = V − HQHᵀ − βR and M = HFPFᵀHᵀ:

    * ``factors="one"``: λ = max(1, tr N / tr M) for the whole covariance;
    * ``factors="per axis"``: λᵢ = max(1, Nᵢᵢ/Mᵢᵢ) for the part of the state that measurement i sees, D^½FPFᵀD^½ + Q.

    Since λ needs the innovation, `predict` leaves λ = 1 in P, and `update` puts it in. A missed scan leaves V and λ as they were.

    Parameters
    ----------
    F, H, Q, R, x0, P0
        As for `MatrixKF`.
    beta : float
        Weakening factor β ≥ 0: the larger, the later λ exceeds 1.
    rho : float
        Forgetting factor 0 < ρ ≤ 1 of V.
    factors : {"one", "per axis"}

    Attributes
    ----------
    fading : float or numpy.ndarray, shape (m,)
        λ of the last update.
    V : numpy.ndarray, shape (m, m), or None before the first update

    Raises
    ------
    ValueError
        As for `MatrixKF`, β < 0, ρ outside (0, 1], unknown `factors`, and with "per axis" a state component that several measurements see, or none.

    References
    ----------
    D. H. Zhou, P. M. Frank, International Journal of Control 65 (1996) 295–307; [12] in the text of paper 3.
    """

    def __init__(self, F, H, Q, R, x0, P0, beta=4.0, rho=0.95, factors="one"):
        super().__init__(F, H, Q, R, x0, P0)
        self.beta, self.rho, self.factors = check_scale(beta, "beta"), check_forgetting(rho), factors
        self._axis = axes_seen(self.F, self.H, factors)
        self.V, self._moved = None, None
        self.fading = 1.0 if self._axis is None else np.ones(self.dim_z)

    @atomic
    def predict(self):
        """Predict with λ = 1."""
        moved = self.F @ self.P @ self.F.T
        super().predict()
        self._moved = moved

    def _update(self, z, R):
        self.V = innovation_spread(self.V, z - self.H @ self.x, self.rho)
        if self._moved is not None:  # a second measurement at the same instant finds the covariance already fading
            self.fading, self.P = faded(self._moved, self.V, self.H, self.Q, R, self.beta, self._axis)
            self._moved, self.P_prior = None, self.P.copy()
        super()._update(z, R)

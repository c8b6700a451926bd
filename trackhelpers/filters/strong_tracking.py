"""The strong tracking filter of Zhou and Frank: a fading factor from the innovations keeps the gain up when they grow (paper 3, introduction)."""

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.manoeuvre import check_forgetting


class StrongTrackingKF(MatrixKF):
    """Kalman filter whose predicted covariance is λFPFᵀ + Q, λ ≥ 1 chosen so that the innovations are as large as it believes.

    With the innovation γ, V = γγᵀ at first and (ρV + γγᵀ)/(1 + ρ) later, N = V − HQHᵀ − βR and M = HFPFᵀHᵀ:

    * ``factors="one"``: λ = max(1, tr N / tr M) for the whole covariance;
    * ``factors="per axis"``: λᵢ = max(1, Nᵢᵢ/Mᵢᵢ) for the part of the state that measurement i sees, D^½FPFᵀD^½ + Q.

    Since λ needs the innovation, `predict` leaves λ = 1 in P, and `update` puts it in.

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
        self.beta, self.rho = check_scale(beta, "beta"), check_forgetting(rho)
        if factors not in ("one", "per axis"):
            raise ValueError(f"factors: expected 'one' or 'per axis', got {factors!r}")
        self.factors = factors
        self._axis = axes_seen(self.F, self.H) if factors == "per axis" else None
        self.V, self._moved = None, None
        self.fading = 1.0 if factors == "one" else np.ones(self.dim_z)

    def predict(self):
        """Predict with λ = 1."""
        self._moved = self.F @ self.P @ self.F.T
        super().predict()

    def update(self, z):
        """Correct by measurement `z`, shape (m,), with λ from its innovation; None leaves the prediction and V."""
        if z is None:
            self._no_measurement()
            return
        z = self._measurement(z)
        innovation = z - self.H @ self.x
        square = np.outer(innovation, innovation)
        self.V = square if self.V is None else (self.rho * self.V + square) / (1 + self.rho)
        if self._moved is not None:  # a second measurement at the same instant finds the covariance already fading
            N = self.V - self.H @ self.Q @ self.H.T - self.beta * self.R
            M = self.H @ self._moved @ self.H.T
            if self.factors == "one":
                self.fading = fading_factor(np.trace(N), np.trace(M))
                self.P = self.fading * self._moved + self.Q
            else:
                self.fading = fading_factor(np.diag(N), np.diag(M))
                root = np.sqrt(self.fading)[self._axis]
                self.P = root[:, None] * self._moved * root + self.Q
            self._moved, self.P_prior = None, self.P.copy()
        super().update(z)


def fading_factor(N, M):
    """max(1, N/M), elementwise; 1 where M is not positive, for nothing can fade there."""
    N, M = np.asarray(N, dtype=float), np.asarray(M, dtype=float)
    return np.maximum(1.0, np.divide(N, M, out=np.ones_like(M), where=M > 0))[()]


def axes_seen(F, H):
    """For each state component the one measurement that sees it, now or through F later: shape (n,).

    ValueError where a component is seen by several measurements or by none, so that it belongs to no axis.
    """
    seen, row = np.zeros(H.shape, dtype=bool), H
    for _ in range(len(F)):
        seen |= row != 0
        row = row @ F
    if np.any(seen.sum(axis=0) != 1):
        raise ValueError(
            f"factors: 'per axis' expected each state component to be seen by one measurement, got {seen.sum(axis=0)} for F and H"
        )
    return np.argmax(seen, axis=0)

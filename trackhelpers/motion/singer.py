"""Singer's model: an acceleration that is exponentially correlated in time (paper 3, introduction)."""

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.motion.straight import Cartesian

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_SMALL = 0.5  # below this ratio of times the closed form of `_second` loses digits, and its series needs few terms


class Singer(Cartesian):
    """Acceleration as a first-order Gauss–Markov process, state (x, vx, ax[, y, vy, ay[, …]]).

    ȧ = −a/τ + w with white w, such that a has the standard deviation σ_m and forgets itself in the time τ. Slow (τ → ∞) it is a constant acceleration, fast
    (τ → 0) a constant velocity with white noise.

    Parameters
    ----------
    sigma_m : float or sequence of float
        Standard deviation of the acceleration, m/s²; one number or one an axis.
    tau : float
        Correlation time, s, > 0.
    axes : int
        1, 2 or 3.
    Q
        As for `Model`. Without it the covariance is exact for every dt/τ, relative error ≤ 1e-12 in each entry; there is no G, for the input is white in continuous time.

    References
    ----------
    R. A. Singer, IEEE Transactions on Aerospace and Electronic Systems AES-6 (1970) 473–483; [2] in the text of paper 3.
    """

    _chain = ("", "v", "a")

    def __init__(self, sigma_m=1.0, tau=20.0, axes=2, Q=None):
        self.tau = check_scale(tau, "tau")
        if self.tau == 0:
            raise ValueError("tau: expected a correlation time > 0 s, got 0")
        super().__init__(sigma_m, axes, "continuous", Q, "sigma_m")

    def _Q(self, x, dt, parts):
        axis = self._axis_noise(dt)
        return {
            (k + i, k + j): sigma**2 * float(axis[i, j])
            for k, sigma in zip(self._first, self.sigmas, strict=True)
            for i in range(3)
            for j in range(i + 1)
        }

    def _block(self, dt):
        position, velocity, acceleration = (float(value) for value in self._response(dt))
        return {(0, 1): dt, (0, 2): position, (1, 2): velocity, (2, 2): acceleration}

    def _response(self, t):
        """Position, velocity and acceleration a time `t` after an acceleration of 1: shape (3, ...)."""
        t = np.asarray(t, dtype=float)
        u = t / self.tau
        first = np.divide(-np.expm1(-u), u, out=np.ones_like(u), where=u != 0)  # (1 − e^{−u})/u
        return np.stack([t**2 * _second(u), t * first, np.exp(-u)])

    def _axis_noise(self, dt):
        """Q of one axis for σ_m = 1, (3, 3): 2/τ ∫ response responseᵀ, without a difference of nearly equal numbers."""
        far = 256 * self.tau  # beyond this the response is a straight line, and one piece does
        pieces = int(np.ceil(min(dt, far) / (4 * self.tau)))  # over 4 τ each, 24 nodes are exact to rounding
        edges = np.linspace(0, min(dt, far), max(pieces, 1) + 1)
        if dt > far:
            edges = np.append(edges, dt)
        width = np.diff(edges)
        nodes = (edges[:-1, None] + 0.5 * width[:, None] * (1 + _NODES)).ravel()
        weights = (0.5 * width[:, None] * _WEIGHTS).ravel()
        response = self._response(nodes)
        return (2 / self.tau) * np.einsum("it,t,jt->ij", response, weights, response)


def _second(u):
    """(e^{−u} − 1 + u)/u², ½ at u = 0."""
    small = np.minimum(u, _SMALL)
    series = np.ones_like(u)
    for k in range(20, 2, -1):  # ½ (1 − u/3 (1 − u/4 (1 − …)))
        series = 1 - small / k * series
    large = np.maximum(u, _SMALL)
    return np.where(u < _SMALL, 0.5 * series, (np.expm1(-large) + large) / large**2)

"""Singer's model: an acceleration that is exponentially correlated in time (paper 3, introduction)."""

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.motion.straight import _Cartesian

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_SMALL = 0.5  # below this ratio of times the closed form of `_second` loses digits, and its series needs few terms


class Singer(_Cartesian):
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
    Q, checked
        As for `Model`.

    References
    ----------
    R. A. Singer, IEEE Transactions on Aerospace and Electronic Systems AES-6 (1970) 473–483; [2] in the text of paper 3.
    """

    _chain = ("", "v", "a")

    def __init__(self, sigma_m=1.0, tau=20.0, axes=2, Q=None, checked=True):
        self.tau = check_scale(tau, "tau")
        if self.tau == 0:
            raise ValueError("tau: expected a correlation time > 0 s, got 0")
        super().__init__(sigma_m, axes, Q, checked, "sigma_m")

    def G(self, x, dt):
        """Not defined: the input is white in continuous time, not held over a step. Use `Q`."""
        raise NotImplementedError("Singer's input is not constant within a step: the model has a Q, but no G of such an input")

    def Q(self, x, dt):
        """Process noise covariance, shape (n, n, ...), a read-only view; exact for every dt/τ, relative error ≤ 1e-12 in each entry."""
        if self._Q is not None:
            return super().Q(x, dt)
        x, dt = self._arguments(x, dt)
        return self._spread(np.kron(np.diag(np.square(self.sigmas)), self._axis_noise(dt)), x)

    def linearised(self, x, dt):
        """As `Model.linearised`."""
        x, dt = self._arguments(x, dt)
        Q = self.Q(np.zeros(self.n), dt)
        noise = {(i, j): Q[i, j] for i, j in zip(*np.nonzero(np.tril(Q)), strict=True)}
        return self.f(x, dt), self._jacobian(x, dt, None), noise

    def _block(self, dt):
        return np.column_stack([[1.0, 0.0, 0.0], [dt, 1.0, 0.0], self._response(dt)])

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

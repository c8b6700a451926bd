"""Straight-line models: constant velocity and constant acceleration, Cartesian and polar (thesis, section 3.2)."""

import numpy as np

from trackhelpers.motion.arc import unit
from trackhelpers.motion.base import Model, pair


class _Cartesian(Model):
    """Independent axes, each a chain of integrators driven by one white input."""

    linear = True
    _chain: tuple[str, ...]  # prefixes of position and its derivatives

    def __init__(self, sigma, axes, Q, checked, name):
        if axes not in (1, 2, 3):
            raise ValueError(f"axes: expected 1, 2 or 3, got {axes!r}")
        self.axes = axes
        self.state = tuple(prefix + axis for axis in "xyz"[:axes] for prefix in self._chain)
        values = [sigma] * axes if np.ndim(sigma) == 0 else list(sigma)
        if len(values) != axes:
            raise ValueError(f"{name}: expected one number or {axes}, one an axis, got {len(values)}")
        super().__init__([(name, value) for value in values], Q=Q, checked=checked)

    def _block(self, dt):
        raise NotImplementedError

    def _column(self, dt):
        raise NotImplementedError

    def _rows(self, x, dt, arc):
        transition = np.kron(np.eye(self.axes), self._block(dt))
        return np.einsum("ij,j...->i...", transition, x)

    def F(self, x, dt):
        """Transition matrix, shape (n, n, ...): a read-only view of one (n, n) matrix, for it depends on dt alone."""
        x, dt = self._arguments(x, dt)
        return self._spread(np.kron(np.eye(self.axes), self._block(dt)), x)

    def G(self, x, dt):
        """Gain of the inputs, one column an axis; shape (n, axes, ...), a read-only view."""
        x, dt = self._arguments(x, dt)
        return self._spread(np.kron(np.eye(self.axes), self._column(dt)[:, None]), x)

    def Q(self, x, dt):
        """Process noise covariance, shape (n, n, ...), a read-only view."""
        if self._Q is not None:
            return super().Q(x, dt)
        x, dt = self._arguments(x, dt)
        G = np.kron(np.eye(self.axes), self._column(dt)[:, None]) * self.sigmas
        return self._spread(G @ G.T, x)

    def _jacobian(self, x, dt, arc):
        F = np.kron(np.eye(self.axes), self._block(dt))
        return {(i, j): F[i, j] for i, j in zip(*np.nonzero(F - np.eye(self.n)), strict=True)}

    def _gain(self, x, dt, arc):
        column = np.kron(np.eye(self.axes), self._column(dt)[:, None])
        return {(i, q): column[i, q] for i, q in zip(*np.nonzero(column), strict=True)}

    @staticmethod
    def _spread(matrix, x):
        return np.broadcast_to(matrix.reshape(*matrix.shape, *[1] * (x.ndim - 1)), (*matrix.shape, *x.shape[1:]))


class CV(_Cartesian):
    """Constant velocity, state (x, vx[, y, vy[, z, vz]]): thesis (3.1)–(3.2), axis after axis.

    Parameters
    ----------
    sigma_a : float or sequence of float
        Standard deviation of the acceleration, constant within a step, m/s²; one number or one an axis. G = [T²/2; T] an axis.
    axes : int
        1, 2 or 3.
    Q, checked
        As for `Model`.
    """

    _chain = ("", "v")

    def __init__(self, sigma_a=0.0, axes=2, Q=None, checked=True):
        super().__init__(sigma_a, axes, Q, checked, "sigma_a")

    def _block(self, dt):
        return np.array([[1, dt], [0, 1]])

    def _column(self, dt):
        return np.array([dt**2 / 2, dt])


class CA(_Cartesian):
    """Constant acceleration, state (x, vx, ax[, y, vy, ay[, …]]): thesis (3.5) in Cartesian form, and section 4.1 with one axis.

    Parameters
    ----------
    sigma_da : float or sequence of float
        Standard deviation of the acceleration's increment in a step, m/s²; one number or one an axis. G = [T²/2; T; 1] an axis.
    axes : int
        1, 2 or 3.
    Q, checked
        As for `Model`.
    """

    _chain = ("", "v", "a")

    def __init__(self, sigma_da=0.0, axes=2, Q=None, checked=True):
        super().__init__(sigma_da, axes, Q, checked, "sigma_da")

    def _block(self, dt):
        return np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])

    def _column(self, dt):
        return np.array([dt**2 / 2, dt, 1])


class PolarCV(Model):
    """Constant velocity in polar form, state (x, y, θ, v): thesis (3.3)–(3.4). Nonlinear, although the thesis calls it linear.

    Parameters
    ----------
    sigma_a : float
        Standard deviation of the acceleration along the heading, m/s²; G = [T²/2 along θ; T].
    sigma_w : float
        Standard deviation of the turn rate, rad/s; G = T on θ. Without it the heading never changes.
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "θ", "v")

    def __init__(self, sigma_a=0.0, sigma_w=0.0, noise="straight", Q=None, checked=True):
        super().__init__([("sigma_a", sigma_a), ("sigma_w", sigma_w)], noise, Q, checked)

    def _arc(self, x, dt, order):
        return unit(x[2])

    def _rows(self, x, dt, arc):
        px, py, heading, v = x
        step = v * dt * arc
        return px + step.real, py + step.imag, heading, v

    def _jacobian(self, x, dt, arc):
        return pair(2, 1j * x[3] * dt * arc) | pair(3, dt * arc)

    def _gain(self, x, dt, arc):
        return pair(0, dt**2 / 2 * arc) | {(3, 0): dt, (2, 1): dt}

    def _arc_gain(self, x, dt, arc):
        # a turn rate held over the step bends the path: ∂p/∂u = i v e^{iθ} T²/2
        return self._gain(x, dt, arc) | pair(1, 0.5j * x[3] * dt**2 * arc)


class PolarCA(Model):
    """Constant acceleration in polar form, state (x, y, θ, v, a): thesis (3.5)–(3.6), with the row of θ that (3.6) lacks.

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk along the heading, m/s³; G = [T³/6 along θ; T²/2; T].
    sigma_w : float
        Standard deviation of the turn rate, rad/s; G = T on θ.
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "θ", "v", "a")

    def __init__(self, sigma_j=0.0, sigma_w=0.0, noise="straight", Q=None, checked=True):
        super().__init__([("sigma_j", sigma_j), ("sigma_w", sigma_w)], noise, Q, checked)

    def _arc(self, x, dt, order):
        return unit(x[2])

    def _rows(self, x, dt, arc):
        px, py, heading, v, a = x
        step = (v * dt + a * dt**2 / 2) * arc  # (3.6)
        return px + step.real, py + step.imag, heading, v + a * dt, a

    def _jacobian(self, x, dt, arc):
        _, _, _, v, a = x
        return pair(2, 1j * (v * dt + a * dt**2 / 2) * arc) | pair(3, dt * arc) | pair(4, dt**2 / 2 * arc) | {(3, 4): dt}

    def _gain(self, x, dt, arc):
        return pair(0, dt**3 / 6 * arc) | {(3, 0): dt**2 / 2, (4, 0): dt, (2, 1): dt}

    def _arc_gain(self, x, dt, arc):
        _, _, _, v, a = x
        return self._gain(x, dt, arc) | pair(1, 1j * (v * dt**2 / 2 + a * dt**3 / 3) * arc)

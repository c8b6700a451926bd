"""Straight-line models: constant velocity and constant acceleration, Cartesian and polar (thesis, section 3.2)."""

import numpy as np

from trackhelpers.motion.arc import unit
from trackhelpers.motion.base import LinearMotion, MotionModel, pair


class Cartesian(LinearMotion):
    """Independent axes, each a chain of integrators driven by one white input; a subclass writes the entries of one axis.

    `_block(dt)` are the entries by which an axis's transition differs from the identity, `_column(dt)` is its column of G.
    """

    _chain: tuple[str, ...]  # prefixes of position and its derivatives

    def __init__(self, sigma, axes, noise, Q, name):
        if isinstance(axes, (bool, np.timedelta64)) or not isinstance(axes, (int, np.integer)) or not 1 <= axes <= 3:
            raise ValueError(f"axes: expected 1, 2 or 3, got {axes!r}")
        self.axes = axes
        self.state = tuple(prefix + axis for axis in "xyz"[:axes] for prefix in self._chain)
        self._first = range(0, len(self.state), len(self._chain))  # component of each axis
        self.white = tuple(i + len(self._chain) - 1 for i in self._first)
        values = list(sigma) if isinstance(sigma, (list, tuple)) or getattr(sigma, "ndim", 0) else [sigma] * axes
        if len(values) != axes:
            raise ValueError(f"{name}: expected one number or {axes}, one an axis, got {len(values)}")
        super().__init__([(name, value) for value in values], noise, Q)

    def _block(self, dt):
        raise NotImplementedError

    def _column(self, dt):
        raise NotImplementedError

    def _F(self, x, dt, parts):
        block = self._block(dt)
        return {(k + i, k + j): value for k in self._first for (i, j), value in block.items()}

    def _G(self, x, dt, parts):
        column = self._column(dt)
        return {(k + i, q): value for q, k in enumerate(self._first) for i, value in enumerate(column)}


class CV(Cartesian):
    """Constant velocity, state (x, vx[, y, vy[, z, vz]]): thesis (3.1)–(3.2), axis after axis.

    Parameters
    ----------
    sigma_a : float or sequence of float
        Standard deviation of the acceleration, constant within a step, m/s²; one number or one an axis. G = [T²/2; T] an axis.
    axes : int
        1, 2 or 3.
    noise, Q
        As for `MotionModel`; "continuous" is a white acceleration, whose Q is σ² [[T³/3, T²/2], [T²/2, T]] an axis.
    """

    _chain = ("", "v")

    def __init__(self, sigma_a=0.0, axes=2, noise="straight", Q=None):
        super().__init__(sigma_a, axes, noise, Q, "sigma_a")

    def _block(self, dt):
        return {(0, 1): dt}

    def _column(self, dt):
        return dt**2 / 2, dt


class CA(Cartesian):
    """Constant acceleration, state (x, vx, ax[, y, vy, ay[, …]]): thesis (3.5) in Cartesian form, and section 4.1 with one axis.

    Parameters
    ----------
    sigma_da : float or sequence of float
        Standard deviation of the acceleration's increment in a step, m/s²; one number or one an axis. G = [T²/2; T; 1] an axis.
    axes : int
        1, 2 or 3.
    noise, Q
        As for `MotionModel`; "continuous" is a white jerk.
    """

    _chain = ("", "v", "a")

    def __init__(self, sigma_da=0.0, axes=2, noise="straight", Q=None):
        super().__init__(sigma_da, axes, noise, Q, "sigma_da")

    def _block(self, dt):
        return {(0, 1): dt, (0, 2): dt**2 / 2, (1, 2): dt}

    def _column(self, dt):
        return dt**2 / 2, dt, 1.0


class PolarCV(MotionModel):
    """Constant velocity in polar form, state (x, y, θ, v): thesis (3.3)–(3.4). Nonlinear, although the thesis calls it linear.

    Parameters
    ----------
    sigma_a : float
        Standard deviation of the acceleration along the heading, m/s²; G = [T²/2 along θ; T].
    sigma_w : float
        Standard deviation of the turn rate, rad/s; G = T on θ. Without it the heading never changes.
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "θ", "v"), (2,), (3, 2)
    backwards = (3,)

    def __init__(self, sigma_a=0.0, sigma_w=0.0, noise="straight", Q=None):
        super().__init__([("sigma_a", sigma_a), ("sigma_w", sigma_w)], noise, Q)

    def _parts(self, x, dt, order):
        return unit(x[2])

    def _f(self, x, dt, arc):
        px, py, heading, v = x
        step = v * dt * arc
        return px + step.real, py + step.imag, heading, v

    def _F(self, x, dt, arc):
        return pair(2, 1j * x[3] * dt * arc) | pair(3, dt * arc)

    def _G(self, x, dt, arc):
        return pair(0, dt**2 / 2 * arc) | {(3, 0): dt, (2, 1): dt}

    def _G_exact(self, x, dt, arc):
        # a turn rate held over the step bends the path: ∂p/∂u = i v e^{iθ} T²/2
        return self._G(x, dt, arc) | pair(1, 0.5j * x[3] * dt**2 * arc)


class PolarCA(MotionModel):
    """Constant acceleration in polar form, state (x, y, θ, v, a): thesis (3.5)–(3.6), with the row of θ that (3.6) lacks.

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk along the heading, m/s³; G = [T³/6 along θ; T²/2; T].
    sigma_w : float
        Standard deviation of the turn rate, rad/s; G = T on θ.
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "θ", "v", "a"), (2,), (4, 2)
    backwards = (3, 4)

    def __init__(self, sigma_j=0.0, sigma_w=0.0, noise="straight", Q=None):
        super().__init__([("sigma_j", sigma_j), ("sigma_w", sigma_w)], noise, Q)

    def _parts(self, x, dt, order):
        return unit(x[2])

    def _f(self, x, dt, arc):
        px, py, heading, v, a = x
        step = (v * dt + a * dt**2 / 2) * arc  # (3.6)
        return px + step.real, py + step.imag, heading, v + a * dt, a

    def _F(self, x, dt, arc):
        _, _, _, v, a = x
        return pair(2, 1j * (v * dt + a * dt**2 / 2) * arc) | pair(3, dt * arc) | pair(4, dt**2 / 2 * arc) | {(3, 4): dt}

    def _G(self, x, dt, arc):
        return pair(0, dt**3 / 6 * arc) | {(3, 0): dt**2 / 2, (4, 0): dt, (2, 1): dt}

    def _G_exact(self, x, dt, arc):
        _, _, _, v, a = x
        return self._G(x, dt, arc) | pair(1, 1j * (v * dt**2 / 2 + a * dt**3 / 3) * arc)

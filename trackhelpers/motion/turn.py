"""Turn-rate models: the heading turns at a rate ω of its own (thesis, section 3.3)."""

from trackhelpers.motion.arc import turn_integrals, unit
from trackhelpers.motion.base import Model, pair


class CTRV(Model):
    """Constant turn rate and velocity, state (x, y, v, θ, ω): thesis (3.7)–(3.16), exact at ω = 0 and near it.

    Parameters
    ----------
    sigma_a : float
        Standard deviation of the acceleration along the heading, m/s²; G = [T²/2 along θ; T on v].
    sigma_w : float
        Standard deviation of the yaw acceleration, rad/s²; G = [T²/2 on θ; T on ω].
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "v", "θ", "ω")

    def __init__(self, sigma_a=0.0, sigma_w=0.0, noise="straight", Q=None, checked=True):
        super().__init__([("sigma_a", sigma_a), ("sigma_w", sigma_w)], noise, Q, checked)

    def _arc(self, x, dt, order):
        return unit(x[3]), turn_integrals(x[4] * dt, order)

    def _rows(self, x, dt, arc):
        px, py, v, heading, w = x
        u, E = arc
        step = v * dt * u * E[0]  # (3.8), without its division by ω
        return px + step.real, py + step.imag, v, heading + w * dt, w

    def _jacobian(self, x, dt, arc):
        v, (u, E) = x[2], arc
        d_speed = dt * u * E[0]
        # (3.10) corrected; at ω = 0 the last column is that of (3.11) corrected
        return pair(2, d_speed) | pair(3, 1j * v * d_speed) | pair(4, 1j * v * dt**2 * u * E[1]) | {(3, 4): dt}

    def _gain(self, x, dt, arc):
        return pair(0, dt**2 / 2 * arc[0]) | {(2, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}  # (3.13)

    def _arc_gain(self, x, dt, arc):
        v, (u, E) = x[2], arc
        return self._gain(x, dt, arc) | pair(0, dt**2 * u * E[1]) | pair(1, 0.5j * v * dt**3 * u * E[2])


class CTRA(Model):
    """Constant turn rate and acceleration, state (x, y, v, θ, ω, a): thesis, Figure 3.

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk along the heading, m/s³; G = [T³/6 along θ; T²/2 on v; T on a].
    sigma_w : float
        Standard deviation of the yaw acceleration, rad/s²; G = [T²/2 on θ; T on ω].
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "v", "θ", "ω", "a")

    def __init__(self, sigma_j=0.0, sigma_w=0.0, noise="straight", Q=None, checked=True):
        super().__init__([("sigma_j", sigma_j), ("sigma_w", sigma_w)], noise, Q, checked)

    def _arc(self, x, dt, order):
        return unit(x[3]), turn_integrals(x[4] * dt, order + 1)

    def _rows(self, x, dt, arc):
        px, py, v, heading, w, a = x
        u, E = arc
        step = u * (v * dt * E[0] + a * dt**2 * E[1])
        return px + step.real, py + step.imag, v + a * dt, heading + w * dt, w, a

    def _jacobian(self, x, dt, arc):
        v, a, (u, E) = x[2], x[5], arc
        d_turn = 1j * dt**2 * u * (v * E[1] + a * dt * E[2])
        entries = pair(2, dt * u * E[0]) | pair(3, 1j * dt * u * (v * E[0] + a * dt * E[1])) | pair(4, d_turn) | pair(5, dt**2 * u * E[1])
        return entries | {(2, 5): dt, (3, 4): dt}

    def _gain(self, x, dt, arc):
        return pair(0, dt**3 / 6 * arc[0]) | {(2, 0): dt**2 / 2, (5, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}

    def _arc_gain(self, x, dt, arc):
        v, a, (u, E) = x[2], x[5], arc
        half = 0.5 * dt**3 * u
        return self._gain(x, dt, arc) | pair(0, half * E[2]) | pair(1, 1j * half * (v * E[2] + a * dt * E[3]))

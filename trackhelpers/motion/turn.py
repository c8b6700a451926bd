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

    def _rows(self, x, dt):
        px, py, v, heading, w = x
        (E0,) = turn_integrals(w * dt, 0)
        step = v * dt * unit(heading) * E0  # (3.8), without its division by ω
        return px + step.real, py + step.imag, v, heading + w * dt, w

    def _jacobian(self, x, dt):
        _, _, v, heading, w = x
        E0, E1 = turn_integrals(w * dt, 1)
        u = dt * unit(heading)
        d_speed = u * E0
        # (3.10) corrected; at ω = 0 the last column is that of (3.11) corrected
        return pair(2, d_speed) | pair(3, 1j * v * d_speed) | pair(4, 1j * v * dt * u * E1) | {(3, 4): dt}

    def _gain(self, x, dt):
        return pair(0, dt**2 / 2 * unit(x[3])) | {(2, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}  # (3.13)

    def _arc_gain(self, x, dt):
        _, _, v, heading, w = x
        _, E1, E2 = turn_integrals(w * dt, 2)
        u = dt**2 * unit(heading)
        return self._gain(x, dt) | pair(0, u * E1) | pair(1, 0.5j * v * dt * u * E2)


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

    def _rows(self, x, dt):
        px, py, v, heading, w, a = x
        E0, E1 = turn_integrals(w * dt, 1)
        step = unit(heading) * (v * dt * E0 + a * dt**2 * E1)
        return px + step.real, py + step.imag, v + a * dt, heading + w * dt, w, a

    def _jacobian(self, x, dt):
        _, _, v, heading, w, a = x
        E0, E1, E2 = turn_integrals(w * dt, 2)
        u = dt * unit(heading)
        d_turn = 1j * dt * u * (v * E1 + a * dt * E2)
        entries = pair(2, u * E0) | pair(3, 1j * u * (v * E0 + a * dt * E1)) | pair(4, d_turn) | pair(5, dt * u * E1)
        return entries | {(2, 5): dt, (3, 4): dt}

    def _gain(self, x, dt):
        return pair(0, dt**3 / 6 * unit(x[3])) | {(2, 0): dt**2 / 2, (5, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}

    def _arc_gain(self, x, dt):
        _, _, v, heading, w, a = x
        _, _, E2, E3 = turn_integrals(w * dt, 3)
        u = 0.5 * dt**3 * unit(heading)
        return self._gain(x, dt) | pair(0, u * E2) | pair(1, 1j * u * (v * E2 + a * dt * E3))

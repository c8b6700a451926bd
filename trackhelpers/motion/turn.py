"""Turn-rate models: the heading turns at a rate ω of its own (thesis, section 3.3)."""

from trackhelpers.motion.arc import turned_moments
from trackhelpers.motion.base import MotionModel, pair


class CTRV(MotionModel):
    """Constant turn rate and velocity, state (x, y, v, θ, ω): thesis (3.7)–(3.16), exact at ω = 0 and near it.

    At rest the turn rate cannot be seen: a filter of a standing target estimates it all the same, from noise, with a false certainty (up to 15 σ was seen).
    Where a target stands still for long, `CSAV` is the model: its turn rate is speed times curvature.

    Parameters
    ----------
    sigma_a : float
        Standard deviation of the acceleration along the heading, m/s²; G = [T²/2 along θ; T on v].
    sigma_w : float
        Standard deviation of the yaw acceleration, rad/s²; G = [T²/2 on θ; T on ω].
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "v", "θ", "ω"), (3,), (2, 4)
    backwards = (2,)

    def __init__(self, sigma_a=0.0, sigma_w=0.0, noise="straight", Q=None):
        super().__init__([("sigma_a", sigma_a), ("sigma_w", sigma_w)], noise, Q)

    def _parts(self, x, dt, order):
        return turned_moments(x[3], x[4], dt, order)

    def _f(self, x, dt, arc):
        px, py, v, heading, w = x
        step = v * arc[1][0]  # (3.8), without its division by ω
        return px + step.real, py + step.imag, v, heading + w * dt, w

    def _F(self, x, dt, arc):
        sideways, (_, E) = 1j * x[2], arc
        # (3.10) corrected; at ω = 0 the last column is that of (3.11) corrected
        return pair(2, E[0]) | pair(3, sideways * E[0]) | pair(4, sideways * E[1]) | {(3, 4): dt}

    def _G(self, x, dt, arc):
        return pair(0, dt**2 / 2 * arc[0]) | {(2, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}  # (3.13)

    def _G_exact(self, x, dt, arc):
        v, (_, E) = x[2], arc
        return self._G(x, dt, arc) | pair(0, E[1]) | pair(1, 0.5j * v * E[2])


class CTRA(MotionModel):
    """Constant turn rate and acceleration, state (x, y, v, θ, ω, a): thesis, Figure 3.

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk along the heading, m/s³; G = [T³/6 along θ; T²/2 on v; T on a].
    sigma_w : float
        Standard deviation of the yaw acceleration, rad/s²; G = [T²/2 on θ; T on ω].
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "v", "θ", "ω", "a"), (3,), (5, 4)
    backwards = (2, 5)

    def __init__(self, sigma_j=0.0, sigma_w=0.0, noise="straight", Q=None):
        super().__init__([("sigma_j", sigma_j), ("sigma_w", sigma_w)], noise, Q)

    def _parts(self, x, dt, order):
        return turned_moments(x[3], x[4], dt, order + 1)

    def _f(self, x, dt, arc):
        px, py, v, heading, w, a = x
        _, E = arc
        step = v * E[0] + a * E[1]
        return px + step.real, py + step.imag, v + a * dt, heading + w * dt, w, a

    def _F(self, x, dt, arc):
        v, a, (_, E) = x[2], x[5], arc
        entries = pair(2, E[0]) | pair(3, 1j * (v * E[0] + a * E[1])) | pair(4, 1j * (v * E[1] + a * E[2])) | pair(5, E[1])
        return entries | {(2, 5): dt, (3, 4): dt}

    def _G(self, x, dt, arc):
        return pair(0, dt**3 / 6 * arc[0]) | {(2, 0): dt**2 / 2, (5, 0): dt, (3, 1): dt**2 / 2, (4, 1): dt}

    def _G_exact(self, x, dt, arc):
        v, a, (_, E) = x[2], x[5], arc
        return self._G(x, dt, arc) | pair(0, 0.5 * E[2]) | pair(1, 0.5j * (v * E[2] + a * E[3]))

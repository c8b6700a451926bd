"""Curvature models: the turn rate is speed times curvature, c v, so that a target at rest does not turn (thesis, Figure 3).

The curvature c, 1/m, is a state (CCA) or follows from the steering angle Φ of a vehicle of wheelbase L: c = tan Φ / L (CSAV, CSAA). Along the way
s = vT + ½aT² the heading turns by cs, whatever the speed did meanwhile, so p' = p + s e^{iθ} E₀(cs).
"""

import math
from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.motion.arc import integrate_along_arc, turn_integrals, unit
from trackhelpers.motion.base import MotionModel, pair


class _Way(NamedTuple):
    """What f, F and G share: the state's parts, the way s, the direction e^{iθ} it starts in, and the integrals along the arc."""

    v: np.ndarray
    heading: np.ndarray
    a: np.ndarray  # 0 where the model has none
    c: np.ndarray
    slope: np.ndarray  # dc/d(column 4)
    s: np.ndarray
    u: np.ndarray
    E: list


class _Curvature(MotionModel):
    """A model with columns v, θ, a curvature-like state and perhaps a; `_curve` gives c and its derivative by that state."""

    def _curve(self, x):
        raise NotImplementedError

    def _parts(self, x, dt, order):
        v, heading, a = x[2], x[3], x[5] if self.n == 6 else 0.0 * x[2]
        c, slope = self._curve(x)
        s = v * dt + a * dt**2 / 2
        return _Way(v, heading, a, c, slope, s, unit(heading), turn_integrals(c * s, min(order, 1)))

    def _f(self, x, dt, way):
        step = way.s * way.u * way.E[0]
        return x[0] + step.real, x[1] + step.imag, way.v + way.a * dt, way.heading + way.c * way.s, *x[4:]

    def _F(self, x, dt, way):
        end = unit(way.heading + way.c * way.s)  # ∂p'/∂s: the last bit of way points along the last heading
        d_curve = 1j * way.slope * way.s**2 * way.u * way.E[1]
        entries = pair(2, dt * end) | pair(3, 1j * way.s * way.u * way.E[0]) | pair(4, d_curve)
        entries |= {(3, 2): way.c * dt, (3, 4): way.slope * way.s}
        if self.n == 6:
            entries |= pair(5, dt**2 / 2 * end) | {(2, 5): dt, (3, 5): way.c * dt**2 / 2}
        return entries

    def _G(self, x, dt, way):
        if self.n == 5:
            return pair(0, dt**2 / 2 * way.u) | {(2, 0): dt, (4, 1): dt}
        return pair(0, dt**3 / 6 * way.u) | {(2, 0): dt**2 / 2, (5, 0): dt, (4, 1): dt}

    def _G_exact(self, x, dt, way):
        v, heading, a, c = way[:4]
        further = dt**2 / 2 if self.n == 5 else dt**3 / 6  # ∂s/∂(acceleration or jerk)
        end = unit(heading + c * way.s)

        def bend(t):  # ∂p/∂(curvature rate) per unit time: i v(t) e^{iθ(t)} ∂θ(t)
            t = t.reshape(-1, *[1] * np.ndim(v))
            turned = v * t**2 / 2 + a * t**3 / 3
            return 1j * (v + a * t) * turned * unit(heading + c * (v * t + a * t**2 / 2))

        entries = self._G(x, dt, way) | pair(0, further * end) | {(3, 0): c * further}
        return entries | pair(1, way.slope * integrate_along_arc(bend, dt)) | {(3, 1): way.slope * (v * dt**2 / 2 + a * dt**3 / 3)}


class _Steered(_Curvature):
    def _set_wheelbase(self, wheelbase):
        self.wheelbase = check_scale(wheelbase, "wheelbase")
        if self.wheelbase == 0:
            raise ValueError("wheelbase: expected a length > 0 m, got 0")

    def _curve(self, x):
        tangent = math.tan(x[4]) if type(x[4]) is float else np.tan(x[4])
        return tangent / self.wheelbase, (1 + tangent**2) / self.wheelbase


class CSAV(_Steered):
    """Constant steering angle and velocity, state (x, y, v, θ, Φ).

    Parameters
    ----------
    wheelbase : float
        Distance L of the axles, m, > 0; the curvature is tan Φ / L.
    sigma_a : float
        Standard deviation of the acceleration, m/s²; G = [T²/2 along θ; T on v].
    sigma_phi : float
        Standard deviation of the steering rate, rad/s; G = T on Φ.
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "v", "θ", "Φ"), (3, 4), (2, 4)
    backwards = (2, 4)

    def __init__(self, wheelbase, sigma_a=0.0, sigma_phi=0.0, noise="straight", Q=None):
        self._set_wheelbase(wheelbase)
        super().__init__([("sigma_a", sigma_a), ("sigma_phi", sigma_phi)], noise, Q)


class CSAA(_Steered):
    """Constant steering angle and acceleration, state (x, y, v, θ, Φ, a).

    Parameters
    ----------
    wheelbase : float
        Distance L of the axles, m, > 0; the curvature is tan Φ / L.
    sigma_j : float
        Standard deviation of the jerk, m/s³; G = [T³/6 along θ; T²/2 on v; T on a].
    sigma_phi : float
        Standard deviation of the steering rate, rad/s; G = T on Φ.
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "v", "θ", "Φ", "a"), (3, 4), (5, 4)
    backwards = (2, 4, 5)

    def __init__(self, wheelbase, sigma_j=0.0, sigma_phi=0.0, noise="straight", Q=None):
        self._set_wheelbase(wheelbase)
        super().__init__([("sigma_j", sigma_j), ("sigma_phi", sigma_phi)], noise, Q)


class CCA(_Curvature):
    """Constant curvature and acceleration, state (x, y, v, θ, c, a).

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk, m/s³; G = [T³/6 along θ; T²/2 on v; T on a].
    sigma_c : float
        Standard deviation of the curvature's rate, 1/(m s); G = [vT²/2 on θ; T on c].
    noise, Q
        As for `MotionModel`.
    """

    state, angles, white = ("x", "y", "v", "θ", "c", "a"), (3,), (5, 4)
    backwards = (2, 4, 5)

    def __init__(self, sigma_j=0.0, sigma_c=0.0, noise="straight", Q=None):
        super().__init__([("sigma_j", sigma_j), ("sigma_c", sigma_c)], noise, Q)

    def _curve(self, x):
        return x[4], 1.0

    def _G(self, x, dt, way):
        return super()._G(x, dt, way) | {(3, 1): x[2] * dt**2 / 2}

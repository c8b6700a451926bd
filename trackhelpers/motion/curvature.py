"""Curvature models: the turn rate is speed times curvature, c v, so that a target at rest does not turn (thesis, Figure 3).

The curvature c, 1/m, is a state (CCA) or follows from the steering angle Φ of a vehicle of wheelbase L: c = tan Φ / L (CSAV, CSAA). Along the way
s = vT + ½aT² the heading turns by cs, whatever the speed did meanwhile, so p' = p + s e^{iθ} E₀(cs).
"""

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.motion.arc import integrate_along_arc, turn_integrals, unit
from trackhelpers.motion.base import Model, pair


class _Curvature(Model):
    """A model with columns v, θ, a curvature-like state and perhaps a; `_curve` gives c and its derivative by that state."""

    def _curve(self, x):
        raise NotImplementedError

    def _motion(self, x):
        """v, θ, c, dc/d(column 4) and a (0 where the model has none)."""
        c, slope = self._curve(x)
        return x[2], x[3], c, slope, x[5] if self.n == 6 else np.zeros_like(x[2])

    def _rows(self, x, dt):
        v, heading, c, _, a = self._motion(x)
        s = v * dt + a * dt**2 / 2
        (E0,) = turn_integrals(c * s, 0)
        step = s * unit(heading) * E0
        return x[0] + step.real, x[1] + step.imag, v + a * dt, heading + c * s, *x[4:]

    def _jacobian(self, x, dt):
        v, heading, c, slope, a = self._motion(x)
        s = v * dt + a * dt**2 / 2
        E0, E1 = turn_integrals(c * s, 1)
        u = unit(heading)
        end = unit(heading + c * s)  # ∂p'/∂s: the last bit of way points along the last heading
        entries = pair(2, dt * end) | pair(3, 1j * s * u * E0) | pair(4, 1j * slope * s**2 * u * E1) | {(3, 2): c * dt, (3, 4): slope * s}
        if self.n == 6:
            entries |= pair(5, dt**2 / 2 * end) | {(2, 5): dt, (3, 5): c * dt**2 / 2}
        return entries

    def _gain(self, x, dt):
        u = unit(x[3])
        if self.n == 5:
            return pair(0, dt**2 / 2 * u) | {(2, 0): dt, (4, 1): dt}
        return pair(0, dt**3 / 6 * u) | {(2, 0): dt**2 / 2, (5, 0): dt, (4, 1): dt}

    def _arc_gain(self, x, dt):
        v, heading, c, slope, a = self._motion(x)
        way = dt**2 / 2 if self.n == 5 else dt**3 / 6  # ∂s/∂(acceleration or jerk)
        end = unit(heading + c * (v * dt + a * dt**2 / 2))

        def bend(t):  # ∂p/∂(curvature rate) per unit time: i v(t) e^{iθ(t)} ∂θ(t)
            t = t.reshape(-1, *[1] * np.ndim(v))
            turned = v * t**2 / 2 + a * t**3 / 3
            return 1j * (v + a * t) * turned * unit(heading + c * (v * t + a * t**2 / 2))

        entries = self._gain(x, dt) | pair(0, way * end) | {(3, 0): c * way}
        return entries | pair(1, slope * integrate_along_arc(bend, dt)) | {(3, 1): slope * (v * dt**2 / 2 + a * dt**3 / 3)}


class _Steered(_Curvature):
    def _set_wheelbase(self, wheelbase):
        self.wheelbase = check_scale(wheelbase, "wheelbase")
        if self.wheelbase == 0:
            raise ValueError("wheelbase: expected a length > 0 m, got 0")

    def _curve(self, x):
        tangent = np.tan(x[4])
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
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "v", "θ", "Φ")

    def __init__(self, wheelbase, sigma_a=0.0, sigma_phi=0.0, noise="straight", Q=None, checked=True):
        self._set_wheelbase(wheelbase)
        super().__init__([("sigma_a", sigma_a), ("sigma_phi", sigma_phi)], noise, Q, checked)


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
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "v", "θ", "Φ", "a")

    def __init__(self, wheelbase, sigma_j=0.0, sigma_phi=0.0, noise="straight", Q=None, checked=True):
        self._set_wheelbase(wheelbase)
        super().__init__([("sigma_j", sigma_j), ("sigma_phi", sigma_phi)], noise, Q, checked)


class CCA(_Curvature):
    """Constant curvature and acceleration, state (x, y, v, θ, c, a).

    Parameters
    ----------
    sigma_j : float
        Standard deviation of the jerk, m/s³; G = [T³/6 along θ; T²/2 on v; T on a].
    sigma_c : float
        Standard deviation of the curvature's rate, 1/(m s); G = [vT²/2 on θ; T on c].
    noise, Q, checked
        As for `Model`.
    """

    state = ("x", "y", "v", "θ", "c", "a")

    def __init__(self, sigma_j=0.0, sigma_c=0.0, noise="straight", Q=None, checked=True):
        super().__init__([("sigma_j", sigma_j), ("sigma_c", sigma_c)], noise, Q, checked)

    def _curve(self, x):
        return x[4], np.ones_like(x[4])

    def _gain(self, x, dt):
        return super()._gain(x, dt) | {(3, 1): x[2] * dt**2 / 2}

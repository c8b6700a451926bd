"""Sensors that see polar coordinates: range, bearing, range rate."""

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.sensors.base import CTRV_STATE, Sensor


class RangeBearing(Sensor):
    """Range ρ and bearing ψ from the origin.

    Parameters
    ----------
    sigma : float or sequence of two floats
        Standard deviations of the noise, (m, rad).
    state : sequence of str
        Names of the state's components, x and y among them.

    Raises
    ------
    ValueError
        From `h` and `H` for one target at the origin, where the bearing does not exist; in an ensemble that run gets NaN.
    """

    names = ("ρ", "ψ")

    def __init__(self, sigma, state=CTRV_STATE):
        super().__init__(sigma, state)
        self._position = self._column("x"), self._column("y")

    def _share(self, x):
        px, py = (x[i] for i in self._position)
        rho = np.sqrt(px * px + py * py)  # np.hypot is slower by half
        if not np.all(rho):
            if x.ndim == 1:
                raise ValueError("x: the target stands at the sensor (range 0), where bearing and range rate do not exist")
            rho = np.where(rho == 0, np.nan, rho)
        return px, py, rho

    def _h(self, x):
        px, py, rho = self._shared(x)
        return [rho, np.arctan2(py, px)]

    def _entries(self, x):
        px, py, rho = self._shared(x)
        i, j = self._position
        return {(0, i): px / rho, (0, j): py / rho, (1, i): -py / rho**2, (1, j): px / rho**2}


class Radar(RangeBearing):
    """The thesis's sensor 1 (section 4.2): range ρ, bearing ψ and range rate ρ̇ = (x v_x + y v_y)/ρ, the printed (v_x + v_y)/ρ corrected.

    Parameters
    ----------
    sigma : float or sequence of three floats
        Standard deviations of the noise, (m, rad, m/s).
    state : sequence of str
        Names of the state's components: x, y and either v, θ or vx, vy.

    Raises
    ------
    ValueError
        As for `RangeBearing`.
    """

    names = ("ρ", "ψ", "ρ̇")

    def __init__(self, sigma=(0.3, 0.03, 0.3), state=CTRV_STATE):
        super().__init__(sigma, state)
        self._heading_form = "v" in self.state and "θ" in self.state
        self._velocity = tuple(self._column(name) for name in (("v", "θ") if self._heading_form else ("vx", "vy")))

    def _share(self, x):
        px, py, rho = super()._share(x)
        first, second = (x[i] for i in self._velocity)
        if not self._heading_form:
            return px, py, rho, first, second, None, None
        cos, sin = _angles.cos_sin(second)
        return px, py, rho, first * cos, first * sin, cos, sin

    def _parts(self, x):
        return self._shared(x)[:5]

    def _h(self, x):
        px, py, rho, vx, vy = self._parts(x)
        return [rho, np.arctan2(py, px), (px * vx + py * vy) / rho]

    def _entries(self, x):
        px, py, rho, vx, vy, cos, sin = self._shared(x)
        i, j = self._position
        k, l = self._velocity
        c, s = px / rho, py / rho
        across = vy * c - vx * s  # ∂ρ̇/∂θ is its negative; over ρ it is the turn rate of the line of sight
        turn = across / rho
        entries = {(0, i): c, (0, j): s, (1, i): -s / rho, (1, j): c / rho, (2, i): -s * turn, (2, j): c * turn}
        return entries | ({(2, k): c * cos + s * sin, (2, l): -across} if self._heading_form else {(2, k): c, (2, l): s})

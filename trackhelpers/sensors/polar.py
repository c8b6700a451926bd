"""Sensors that see polar coordinates: range, bearing, range rate."""

from math import atan2, sqrt

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.sensors.base import CTRV_STATE, Sensor, check_mounting


class RangeBearing(Sensor):
    """Range ρ and bearing ψ from where the sensor stands.

    Parameters
    ----------
    sigma, state, R, rows
        As for `Sensor`; sigma in (m, rad). The state holds x and y, and no z, which a sensor in the plane would ignore.
    position : (float, float)
        Where the sensor stands, m.
    heading : float
        Where its bearing 0 points, rad from +x.

    Raises
    ------
    ValueError
        From `h` and `H` for one target at the sensor, where the bearing does not exist; in an ensemble that run gets NaN.
    """

    names = ("ρ", "ψ")

    def __init__(self, sigma=(1.0, 0.01), state=CTRV_STATE, R=None, rows=None, position=(0.0, 0.0), heading=0.0):
        super().__init__(sigma, state, R, rows)
        if "z" in self.state:
            raise ValueError(f"state: expected none named z, which {type(self).__name__}, in the plane, would ignore, got {self.state}")
        self._place = self._column("x"), self._column("y")
        self.position, self.heading = check_mounting(position, heading, 2)
        self._elsewhere = any(self.position)

    def _parts(self, x):
        i, j = self._place
        px, py = x[i], x[j]
        if self._elsewhere:
            px, py = px - self.position[0], py - self.position[1]
        square = px * px + py * py  # np.hypot is slower by half
        if x.ndim == 1:
            if square == 0:
                raise ValueError("x: the target stands at the sensor (range 0), where bearing and range rate do not exist")
            return px, py, sqrt(square)
        rho = np.sqrt(square)
        return px, py, rho if np.all(rho) else np.where(rho == 0, np.nan, rho)

    def _bearing(self, px, py):
        if type(px) is float:
            return atan2(py, px) - self.heading
        bearing = np.arctan2(py, px)
        return bearing - self.heading if self.heading else bearing

    def _h(self, x, parts):
        px, py, rho = parts
        return [rho, self._bearing(px, py)]

    def _H(self, x, parts):
        px, py, rho = parts
        i, j = self._place
        return {(0, i): px / rho, (0, j): py / rho, (1, i): -py / rho**2, (1, j): px / rho**2}


class Radar(RangeBearing):
    """The thesis's sensor 1 (section 4.2): range ρ, bearing ψ and range rate ρ̇ = (x v_x + y v_y)/ρ, the printed (v_x + v_y)/ρ corrected.

    Parameters
    ----------
    sigma, state, R, rows, position, heading
        As for `RangeBearing`; sigma in (m, rad, m/s), and the state holds x, y and either v, θ or vx, vy.

    Raises
    ------
    ValueError
        As for `RangeBearing`.
    """

    names = ("ρ", "ψ", "ρ̇")

    def __init__(self, sigma=(0.3, 0.03, 0.3), state=CTRV_STATE, R=None, rows=None, position=(0.0, 0.0), heading=0.0):
        super().__init__(sigma, state, R, rows, position, heading)
        self._heading_form = "v" in self.state and "θ" in self.state
        self._velocity = tuple(self._column(name) for name in (("v", "θ") if self._heading_form else ("vx", "vy")))

    def _parts(self, x):
        """x, y, ρ, v_x, v_y, and in the heading form cos θ and sin θ."""
        px, py, rho = RangeBearing._parts(self, x)
        first, second = x[self._velocity[0]], x[self._velocity[1]]
        if not self._heading_form:
            return px, py, rho, first, second, None, None
        cos, sin = _angles.cos_sin(second)
        return px, py, rho, first * cos, first * sin, cos, sin

    def _h(self, x, parts):
        px, py, rho, vx, vy, *_ = parts
        return [rho, self._bearing(px, py), (px * vx + py * vy) / rho]

    def _H(self, x, parts):
        px, py, rho, vx, vy, cos, sin = parts
        i, j = self._place
        k, l = self._velocity
        c, s = px / rho, py / rho
        across = vy * c - vx * s  # ∂ρ̇/∂θ is its negative; over ρ it is the turn rate of the line of sight
        turn = across / rho
        entries = {(0, i): c, (0, j): s, (1, i): -s / rho, (1, j): c / rho, (2, i): -s * turn, (2, j): c * turn}
        return entries | ({(2, k): c * cos + s * sin, (2, l): -across} if self._heading_form else {(2, k): c, (2, l): s})

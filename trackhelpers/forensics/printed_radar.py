"""Section 4.2 as it is printed: the radar's range rate and Jacobian, and the list of steps."""

from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.sensors import Radar

RANGE_RATES = ("printed", "right")
JACOBIANS = ("printed v", "printed y", "own", "right")


class PrintedRadar(Radar):
    """The radar with the range rate and the third row of J_H that the thesis prints, together or each alone.

    Parameters
    ----------
    sigma, state
        As for `Radar`; the state holds v and θ.
    range_rate : {"printed", "right"}
        ``"printed"`` is (v_x + v_y)/ρ, in units of 1/s; ``"right"`` is (x v_x + y v_y)/ρ.
    jacobian : {"printed v", "printed y", "own", "right"}
        Third row of J_H. The printed one is [v/ρ − x(v_x+v_y)/ρ³, v/ρ − y(v_x+v_y)/ρ³, (x+y)/ρ, 0, 0]; our copy has y for the v in front, perhaps a slip of
        the scan, and both readings are offered. ``"own"`` holds the derivatives of the range rate in use, ``"right"`` those of the right one.
    """

    def __init__(self, sigma=(0.3, 0.03, 0.3), state=("x", "y", "v", "θ", "ω"), range_rate="printed", jacobian="printed v"):
        super().__init__(sigma, state)
        if not self._heading_form:
            raise ValueError(f"state: PrintedRadar needs components named v and θ, got {self.state}")
        if range_rate not in RANGE_RATES:
            raise ValueError(f"range_rate: expected one of {RANGE_RATES}, got {range_rate!r}")
        if jacobian not in JACOBIANS:
            raise ValueError(f"jacobian: expected one of {JACOBIANS}, got {jacobian!r}")
        self.range_rate, self.jacobian = range_rate, jacobian

    def _h(self, x, parts):
        right = super()._h(x, parts)
        if self.range_rate == "right":
            return right
        _, _, rho, vx, vy, *_ = parts
        return [*right[:2], (vx + vy) / rho]

    def _H(self, x, parts):
        entries = super()._H(x, parts)
        if self.jacobian == "right" or (self.jacobian == "own" and self.range_rate == "right"):
            return entries
        px, py, rho, vx, vy, c, s = parts
        (i, j), (k, l) = self._place, self._velocity
        v = x[k]
        outward_x, outward_y = px * (vx + vy) / rho**3, py * (vx + vy) / rho**3
        if self.jacobian == "own":
            return entries | {(2, i): -outward_x, (2, j): -outward_y, (2, k): (c + s) / rho, (2, l): v * (c - s) / rho}
        front = (v if self.jacobian == "printed v" else py) / rho
        return entries | {(2, i): front - outward_x, (2, j): front - outward_y, (2, k): (px + py) / rho, (2, l): 0.0 * rho}


class UnpredictedEKF(EnsembleEKF):
    """The printed list of steps: the covariance is predicted (step 05), the state is not, for no step of the list does it."""

    def predict(self, dt):
        """Predict the covariance over `dt` seconds, dt ≥ 0."""
        x = self.x
        super().predict(dt)
        self.x = x


class LinearisedRadar(Radar):
    """The radar with H x for h(x), as step 07 prints the innovation, z − H x̂, for both sensors. Parameters as for `Radar`."""

    def _h(self, x, parts):
        rows = [0.0] * len(self.components)
        for (i, j), value in self._H(x, parts).items():
            rows[i] = rows[i] + value * x[j]
        return rows

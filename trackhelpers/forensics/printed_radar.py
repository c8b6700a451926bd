"""The radar of section 4.2 with the range rate and the third row of J_H that the thesis prints, together or each alone."""

from trackhelpers.published import thesis_chapter_4 as printed
from trackhelpers.sensors import Radar

RANGE_RATES = ("printed", "right")
JACOBIANS = ("printed v", "printed y", "own", "right")


class PrintedRadar(Radar):
    """The radar as the thesis prints it.

    Parameters
    ----------
    sigma
        As for `Radar`; the state is CTRV's.
    range_rate : {"printed", "right"}
        ``"printed"`` is (v_x + v_y)/ρ, in units of 1/s; ``"right"`` is (x v_x + y v_y)/ρ.
    jacobian : {"printed v", "printed y", "own", "right"}
        Third row of J_H: as printed, in both readings of our copy (`trackhelpers.published.thesis_chapter_4.range_rate_row`). ``"own"`` holds the derivatives of the range
        rate in use, ``"right"`` those of the right one.
    """

    def __init__(self, sigma=(0.3, 0.03, 0.3), range_rate="printed", jacobian="printed v"):
        super().__init__(sigma)
        if range_rate not in RANGE_RATES:
            raise ValueError(f"range_rate: expected one of {RANGE_RATES}, got {range_rate!r}")
        if jacobian not in JACOBIANS:
            raise ValueError(f"jacobian: expected one of {JACOBIANS}, got {jacobian!r}")
        self.range_rate, self.jacobian = range_rate, jacobian

    def _h(self, x, parts):
        right = super()._h(x, parts)
        return right if self.range_rate == "right" else [*right[:2], printed.range_rate_of(*x)]

    def _H(self, x, parts):
        entries = super()._H(x, parts)
        if self.jacobian == "right" or (self.jacobian == "own" and self.range_rate == "right"):
            return entries
        if self.jacobian == "own":
            px, py, rho, vx, vy, c, s = parts
            fall = (vx + vy) / rho**3
            row = -px * fall, -py * fall, (c + s) / rho, (vx - vy) / rho
        else:
            row = printed.range_rate_row_of(*x, self.jacobian[-1])[:4]
        return entries | {(2, j): value for j, value in enumerate(row)}

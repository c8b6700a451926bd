"""The thesis's section 4.2 as printed, errors included: the radar's range rate and its row of J_H, for states (x, y, v, θ, ω) of shape (5, ...)."""

import numpy as np

from ..checks import check_array, check_choice


def range_rate(x):
    """Row 3 of g(u, x), (v_x + v_y)/ρ: its unit is 1/s. ValueError for what is no state (5, ...)."""
    return range_rate_of(*check_array(x, "x", 5))


def range_rate_of(px, py, v, heading, w):
    """`range_rate` of components, as hooks have them."""
    return v * (np.cos(heading) + np.sin(heading)) / np.sqrt(px * px + py * py)


def range_rate_row(x, front="v"):
    """Row 3 of J_H, (5, ...), with y_x and y_y read as v_x and v_y.

    Our copy has y for what stands in front of its first two entries, perhaps a slip of the scan for v; `front` chooses the reading, "v" or "y".
    """
    check_choice(front, "front", ("v", "y"))
    return np.stack(range_rate_row_of(*check_array(x, "x", 5), front))


def range_rate_row_of(px, py, v, heading, w, front):
    """`range_rate_row` of components, as hooks have them: five entries."""
    rho = np.sqrt(px * px + py * py)
    head, fall = (v if front == "v" else py) / rho, range_rate_of(px, py, v, heading, w) / rho**2
    return [head - px * fall, head - py * fall, (px + py) / rho, 0 * rho, 0 * rho]

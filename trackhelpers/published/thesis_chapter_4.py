"""The thesis's section 4.2 as printed, errors included: the radar's range rate and its row of J_H, for states (x, y, v, θ, ω) of shape (5, ...)."""

import numpy as np


def range_rate(x):
    """Row 3 of g(u, x), (v_x + v_y)/ρ: its unit is 1/s."""
    px, py, v, heading, _ = x
    return v * (np.cos(heading) + np.sin(heading)) / np.sqrt(px * px + py * py)


def range_rate_row(x, front="v"):
    """Row 3 of J_H, (5, ...), with y_x and y_y read as v_x and v_y.

    Our copy has y for what stands in front of its first two entries, perhaps a slip of the scan for v; `front` chooses the reading, "v" or "y".
    """
    if front not in ("v", "y"):
        raise ValueError(f"front: expected 'v' or 'y', got {front!r}")
    px, py, v, _, _ = x
    rho = np.sqrt(px * px + py * py)
    head, fall = (v if front == "v" else py) / rho, range_rate(x) / rho**2
    return np.stack([head - px * fall, head - py * fall, (px + py) / rho, 0 * rho, 0 * rho])

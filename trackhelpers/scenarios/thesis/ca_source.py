"""Section 4.1: a source that accelerates along a line, s(t) = 3t² − 2t + 5, and a sensor of its position."""

import numpy as np

T = 0.05  # s
STEPS = 200  # samples k = 0 … 199, the first at t = 0
SIGMA = 0.5  # m, of the noise that is added to s; its square is the filter's R, and the number on the diagonal of its Q


def truth(steps=STEPS):
    """Position (m), velocity (m/s) and acceleration (m/s²) of the source at k T, k = 0 … steps − 1: shape (3, steps)."""
    if not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"steps: expected a whole number ≥ 1, got {steps!r}")
    t = T * np.arange(steps)
    return np.stack([3 * t**2 - 2 * t + 5, 6 * t - 2, np.full(steps, 6.0)])

"""Paper 2, "Kalman filtering and track fusion": three tracks, pairs of sensors, two local filters and a centralised one, and their errors without sampling.

The state is (x, vx, y, vy) in m and m/s, the layout of ``CV(axes=2)``; samples k = 0 … N−1 are T = 2 s apart. Time is the axis before the runs: truth (4, N)
or (4, N, M), measurements (2, 2, N, M), sensor by component, estimates (3, 4, N, M), filter by component.
"""

from trackhelpers.scenarios.track_fusion.errors import Design, Fused, design, exact_errors, expected_nees, fuse, rms, two_points
from trackhelpers.scenarios.track_fusion.tracks import (
    CROSSED,
    FILTERS,
    MODEL,
    PAIRS,
    SIGMA_A,
    START,
    TRACKS,
    TURN,
    FullPosition,
    T,
    accelerated,
    position_pair,
    run,
    simulate,
    straight,
    times,
    turn,
)

__all__ = [
    "CROSSED",
    "FILTERS",
    "MODEL",
    "PAIRS",
    "SIGMA_A",
    "START",
    "TRACKS",
    "TURN",
    "Design",
    "FullPosition",
    "Fused",
    "T",
    "accelerated",
    "design",
    "exact_errors",
    "expected_nees",
    "fuse",
    "position_pair",
    "rms",
    "run",
    "simulate",
    "straight",
    "times",
    "turn",
    "two_points",
]

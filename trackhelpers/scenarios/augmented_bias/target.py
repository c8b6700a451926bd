"""Table 1's target: 1300 s of rest, acceleration, deceleration and a sinusoid, and its measured positions.

The state is (x, vx, y, vy) in m and m/s, the layout of ``CV(axes=2)``. Samples k = 0 … 1300 are T = 1 s apart; the filters start at k = 0 and measure from k = 1 on. Time is
the axis before the runs: truth (4, N + 1), measurements (2, N, M).
"""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_scale
from trackhelpers.ensemble import standard_normal

T = 1.0  # s
STEPS = 1300
COMPONENTS = ("x", "vx", "y", "vy")
START = (10.0, 5.0, 20.0, 5.0)  # m, m/s; Table 1's initial state is garbled, see notebook 3
P0 = np.diag([3.0, 1.0, 3.0, 1.0])
R = 3.0 * np.eye(2)  # m², printed
TAU, SPREAD = 20.0, 0.6  # s, and σ/a of the exponentially correlated acceleration: ours
SWING, PERIOD = 10.0, 100.0  # m/s and s of the sinusoidal speed: ours
SETTLING = 40  # s at the beginning of a segment that "settled" figures leave out


class Segment(NamedTuple):
    """Samples first … last of Table 1, and what the target does in x and in y."""

    name: str
    first: int
    last: int
    x: str
    y: str

    @property
    def samples(self):
        """Slice of the samples k = first … last in an array that begins at k = 0."""
        return slice(self.first, self.last + 1)

    @property
    def settled(self):
        """The same without the first `SETTLING` seconds."""
        return slice(self.first + SETTLING, self.last + 1)

    @property
    def transient(self):
        """Only the first `SETTLING` seconds."""
        return slice(self.first, self.first + SETTLING)


SEGMENTS = (
    Segment("uniform 1", 1, 200, "uniform", "uniform"),
    Segment("accelerated", 201, 400, "accelerated", "accelerated"),
    Segment("decelerated", 401, 600, "decelerated", "decelerated"),
    Segment("uniform 2", 601, 700, "uniform", "uniform"),
    Segment("varying acceleration", 701, 900, "exponentially correlated, mean +a", "uniform"),
    Segment("varying deceleration", 901, 1100, "exponentially correlated, mean −a", "uniform"),
    Segment("sinusoid", 1101, 1300, "uniform", "sinusoidal speed"),
)


def correlated(path=0, steps=400):
    """One path of the unit Gauss–Markov process with correlation time `TAU`, (steps,): frozen, the same for every run and every a.

    Drawing it anew in every run would average away the very bias that is scored. `path` numbers further ones.
    """
    noise = np.random.default_rng([2018, path]).standard_normal(steps)
    memory = np.exp(-T / TAU)
    g = noise.copy()
    for k in range(1, steps):
        g[k] = memory * g[k - 1] + np.sqrt(1 - memory**2) * noise[k]
    return g


def accelerations(a=2.0, path=0):
    """Acceleration (2, 1300) in x and y, m/s², held from sample k to k + 1; the sinusoid of y's speed, which is not held, is left out."""
    a = check_scale(a, "a")
    both = np.zeros((2, STEPS))
    both[:, 200:400], both[:, 400:600] = a, -a
    both[0, 700:900], both[0, 900:1100] = a, -a
    both[0, 700:1100] += SPREAD * a * correlated(path)
    return both


def track_of(accelerations, start=START):
    """Track (4, N + 1) of a target from accelerations (2, N) in x and y, m/s², each held for a step."""
    track = np.empty((4, np.shape(accelerations)[1] + 1))
    for axis, acceleration in enumerate(np.asarray(accelerations, dtype=float)):
        p, v = start[2 * axis : 2 * axis + 2]
        speed = v + T * np.concatenate([[0], np.cumsum(acceleration)])
        track[2 * axis + 1] = speed
        track[2 * axis] = p + np.concatenate([[0], np.cumsum(T * speed[:-1] + T**2 / 2 * acceleration)])
    return track


def truth(a=2.0, path=0):
    """The true track of Table 1, as we read it: (4, 1301), m and m/s.

    Parameters
    ----------
    a : float
        Size of the acceleration, m/s² ≥ 0; the paper's is lost.
    path : int
        Number of the frozen path of the exponentially correlated acceleration.

    Returns
    -------
    numpy.ndarray, shape (4, 1301)
        Accelerations are held within a step; the sinusoid is integrated exactly.
    """
    track = track_of(accelerations(a, path))
    sinusoid, t = slice(1101, None), T * np.arange(1, 201)
    w = 2 * np.pi / PERIOD
    track[3, sinusoid] = track[3, 1100] + SWING * np.sin(w * t)
    track[2, sinusoid] = track[2, 1100] + track[3, 1100] * t + SWING / w * (1 - np.cos(w * t))
    return track


def simulate(rngs, track, R=R):
    """Starts (4, M), drawn from N(truth, `P0`), and measured positions (2, N, M) at samples 1 … N, one block of noise a run.

    Of T tracks, (4, N + 1, T), all with the same noise: (4, T, M) and (2, N, T, M).
    """
    steps, alike = track.shape[1] - 1, (1,) * (track.ndim - 2)
    noise, track = standard_normal(rngs, (4 + 2 * steps,)), track[..., None]
    start = track[:, 0] + (np.sqrt(np.diag(P0))[:, None] * noise[:4]).reshape(4, *alike, -1)
    errors = np.einsum("ij,jkm->ikm", np.linalg.cholesky(R), noise[4:].reshape(2, steps, -1))
    return start, track[[0, 2], 1:] + errors.reshape(2, steps, *alike, -1)

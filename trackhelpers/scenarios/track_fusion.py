"""Paper 2, "Kalman filtering and track fusion": three tracks, pairs of sensors, what their filters believe, and how they start.

The state is (x, vx, y, vy) in m and m/s, the layout of ``CV(axes=2)``; samples k = 0 … N−1 are T = 2 s apart. Time is the axis before the runs: truth (4, N)
or (4, N, M), measurements (2, 2, N, M), sensor by component.
"""

import numpy as np

from trackhelpers.arrays import congruence
from trackhelpers.checks import check_array, check_covariance, check_scale
from trackhelpers.ensemble import standard_normal
from trackhelpers.motion import CV
from trackhelpers.sensors import LinearSensor, Position

T = 2.0  # s
SIGMA_A = 0.2  # m/s², what the filters believe
START = (1000.0, 12000.0)  # m
TURN = slice(201, 301)  # steps k → k + 1 of the turning track that are accelerated: 402 s ≤ t < 602 s
MODEL = CV(SIGMA_A, axes=2)
F, Q = MODEL.F(np.zeros(4), T), MODEL.Q(np.zeros(4), T)
H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])

LOOK = {  # one colour and dash a method in all figures of the paper
    "sensor 1": {"color": "#332288", "linestyle": (0, (1, 1))},
    "sensor 2": {"color": "#882255", "linestyle": (0, (4, 1, 1, 1, 1, 1))},
    "convex": {"color": "#0072B2", "linestyle": "-"},
    "BSC": {"color": "#D55E00", "linestyle": "--"},
    "CI": {"color": "#009E73", "linestyle": "-."},
    "maximum likelihood": {"color": "#CC79A7", "linestyle": ":"},
    "information": {"color": "#999933", "linestyle": (0, (6, 2))},
    "centralised": {"color": "#E69F00", "linestyle": (0, (4, 1, 1, 1))},
}

# The two-point start x̂(1) = LAST z(1) + FIRST z(0): the position measured last, the difference as velocity.
LAST, FIRST = np.kron(np.eye(2), [[1], [1 / T]]), np.kron(np.eye(2), [[0], [-1 / T]])
UNFORESEEN = np.kron(np.eye(2), [[0, 0], [1 / T, -1]])  # its error from the deviation of x(1) from F x(0)


def position_pair(first, second):
    """Two position sensors on the state of `MODEL`; each standard deviation one number or (σ_x, σ_y), m."""
    return Position(first, MODEL.state), Position(second, MODEL.state)


PAIRS = {"A": position_pair(100.0, 150.0), "B": position_pair(100.0, 100.0), "C": position_pair((60.0, 150.0), (150.0, 60.0))}
# Their R do not commute, so that P12 is not symmetric: the only kind of pair that shows an exchanged index.
CROSSED = tuple(LinearSensor(H, R, MODEL.state) for R in (np.diag([60.0**2, 150.0**2]), np.array([[22500.0, 9000.0], [9000.0, 8100.0]])))


def times(steps):
    """Sampling times (steps,), s."""
    return T * np.arange(_steps(steps))


def straight(steps=201):
    """The track of section 2.4 (1), (4, steps): velocity (15, −5) m/s throughout."""
    return _track((15.0, -5.0), np.zeros((2, _steps(steps) - 1)))


def turn(steps=401):
    """The track of section 2.4 (2), (4, steps): velocity (1, −15) m/s, from 402 s to 602 s a parabola with a = (0.075, 0.075) m/s², then (16, 0) m/s.

    The acceleration and the end of the turn are ours; the source says only that the turn begins at 402 s and is a parabola.
    """
    acceleration = np.zeros((2, _steps(steps) - 1))
    acceleration[:, TURN] = 0.075
    return _track((1.0, -15.0), acceleration)


def accelerated(steps=201):
    """The third track, announced but not described by the source, (4, steps): from (15, −5) m/s with a = (0.1, −0.05) m/s² throughout."""
    return _track((15.0, -5.0), np.repeat([[0.1], [-0.05]], _steps(steps) - 1, axis=1))


TRACKS = {"straight": straight, "turn": turn, "accelerated": accelerated}


def simulate(rngs, truth, pair, sigma_a=0.0):
    """Measurements of M runs, and the track that each of them flew.

    Every run draws one block of noise, the same whatever the sensors and `sigma_a`, so that settings are compared on the same runs.

    Parameters
    ----------
    rngs : sequence of numpy.random.Generator
        One a run, not yet drawn from: a generator that has been used gives other noise.
    truth : array_like, shape (4, N)
        The track without process noise.
    pair : two sensors
        Of positions, made for the state of `MODEL`.
    sigma_a : float
        *True* standard deviation of a random acceleration, m/s², constant within each step; 0 is the source's deterministic track.

    Returns
    -------
    truth : numpy.ndarray, shape (4, N, M), or (4, N, 1) where all runs fly the same track
    z : numpy.ndarray, shape (2, 2, N, M)
        Measured positions, m: sensor, component, sample, run.
    """
    truth = check_array(truth, "truth", 4)
    if truth.ndim != 2:
        raise ValueError(f"truth: expected shape (4, N), got {truth.shape}")
    return measured(draw(rngs, truth.shape[1]), truth, pair, sigma_a)


def draw(rngs, steps):
    """The noise of M runs over N steps, standard normal, (6, N, M): four rows for what two sensors measure, two for the acceleration; one generator a run."""
    return standard_normal(rngs, (6, steps))


def measured(noise, truth, pair, sigma_a=0.0):
    """What `simulate` returns, and for the same arguments, from noise (6, N, M) that was drawn before: several settings on the same runs draw once."""
    truth = truth[..., None]
    if check_scale(sigma_a, "sigma_a") > 0:
        truth = truth + _response(sigma_a * noise[4:, :-1])
    z = np.empty((2, 2, *noise.shape[1:]))
    for i, sensor in enumerate(pair):
        np.einsum("ij,jkm->ikm", np.linalg.cholesky(sensor.R), noise[2 * i : 2 * i + 2], out=z[i])
        z[i] += sensor.h(truth)
    return truth, z


def two_points(R, Q=Q):
    """Covariance of the two-point start, and the part of it that two sensors have in common.

    x̂(1) = (z(1), (z(1) − z(0))/T) an axis. The covariance is [[R, R/T], [R/T, 2R/T² + qT²/4]] an axis; only qT²/4 on the velocity, the process noise between the
    two points, is common.

    Parameters
    ----------
    R : array_like, shape (2, 2)
        Of the position sensor, m².
    Q : array_like, shape (4, 4)
        Process noise covariance of a step; default that of `MODEL`.

    Returns
    -------
    P, common : numpy.ndarray, shape (4, 4)
    """
    R, common = check_covariance(R, "R", 2), congruence(UNFORESEEN, check_covariance(Q, "Q", 4))
    return congruence(LAST, R) + congruence(FIRST, R) + common, common


def _steps(steps):
    if not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"steps: expected a whole number ≥ 1, got {steps!r}")
    return steps


def _track(velocity, acceleration):
    """Truth (4, N) from `START`, with accelerations (2, N − 1) constant within each step."""
    t = times(acceleration.shape[1] + 1)
    start = np.array([START[0], velocity[0], START[1], velocity[1]])
    free = start[:, None] + t * np.array([velocity[0], 0, velocity[1], 0])[:, None]
    return free + _response(acceleration)


def _response(acceleration):
    """What accelerations (2, N − 1, ...) add to a track that starts at k = 0: (4, N, ...), exactly, for they are constant within each step."""
    rest = np.zeros((2, 1, *acceleration.shape[2:]))
    v = np.concatenate([rest, T * np.cumsum(acceleration, axis=1)], axis=1)
    p = np.concatenate([rest, np.cumsum(T * v[:, :-1] + T**2 / 2 * acceleration, axis=1)], axis=1)
    return np.stack([p[0], v[0], p[1], v[1]])

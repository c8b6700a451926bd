"""Paper 2's tracks and sensors, its measurements, and its filters run on them."""

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, check_scale
from trackhelpers.consistency import nis
from trackhelpers.ensemble import EnsembleKF, standard_normal
from trackhelpers.motion import CV
from trackhelpers.sensors import Position

T = 2.0  # s
SIGMA_A = 0.2  # m/s², what the filters believe
START = (1000.0, 12000.0)  # m
TURN = slice(201, 301)  # steps k → k + 1 of the turning track that are accelerated: 402 s ≤ t < 602 s
MODEL = CV(SIGMA_A, axes=2)
FILTERS = ("sensor 1", "sensor 2", "centralised")


class FullPosition(Position):
    """A position sensor whose two components are correlated: R (2, 2), m², any positive definite covariance."""

    def __init__(self, R, state=MODEL.state):
        R = check_covariance(R, "R", 2, definite=True)
        super().__init__(np.sqrt(np.diag(R)), state)
        self.R = R
        self.R.setflags(write=False)


def position_pair(first, second):
    """Two position sensors on the state of `MODEL`; each standard deviation one number or (σ_x, σ_y), m."""
    return Position(first, MODEL.state), Position(second, MODEL.state)


PAIRS = {"A": position_pair(100.0, 150.0), "B": position_pair(100.0, 100.0), "C": position_pair((60.0, 150.0), (150.0, 60.0))}
# Their R do not commute, so that P12 is not symmetric: the only kind of pair that shows an exchanged index.
CROSSED = FullPosition(np.diag([60.0**2, 150.0**2])), FullPosition([[22500.0, 9000.0], [9000.0, 8100.0]])


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
    noise = standard_normal(rngs, (6, truth.shape[1]))
    truth = truth[..., None]
    if check_scale(sigma_a, "sigma_a") > 0:
        truth = truth + _response(sigma_a * noise[4:, :-1])
    errors = [np.einsum("ij,jkm->ikm", np.linalg.cholesky(sensor.R), noise[2 * i : 2 * i + 2]) for i, sensor in enumerate(pair)]
    return truth, np.stack([sensor.h(truth) + error for sensor, error in zip(pair, errors, strict=True)])


def run(z, plan, x0=None):
    """The three filters on the measurements of M runs.

    Parameters
    ----------
    z : array_like, shape (2, 2, N, M)
    plan : Design
        Says how the filters start, what they believe and what the sensors are.
    x0 : array_like, shape (4,)
        x̂(0|0) where the plan starts from a prior.

    Returns
    -------
    x : numpy.ndarray, shape (3, 4, N, M)
        Estimates of `FILTERS`, NaN before the first one.
    nis : numpy.ndarray, shape (2, N, M)
        Normalised innovation squared of sensors 1 and 2 in their own filters, NaN up to the first estimate.
    """
    z = np.asarray(z, dtype=float)
    steps = plan.P.shape[-1]
    if z.ndim != 4 or z.shape[:3] != (2, 2, steps):
        raise ValueError(f"z: expected shape (2, 2, {steps}, M), got {z.shape}")
    if (x0 is None) != (plan.first == 1):  # a prior at step 0, or two points that give the first estimate at step 1
        raise ValueError(
            f"x0: expected {'None' if plan.first else 'shape (4,)'} with a design whose first estimate is at step {plan.first}"
        )
    x, nis_of = np.full((3, 4, *z.shape[2:]), np.nan), np.full((2, *z.shape[2:]), np.nan)
    seen = z[:, :, :2].reshape(4, 2, -1)
    for i, sensors in enumerate(((0,), (1,), (0, 1))):
        rows = slice(4 * i, 4 * i + 4)
        start = plan.ahead[rows] @ seen[:, 1] + plan.behind[rows] @ seen[:, 0]
        start = start if x0 is None else start + check_array(x0, "x0", 4, ())[:, None]
        kf = EnsembleKF(plan.model, start, plan.P[i, ..., plan.first])
        x[i, :, plan.first] = kf.x
        for k in range(plan.first + 1, steps):
            kf.predict(T)
            for s in sensors:
                kf.update(z[s, :, k], plan.pair[s])
            x[i, :, k] = kf.x
            if i < 2:
                nis_of[i, k] = nis(kf.y, kf.S[..., 0])
    return x, nis_of


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

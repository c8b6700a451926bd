"""What a model that does not fit does to a Kalman filter: the plain filter in closed form, the model error of (7), and the witnesses.

Expectations over finitely many equally likely outcomes take the place of sampling where a moment has to be exact.
"""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy import linalg, stats

from trackhelpers.consistency import nees
from trackhelpers.ensemble import monte_carlo
from trackhelpers.scenarios.augmented_bias.contenders import F, H, exact_errors, plain
from trackhelpers.scenarios.augmented_bias.target import PERIOD, STEPS, SWING, R, T, accelerations, simulate


class System(NamedTuple):
    """A linear system whose matrices change from step to step, (1)–(3): arrays over N steps, the step first."""

    F: np.ndarray  # (N, n, n)
    H: np.ndarray  # (N, m, n)
    Q: np.ndarray  # (N, n, n)
    R: np.ndarray  # (N, m, m)
    mean: np.ndarray  # (n,) of the start
    P0: np.ndarray  # (n, n) of the start


def random_system(rng, steps=3, n=2, m=1):
    """A `System` drawn at random."""

    def covariance(k):
        A = rng.normal(size=(steps, k, k))
        return A @ np.swapaxes(A, 1, 2) + 0.2 * np.eye(k)

    transition = np.eye(n) + 0.5 * rng.normal(size=(steps, n, n))
    return System(transition, rng.normal(size=(steps, m, n)), covariance(n), covariance(m), rng.normal(size=n), covariance(n)[0])


def outcomes(system):
    """States and measurements of a system in all outcomes of noise whose components are ±1 with equal chance.

    Start, process noise and measurement noise are Cholesky roots times such components, so their moments over the outcomes are those of (2) and (3), exactly. A mean over
    the last axis is an expectation, and not an estimate of one.

    Returns
    -------
    X : numpy.ndarray, shape (N + 1, n, 2^L)
        L is the number of noise components.
    Z : numpy.ndarray, shape (N, m, 2^L)
    W : numpy.ndarray, shape (N, n, 2^L)
        Process noise.
    """
    steps, n, m = len(system.F), len(system.mean), system.H.shape[1]
    signs = np.array(list(product((-1.0, 1.0), repeat=n + steps * (n + m)))).T
    start, w, v = np.split(signs, [n, n + steps * n])
    root = np.linalg.cholesky
    W = root(system.Q) @ w.reshape(steps, n, -1)
    X = [system.mean[:, None] + root(system.P0) @ start]
    for k in range(steps):
        X.append(system.F[k] @ X[-1] + W[k])  # (1)
    X = np.array(X)
    return X, system.H @ X[1:] + root(system.R) @ v.reshape(steps, m, -1), W


def regression(target, data):
    """Best linear guess (n, L) of `target` (n, L) from a constant and `data` (m, L) over equally likely outcomes, and the covariance (n, n) of what it misses."""
    columns = np.vstack([np.ones(target.shape[1]), data]).T
    guess = (columns @ np.linalg.lstsq(columns, target.T, rcond=None)[0]).T
    miss = target - guess
    return guess, miss @ miss.T / target.shape[1]


def by_regression(X, Z):
    """What a Kalman filter should compute from `outcomes`, without any of its formulas: for each step x⁻ (n, L), P⁻, K, x (n, L), P."""
    rows = []
    for k, z in enumerate(Z):
        past = Z[:k].reshape(k * len(z), -1) if k else z[:0]
        prior, P_prior = regression(X[k + 1], past)
        expected, S = regression(z, past)
        K = np.linalg.solve(S, (z - expected) @ (X[k + 1] - prior).T / X.shape[-1]).T
        rows.append((prior, P_prior, K, *regression(X[k + 1], np.vstack([past, z]))))
    return rows


@dataclass(frozen=True)
class Settled:
    """One axis of the settled constant-velocity filter, in closed form; everything follows from its tracking index (Kalata 1984).

    The target's own motion is not random: the true covariances hold the measurement noise alone.
    """

    index: float  # Γ_ti = σ_a T²/σ
    sigma: float = float(np.sqrt(R[0, 0]))  # of a measured position, m
    dt: float = T  # s

    @property
    def root(self):
        """r = (4 + Γ_ti − √(8Γ_ti + Γ_ti²))/4; r² is the product of the poles."""
        return (4 + self.index - np.sqrt(8 * self.index + self.index**2)) / 4

    @property
    def delay(self):
        """τ = T r/(1 − r), s: the age of the tangent that the filter extrapolates."""
        return self.dt * self.root / (1 - self.root)

    @property
    def gain(self):
        """K = [α; β/T], (2,)."""
        return np.array([1 - self.root**2, 2 * (1 - self.root) ** 2 / self.dt])

    @property
    def kept(self):
        """I − KH, (2, 2)."""
        return np.eye(2) - np.outer(self.gain, [1, 0])

    @property
    def loop(self):
        """(I − KH)F, (2, 2): what hands an error on to the next step."""
        return self.kept @ [[1, self.dt], [0, 1]]

    @property
    def believed(self):
        """The filter's covariance P, (2, 2)."""
        r, cross = self.root, self.gain[1]
        return self.sigma**2 * np.array([[self.gain[0], cross], [cross, 4 * (1 - r) ** 3 / (r * self.dt**2)]])

    @property
    def noise(self):
        """True covariance of the error, (2, 2): what the measurement noise leaves in it."""
        r = self.root
        cross = 2 * (1 - r) ** 2 / self.dt
        return self.sigma**2 / (1 + r) * np.array([[(1 - r) * (1 + 2 * r), cross], [cross, 2 * (1 - r) ** 3 / (r * self.dt**2)]])

    def lag(self, a):
        """Mean error (position, velocity) under a constant acceleration a, m/s²: −aτ²/2 and −aτ."""
        return np.array([-a * self.delay**2 / 2, -a * self.delay])

    def rmse(self, a):
        """Root mean square error (position, velocity) under a constant acceleration a."""
        return np.sqrt(self.lag(a) ** 2 + np.diag(self.noise))

    def innovation_noise(self, lag=0):
        """Autocovariance of the innovation at a lag, m²; at 0 its variance, which the filter believes to be σ²/r²."""
        F, H, C = np.array([[1, self.dt], [0, 1]]), np.array([1.0, 0]), self.noise
        if lag == 0:
            return H @ F @ C @ F.T @ H + self.sigma**2
        now = self.gain * self.sigma**2 - self.loop @ C @ F.T @ H  # cov(e_k, ν_k)
        return -H @ F @ np.linalg.matrix_power(self.loop, lag - 1) @ now

    def response(self, omega):
        """Errors (position, velocity), complex, under a position e^{iωt}, whose velocity is iω e^{iωt}; `omega` (…) in rad/s."""
        z, r = np.exp(1j * np.asarray(omega) * self.dt), self.root
        poles = z**2 - (4 * r - 1 - r**2) * z + r**2
        velocity = 2 * (1 - r) ** 2 * z * (z - 1) / (self.dt * poles)
        return np.array([-(r**2) * (z - 1) ** 2 / poles, velocity - 1j * np.asarray(omega)])

    @property
    def kick(self):
        """Error (2,) right after a step with an acceleration of 1 m/s², held within the step."""
        return -self.kept @ [self.dt**2 / 2, self.dt]

    def correlated(self, tau_a):
        """RMS errors (position, velocity) under a Gauss–Markov acceleration of 1 m/s² RMS and correlation time `tau_a`, s, held within a step; without noise."""
        memory = np.exp(-self.dt / tau_a)
        A = np.block([[self.loop, memory * self.kick[:, None]], [np.zeros((1, 2)), np.array([[memory]])]])
        drive = np.append(self.kick, 1.0)
        return np.sqrt(np.diag(linalg.solve_discrete_lyapunov(A, (1 - memory**2) * np.outer(drive, drive)))[:2])

    def worst(self, steps=400):
        """Largest mean position error that any acceleration within ±1 m/s², held within a step, can bring about, m: the sum of the |impulse response|."""
        errors = [self.kick]
        for _ in range(steps - 1):
            errors.append(self.loop @ errors[-1])
        return float(np.abs(errors)[:, 0].sum())


def integrated(a=2.0, path=0):
    """What the constant-velocity model misses of Table 1's target in each step, by quadrature: ∫(T − s) a ds and ∫ a ds, (4, 1300), beginning with k = 1."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    s = T * (1 + nodes) / 2
    held = np.repeat(accelerations(a, path)[..., None], len(s), axis=-1)
    w, t = 2 * np.pi / PERIOD, T * np.arange(STEPS - 1100)[:, None] + s
    held[1, 1100:] = SWING * w * np.cos(w * t)
    return np.stack([held @ (T / 2 * weights * (T - s)), held @ (T / 2 * weights)], axis=1).reshape(4, STEPS)


def change(series, steps):
    """RMS over time of the change of a series (…, N) within so many steps."""
    return np.sqrt(np.mean((series[..., steps:] - series[..., :-steps]) ** 2, axis=-1))


def autocorrelation(series, lag=1):
    """Autocorrelation (…) of a series (…, N) about zero."""
    return np.sum(series[..., lag:] * series[..., :-lag], axis=-1) / np.sum(series**2, axis=-1)


class Runs(NamedTuple):
    """The plain filter over M runs on a fixed track of N steps; step k is entry k − 1."""

    error: np.ndarray  # (4, N, M)
    innovation: np.ndarray  # (2, N, M)
    nis: np.ndarray  # (N, M)
    nees: np.ndarray  # (N, M)


def sampled(track, runs=1000, seed=2018):
    """The plain filter on `runs` independent runs over a track (4, N + 1), the same noise for every track of this length: `Runs`."""
    linear = plain()

    def task(rngs):
        x, z = simulate(rngs, track)
        rows = []
        for k, step in enumerate(linear.steps(x, z)):
            rows.append((step.x - track[:, k + 1, None], z[:, k] - H @ F @ x, step.nis, nees(track[:, k + 1], step.x, step.P)))
            x = step.x
        return {name: np.stack(part, axis=-2) for name, part in zip(Runs._fields, zip(*rows, strict=True), strict=True)}

    return Runs(**monte_carlo(task, runs, seed, reduce=dict.fromkeys(Runs._fields, "concat")))


def mean_innovation(track):
    """Mean innovations (2, N) of the plain filter on a track (4, N + 1), by the exact recursion."""
    bias, _, _ = exact_errors(plain(), track)
    return track[[0, 2], 1:] - H @ F @ (track + bias)[:, :-1]


def power(settled, means, probability=0.99):
    """Chance (…) that the NIS of a settled filter exceeds its chi-square quantile when the innovations have the means (axes, …), m: exact."""
    v, S, axes = settled.innovation_noise(), settled.sigma**2 / settled.root**2, len(means)
    limit = stats.chi2.ppf(probability, axes)
    return stats.ncx2.sf(limit * S / v, axes, np.sum(np.square(means), axis=0) / v)

"""When has a target begun to manoeuvre? The statistics on which switching filters decide, for one target or for runs on the last axis."""

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from trackhelpers.arrays import check_array, check_dt, check_scale, congruence, inverse, matmul, matvec


def check_probability(value, name):
    """`value` as a float; ValueError unless it lies between 0 and 1."""
    if not (np.isscalar(value) and np.isreal(value) and 0 < value < 1):
        raise ValueError(f"{name}: expected a probability between 0 and 1, got {value!r}")
    return float(value)


def check_window(value, name="window", least=1):
    """`value` as an int; ValueError unless it is a whole number ≥ `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ValueError(f"{name}: expected a whole number ≥ {least}, got {value!r}")
    return int(value)


def fading_limit(dim, window, probability):
    """What a fading sum of NIS stays below with the given probability while the model is right.

    The sum s ← α s + NIS, α = 1 − 1/window, remembers about `window` innovations. For white innovations it is Σ αʲ χ²ⱼ with independent chi-square variables of `dim`
    degrees of freedom. Its tail is computed by the saddlepoint approximation of Lugannani and Rice; the probability of a larger sum is right to 5 % of itself. (The usual
    fit of one scaled chi-square variable, Bar-Shalom, Li and Kirubarajan, 2001, section 11.2, has twice as many false alarms as it promises at 0.999.)

    Parameters
    ----------
    dim : int
        Number of measured components, ≥ 1.
    window : int
        Effective length of the memory, steps, ≥ 1.
    probability : float
        Of staying below the limit.
    """
    dim, window, tail = check_window(dim, "dim"), check_window(window), 1 - check_probability(probability, "probability")
    if window == 1:
        return float(stats.chi2.ppf(probability, dim))
    alpha = 1 - 1 / window
    weights = alpha ** np.arange(np.ceil(np.log(1e-12) / np.log(alpha)))

    def exceeded(limit):
        """Probability that the sum is larger than a limit above its mean."""

        def derivative(t):
            return dim * np.sum(weights / (1 - 2 * t * weights)) - limit

        t = brentq(derivative, 0.0, 0.5 * (1 - 1e-12), xtol=1e-15)
        log_moment = -0.5 * dim * np.sum(np.log1p(-2 * t * weights))
        curvature = 2 * dim * np.sum((weights / (1 - 2 * t * weights)) ** 2)
        w, u = np.sqrt(2 * (t * limit - log_moment)), t * np.sqrt(curvature)
        return stats.norm.sf(w) + stats.norm.pdf(w) * (1 / u - 1 / w)

    mean = dim * weights.sum()
    spread = np.sqrt(2 * dim * np.sum(weights**2))
    low, high = mean + 1e-3 * spread, mean + spread
    if exceeded(low) < tail:
        raise ValueError(f"probability: expected one above that of the sum's mean, {1 - exceeded(low):.2f}, got {probability}")
    while exceeded(high) > tail:
        high += spread
    return float(brentq(lambda limit: np.log(exceeded(limit) / tail), low, high, xtol=1e-10))


def fading_sum(total, nis, window):
    """The sum of `fading_limit` after another NIS, both of shape (...)."""
    return (1 - 1 / window) * total + nis


class OneAPrediction:
    """For filters whose memory counts steps, so that two measurements at one instant would be taken for two steps.

    `_steps` counts the predictions since the last measurement: an int, or (M,) for many runs. It is more than 1 after a missed scan.
    """

    _steps = 0

    def _one_a_prediction(self):
        """RuntimeError unless `predict` was called since the last measurement."""
        if not np.all(self._steps):
            raise RuntimeError("update: expected one measurement after each predict(); stack what is measured at one instant into one z")


def check_forgetting(value, name="rho"):
    """`value` as a float; ValueError unless 0 < value ≤ 1."""
    number = check_scale(value, name)
    if not 0 < number <= 1:
        raise ValueError(f"{name}: expected a forgetting factor in (0, 1], got {value!r}")
    return number


def check_inflation(value):
    """`value` as a float; ValueError unless it is a finite number ≥ 1."""
    number = check_scale(value, "inflation")
    if number < 1:
        raise ValueError(f"inflation: expected a factor ≥ 1, got {value!r}")
    return number


def check_step(dt):
    """`dt` as a float, s; ValueError unless it is a finite number > 0."""
    dt = check_dt(dt)
    if dt == 0:
        raise ValueError("dt: expected a step > 0 s, got 0")
    return dt


def check_pair(quiet, manoeuvring):
    """ValueError unless `quiet` is a Cartesian model such as CV and `manoeuvring` one with the same axes and accelerations, such as CA."""
    wanted = tuple(name for name in manoeuvring.state if not name.startswith("a"))
    if not (quiet.linear and manoeuvring.linear) or quiet.state != wanted or len(manoeuvring.state) * 2 != len(quiet.state) * 3:
        raise ValueError(
            f"quiet, manoeuvring: expected linear models with states such as (x, vx) and (x, vx, ax), got {quiet.state} and {manoeuvring.state}"
        )


def check_switching(stay, mu):
    """The transition matrix, [i, j] from model i to model j, and the first probabilities (2,); ValueError unless all lie strictly between 0 and 1."""
    stay, mu = check_array(stay, "stay", 2, ()), check_array(mu, "mu", 2, ())
    for name, value in (("stay", stay), ("mu", mu)):
        if np.any((value <= 0) | (value >= 1)):
            raise ValueError(f"{name}: expected two probabilities between 0 and 1, got {value}")
    if abs(mu.sum() - 1) > 1e-9:
        raise ValueError(f"mu: expected probabilities that sum to 1, got {mu}")
    return np.array([[stay[0], 1 - stay[0]], [1 - stay[1], stay[1]]]), mu


def check_input(F, G, H, window):
    """G (n, q) and `window`; ValueError unless the measurements of so many steps can tell every constant input from none."""
    n, m = len(F), len(H)
    G = np.asarray(G, dtype=float)
    if G.ndim != 2 or G.shape[0] != n or G.shape[1] == 0 or not np.all(np.isfinite(G)):
        raise ValueError(f"G: expected finite numbers of shape ({n}, q), one column an input, got shape {G.shape}")
    window, moved, seen = check_window(window), np.zeros_like(G), []
    for _ in range(window):
        moved = F @ moved + G
        seen.append(H @ moved)
    if np.linalg.matrix_rank(np.concatenate(seen)) < G.shape[1]:
        raise ValueError(f"window: expected enough steps to see {G.shape[1]} inputs in {m} measured components, got {window}")
    return G, window


def position_rows(model):
    """H (axes, n) that sees the positions of a Cartesian model, axis after axis."""
    return np.eye(model.n)[[i for i, name in enumerate(model.state) if name in ("x", "y", "z")]]


def with_runs(A, like):
    """A with an axis of length 1 for the runs where `like` has an axis more; A (p, q) beside P (n, n, M) becomes (p, q, 1)."""
    return A.reshape(*A.shape, *[1] * (np.ndim(like) - A.ndim))


def constant_input(y, S, K, steps, F, G, H):
    """Least squares estimate of an input that entered at every step of a window, from the innovations of a filter that did not know of it.

    An input u moves the filter's error by −b_j u, with b⁻ = F b + G and b = (I − KH) b⁻ from b = 0 at the window's beginning, and so each innovation by H b⁻ u
    (Chan, Hu and Plant, IEEE Transactions on Aerospace and Electronic Systems AES-15, 1979). A step without a measurement has K = 0.

    Parameters
    ----------
    y, S, K : sequences of arrays (m, ...), (m, m, ...) and (n, m, ...)
        Innovations, their covariances, and gains of the window's measurements, the oldest first.
    steps : sequence of int or of arrays (...)
        Steps that led to each measurement from the one before: 1, or more where scans were missed.
    F, G, H : numpy.ndarray, shapes (n, n), (n, q) and (m, n)

    Returns
    -------
    u : numpy.ndarray, shape (q, ...)
    covariance : numpy.ndarray, shape (q, q, ...)
    shift : numpy.ndarray, shape (n, q, ...)
        b at the window's end: what one unit of input has moved the state by, unseen by the filter.
    significance : numpy.ndarray, shape (...)
        uᵀ covariance⁻¹ u, chi-square with q degrees of freedom when there is no input.
    """
    b = np.zeros((*G.shape, *S[0].shape[2:]))
    ahead = with_runs(G, b)
    information, weighted = 0.0, 0.0
    for innovation, cov, gain, count in zip(y, S, K, steps, strict=True):
        for step in range(np.max(count)):
            moved = matmul(F, b) + ahead
            b = moved if step < np.min(count) else np.where(step < count, moved, b)
        seen = matmul(H, b)
        whitened = matmul(inverse(cov), seen)
        information = information + np.einsum("ki...,kj...->ij...", seen, whitened)
        weighted = weighted + np.einsum("ki...,k...->i...", whitened, innovation)
        b = b - matmul(gain, seen)
    covariance = inverse(information)
    u = matvec(covariance, weighted)
    return u, covariance, b, np.einsum("i...,i...->...", u, weighted)


def manoeuvre_start(x, P, z, R, dt):
    """A state with acceleration for a manoeuvre that began `dt` ago, from the estimate at its beginning and the first measurement in it.

    Bar-Shalom and Birmiwal, IEEE Transactions on Aerospace and Electronic Systems AES-18 (1982): an axis with position p, velocity v and a measured z gets the
    acceleration 2(z − p − vT)/T², the velocity v + T times that, and the position z. The covariance is that of these linear functions.

    Parameters
    ----------
    x : numpy.ndarray, shape (2k, ...)
        Position and velocity of k axes, axis after axis, before the manoeuvre.
    P : numpy.ndarray, shape (2k, 2k, ...)
    z : numpy.ndarray, shape (k, ...)
        Position measured `dt` later.
    R : numpy.ndarray, shape (k, k) or (k, k, ...)
        Covariance of its noise.
    dt : float or numpy.ndarray, shape (...)
        Time since the estimate, s, > 0: one step, or several where scans were missed.

    Returns
    -------
    x (3k, ...), P (3k, 3k, ...) : numpy.ndarray
        Position, velocity and acceleration, axis after axis.
    """
    dt = np.asarray(dt, dtype=float)
    if not np.all(dt > 0):
        raise ValueError(f"dt: expected times > 0 s, got {dt}")
    B, A = np.zeros((3 * len(z), 2 * len(z), *dt.shape)), np.zeros((3 * len(z), len(z), *dt.shape))
    for axis in range(len(z)):
        p, v, a = range(3 * axis, 3 * axis + 3)
        A[p, axis], A[v, axis], A[a, axis] = 1, 2 / dt, 2 / dt**2
        B[v, 2 * axis], B[v, 2 * axis + 1] = -2 / dt, -1
        B[a, 2 * axis], B[a, 2 * axis + 1] = -2 / dt**2, -2 / dt
    return matvec(A, z) + matvec(B, x), congruence(B, P) + with_runs(congruence(A, R), P)

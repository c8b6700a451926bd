"""When has a target begun to manoeuvre? The statistics on which switching filters decide, for one target or for runs on the last axis."""

from functools import lru_cache

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from trackhelpers.arrays import check_array, congruence, inverse, matvec
from trackhelpers.checks import check_numbers, check_together
from trackhelpers.checks import check_probability as check_probability
from trackhelpers.manoeuvre_checks import check_forgetting as check_forgetting
from trackhelpers.manoeuvre_checks import check_inflation as check_inflation
from trackhelpers.manoeuvre_checks import check_innovations, check_spread
from trackhelpers.manoeuvre_checks import check_input as check_input
from trackhelpers.manoeuvre_checks import check_pair as check_pair
from trackhelpers.manoeuvre_checks import check_step as check_step
from trackhelpers.manoeuvre_checks import check_switching as check_switching
from trackhelpers.manoeuvre_checks import check_window as check_window
from trackhelpers.model import check_model


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
    return _fading_limit(check_window(dim, "dim"), check_window(window), check_probability(probability, "probability"))


@lru_cache
def _fading_limit(dim, window, probability):
    tail = 1 - probability
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
    """The sum of `fading_limit` after another NIS, both of shape (...). ValueError for shapes that do not fit, a window < 1."""
    window, (total, nis) = check_window(window), check_together(total=total, nis=nis)
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


def position_rows(model):
    """H (axes, n) that sees the positions of a Cartesian model, axis after axis."""
    state = check_model(model).state
    return np.eye(model.n)[[i for i, name in enumerate(state) if name in ("x", "y", "z")]]


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

    Raises
    ------
    ValueError
        Sequences of different length, shapes that do not fit, what is no number.
    """
    y, S, K, steps, F, G, H = check_innovations(y, S, K, steps, F, G, H)
    sums = np.zeros((*G.shape, *S[0].shape[2:])), 0.0, 0.0
    for innovation, cov, gain, count in zip(y, S, K, steps, strict=True):
        for step in range(np.max(count)):
            moved = input_moves(sums[0], F, G)
            sums = (moved if step < np.min(count) else np.where(step < count, moved, sums[0]), *sums[1:])
        sums = input_seen(*sums, innovation, cov, gain, H)
    return input_found(*sums)


def input_moves(b, F, G):
    """b (n, q, ...) of `constant_input` after a step: F b + G."""
    return np.tensordot(F, b, 1) + with_runs(G, b)


def input_seen(b, information, weighted, y, S, K, H):
    """b (n, q, ...), the information (q, q, ...) on the input, and the innovations weighted by it (q, ...), after a measurement; as in `constant_input`."""
    seen = np.tensordot(H, b, 1)
    whitened = np.einsum("ij...,jq...->iq...", inverse(S), seen)
    information = information + np.einsum("iq...,ip...->qp...", seen, whitened)
    weighted = weighted + np.einsum("iq...,i...->q...", whitened, y)
    return b - np.einsum("ni...,iq...->nq...", K, seen), information, weighted


def input_found(b, information, weighted):
    """What `constant_input` returns, from the sums at the window's end."""
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

    Raises
    ------
    ValueError
        Shapes that do not fit, what is no number, for one target a P or an R that is no covariance, times that are not > 0.
    """
    dt = check_numbers(dt, "dt")
    if not np.all((dt > 0) & (dt < np.inf)):
        raise ValueError(f"dt: expected times > 0 s, got {dt}")
    z = check_array(z, "z", None)
    x, n = check_array(x, "x", 2 * len(z), z.shape[1:]), 2 * len(z)
    if dt.shape not in ((), z.shape[1:]):
        raise ValueError(f"dt: expected one time, or one a run, shape {z.shape[1:]}, got {dt.shape}")
    P, R = check_spread(P, "P", n), check_spread(R, "R", len(z))
    B, A = np.zeros((3 * len(z), 2 * len(z), *dt.shape)), np.zeros((3 * len(z), len(z), *dt.shape))
    for axis in range(len(z)):
        p, v, a = range(3 * axis, 3 * axis + 3)
        A[p, axis], A[v, axis], A[a, axis] = 1, 2 / dt, 2 / dt**2
        B[v, 2 * axis], B[v, 2 * axis + 1] = -2 / dt, -1
        B[a, 2 * axis], B[a, 2 * axis + 1] = -2 / dt**2, -2 / dt
    return matvec(A, z) + matvec(B, x), congruence(B, P) + with_runs(congruence(A, R), P)

"""What filters with known gains do on the average, without sampling; the lag of a constant-velocity filter in closed form."""

import numpy as np

from trackhelpers.scenarios.augmented_bias.target import R


def gains(linear, steps):
    """Gains (n, m, steps) and posterior covariances (n, n, steps + 1) of a `Linear` contender: they know no measurement."""
    F, H, Q, P = linear.F, linear.H, linear.Q, linear.P0
    K, Ps = [], [P]
    for _ in range(steps):
        P = F @ P @ F.T + Q
        gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        A = np.eye(len(F)) - gain @ H
        P = A @ P @ A.T + gain @ R @ gain.T
        P = (P + P.T) / 2
        K.append(gain)
        Ps.append(P)
    return np.stack(K, axis=-1), np.stack(Ps, axis=-1)


def exact_errors(linear, track):
    """Mean and covariance of a `Linear` contender's error on a fixed track, by recursion.

    Parameters
    ----------
    linear : trackhelpers.scenarios.augmented_bias.contenders.Linear
    track : array_like, shape (4, N + 1)
        True positions and velocities; measured from sample 1 on with the covariance R, the start drawn about sample 0.

    Returns
    -------
    bias : numpy.ndarray, shape (4, N + 1)
    covariance, believed : numpy.ndarray, shape (4, 4, N + 1)
        True covariance of the error, and the filter's own.
    """
    track = np.asarray(track, dtype=float)
    K, P = gains(linear, track.shape[1] - 1)
    F, H, L = linear.F, linear.H, linear.to_estimate
    C, mean = linear.P0, linear.from_start @ track[:, 0]
    means, covariances = [mean], [C]
    for k in range(1, track.shape[1]):
        gain = K[..., k - 1]
        A = np.eye(len(F)) - gain @ H
        mean = A @ F @ mean + gain @ track[[0, 2], k]
        C = A @ F @ C @ F.T @ A.T + gain @ R @ gain.T
        means.append(mean)
        covariances.append(C)
    bias = L @ np.stack(means, axis=-1) - track
    return bias, np.einsum("ij,jlk,ml->imk", L, np.stack(covariances, axis=-1), L), np.einsum("ij,jlk,ml->imk", L, P, L)


def alpha_beta(index):
    """Steady gains of a constant-velocity filter by its tracking index Γ = σ_a T²/σ: K = [α; β/T] (Kalata 1984).

    r = (4 + Γ − √(8Γ + Γ²))/4, α = 1 − r², β = 2(2 − α) − 4√(1 − α).
    """
    index = np.asarray(index, dtype=float)
    r = (4 + index - np.sqrt(8 * index + index**2)) / 4
    alpha = 1 - r**2
    return alpha, 2 * (2 - alpha) - 4 * np.sqrt(1 - alpha)


def steady_lag(index, a=1.0, dt=1.0):
    """Error (position, velocity) of a settled constant-velocity filter under a constant acceleration: −(1 − α)aT²/β and −(α/β − ½)aT."""
    alpha, beta = alpha_beta(index)
    return -(1 - alpha) * a * dt**2 / beta, -(alpha / beta - 0.5) * a * dt


def settling_time(bias, limit, change, end):
    """Samples after `change` until |bias| stays at or below `limit` up to `end`.

    Parameters
    ----------
    bias : array_like, shape (N,)
        Mean error of one component.
    limit : float
        Bound, in the unit of the error.
    change, end : int
        First sample of the segment, and last.

    Returns
    -------
    int
        0 if it never leaves the bound; end − change + 1 if it does not settle.
    """
    outside = np.flatnonzero(np.abs(np.asarray(bias)[change : end + 1]) > limit)
    return int(outside[-1]) + 1 if len(outside) else 0

"""The thesis's chapter 3 as printed, errors included: a function with an equation's number transcribes it, entry by entry, for states of shape (n, ...)."""

import numpy as np

from ..checks import check_array, check_dt, check_scale


def transition_36(x, dt):
    """(3.6): state (x, y, θ, v, a). Four increments are printed for five components; read row by row, the third one, aT, falls to θ."""
    (px, py, heading, v, a), dt = _given(x, dt)
    way = v * dt + a / 2 * dt**2
    return np.stack([px + way * np.cos(heading), py + way * np.sin(heading), heading + a * dt, v, a])


def transition_38(x, dt):
    """(3.8), the first branch of (3.9) too: state (x, y, v, θ, ω); 0/0 at ω = 0."""
    (px, py, v, heading, w), dt = _given(x, dt)
    east = px + v / w * np.sin(w * dt + heading) - v / w * np.sin(heading)
    north = py - v / w * np.cos(w * dt + heading) + v / w * np.cos(heading)
    return np.stack([east, north, v, w * dt + heading, w])


def transition_39_straight(x, dt):
    """(3.9), second branch. Four rows are printed for five components; read row by row, θ becomes the fourth one, ω, and ω itself has none and stays."""
    (px, py, v, heading, w), dt = _given(x, dt)
    return np.stack([px + v * np.cos(heading) * dt, py + v * np.sin(heading) * dt, v, w, w])


def jacobian_310(x, dt):
    """(3.10) as printed in our copy, (5, 5, ...), "Δn" read as Δt: row 2 has columns 3 and 4 exchanged, the 1/ω² terms a factor Δt too many."""
    (_, _, v, heading, w), dt = _given(x, dt)
    s, c = np.sin(heading), np.cos(heading)
    s1, c1 = np.sin(dt * w + heading), np.cos(dt * w + heading)
    J = _identity(w)
    J[0, 2] = (-s + s1) / w
    J[0, 3] = v / w * (-c + c1)
    J[0, 4] = dt * v / w * c1 - dt * v / w**2 * (-s + s1)
    J[1, 2] = v / w * (-s + s1)
    J[1, 3] = (c - c1) / w
    J[1, 4] = dt * v / w * s1 - dt * v / w**2 * (c - c1)
    J[3, 4] = dt
    return J


def jacobian_310_repaired(x, dt):
    """(3.10) with the columns of row 2 in order and no Δt before the 1/ω² terms, (5, 5, ...): the derivative of (3.8), written as the thesis writes it."""
    (_, _, v, heading, w), dt = _given(x, dt)
    J = jacobian_310(x, dt)
    J[1, 2], J[1, 3] = J[1, 3].copy(), J[1, 2].copy()
    J[0, 4] = dt * v / w * np.cos(dt * w + heading) - v / w**2 * (-np.sin(heading) + np.sin(dt * w + heading))
    J[1, 4] = dt * v / w * np.sin(dt * w + heading) - v / w**2 * (np.cos(heading) - np.cos(dt * w + heading))
    return J


def jacobian_311(x, dt):
    """(3.11), (5, 5, ...): by its column 5 the turn rate does not move the position."""
    (_, _, v, heading, w), dt = _given(x, dt)
    J = _identity(w)
    J[0, 2], J[0, 3] = dt * np.cos(heading), -dt * v * np.sin(heading)
    J[1, 2], J[1, 3] = dt * np.sin(heading), dt * v * np.cos(heading)
    J[3, 4] = dt
    return J


def noise_312(x, dt, mu):
    """(3.12), (5, ...): what an acceleration mu[0] and a yaw acceleration mu[1] are said to add to the state."""
    (_, _, _, heading, _), dt = _given(x, dt)
    a, w = check_array(mu, "mu", 2)
    rows = [dt**2 / 2 * a * np.cos(heading), dt**2 / 2 * a * np.sin(heading), dt * a, dt**2 / 2 * w, dt * w]
    return np.stack(np.broadcast_arrays(*rows))


def covariance_316(x, dt, sigma_a, sigma_w):
    """(3.16), (5, 5, ...): the elements (5,4) and (5,5) lack the square of σ, so it is not symmetric."""
    (_, _, _, heading, _), dt = _given(x, dt)
    sigma_a, sigma_w = check_scale(sigma_a, "sigma_a"), check_scale(sigma_w, "sigma_w")
    c, s = np.cos(heading), np.sin(heading)
    Q = np.zeros((5, 5, *heading.shape))
    Q[0, 0], Q[1, 1] = (dt**2 / 2 * sigma_a * c) ** 2, (dt**2 / 2 * sigma_a * s) ** 2
    Q[0, 1] = Q[1, 0] = dt**4 / 4 * sigma_a**2 * s * c
    Q[0, 2] = Q[2, 0] = dt**3 / 2 * sigma_a**2 * c
    Q[1, 2] = Q[2, 1] = dt**3 / 2 * sigma_a**2 * s
    Q[2, 2] = dt**2 * sigma_a**2
    Q[3, 3], Q[3, 4] = (dt**2 / 2 * sigma_w) ** 2, dt**3 / 2 * sigma_w**2
    Q[4, 3], Q[4, 4] = dt**3 / 2 * sigma_w, dt**2 * sigma_w
    return Q


def _given(x, dt):
    """The rows of a state (5, ...), and a time step; ValueError for what is neither."""
    return check_array(x, "x", 5), check_dt(dt)


def _identity(w):
    J = np.zeros((5, 5, *w.shape))
    J[range(5), range(5)] = 1
    return J

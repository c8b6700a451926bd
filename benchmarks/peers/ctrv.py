"""CTRV, lidar and radar written by hand for one state vector, with the math module and without checks, as the users of a library would."""

from math import atan2, cos, hypot, pi, sin

import numpy as np


def wrap(angle):
    return (angle + pi) % (2 * pi) - pi


def arc(w, T):
    """Half the angle h turned in a step, sin(h)/h and (sin h − h cos h)/h², both by the series that serve the small h of this problem."""
    h = 0.5 * w * T
    square = h * h
    j0 = 1 - square / 6 * (1 - square / 20 * (1 - square / 42))
    j1 = h / 3 * (1 - square / 10 * (1 - square / 28))
    return h, j0, j1


def transition(x, T):
    px, py, v, heading, w = x.tolist()  # plain numbers: NumPy's scalars are slower
    h, j0, _ = arc(w, T)
    return np.array([px + v * T * cos(heading + h) * j0, py + v * T * sin(heading + h) * j0, v, wrap(heading + w * T), w])


def jacobian(x, T):
    _, _, v, heading, w = x.tolist()
    h, j0, j1 = arc(w, T)
    along, across = cos(heading + h), sin(heading + h)
    dx, dy, half = T * along * j0, T * across * j0, 0.5 * v * T * T
    return np.array(
        [
            [1, 0, dx, -v * dy, -half * (across * j0 + along * j1)],
            [0, 1, dy, v * dx, half * (along * j0 - across * j1)],
            [0, 0, 1, 0, 0],
            [0, 0, 0, 1, T],
            [0, 0, 0, 0, 1],
        ]
    )


def noise(heading, T, sigmas):
    a, w = (T * sigmas[0]) ** 2, (T * sigmas[1]) ** 2
    c, s, half = T / 2 * cos(heading), T / 2 * sin(heading), T / 2
    return np.array(
        [
            [a * c * c, a * c * s, a * c, 0, 0],
            [a * c * s, a * s * s, a * s, 0, 0],
            [a * c, a * s, a, 0, 0],
            [0, 0, 0, w * half * half, w * half],
            [0, 0, 0, w * half, w],
        ]
    )


def radar(x):
    px, py, v, heading, _ = x.tolist()
    rho = hypot(px, py)
    return np.array([rho, atan2(py, px), v * (px * cos(heading) + py * sin(heading)) / rho])


def radar_jacobian(x):
    px, py, v, heading, _ = x.tolist()
    rho = hypot(px, py)
    c, s, cos_x, sin_x = px / rho, py / rho, cos(heading), sin(heading)
    turn = v * (c * sin_x - s * cos_x) / rho
    return np.array([[c, s, 0, 0, 0], [-s / rho, c / rho, 0, 0, 0], [-s * turn, c * turn, c * cos_x + s * sin_x, -rho * turn, 0]])


def radar_residual(a, b):
    y = a - b
    y[1] = wrap(y[1])
    return y


LIDAR = np.eye(2, 5)


def lidar(x):
    return x[:2]


def lidar_jacobian(x):
    return LIDAR

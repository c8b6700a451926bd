"""A linear model that is given by its matrices for one step, such as an augmented one."""

import numpy as np

from trackhelpers.arrays import check_angles, check_covariance, check_dt, check_matrix
from trackhelpers.checks import check_names
from trackhelpers.hooks import applied, entries_of
from trackhelpers.model import Model


class LinearModel(Model):
    """x(t + dt) = F x(t) + w with the covariance Q of w, for the one step dt for which F and Q are given.

    Parameters
    ----------
    F : array_like, shape (n, n)
    Q : array_like, shape (n, n)
    dt : float
        The step, s, > 0.
    state : sequence of str
        Names of the n components.
    angles : sequence of int
        Indices of those that are angles.

    Raises
    ------
    ValueError
        Shapes that do not fit the names, an F that is not finite, a Q that is no covariance; from `f`, `F` and `Q` another step than `dt`.
    """

    linear = True

    def __init__(self, F, Q, dt, state, angles=()):
        self.state = check_names(state, "state")
        self.angles = check_angles(angles, self.n)
        self._transition = entries_of(check_matrix(F, "F", (self.n, self.n)), np.eye(self.n))
        self.dt = check_dt(dt)
        if self.dt == 0:
            raise ValueError("dt: expected a step > 0 s, got 0")
        super().__init__(Q=check_covariance(Q, "Q", self.n))

    def _arguments(self, x, dt):
        x, dt = super()._arguments(x, dt)
        if abs(dt - self.dt) > 1e-12 * self.dt:
            raise ValueError(f"dt: expected {self.dt} s, for which the matrices were given, got {dt}")
        return x, dt

    def _f(self, x, dt, parts):
        return applied(self._transition, x)

    def _F(self, x, dt, parts):
        return self._transition

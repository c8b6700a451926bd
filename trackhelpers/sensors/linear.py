"""Linear sensors: the position, and anything that is given by its matrices."""

from math import cos, sin

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_covariance, check_matrix
from trackhelpers.checks import check_names, check_numbers
from trackhelpers.hooks import entries_of
from trackhelpers.sensors.base import CTRV_STATE, Sensor, check_mounting


class Position(Sensor):
    """Measures the position directly, one component for each of x, y, z that the state holds, as seen from where the sensor stands.

    Parameters
    ----------
    sigma, state, R, rows
        As for `Sensor`; sigma in m.
    position : sequence of float, optional
        Where the sensor stands, m, one number an axis; default the origin.
    heading : float
        Which way its first axis points, rad from +x; the others follow. For two axes or more.
    """

    linear = True

    def __init__(self, sigma=1.0, state=CTRV_STATE, R=None, rows=None, position=None, heading=0.0):
        self.names = tuple(name for name in "xyz" if name in check_names(state, "state"))
        if not self.names:
            raise ValueError(f"state: expected a component named x, y or z, which {type(self).__name__} needs, got {tuple(state)}")
        super().__init__(sigma, state, R, rows)
        self._columns = [self._column(name) for name in self.components]
        axes = len(self.components)
        self.position, self.heading = check_mounting(np.zeros(axes) if position is None else position, heading, axes)
        if self.heading and self.components[:2] != ("x", "y"):
            raise ValueError(f"heading: expected 0 without components named x and y, got {self.heading}")

    def _h(self, x, parts):
        seen = [x[i] - p if p else x[i] for i, p in zip(self._columns, self.position, strict=True)]
        if self.heading:
            c, s = cos(self.heading), sin(self.heading)
            seen[:2] = c * seen[0] + s * seen[1], c * seen[1] - s * seen[0]
        return seen

    def _H(self, x, parts):
        entries = {(row, column): 1.0 for row, column in enumerate(self._columns)}
        if self.heading:
            (i, j), c, s = self._columns[:2], cos(self.heading), sin(self.heading)
            entries |= {(0, i): c, (0, j): s, (1, i): -s, (1, j): c}
        return entries


class Lidar(Position):
    """The thesis's sensor 0 (section 4.2): position (x, y).

    Parameters
    ----------
    sigma, state, R, rows, position, heading
        As for `Position`; the state holds x and y, and no z, which a lidar in the plane would ignore.
    """

    def __init__(self, sigma=0.15, state=CTRV_STATE, R=None, rows=None, position=None, heading=0.0):
        super().__init__(sigma, state, R, rows, position, heading)
        if self.components != ("x", "y"):
            raise ValueError(f"state: expected components named x and y and no z, which Lidar needs, got {tuple(state)}")


class LinearSensor(Sensor):
    """A linear sensor that is given by its matrices.

    Parameters
    ----------
    H : array_like, shape (m, n)
    R : array_like, shape (m, m)
        Covariance of the noise; its components may be correlated.
    state : sequence of str
        Names of the n components of the state.
    names : sequence of str, optional
        Names of the m measured components; default z1, z2, …
    angles : sequence of int, optional
        Indices of the measured components that are angles, rad. Without it, those that the names θ, Φ and ψ tell: of a measured component, or of a state's component
        that a row of H picks.

    Raises
    ------
    ValueError
        An H that does not fit the state or is not finite, an R that is no covariance of its size, angles out of range.
    """

    linear = True

    def __init__(self, H, R, state, names=None, angles=None):
        H = np.atleast_2d(check_numbers(H, "H"))
        self.names = tuple(f"z{i + 1}" for i in range(len(H))) if names is None else check_names(names, "names")
        super().__init__(1.0, state, check_covariance(R, "R", len(self.names)), angles=angles)
        H = check_matrix(H, "H", (self.m, len(self.state)))
        self._matrix, self._sparse = H.copy(), entries_of(H)
        if angles is None:
            known = [j for j, name in enumerate(self.state) if name in _angles.NAMES]
            self.angles = tuple(i for i in range(self.m) if i in self.angles or self.picks(i, known))

    def picks(self, i, columns):
        """Whether row i of H is one of the state's components `columns`, or its negative."""
        nonzero = np.flatnonzero(self._matrix[i])
        return len(nonzero) == 1 and nonzero[0] in columns and abs(self._matrix[i, nonzero[0]]) == 1

    def _h(self, x, parts):
        rows = [0.0 * x[0]] * self.m
        for (i, j), value in self._sparse.items():
            rows[i] = rows[i] + value * x[j]
        return rows

    def _H(self, x, parts):
        return self._sparse

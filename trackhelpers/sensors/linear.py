"""Linear sensors: the position, and anything that is given by its matrices."""

import numpy as np

from trackhelpers.arrays import check_array, check_covariance
from trackhelpers.sensors.base import CTRV_STATE, Sensor


class Position(Sensor):
    """Measures the position directly, one component for each of x, y, z that the state holds.

    Parameters
    ----------
    sigma : float or sequence of float
        Standard deviation of the noise, m, one number or one an axis.
    state : sequence of str
        Names of the state's components.
    """

    linear = True

    def __init__(self, sigma, state=CTRV_STATE):
        self.names = tuple(name for name in "xyz" if name in state)
        if not self.names:
            raise ValueError(f"state: {type(self).__name__} needs a component named x, y or z, got {tuple(state)}")
        super().__init__(sigma, state)
        self._columns = [self._column(name) for name in self.names]

    def _h(self, x):
        return [x[i] for i in self._columns]

    def _entries(self, x):
        return {(row, column): 1.0 for row, column in enumerate(self._columns)}


class Lidar(Position):
    """The thesis's sensor 0 (section 4.2): position (x, y).

    Parameters
    ----------
    sigma : float or sequence of two floats
        Standard deviation of the noise, m.
    state : sequence of str
        Names of the state's components, x and y among them.
    """

    def __init__(self, sigma=0.15, state=CTRV_STATE):
        super().__init__(sigma, state)
        if self.names != ("x", "y"):
            raise ValueError(f"state: Lidar needs components named x and y and no z, got {tuple(state)}")


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

    Raises
    ------
    ValueError
        An H that does not fit the state or is not finite, an R that is no covariance of its size.
    """

    linear = True

    def __init__(self, H, R, state, names=None):
        H = np.atleast_2d(np.asarray(H, dtype=float))
        self.names = tuple(f"z{i + 1}" for i in range(len(H))) if names is None else tuple(names)
        R = check_covariance(R, "R", len(self.names))
        super().__init__(np.sqrt(np.diag(R)), state)
        self.R = R
        self.R.setflags(write=False)
        self._H = check_array(H, "H", self.m, (len(self.state),))
        if not np.all(np.isfinite(self._H)):
            raise ValueError("H: expected finite numbers")

    def _h(self, x):
        return list(np.einsum("ij,j...->i...", self._H, x))

    def _entries(self, x):
        return {(int(i), int(j)): float(self._H[i, j]) for i, j in zip(*np.nonzero(self._H), strict=True)}

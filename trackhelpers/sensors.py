"""Sensors: the measurement h, its Jacobian H, the noise covariance R, and the residual that knows which components are angles.

A sensor learns the layout of the state from the names of the model, ``Radar(sigma, state=model.state)``; without them it takes CTRV's.
"""

from functools import cached_property

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_array, check_covariance, check_scale

CTRV_STATE = ("x", "y", "v", "θ", "ω")


class Sensor:
    """What all sensors share.

    A subclass sets `names` (of the measured components) and writes `_h` and the entries of H that are not zero, `_entries`; what these two share it computes
    in `_share` and takes from `_shared`.

    Parameters
    ----------
    sigma : float or sequence of float
        Standard deviations of the noise, one number or one a measured component, SI units and rad.
    state : sequence of str
        Names of the state's components.
    """

    names: tuple[str, ...] = ()
    linear = False
    _angular = ("ψ",)
    _kept = None, None  # within `linearised`: x and what h and H share there

    def __init__(self, sigma, state):
        self.state = tuple(state)
        values = [sigma] * len(self.names) if np.ndim(sigma) == 0 else list(sigma)
        if len(values) != len(self.names):
            raise ValueError(f"sigma: expected one number or {len(self.names)}, for ({', '.join(self.names)}), got {len(values)}")
        self.sigma = tuple(check_scale(value, "sigma") for value in values)
        self.R = np.diag(np.square(self.sigma))
        self.R.setflags(write=False)

    def __repr__(self):
        return f"{type(self).__name__}(sigma={self.sigma}, state=({', '.join(self.state)}))"

    @property
    def m(self):
        """Number of measured components."""
        return len(self.names)

    @cached_property
    def angles(self):
        """Indices of the measured components that are angles."""
        return tuple(i for i, name in enumerate(self.names) if name in self._angular)

    def h(self, x):
        """Measurement of state x without noise: (n, ...) to (m, ...). ValueError for a first axis that is not n, or a state (n,) not finite."""
        return np.array(self._h(check_array(x, "x", len(self.state))), dtype=float)

    def H(self, x):
        """Jacobian ∂h/∂x at x: (n, ...) to (m, n, ...). Errors as for `h`."""
        x = check_array(x, "x", len(self.state))
        matrix = np.zeros((self.m, len(self.state), *x.shape[1:]))
        for index, value in self._entries(x).items():
            matrix[index] = value
        return matrix

    def entries(self, x):
        """The entries of H at x that are not zero, (row, column) -> number or array (...): what the ensemble filters multiply with."""
        return self._entries(check_array(x, "x", len(self.state)))

    def linearised(self, x):
        """`h` and `entries` at x in one go: what they share, such as the range, is computed once. Arguments and errors as for `h`.

        Returns
        -------
        h : numpy.ndarray, shape (m, ...)
        entries : dict (row, column) -> number or array (...)
        """
        x = check_array(x, "x", len(self.state))
        self._kept = x, self._share(x)
        try:
            return self.h(x), self.entries(x)
        finally:
            self._kept = None, None

    def residual(self, z, z_hat):
        """z − z_hat with the angles' difference taken the short way round; shapes (m, ...)."""
        return _angles.residual(z, z_hat, self.angles)

    def _column(self, name):
        if name not in self.state:
            raise ValueError(f"state: {type(self).__name__} needs a component named {name!r}, got {self.state}")
        return self.state.index(name)

    def _shared(self, x):
        known, parts = self._kept
        return parts if known is x else self._share(x)

    def _share(self, x):
        return None

    def _h(self, x):
        raise NotImplementedError

    def _entries(self, x):
        raise NotImplementedError


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


class RangeBearing(Sensor):
    """Range ρ and bearing ψ from the origin.

    Parameters
    ----------
    sigma : float or sequence of two floats
        Standard deviations of the noise, (m, rad).
    state : sequence of str
        Names of the state's components, x and y among them.

    Raises
    ------
    ValueError
        From `h` and `H` for one target at the origin, where the bearing does not exist; in an ensemble that run gets NaN.
    """

    names = ("ρ", "ψ")

    def __init__(self, sigma, state=CTRV_STATE):
        super().__init__(sigma, state)
        self._position = self._column("x"), self._column("y")

    def _share(self, x):
        px, py = (x[i] for i in self._position)
        rho = np.sqrt(px * px + py * py)  # np.hypot is slower by half
        if not np.all(rho):
            if x.ndim == 1:
                raise ValueError("x: the target stands at the sensor (range 0), where bearing and range rate do not exist")
            rho = np.where(rho == 0, np.nan, rho)
        return px, py, rho

    def _h(self, x):
        px, py, rho = self._shared(x)
        return [rho, np.arctan2(py, px)]

    def _entries(self, x):
        px, py, rho = self._shared(x)
        i, j = self._position
        return {(0, i): px / rho, (0, j): py / rho, (1, i): -py / rho**2, (1, j): px / rho**2}


class Radar(RangeBearing):
    """The thesis's sensor 1 (section 4.2): range ρ, bearing ψ and range rate ρ̇ = (x v_x + y v_y)/ρ, the printed (v_x + v_y)/ρ corrected.

    Parameters
    ----------
    sigma : float or sequence of three floats
        Standard deviations of the noise, (m, rad, m/s).
    state : sequence of str
        Names of the state's components: x, y and either v, θ or vx, vy.

    Raises
    ------
    ValueError
        As for `RangeBearing`.
    """

    names = ("ρ", "ψ", "ρ̇")

    def __init__(self, sigma=(0.3, 0.03, 0.3), state=CTRV_STATE):
        super().__init__(sigma, state)
        self._heading_form = "v" in self.state and "θ" in self.state
        self._velocity = tuple(self._column(name) for name in (("v", "θ") if self._heading_form else ("vx", "vy")))

    def _share(self, x):
        px, py, rho = super()._share(x)
        first, second = (x[i] for i in self._velocity)
        if not self._heading_form:
            return px, py, rho, first, second, None, None
        cos, sin = _angles.cos_sin(second)
        return px, py, rho, first * cos, first * sin, cos, sin

    def _parts(self, x):
        return self._shared(x)[:5]

    def _h(self, x):
        px, py, rho, vx, vy = self._parts(x)
        return [rho, np.arctan2(py, px), (px * vx + py * vy) / rho]

    def _entries(self, x):
        px, py, rho, vx, vy, cos, sin = self._shared(x)
        i, j = self._position
        k, l = self._velocity
        c, s = px / rho, py / rho
        across = vy * c - vx * s  # ∂ρ̇/∂θ is its negative; over ρ it is the turn rate of the line of sight
        turn = across / rho
        entries = {(0, i): c, (0, j): s, (1, i): -s / rho, (1, j): c / rho, (2, i): -s * turn, (2, j): c * turn}
        return entries | ({(2, k): c * cos + s * sin, (2, l): -across} if self._heading_form else {(2, k): c, (2, l): s})


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

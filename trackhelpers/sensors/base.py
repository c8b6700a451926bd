"""What all sensors share: argument checks, and dense matrices built from the entries a sensor writes down."""

from functools import cached_property

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_array, check_scale

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

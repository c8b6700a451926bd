"""What all sensors share: the noise, the mounting, the rows taken, and arrays out of the hooks that a sensor writes down."""

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_angles, check_array, check_covariance, check_scale
from trackhelpers.checks import check_names, check_number, check_numbers
from trackhelpers.hooks import central_differences, dense, evaluate, filled, refuse_overrides

CTRV_STATE = ("x", "y", "v", "θ", "ω")


class Sensor:
    """A sensor z = h(x) + v, v of the covariance R.

    A subclass sets `names`, those of all components that it can measure, and writes *hooks*, from which the filters of one target and the ensembles take them
    alike. For a state x, whose components x[i] are numbers or arrays (...):

    * ``_h(x, parts)``: a row for each component;
    * ``_H(x, parts)``: entries of ∂h/∂x that are not zero, (row, column) -> value; without it central differences serve;
    * ``_parts(x)``: what the two share, computed once a step.

    Parameters
    ----------
    sigma : float or sequence of float
        Standard deviations of the noise, one number or one a measured component, SI units and rad.
    state : sequence of str
        Names of the state's components.
    R : array_like, shape (m, m), optional
        Covariance of the noise in the place of `sigma`: symmetric positive semidefinite, correlated or not.
    rows : sequence of str, optional
        Names of the components that are measured, in this order; all by default. `sigma` and `R` are theirs, or of all components.
    angles : sequence of int, optional
        Indices of those among all components that are angles, rad; by default those with the names θ, Φ and ψ.

    Attributes
    ----------
    components : tuple of str
        All that it can measure.
    names : tuple of str
        The m components that it does measure.
    angles : tuple of int
        Indices of those that are angles, rad.
    linear : bool
        Whether h is H x plus a constant.

    Raises
    ------
    ValueError
        A sigma, an R, names or indices that do not fit.
    TypeError
        When a subclass defines h, H, step, or linearised anew: its hook is meant.
    """

    names: tuple[str, ...] = ()
    linear = False

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        refuse_overrides(cls, Sensor, h="_h", H="_H", step="_h or _H", linearised="_h or _H")

    def __init__(self, sigma, state, R=None, rows=None, angles=None):
        self.state, self.components = check_names(state, "state"), check_names(self.names, "names")
        every = len(self.components)
        known = [i for i, name in enumerate(self.components) if name in _angles.NAMES]
        self._wrapping = known if angles is None else list(check_angles(angles, every))
        self._taken = self._indices(rows)
        self._partly = self._taken != tuple(range(every))
        self.names = tuple(self.components[i] for i in self._taken)
        self.angles = tuple(k for k, i in enumerate(self._taken) if i in self._wrapping)
        self.R = self._covariance(sigma, R)
        self.R.setflags(write=False)
        self.sigma = tuple(np.sqrt(np.diag(self.R)).tolist())
        self._nought = np.zeros((self.m, len(self.state)))
        self._affine = None  # of a linear sensor H and h(0), made once

    def __repr__(self):
        return f"{type(self).__name__}(sigma={self.sigma}, state=({', '.join(self.state)}), names=({', '.join(self.names)}))"

    @property
    def m(self):
        """Number of measured components."""
        return len(self.names)

    def at(self, t):
        """The sensor at the time `t`, s: itself, unless a subclass moves or changes with time. ValueError for what is no time."""
        check_time(t)
        return self

    def of_runs(self, mask):
        """The sensor for some runs of an ensemble, mask (M,) bool: itself, unless a subclass differs from run to run."""
        return self

    def h(self, x):
        """Measurement of state x without noise: (n, ...) to (m, ...). ValueError for a first axis that is not n, or a state (n,) not finite."""
        x = check_array(x, "x", len(self.state))
        return filled(evaluate(lambda x: self._rows(x, self._parts(x)), x), self.m, x, "_h")

    def H(self, x):
        """Jacobian ∂h/∂x at x: (n, ...) to (m, n, ...), read-only where it is the same for all runs. Errors as for `h`."""
        x = check_array(x, "x", len(self.state))
        return dense(evaluate(lambda x: self._entries(x, self._parts(x)), x), self._nought, x)

    def step(self, x):
        """h and H in one go: what a filter of one target corrects with. Arguments and errors as for `h`."""
        x = check_array(x, "x", len(self.state))
        if self.linear and x.ndim == 1:
            if self._affine is None:
                origin = np.zeros(len(self.state))
                self._affine = self.H(origin), self.h(origin)
                self._affine[0].setflags(write=False)
            H, constant = self._affine
            return H.dot(x) + constant, H
        rows, entries = evaluate(self._hooks, x)
        return filled(rows, len(self.names), x, "_h"), dense(entries, self._nought, x)

    def linearised(self, x):
        """h and the entries of H in one go: what the ensemble filters multiply with. Arguments and errors as for `h`.

        Returns
        -------
        h : numpy.ndarray, shape (m, ...)
        entries : dict (row, column) -> number or array (...)
        """
        x = check_array(x, "x", len(self.state))
        rows, entries = self._hooks(x)
        return filled(rows, self.m, x, "_h"), entries

    def residual(self, z, z_hat):
        """z − z_hat with the angles' difference taken the short way round; shapes (m, ...). ValueError for shapes that do not fit."""
        z, z_hat = check_numbers(z, "z"), check_numbers(z_hat, "z_hat")
        try:
            difference = z - z_hat
        except ValueError:
            difference = None
        if difference is None or z.shape[:1] != (self.m,) or z_hat.shape[:1] != (self.m,):
            raise ValueError(
                f"z, z_hat: expected shapes ({self.m}, ...) that broadcast against each other, got {z.shape} and {z_hat.shape}"
            )
        return _angles.wrap_rows(difference, self.angles)

    def _indices(self, rows):
        if rows is None:
            return tuple(range(len(self.components)))
        rows = (rows,) if isinstance(rows, str) else check_names(rows, "rows")
        if not set(rows) <= set(self.components):
            raise ValueError(f"rows: expected some of {self.components}, each once, got {rows}")
        return tuple(self.components.index(name) for name in rows)

    def _covariance(self, sigma, R):
        """R of the rows taken."""
        every, taken = len(self.components), list(self._taken)
        if R is not None:
            size = len(np.atleast_2d(check_numbers(R, "R")))
            if size == every:
                return check_covariance(R, "R", every)[np.ix_(taken, taken)]
            return check_covariance(R, "R", len(taken))
        values = list(sigma) if isinstance(sigma, (list, tuple)) or getattr(sigma, "ndim", 0) else [sigma] * every
        if len(values) == every:
            values = [values[i] for i in taken]
        if len(values) != len(taken):
            raise ValueError(f"sigma: expected one number or {len(taken)}, for ({', '.join(self.names)}), got {len(values)}")
        return np.diag(np.square([check_scale(value, "sigma") for value in values]))

    def _column(self, name):
        if name not in self.state:
            raise ValueError(f"state: expected a component named {name!r}, which {type(self).__name__} needs, got {self.state}")
        return self.state.index(name)

    def _hooks(self, x):
        parts = self._parts(x)
        return self._rows(x, parts), self._entries(x, parts)

    def _rows(self, x, parts):
        """The rows of `_h` that are taken."""
        rows = self._h(x, parts)
        return [rows[i] for i in self._taken] if self._partly else rows

    def _entries(self, x, parts):
        """The entries of `_H` in the rows that are taken."""
        entries = self._H(x, parts)
        if not self._partly:
            return entries
        place = {i: k for k, i in enumerate(self._taken)}
        return {(place[i], j): value for (i, j), value in entries.items() if i in place}

    def _parts(self, x):
        return None

    def _h(self, x, parts):
        raise NotImplementedError(f"{type(self).__name__} lacks the hook _h: the rows of h")

    def _H(self, x, parts):
        return central_differences(lambda x: self._h(x, self._parts(x)), x, self._wrapping)


def check_mounting(position, heading, axes):
    """The mounting as a tuple of numbers and a number: where a sensor stands, m, `axes` of them, and which way it looks, rad."""
    place = check_array(position, "position", axes, ())
    return tuple(place.tolist()), check_number(heading, "heading", "an angle in rad")


def check_time(t):
    """ValueError unless `t` is a finite time in seconds."""
    if not (isinstance(t, float) and t - t == 0):
        check_number(t, "t", "a finite time, seconds as a number")

"""A model of how a state changes: written once, by hooks, for filters of one target and for ensembles."""

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_array, check_covariance, check_dt, check_scale
from trackhelpers.hooks import central_differences, dense, entries_of, evaluate, filled, refuse_overrides


def check_model(model, name="model"):
    """`model`; ValueError unless it is a `Model`."""
    if not isinstance(model, Model):
        raise ValueError(f"{name}: expected a model of trackhelpers, got {model!r}")
    return model


class Model:
    """A model x(t + dt) = f(x, dt) + w, w of the covariance Q.

    A subclass names its state and writes *hooks*, each one quantity, from which the filters of one target and the ensembles take it alike. For a state x, whose
    components x[i] are numbers or arrays (...), and a step dt:

    * ``_f(x, dt, parts)``: the n rows of f;
    * ``_F(x, dt, parts)``: entries of ∂f/∂x that differ from the identity, (row, column) -> value; without it central differences serve;
    * ``_G(x, dt, parts)``: entries of G (n, q), one column an input; then Q = G diag(σ²) Gᵀ;
    * ``_Q(x, dt, parts)``: where Q is something else, its entries on and below the diagonal that are not zero;
    * ``_parts(x, dt, order)``: what these share, computed once a step; `order` is 0 where f alone is wanted, 1 where F or Q is (`_order` of the class).

    Parameters
    ----------
    sigmas : sequence of (str, float)
        Names and standard deviations of the inputs, SI units.
    Q : array_like, shape (n, n), optional
        A constant process noise covariance in the place of the hooks' one.

    Attributes
    ----------
    state : tuple of str
        Names of the n components.
    angles : tuple of int
        Indices of the components that are angles, rad.
    bounds : dict of str -> (float, float)
        Least and largest value of the components that have one (a number of people, say); filters bring their estimate back to it.
    linear : bool
        Whether f is F x with F and Q that depend on dt alone.

    Raises
    ------
    TypeError
        When a subclass defines f, F, G, Q, step, or linearised anew: its hook is meant.
    """

    state: tuple[str, ...] = ()
    angles: tuple[int, ...] = ()
    bounds: dict = {}  # noqa: RUF012  a declaration, read only
    linear = False
    _order = 1  # of the parts that F and Q need

    def __init_subclass__(cls, **kwargs):
        super().__init_subclass__(**kwargs)
        refuse_overrides(cls, Model, f="_f", F="_F", G="_G", Q="_Q", step="_f, _F or _Q", linearised="_f, _F or _Q")

    def __init__(self, sigmas=(), Q=None):
        self.sigmas = tuple(check_scale(value, name) for name, value in sigmas)
        self._constant = None if Q is None else check_covariance(Q, "Q", self.n)
        self._by_gain = self._constant is None and type(self)._Q is Model._Q
        self._scales = np.array(self.sigmas)
        self._no_input = np.zeros((self.n, len(self.sigmas)))
        self._eye, self._nought = np.eye(self.n), np.zeros((self.n, self.n))
        self._limits = {self.state.index(name): limits for name, limits in self.bounds.items()}

    def __repr__(self):
        noise = f"sigmas={self.sigmas}" if self._constant is None else "Q=constant"
        return f"{type(self).__name__}(state=({', '.join(self.state)}), {noise})"

    @property
    def n(self):
        """Number of state components."""
        return len(self.state)

    def f(self, x, dt):
        """State after `dt` seconds without noise.

        Parameters
        ----------
        x : array_like, shape (n, ...)
            State, with any trailing axes (runs, sigma points).
        dt : float
            Time step ≥ 0, s.

        Returns
        -------
        numpy.ndarray, shape (n, ...)
            Neither wrapped nor bounded, so that f is smooth; `normalise` does that.

        Raises
        ------
        ValueError
            A first axis that is not n, a state (n,) that is not finite, a negative dt.
        """
        x, dt = self._arguments(x, dt)
        return filled(evaluate(lambda x: self._f(x, dt, self._parts(x, dt, 0)), x), self.n, x, "_f")

    def F(self, x, dt):
        """Jacobian ∂f/∂x at `x`, shape (n, n, ...), read-only where it is the same for all runs; arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        return dense(evaluate(lambda x: self._F(x, dt, self._parts(x, dt, 1)), x), self._eye, x)

    def G(self, x, dt):
        """How inputs that are constant within the step reach the state: shape (n, q, ...), one column an input; arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        return dense(evaluate(lambda x: self._gain(x, dt, self._parts(x, dt, self._order)), x), self._no_input, x)

    def Q(self, x, dt):
        """Process noise covariance at the state before the step, shape (n, n, ...), read-only where it is the same for all runs; arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        return dense(evaluate(lambda x: self._noise(x, dt, self._parts(x, dt, self._order)), x), self._nought, x, mirrored=True)

    def step(self, x, dt):
        """f, F and Q in one go: what a filter of one target predicts with. Arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        if self._by_gain and x.ndim == 1:  # on dense matrices of one target the product with G is sooner made than its entries
            f, transition, gain = evaluate(self._moves, x, dt)
            scaled = dense(gain, self._no_input, x) * self._scales
            Q = scaled @ scaled.T
        else:
            f, transition, noise = evaluate(self._hooks, x, dt)
            Q = dense(noise, self._nought, x, mirrored=True)
        return filled(f, len(self.state), x, "_f"), dense(transition, self._eye, x), Q

    def linearised(self, x, dt):
        """f, F and Q in one go, the matrices by their entries: what the ensemble filters multiply with. Arguments as for `f`.

        Returns
        -------
        f : numpy.ndarray, shape (n, ...)
        transition : dict (i, j) -> number or array (...)
            Entries by which F differs from the identity.
        noise : dict (i, j) -> number or array (...)
            Entries of Q on and below the diagonal that are not zero.
        """
        x, dt = self._arguments(x, dt)
        f, transition, noise = self._hooks(x, dt)
        return filled(f, self.n, x, "_f"), transition, noise

    def normalise(self, x):
        """A copy of the state x (n, ...) with its angles in [−π, π) and its components within their bounds. Errors as for `f`."""
        return self._normalise(np.array(check_array(x, "x", self.n)))

    def _normalise(self, x):
        """`normalise` in place."""
        _angles.wrap_rows(x, self.angles)
        for i, limits in self._limits.items():
            np.clip(x[i : i + 1], *limits, out=x[i : i + 1])
        return x

    def _arguments(self, x, dt):
        return check_array(x, "x", len(self.state)), check_dt(dt)

    def _hooks(self, x, dt):
        parts = self._parts(x, dt, self._order)
        return self._f(x, dt, parts), self._F(x, dt, parts), self._noise(x, dt, parts)

    def _moves(self, x, dt):
        parts = self._parts(x, dt, self._order)
        return self._f(x, dt, parts), self._F(x, dt, parts), self._gain(x, dt, parts)

    def _noise(self, x, dt, parts):
        """Entries of Q on and below the diagonal: of the constant one, where there is one."""
        return self._Q(x, dt, parts) if self._constant is None else entries_of(np.tril(self._constant))

    def _parts(self, x, dt, order):
        return None

    def _f(self, x, dt, parts):
        raise NotImplementedError(f"{type(self).__name__} lacks the hook _f: the rows of f")

    def _F(self, x, dt, parts):
        return central_differences(lambda x: self._f(x, dt, self._parts(x, dt, 0)), x)

    def _G(self, x, dt, parts):
        raise NotImplementedError(
            f"{type(self).__name__} has no G: no input that is constant within a step; give it the hook _G or _Q, or a constant Q"
        )

    def _gain(self, x, dt, parts):
        """The G in use, where a class has several."""
        return self._G(x, dt, parts)

    def _Q(self, x, dt, parts):
        inputs = [[] for _ in self.sigmas]
        for (i, q), value in self._gain(x, dt, parts).items():
            inputs[q].append((i, self.sigmas[q] * value))
        noise = {}
        for column in inputs:
            for k, (i, a) in enumerate(column):
                for j, b in column[: k + 1]:
                    place = (i, j) if i >= j else (j, i)
                    noise[place] = noise[place] + a * b if place in noise else a * b
        return noise

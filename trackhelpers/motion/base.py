"""What all motion models share: argument checks, and dense matrices built from the entries a model writes down."""

from functools import cached_property

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, check_dt, check_scale


class Model:
    """A motion model x(t+dt) = f(x, dt) + G(x, dt) u, with white inputs u of standard deviations σ that are constant within a step.

    A subclass names its state and writes down, for a state x (n, ...) and a step dt, the rows of f (`_rows`), the entries of F that differ from the
    identity (`_jacobian`) and the entries of G (`_gain`, straight line; `_arc_gain`, along the arc); what these share, sines and cosines above all, it
    computes in `_arc`. The dense arrays are made here, once for all.

    Parameters
    ----------
    sigmas : sequence of (str, float)
        Names and standard deviations of the inputs, SI units.
    noise : {"straight", "exact"}
        Whether G is that of a straight line through the current heading (the thesis's (3.13)) or is integrated along the arc.
    Q : array_like, shape (n, n), optional
        A constant process noise covariance that replaces G diag(σ²) Gᵀ.
    checked : bool
        False admits a `Q` that is no covariance, for showing what it does.
    """

    state: tuple[str, ...] = ()
    linear = False
    _angular = ("θ", "Φ")

    def __init__(self, sigmas, noise="straight", Q=None, checked=True):
        if noise not in ("straight", "exact"):
            raise ValueError(f"noise: expected 'straight' or 'exact', got {noise!r}")
        self.noise = noise
        self.sigmas = tuple(check_scale(value, name) for name, value in sigmas)
        self.checked = checked
        self._Q = None if Q is None else check_covariance(Q, "Q", self.n, checked=checked)

    def __repr__(self):
        noise = f"sigmas={self.sigmas}, noise={self.noise!r}" if self._Q is None else "Q=constant"
        return f"{type(self).__name__}(state=({', '.join(self.state)}), {noise})"

    @property
    def n(self):
        """Number of state components."""
        return len(self.state)

    @cached_property
    def angles(self):
        """Indices of the state components that are angles."""
        return tuple(i for i, name in enumerate(self.state) if name in self._angular)

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
            Angles are not wrapped, so that f is smooth; filters wrap.

        Raises
        ------
        ValueError
            A first axis that is not n, a state (n,) that is not finite, a negative dt.
        """
        x, dt = self._arguments(x, dt)
        return self._filled(self._rows(x, dt, self._arc(x, dt, 0)), x)

    def F(self, x, dt):
        """Jacobian ∂f/∂x at `x`, shape (n, n, ...); arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        return self._dense(self._jacobian(x, dt, self._arc(x, dt, 1)), x, np.eye(self.n))

    def G(self, x, dt):
        """How inputs that are constant within the step reach the state: shape (n, q, ...), one column an input; arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        return self._dense(self._chosen_gain(x, dt, self._arc(x, dt, 2)), x, np.zeros((self.n, len(self.sigmas))))

    def Q(self, x, dt):
        """Process noise covariance G diag(σ²) Gᵀ at the state before the step, shape (n, n, ...); arguments as for `f`."""
        x, dt = self._arguments(x, dt)
        if self._Q is not None:
            return np.broadcast_to(self._Q.reshape(self.n, self.n, *[1] * (x.ndim - 1)), (self.n, self.n, *x.shape[1:]))
        G = self.G(x, dt)
        return np.einsum("ij...,j,kj...->ik...", G, np.square(self.sigmas), G)

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
        arc = self._arc(x, dt, 2 if self.noise == "exact" else 1)
        f = self._filled(self._rows(x, dt, arc), x)
        transition = self._jacobian(x, dt, arc)
        if self._Q is not None:
            return f, transition, {(i, j): self._Q[i, j] for i, j in zip(*np.nonzero(np.tril(self._Q)), strict=True)}
        scaled = {(i, q): self.sigmas[q] * value for (i, q), value in self._chosen_gain(x, dt, arc).items()}
        noise = {}
        for (i, q), a in scaled.items():
            for (j, r), b in scaled.items():
                if q == r and j <= i:
                    noise[i, j] = noise[i, j] + a * b if (i, j) in noise else a * b
        return f, transition, noise

    def _arguments(self, x, dt):
        return check_array(x, "x", self.n), check_dt(dt)

    @staticmethod
    def _filled(rows, x):
        f = np.empty(x.shape)
        for i, row in enumerate(rows):
            f[i] = row
        return f

    @staticmethod
    def _dense(entries, x, constant):
        matrix = np.empty((*constant.shape, *x.shape[1:]))
        matrix[:] = constant.reshape(*constant.shape, *[1] * (x.ndim - 1))
        for index, value in entries.items():
            matrix[index] = value
        return matrix

    def _chosen_gain(self, x, dt, arc):
        return (self._arc_gain if self.noise == "exact" else self._gain)(x, dt, arc)

    def _arc(self, x, dt, order):
        """What the hooks below share, computed once a step: `order` 0 serves `_rows`, 1 `_jacobian` too, 2 also `_arc_gain`."""
        return None

    def _rows(self, x, dt, arc):
        raise NotImplementedError

    def _jacobian(self, x, dt, arc):
        raise NotImplementedError

    def _gain(self, x, dt, arc):
        raise NotImplementedError

    def _arc_gain(self, x, dt, arc):
        raise NotImplementedError


def pair(column, value):
    """Entries of the x and y rows (0 and 1) in one column, from a complex number p = x + iy."""
    return {(0, column): value.real, (1, column): value.imag}

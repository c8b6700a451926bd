"""What all models of a moving target share: three ways in which white inputs reach the state."""

import numpy as np

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_array
from trackhelpers.checks import check_choice, check_together
from trackhelpers.hooks import applied
from trackhelpers.model import Model
from trackhelpers.symbols import Symbol

NOISES = ("straight", "exact", "continuous")
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class MotionModel(Model):
    """A model of a moving target with white inputs.

    Hooks as for `Model`, and ``_G_exact(x, dt, parts)``, which is G integrated along the arc.

    Parameters
    ----------
    sigmas : sequence of (str, float)
        As for `Model`.
    noise : {"straight", "exact", "continuous"}
        "straight": inputs that are constant within a step and move the target along its heading (the thesis's (3.13)). "exact": the same inputs, integrated along
        the arc. "continuous": white noise in continuous time of the spectral density σ², integrated over the step about the predicted path, so that two steps give
        the covariance of one of their sum; the σ then have the unit of the input times √s.
    Q : array_like, shape (n, n), optional
        As for `Model`.
    """

    white: tuple[int, ...] = ()  # the component whose derivative is the input, one an input
    backwards: tuple[
        int, ...
    ] = ()  # components that change their sign when the same motion is called one backwards: speed, acceleration, curvature

    def __init__(self, sigmas, noise="straight", Q=None):
        self.noise = check_choice(noise, "noise", NOISES)
        if noise == "exact":
            self._order = 2
        super().__init__(sigmas, Q)
        self._integrated = noise == "continuous" and self._by_gain  # a hook _Q of a subclass goes before
        self._by_gain = self._by_gain and noise != "continuous"

    def __repr__(self):
        return super().__repr__()[:-1] + f", noise={self.noise!r})"

    def fold(self, x, near=None):
        """One of the two names of a motion: with (v, θ), a model with speed and heading also knows it as (−v, θ + π), driven backwards.

        A filter that has settled on the other name is right about everything that moves, and NEES against a truth in the first name calls it thousands of
        standard deviations off: compare with ``model.fold(truth, near=kf.x)``, or ask ``kf.nees(truth, fold=True)``.

        Parameters
        ----------
        x : array_like, shape (n, ...)
        near : array_like, shape (n, ...), optional
            The name is chosen whose heading is nearer to that of `near`; without it, the one with v ≥ 0.

        Returns
        -------
        numpy.ndarray, shape (n, ...)
            Its heading in [−π, π); a model without a heading gives x back.

        Raises
        ------
        ValueError
            Shapes that do not fit, a state (n,) that is not finite.
        """
        x = check_array(x, "x", self.n)
        if not self.backwards:
            return x.copy()
        heading, speed = self.angles[0], self.backwards[0]
        if near is None:
            other = x[speed] < 0
        else:
            near = check_array(near, "near", self.n)
            check_together("shapes (n, ...) that broadcast", x=x[0], near=near[0])
            away = _angles.residual(x[[heading]], near[[heading]], (0,))[0]
            other = np.abs(away) > np.pi / 2
        folded = np.array(np.broadcast_to(x, np.broadcast_shapes(x.shape, (self.n, *np.shape(other)))))
        folded[list(self.backwards)] *= np.where(other, -1.0, 1.0)
        folded[heading] += np.where(other, np.pi, 0.0)
        return _angles.wrap_rows(folded, (heading,))

    def _gain(self, x, dt, parts):
        if self.noise == "continuous":
            raise NotImplementedError(
                f"noise='continuous': the input of {type(self).__name__} is white in time, so that no G multiplies it; use Q"
            )
        return (self._G_exact if self.noise == "exact" else self._G)(x, dt, parts)

    def _noise(self, x, dt, parts):
        return self._continuous(x, dt) if self._integrated else super()._noise(x, dt, parts)

    def _continuous(self, x, dt):
        """Entries of ∫₀^dt Φ(t) diag(σ²) Φ(t)ᵀ dt, Φ(t) the columns of the transition from time t to the end that belong to the driven components."""
        if isinstance(x[0], Symbol):
            return self._continuous_of_symbols(x, dt)
        x = np.asarray(x, dtype=float)[:, None]
        column = (-1, *[1] * (x.ndim - 2))
        t, weights = (0.5 * dt * (1 + _NODES)).reshape(column), (0.5 * dt * _WEIGHTS).reshape(column)
        shape = (len(_NODES), *x.shape[2:])
        path = np.stack([np.broadcast_to(row, shape) for row in self._f(x, t, self._parts(x, t, 0))])
        transition = self._F(path, dt - t, self._parts(path, dt - t, 1))
        noise = {}
        for sigma, driven in zip(self.sigmas, self.white, strict=True):
            response = {driven: 1.0} | {i: value for (i, j), value in transition.items() if j == driven}
            for i, a in response.items():
                weighted = weights * a
                for j, b in response.items():
                    if j <= i:
                        total = sigma**2 * np.add.reduce(weighted * b)
                        noise[i, j] = noise.get((i, j), 0.0) + (total.item() if total.size == 1 else total)
        return noise

    def _continuous_of_symbols(self, x, dt):
        """`_continuous` written out, node after node."""
        noise = {}
        for node, weight in zip(_NODES.tolist(), _WEIGHTS.tolist(), strict=True):
            t, rest = (0.5 * (1 + node)) * dt, (0.5 * (1 - node)) * dt
            path = list(self._f(x, t, self._parts(x, t, 0)))
            transition = self._F(path, rest, self._parts(path, rest, 1))
            for sigma, driven in zip(self.sigmas, self.white, strict=True):
                response = {driven: 1.0} | {i: value for (i, j), value in transition.items() if j == driven}
                for i, a in response.items():
                    for j, b in response.items():
                        if j <= i:
                            noise[i, j] = noise.get((i, j), 0.0) + (0.5 * weight * sigma**2) * dt * (a * b)
        return noise

    def _G_exact(self, x, dt, parts):
        raise NotImplementedError(f"{type(self).__name__} lacks the hook _G_exact: the gain of its inputs along the arc")


class LinearMotion(MotionModel):
    """A model whose F and Q depend on dt alone."""

    linear = True

    _latest = None, None  # the last step and the noise integrated over it

    def _f(self, x, dt, parts):
        return applied(self._F(x, dt, parts), x)

    def _continuous(self, x, dt):
        if self._latest[0] != dt:
            self._latest = dt, super()._continuous(np.zeros(self.n), dt)
        return self._latest[1]

    def _G_exact(self, x, dt, parts):
        return self._G(x, dt, parts)


def pair(column, value):
    """Entries of the x and y rows (0 and 1) in one column, from a complex number p = x + iy."""
    return {(0, column): value.real, (1, column): value.imag}

"""Interacting multiple models of any kind: with headings, and with states of different layouts."""

import numpy as np
from filterpy.kalman import IMMEstimator

from trackhelpers import angles as _angles
from trackhelpers.arrays import check_array, divide
from trackhelpers.checks import check_names
from trackhelpers.filters.base import OneTarget, atomic, refused
from trackhelpers.filters.imm import weighed
from trackhelpers.hooks import central_differences
from trackhelpers.manoeuvre_checks import check_probabilities


@refused(batch_filter="trackhelpers.follow.follow")
class MotionIMM(OneTarget, IMMEstimator):
    """filterpy's IMMEstimator on filters that are driven by models and sensors.

    The models meet in *common* components. Mixing gives each filter new moments of these; what else it holds (a turn rate, an acceleration) keeps its regression on
    them: with J the Jacobian of the common components by the filter's state and A = P Jᵀ(J P Jᵀ)⁻¹, x moves by A (c* − c) and P by A (C* − C) Aᵀ. Of models of one
    layout everything is common, and this is the ordinary IMM. Angles are averaged about the likeliest model's. The Markov step belongs to `predict`: a missed scan
    is no evidence for a model.

    Parameters
    ----------
    filters : sequence of MotionKF, MotionEKF or MotionUKF
    mu0 : array_like, shape (N,)
        Probability of each model at the start.
    transition : array_like, shape (N, N)
        [i, j] is the probability of changing from model i to model j in a step of `predict`.
    common : sequence of str, optional
        Names of the common components; by default those that all states have.
    maps : sequence of N, optional
        For each filter None, where the common components are some of its own, or a pair of functions: ``to(x)`` gives the common components (c, ...) of a state
        (n, ...), and ``back(c, x)`` the state whose common components are c (c,), which takes from x (n,) what they do not tell.

    Attributes
    ----------
    x : numpy.ndarray, shape (c,)
        Of the mixture, in the common components, with its covariance P, shape (c, c).
    mu : numpy.ndarray, shape (N,)
        Probability of each model, after `predict` too.

    Raises
    ------
    ValueError
        Fewer than two filters, probabilities that do not sum to one, common components that a filter without a map lacks, a common component that is an angle of one model and no
        angle of another.

    References
    ----------
    H. A. P. Blom, Y. Bar-Shalom, IEEE Transactions on Automatic Control AC-33 (1988) 780–783.
    """

    def __init__(self, filters, mu0, transition, common=None, maps=None):
        self.filters = list(filters) if isinstance(filters, (list, tuple)) else []
        self.N = len(self.filters)
        if self.N < 2 or not all(hasattr(kf, "model") for kf in self.filters):
            raise ValueError(f"filters: expected a sequence of two filters on models or more, got {filters!r}")
        self.mu = check_probabilities(mu0, "mu0", (self.N,))
        self.M = check_probabilities(transition, "transition", (self.N, self.N))
        maps = [None] * self.N if maps is None else list(maps)
        if len(maps) != self.N:
            raise ValueError(f"maps: expected {self.N}, one a filter, got {len(maps)}")
        states = [kf.model.state for kf in self.filters]
        self.state = (
            tuple(name for name in states[0] if all(name in state for state in states)) if common is None else check_names(common, "common")
        )
        self._maps = [_Picked(kf, self.state) if pair is None else _Mapped(pair) for kf, pair in zip(self.filters, maps, strict=True)]
        named = [{kf.model.state[i] for i in kf.model.angles} & set(self.state) for kf in self.filters]
        for name in self.state:
            if len({name in angular for angular, kf in zip(named, self.filters, strict=True) if name in kf.model.state}) > 1:
                raise ValueError(f"common: {name!r} is an angle of one model and none of another")
        self._angles = tuple(i for i, name in enumerate(self.state) if any(name in angular for angular in named))
        self.likelihood, self.cbar = np.ones(self.N), self.mu.copy()
        self.omega = self._mixing(self._after(self.mu))
        self._log_likelihood, self._likelihood = 0.0, None
        self._mixture()
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

    @atomic
    def predict(self, dt):
        """Mix the filters' estimates, predict each over `dt` seconds, dt ≥ 0, and move the probabilities on by one step of the chain."""
        after = self._after(self.mu)
        self.omega = self._mixing(after)
        moments = [one.moments(kf) for one, kf in zip(self._maps, self.filters, strict=True)]
        for j, (one, kf) in enumerate(zip(self._maps, self.filters, strict=True)):
            one.put(kf, *self._mixed(self.omega[:, j], moments), *moments[j], self._angles)
        for kf in self.filters:
            kf.predict(dt)
        self.mu = self.cbar = after
        self._mixture()
        self.x_prior, self.P_prior = self.x.copy(), self.P.copy()

    @atomic
    def update(self, z, sensor=None, R=None):
        """Correct each filter by `z`, shape (m,), and weigh the models by their likelihoods, whose logarithms are compared.

        Parameters
        ----------
        z : array_like, shape (m,), or None
            None leaves the prediction, and the probabilities.
        sensor : Sensor or sequence of N
            One for all, or one a model, where their states differ.
        R : array_like, shape (m, m), optional
            In the place of the sensors', this time.
        """
        sensors = list(sensor) if isinstance(sensor, (list, tuple)) else [sensor] * self.N
        if len(sensors) != self.N:
            raise ValueError(f"sensor: expected one or {self.N}, one a model, got {len(sensors)}")
        for kf, own in zip(self.filters, sensors, strict=True):
            kf.update(z, own, R=R)
        logs = np.array([kf.log_likelihood for kf in self.filters])
        self.likelihood = np.exp(logs - logs.max())  # up to a common factor
        self.mu, total = weighed(self.mu, logs)
        self._log_likelihood, self._likelihood = float(total), None  # of the mixture
        self._mixture()
        self.z = None if z is None else self.filters[0].z
        self.x_post, self.P_post = self.x.copy(), self.P.copy()

    def _after(self, mu):
        return mu @ self.M

    def _mixing(self, after):
        """[i, j]: probability that model i was in force if j is after the step; a model that nobody comes to keeps its own estimate."""
        return np.divide(self.M * self.mu[:, None], after, out=np.eye(self.N), where=after > 0)

    def _mixture(self):
        self.x, self.P = self._mixed(self.mu, [one.moments(kf) for one, kf in zip(self._maps, self.filters, strict=True)])

    def _mixed(self, weights, moments):
        """Mean and covariance of a mixture of moments in the common components."""
        centre = moments[int(np.argmax(weights))][0]
        apart = np.array([_angles.residual(x, centre, self._angles) for x, _ in moments])
        mean = weights @ apart
        apart = apart - mean
        P = np.einsum("k,kij->ij", weights, np.array([P for _, P in moments])) + (weights * apart.T) @ apart
        return _angles.wrap_components(centre + mean, self._angles), P


class _Picked:
    """Common components that are some of the filter's own."""

    def __init__(self, kf, common):
        missing = [name for name in common if name not in kf.model.state]
        if missing or not common:
            raise ValueError(f"common: expected components of {kf.model!r}, or a map for it, got {tuple(common)}")
        self._rows = [kf.model.state.index(name) for name in common]
        self._whole = len(self._rows) == kf.model.n

    def moments(self, kf):
        return kf.x[self._rows], kf.P[np.ix_(self._rows, self._rows)]

    def put(self, kf, c_new, C_new, c, C, wrap):
        rows = self._rows
        if self._whole:
            kf.x, kf.P = np.empty_like(kf.x), np.empty_like(kf.P)
        else:
            A = divide(kf.P[:, rows], C)
            kf.x, kf.P = kf.x + A @ _angles.residual(c_new, c, wrap), kf.P + A @ (C_new - C) @ A.T
        kf.x[rows], kf.P[np.ix_(rows, rows)] = c_new, C_new


class _Mapped:
    """Common components that are functions of the filter's state."""

    def __init__(self, pair):
        self._to, self._back = pair
        self._latest = None, None  # a state, and the Jacobian there: the mixture, the next mixing and what it puts back ask for the same

    def moments(self, kf):
        J = self._jacobian(kf)
        return np.array(self._to(kf.x), dtype=float), J @ kf.P @ J.T

    def put(self, kf, c_new, C_new, c, C, wrap):
        A = divide(kf.P @ self._jacobian(kf).T, C)
        moved = kf.model.normalise(kf.x + A @ _angles.residual(c_new, c, wrap))
        kf.x = kf.model.normalise(check_array(self._back(c_new, moved), "back(c, x)", kf.model.n, ()))
        kf.P = kf.P + A @ (C_new - C) @ A.T
        kf.P = (kf.P + kf.P.T) / 2

    def _jacobian(self, kf):
        key = kf.x.tobytes()
        if self._latest[0] != key:
            entries = central_differences(self._to, kf.x)
            J = np.zeros((1 + max(i for i, _ in entries), kf.model.n))
            for place, value in entries.items():
                J[place] = value
            self._latest = key, J
        return self._latest[1]

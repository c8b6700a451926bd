"""What all filters for one target share on top of filterpy's: calls that change nothing when they raise, missing measurements, likelihood and NEES."""

from functools import wraps
from math import log, pi, sqrt

import numpy as np

from trackhelpers.checks import check_vector
from trackhelpers.consistency import nees


def atomic(method):
    """The method, except that a call which raises leaves every attribute as it was.

    For filters that put new arrays and objects in the place of old ones and change none in place; the filters of a bank (`filters`, as filterpy's IMM calls them)
    are put back too.
    """

    @wraps(method)
    def call(self, *args, **kwargs):
        before = self.__dict__.copy()
        bank = [(kf, kf.__dict__.copy()) for kf in before["filters"]] if "filters" in before else []
        try:
            return method(self, *args, **kwargs)
        except BaseException:
            for each, attributes in [(self, before), *bank]:
                each.__dict__.clear()
                each.__dict__.update(attributes)
            raise

    return call


def refused(**instead):
    """Class decorator: inherited methods of filterpy that would compute something else on this class raise NotImplementedError and name what to call.

    `instead` maps a method's name to what to use in its place.
    """

    def decorate(cls):
        for name, other in instead.items():

            def method(self, *args, _name=name, _other=other, **kwargs):
                raise NotImplementedError(f"{type(self).__name__}.{_name}: filterpy's would compute something else here; use {_other}")

            method.__name__, method.__doc__ = name, f"Not offered, for filterpy's would compute something else here; use {other}."
            setattr(cls, name, method)
        return cls

    return decorate


def singular(S):
    """The ValueError for an innovation covariance that cannot be inverted."""
    return ValueError(
        f"S: expected a positive definite innovation covariance H P Hᵀ + R, got the singular {S.tolist()}; "
        "prediction and measurement are both certain of the same quantity (P and R are zero there), so that nothing can be weighed"
    )


def inverse_of_S(S):
    """S⁻¹ for filterpy's `update`; ValueError where S is singular, also up to rounding: S_ii (S⁻¹)_ii is 1/(1 − its multiple correlation squared)."""
    try:
        SI = np.linalg.inv(S)
    except np.linalg.LinAlgError:
        raise singular(S) from None
    if S.diagonal().dot(SI.diagonal()) > 1e14:
        raise singular(S)
    return SI


class OneTarget:
    """Mixin in front of a filterpy class whose x is a vector (n,).

    After a step without a measurement nothing of an older one is left: z is None, y, S and K are empty, and the likelihood is that of no evidence, 1.
    """

    _angles = ()  # indices of the state components that are angles
    smoothable = False  # whether its covariances are those of a model, so that a smoother may go back over them

    @property
    def estimate(self):
        """The estimate that the filter is asked for, shape (n,): its state, unless a subclass says otherwise."""
        return self.x

    @property
    def estimate_P(self):
        """Covariance of `estimate`, shape (n, n)."""
        return self.P

    def nees(self, truth):
        """Normalised estimation error squared of `estimate` against `truth`, shape (n,), angles the short way round; see `trackhelpers.consistency.nees`."""
        return nees(check_vector(truth, "truth", len(self.estimate)), self.estimate, self.estimate_P, self._angles)

    def _no_measurement(self):
        self.z, self.y = None, np.zeros(0)
        self.S = self.SI = np.zeros((0, 0))
        self.K = np.zeros((len(self.x), 0))
        self.x_post, self.P_post = self.x.copy(), self.P.copy()
        self._log_likelihood = self._likelihood = self._mahalanobis = None

    @property
    def log_likelihood(self):
        """Logarithm of the last measurement's density, N(y; 0, S); 0 where nothing was measured."""
        if self._log_likelihood is None:
            factor = np.linalg.cholesky(self.S)
            white = np.linalg.solve(factor, self.y)
            self._log_likelihood = float(-0.5 * (white @ white + len(white) * log(2 * pi)) - np.log(factor.diagonal()).sum()) + 0.0
        return self._log_likelihood

    @property
    def mahalanobis(self):
        """√(yᵀS⁻¹y) of the last innovation; 0 where nothing was measured."""
        if self._mahalanobis is None:
            self._mahalanobis = sqrt(self.y @ self.SI @ self.y)
        return self._mahalanobis

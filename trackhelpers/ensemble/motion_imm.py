"""An ensemble of interacting models with headings: the models share one state."""

import numpy as np

from trackhelpers import angles
from trackhelpers.ensemble.covariance import log_density
from trackhelpers.filters.base import atomic
from trackhelpers.filters.imm import weighed
from trackhelpers.manoeuvre_checks import check_probabilities


class EnsembleMotionIMM:
    """`trackhelpers.filters.MotionIMM` over M runs, for models of one layout.

    Parameters
    ----------
    filters : sequence of N EnsembleEKF or EnsembleUKF
        Of models with one state, and of the same runs.
    mu0 : array_like, shape (N,)
        Probability of each model at the start.
    transition : array_like, shape (N, N)
        [i, j] is the probability of changing from model i to model j in a step of `predict`.

    Attributes
    ----------
    mu : numpy.ndarray, shape (N, M)
        Probability of each model, after `predict` too.
    x : numpy.ndarray, shape (n, M)
        Of the mixture, also called `estimate`; P or `estimate_P`, shape (n, n, M), is its covariance.
    y : numpy.ndarray, shape (m, M)
        Innovation of the last update, with S, shape (m, m, M), as moments of the mixture of the filters' predicted measurements.

    Raises
    ------
    ValueError
        Filters of different states or runs, probabilities that do not sum to one.

    References
    ----------
    H. A. P. Blom, Y. Bar-Shalom, IEEE Transactions on Automatic Control AC-33 (1988) 780–783.
    """

    def __init__(self, filters, mu0, transition):
        self.filters = list(filters) if isinstance(filters, (list, tuple)) else []
        if not all(hasattr(ens, "model") and hasattr(ens, "runs") for ens in self.filters):
            raise ValueError(f"filters: expected ensembles, got {filters!r}")
        if len(self.filters) < 2 or len({(ens.model.state, ens.runs) for ens in self.filters}) > 1:
            raise ValueError(f"filters: expected two or more of one state and of the same runs, got {[ens.model for ens in self.filters]}")
        N = len(self.filters)
        mu0, chain = check_probabilities(mu0, "mu0", (N,)), check_probabilities(transition, "transition", (N, N))
        self.model, self.runs, self._chain = self.filters[0].model, self.filters[0].runs, chain
        self.mu = np.repeat(mu0[:, None], self.runs, axis=1)
        self.y, self.S = np.zeros((0, self.runs)), np.zeros((0, 0, self.runs))
        self._put()

    @property
    def estimate(self):
        """The mixture's mean, shape (n, M)."""
        return self.x

    @property
    def estimate_P(self):
        """Its covariance, shape (n, n, M)."""
        return self.P

    @atomic
    def predict(self, dt):
        """Mix the filters' estimates, predict each over `dt` seconds, dt ≥ 0, and move the probabilities on by one step of the chain."""
        after = self._chain.T @ self.mu
        weights = self._chain[:, :, None] * self.mu[:, None] / np.maximum(after, np.finfo(float).tiny)  # [i, j]: i was in force if j is now
        moments = [(ens.x, ens.P) for ens in self.filters]
        for j, ens in enumerate(self.filters):
            ens.x, ens.P = mixed(weights[:, j], moments, self.model.angles)
            ens.predict(dt)
        self.mu = after
        self._put()

    @atomic
    def update(self, z, sensor=None, mask=None, R=None):
        """Correct each filter, and weigh the models by their likelihoods; arguments as for `Ensemble.update`. Runs without a measurement keep their probabilities."""
        for ens in self.filters:
            ens.update(z, sensor, mask=mask, R=R)
        if not self.filters[0].y.size:
            self.y, self.S = self.filters[0].y, self.filters[0].S
        else:
            logs = np.array([log_density(ens.y, ens.S) for ens in self.filters])
            ahead = self.mu
            self.mu = np.where(np.isnan(logs[0]), ahead, weighed(ahead, logs)[0])
            self.y, self.S = mixed(ahead, [(ens.y, ens.S) for ens in self.filters], sensor.angles)
        self._put()

    def _put(self):
        self.x, self.P = mixed(self.mu, [(ens.x, ens.P) for ens in self.filters], self.model.angles)


def mixed(weights, moments, angular=()):
    """Mean (n, M) and covariance (n, n, M) of a mixture: weights (N, M), and N pairs of a mean and a covariance; the components in `angular` the short way round."""
    centre = moments[0][0]
    apart = np.array([np.zeros_like(centre), *(angles.residual(x, centre, angular) for x, _ in moments[1:])])
    mean = np.einsum("km,knm->nm", weights, apart)
    apart -= mean
    P = sum(w * P for w, (_, P) in zip(weights, moments, strict=True)) + np.einsum("km,kim,kjm->ijm", weights, apart, apart)
    return angles.wrap_components(centre + mean, angular), P

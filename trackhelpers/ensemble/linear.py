"""The linear Kalman filter over an ensemble, whose gain is computed once for all runs."""

import numpy as np

from trackhelpers.arrays import check_dt, congruence, symmetrised
from trackhelpers.ensemble import shared
from trackhelpers.ensemble.base import QUIET, Ensemble
from trackhelpers.ensemble.covariance import correct
from trackhelpers.hooks import entries_of
from trackhelpers.model import check_model


class EnsembleKF(Ensemble):
    """`trackhelpers.filters.MotionKF` over M runs.

    Not Evensen's ensemble Kalman filter (EnKF), which takes the covariance of one filter from samples: here M filters run side by side, each with its own exact
    covariance. The gain of a linear filter does not depend on the data: as long as all runs share P0 and none misses a measurement, P, S and K are computed once for all of
    them, and `P`, `S`, `K` are read-only views that repeat the one matrix over the runs.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        A linear model.
    x0 : array_like, shape (n, M)
        Initial estimates.
    P0 : array_like, shape (n, n) or (n, n, M)
        Their covariance.
    """

    def __init__(self, model, x0, P0):
        if not check_model(model).linear:
            raise ValueError(f"model: expected a linear model (CV, CA), got {model!r}; use EnsembleEKF or EnsembleUKF")
        super().__init__(model, x0, P0)
        self._step = None, None, None, None  # model, dt, F and Q of the last prediction
        self._seen = None, None, False  # sensor and H of the last update, and whether h(x) is something else than Hx

    def _shared(name):
        def read(self):
            matrix = getattr(self, "_" + name)
            return matrix if matrix.ndim == 3 else np.broadcast_to(matrix[..., None], (*matrix.shape, self.runs))

        return property(read, lambda self, matrix: setattr(self, "_" + name, matrix), doc=f"{name} of every run, runs on the last axis.")

    P, S, K = _shared("P"), _shared("S"), _shared("K")
    del _shared

    @property
    def _covariance(self):
        return self._P  # (n, n) as long as it is everyone's

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        if self._step[0] is not self.model or self._step[1] != dt:  # F and Q depend on dt alone
            reference = np.zeros(self.model.n)
            self._step = self.model, dt, np.array(self.model.F(reference, dt)), symmetrised(self.model.Q(reference, dt))
        F, Q = self._step[2:]
        if self._P.ndim == 3:
            self.x, self._P = F.dot(self.x), symmetrised(congruence(F, self._P) + Q[..., None])
        else:
            self.x, self._P = shared.predict(self.x, self._P, F, Q)
        self.x = self.model._normalise(self.x)

    def _measurement(self, z, sensor, mask, R):
        checked = super()._measurement(z, sensor, mask, R)
        if not sensor.linear:
            raise ValueError(f"sensor: expected a linear sensor (Position, Lidar), got {sensor!r}; use EnsembleEKF or EnsembleUKF")
        return checked

    def _corrected(self, x, P, z, sensor, R):
        if self._seen[0] is not sensor:
            z_hat, H = sensor.step(np.zeros(self.model.n))
            self._seen = sensor, H, bool(sensor.angles or z_hat.any())
        _, H, curved = self._seen
        given = (
            sensor.residual(z, sensor.h(x)) + H.dot(x) if curved else z
        )  # so that given − Hx is the residual, which knows of angles and mountings
        if P.ndim == 2 and R.ndim == 2:
            x, *rest = shared.correct(x, P, given, H, np.array(R))
            return self.model._normalise(x), *rest
        if P.ndim == 2:
            P = np.repeat(P[..., None], self.runs, axis=2)
        with np.errstate(**QUIET):
            y = given - H.dot(x)  # some runs differ from the others
            K, S, P = correct(P, entries_of(H), R)
            return self._moved(x, K, y), P, y, S, K

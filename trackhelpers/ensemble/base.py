"""What the ensemble filters share: their arguments, masks and bookkeeping."""

import numpy as np

from trackhelpers.arrays import all_finite, check_array, check_covariance, matvec
from trackhelpers.checks import check_mask
from trackhelpers.consistency import nees
from trackhelpers.filters.base import atomic
from trackhelpers.filters.on_model import check_fit
from trackhelpers.model import check_model

QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}  # what a diverging run does, and only there


class Ensemble:
    """Arguments, masks and the bookkeeping that the ensemble filters share."""

    def __init__(self, model, x0, P0):
        check_model(model)
        x0 = check_array(x0, "x0", None)
        if x0.ndim != 2 or x0.shape[0] != model.n or x0.shape[1] == 0:
            raise ValueError(f"x0: expected shape ({model.n}, M), runs on the last axis, got {x0.shape}")
        if not np.all(np.isfinite(x0)):
            raise ValueError(f"x0: expected finite numbers, got {np.count_nonzero(~np.isfinite(x0))} that are not")
        self.model = model
        self.runs = x0.shape[1]
        self.x = model.normalise(x0)
        self.P = check_covariance(P0, "P0", model.n, runs=self.runs)
        self._known = None, None  # the last sensor that was found to fit, and the model that it fits
        self._no_measurement()

    @property
    def failed(self):
        """Which runs have diverged: shape (M,), True where x or P is not finite or P has a negative variance."""
        variances = np.einsum("iim->im", self.P)
        healthy = np.isfinite(self.x).all(axis=0) & np.isfinite(self.P).all(axis=(0, 1)) & (variances >= 0).all(axis=0)
        return ~healthy

    @property
    def estimate(self):
        """The estimates that the filter is asked for: its states, shape (n, M)."""
        return self.x

    @property
    def estimate_P(self):
        """Their covariances, shape (n, n, M)."""
        return self.P

    def nees(self, truth, fold=False):
        """NEES of each run against `truth`, (n,), (n, 1) or (n, M): shape (M,); as that of the filters of one target."""
        truth = check_array(truth, "truth", self.model.n)
        truth = truth[:, None] if truth.ndim == 1 else truth
        return nees(self.model.fold(truth, near=self.x) if fold else truth, self.x, self.P, self.model.angles)

    @property
    def _covariance(self):
        return self.P

    def _no_measurement(self):
        self.y, self.S = np.zeros((0, self.runs)), np.zeros((0, 0, self.runs))
        self.K = np.zeros((self.model.n, 0, self.runs))

    def _measurement(self, z, sensor, mask, R):
        """Checked z (m, M), mask (M,), None where every run is measured, and R (m, m) or (m, m, M)."""
        if self._known[0] is not sensor or self._known[1] is not self.model:
            check_fit(sensor, self.model)
            self._known = sensor, self.model
        z = check_array(z, "z", None)
        if z.shape not in ((sensor.m, self.runs), (sensor.m, 1)):
            raise ValueError(
                f"z: expected shape ({sensor.m}, {self.runs}), runs on the last axis, or ({sensor.m}, 1) for all, got {z.shape}"
            )
        if z.shape[1] != self.runs:
            z = np.broadcast_to(z, (sensor.m, self.runs))
        if mask is not None:
            mask = None if mask.all() else mask
        if not all_finite(z if mask is None else z[:, mask]):
            raise ValueError("z: expected finite measurements; name the runs without one by mask")
        return z, mask, sensor.R if R is None else check_covariance(R, "R", sensor.m, runs=self.runs)

    @atomic
    def update(self, z, sensor=None, mask=None, R=None):
        """Correct the runs that have a measurement.

        Parameters
        ----------
        z : array_like, shape (m, M) or (m, 1), or None
            Measurements; (m, 1) is one measurement for all runs; None: nobody has one.
        sensor : trackhelpers.sensors.Sensor
            Made for the model's state.
        mask : array_like of bool, shape (M,), optional
            The runs that are updated; y, S and K are NaN in the others.
        R : array_like, shape (m, m) or (m, m, M), optional
            Covariance of the noise in the place of the sensor's, this time; one for all runs or one a run, masked ones included.

        Raises
        ------
        ValueError
            Shapes that do not fit, a measurement that is not finite in a run that the mask does not leave out, a sensor of another layout.
        """
        mask = None if mask is None else check_mask(mask, "mask", self.runs)
        if z is None or (mask is not None and not mask.any()):
            self._no_measurement()
            return
        z, mask, R = self._measurement(z, sensor, mask, R)
        if mask is None:
            self.x, self.P, self.y, self.S, self.K = self._corrected(self.x, self._covariance, z, sensor, R)
            return
        there = np.flatnonzero(mask)  # numbers are faster to index with than the mask
        R = R.take(there, axis=2) if R.ndim == 3 else R
        x, P, z = self.x.take(there, axis=1), self.P.take(there, axis=2), z.take(there, axis=1)
        x, P, y, S, K = self._corrected(x, P, z, sensor.of_runs(mask), R)
        self.x, self.P = self.x.copy(), self.P.copy()
        self.x[:, there], self.P[..., there] = x, P
        self.y, self.S, self.K = (self._scattered(part, there) for part in (y, S, K))

    def _scattered(self, part, there):
        whole = np.full((*part.shape[:-1], self.runs), np.nan)
        whole[..., there] = part
        return whole

    def _moved(self, x, K, y):
        """x + K y, brought back to the range of the state."""
        step = matvec(K, y)
        step += x
        return self.model._normalise(step)

    def _corrected(self, x, P, z, sensor, R):
        """x, P, y, S and K after the measurement z of the runs that have one."""
        raise NotImplementedError

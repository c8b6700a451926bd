"""What the ensemble filters share: their arguments, masks and bookkeeping."""

import numpy as np

from trackhelpers import angles
from trackhelpers.arrays import all_finite, check_covariance, matvec

QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}  # what a diverging run does, and only there


class Ensemble:
    """Arguments, masks and the bookkeeping that the ensemble filters share."""

    def __init__(self, model, x0, P0):
        x0 = np.asarray(x0, dtype=float)
        if x0.ndim != 2 or x0.shape[0] != model.n or x0.shape[1] == 0:
            raise ValueError(f"x0: expected shape ({model.n}, M), runs on the last axis, got {x0.shape}")
        if not np.all(np.isfinite(x0)):
            raise ValueError(f"x0: expected finite numbers, got {np.count_nonzero(~np.isfinite(x0))} that are not")
        self.model = model
        self.runs = x0.shape[1]
        self.x = angles.wrap_components(x0, model.angles)
        self.P = check_covariance(P0, "P0", model.n, runs=self.runs)
        self._no_measurement()

    @property
    def failed(self):
        """Which runs have diverged: shape (M,), True where x or P is not finite or P has a negative variance."""
        variances = np.einsum("iim->im", self.P)
        healthy = np.isfinite(self.x).all(axis=0) & np.isfinite(self.P).all(axis=(0, 1)) & (variances >= 0).all(axis=0)
        return ~healthy

    @property
    def _covariance(self):
        return self.P

    def _no_measurement(self):
        self.y, self.S = np.zeros((0, self.runs)), np.zeros((0, 0, self.runs))
        self.K = np.zeros((self.model.n, 0, self.runs))

    def _measurement(self, z, sensor, mask):
        """Checked z (m, M) and mask (M,), the mask None where every run is measured."""
        if getattr(sensor, "state", None) != self.model.state:
            raise ValueError(f"sensor: expected one made with state={self.model.state}, got {sensor!r}")
        z = np.asarray(z, dtype=float)
        if z.shape not in ((sensor.m, self.runs), (sensor.m, 1)):
            raise ValueError(
                f"z: expected shape ({sensor.m}, {self.runs}), runs on the last axis, or ({sensor.m}, 1) for all, got {z.shape}"
            )
        if z.shape[1] != self.runs:
            z = np.broadcast_to(z, (sensor.m, self.runs))
        if mask is not None:
            mask = np.asarray(mask)
            if mask.dtype != bool or mask.shape != (self.runs,):
                raise ValueError(f"mask: expected booleans of shape ({self.runs},), got {mask.dtype} of shape {mask.shape}")
            if mask.all():
                mask = None
        if not all_finite(z if mask is None else z[:, mask]):
            raise ValueError("z: expected finite measurements; name the runs without one by mask")
        return z, mask

    def update(self, z, sensor, mask=None):
        """Correct the runs that have a measurement.

        Parameters
        ----------
        z : array_like, shape (m, M) or (m, 1), or None
            Measurements; (m, 1) is one measurement for all runs; None: nobody has one.
        sensor : trackhelpers.sensors.Sensor
            Made for the model's state.
        mask : array_like of bool, shape (M,), optional
            The runs that are updated; y, S and K are NaN in the others.

        Raises
        ------
        ValueError
            Shapes that do not fit, a measurement that is not finite in a run that the mask does not leave out, a sensor of another layout.
        """
        if z is None or (mask is not None and np.shape(mask) == (self.runs,) and not np.any(mask)):
            self._no_measurement()
            return
        z, mask = self._measurement(z, sensor, mask)
        if mask is None:
            self.x, self.P, self.y, self.S, self.K = self._corrected(self.x, self._covariance, z, sensor)
            return
        x, P, y, S, K = self._corrected(self.x[:, mask], self.P[..., mask], z[:, mask], sensor)
        self.x, self.P = self.x.copy(), self.P.copy()
        self.x[:, mask], self.P[..., mask] = x, P
        self.y, self.S, self.K = (self._scattered(part, mask) for part in (y, S, K))

    def _scattered(self, part, mask):
        whole = np.full((*part.shape[:-1], self.runs), np.nan)
        whole[..., mask] = part
        return whole

    def _moved(self, x, K, y):
        """x + K y, its angles wrapped."""
        step = matvec(K, y)
        step += x
        return angles.wrap_rows(step, self.model.angles)

    def _corrected(self, x, P, z, sensor):
        """x, P, y, S and K after the measurement z of the runs that have one."""
        raise NotImplementedError

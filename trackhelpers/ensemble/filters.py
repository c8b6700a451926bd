"""Kalman filters over an ensemble: one object, M runs, the models and sensors of the single-target filters.

    ens = EnsembleEKF(model, x0, P0)        # x0 (n, M), P0 (n, n) or (n, n, M)
    ens.predict(dt)
    ens.update(z, sensor, mask=None)        # z (m, M); mask (M,) bool: the runs that have a measurement

A run that diverges or whose innovation covariance is no longer positive definite turns to NaN, is named by `failed`, and leaves its neighbours alone.
"""

import numpy as np

from trackhelpers import angles
from trackhelpers.arrays import check_covariance, check_dt, cholesky, congruence, matvec, symmetrised
from trackhelpers.ensemble.covariance import correct, correct_unsymmetric, gain, mirror, propagate

_QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}  # what a diverging run does, and only there


class _Ensemble:
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
        z = np.broadcast_to(z, (sensor.m, self.runs))
        if mask is not None:
            mask = np.asarray(mask)
            if mask.dtype != bool or mask.shape != (self.runs,):
                raise ValueError(f"mask: expected booleans of shape ({self.runs},), got {mask.dtype} of shape {mask.shape}")
            if mask.all():
                mask = None
        if not np.all(np.isfinite(z if mask is None else z[:, mask])):
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
            with np.errstate(**_QUIET):
                self.x, self.P, self.y, self.S, self.K = self._corrected(self.x, self.P, z, sensor)
            return
        with np.errstate(**_QUIET):
            x, P, y, S, K = self._corrected(self.x[:, mask], self.P[..., mask], z[:, mask], sensor)
        self.x, self.P = self.x.copy(), self.P.copy()
        self.x[:, mask], self.P[..., mask] = x, P
        self.y, self.S, self.K = (self._scattered(part, mask) for part in (y, S, K))

    def _scattered(self, part, mask):
        whole = np.full((*part.shape[:-1], self.runs), np.nan)
        whole[..., mask] = part
        return whole

    def _corrected(self, x, P, z, sensor):
        raise NotImplementedError


class EnsembleEKF(_Ensemble):
    """`trackhelpers.filters.MotionEKF` over M runs.

    Parameters
    ----------
    model : trackhelpers.motion.Model
    x0 : array_like, shape (n, M)
        Initial estimates, SI units and rad.
    P0 : array_like, shape (n, n) or (n, n, M)
        Their covariance.

    Attributes
    ----------
    x (n, M), P (n, n, M) : state and covariance; y (m, M), S (m, m, M), K (n, m, M) : of the last update.
    """

    def __init__(self, model, x0, P0):
        super().__init__(model, x0, P0)
        if self.P.ndim == 2:
            self.P = np.repeat(self.P[:, :, None], self.runs, axis=2)

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        with np.errstate(**_QUIET):
            if self.model.checked:
                x, transition, noise = self.model.linearised(self.x, dt)
                self.P = propagate(self.P, transition, noise)
            else:
                self.P = congruence(self.model.F(self.x, dt), self.P) + self.model.Q(self.x, dt)
                x = self.model.f(self.x, dt)
        for i in self.model.angles:
            x[i] = angles.wrap(x[i])
        self.x = x

    def _corrected(self, x, P, z, sensor):
        if self.model.checked:
            K, S, P = correct(P, sensor.entries(x), sensor.R)
        else:
            K, S, P = correct_unsymmetric(P, sensor.H(x), sensor.R)
        y = sensor.residual(z, sensor.h(x))
        return angles.wrap_components(x + matvec(K, y), self.model.angles), P, y, S, K


class EnsembleKF(_Ensemble):
    """`trackhelpers.filters.MotionKF` over M runs.

    The gain of a linear filter does not depend on the data: as long as all runs share P0 and none misses a measurement, P, S and K are computed once for all of
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
        if not model.linear:
            raise ValueError(f"model: expected a linear model (CV, CA), got {model!r}; use EnsembleEKF or EnsembleUKF")
        super().__init__(model, x0, P0)
        self._step = None, None, None  # dt, F, Q of the last prediction
        self._seen = None, None  # sensor and H of the last update

    def _shared(name):
        def read(self):
            matrix = getattr(self, "_" + name)
            return matrix if matrix.ndim == 3 else np.broadcast_to(matrix[..., None], (*matrix.shape, self.runs))

        return property(read, lambda self, matrix: setattr(self, "_" + name, matrix), doc=f"{name} of every run, runs on the last axis.")

    P, S, K = _shared("P"), _shared("S"), _shared("K")
    del _shared

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        if self._step[0] != dt:  # F and Q depend on dt alone
            reference = np.zeros(self.model.n)
            self._step = dt, self.model.F(reference, dt), self.model.Q(reference, dt)
        _, F, Q = self._step
        self.x = F @ self.x
        if self._P.ndim == 2:
            self._P = symmetrised(F @ self._P @ F.T + Q)
        else:
            self._P = symmetrised(congruence(F, self._P) + Q[..., None])

    def _measurement(self, z, sensor, mask):
        z, mask = super()._measurement(z, sensor, mask)
        if not sensor.linear:
            raise ValueError(f"sensor: expected a linear sensor (Position, Lidar), got {sensor!r}; use EnsembleEKF or EnsembleUKF")
        return z, mask

    def _corrected(self, x, P, z, sensor):
        if self._seen[0] is not sensor:
            self._seen = sensor, sensor.H(np.zeros(self.model.n))
        H, R = self._seen[1], sensor.R
        y = z - H @ x
        if self._P.ndim == 3 or x.shape[1] != self.runs:  # some runs differ from the others
            K, S, P = correct(P, sensor.entries(np.zeros(self.model.n)), R)
            return x + matvec(K, y), P, y, S, K
        P = self._P
        S = H @ P @ H.T + R
        try:
            K = np.linalg.solve(S, H @ P).T
        except np.linalg.LinAlgError:
            K = np.full((self.model.n, sensor.m), np.nan)
        A = np.eye(self.model.n) - K @ H
        return x + K @ y, symmetrised(A @ P @ A.T + K @ R @ K.T), y, S, K


class EnsembleUKF(_Ensemble):
    """`trackhelpers.filters.MotionUKF` over M runs.

    Parameters
    ----------
    model : trackhelpers.motion.Model
    x0 : array_like, shape (n, M)
        Initial estimates.
    P0 : array_like, shape (n, n) or (n, n, M)
        Their covariance.
    alpha, beta, kappa : float
        Parameters of the scaled sigma points of van der Merwe.
    """

    def __init__(self, model, x0, P0, alpha=1.0, beta=2.0, kappa=0.0):
        super().__init__(model, x0, P0)
        n = model.n
        self._spread = alpha**2 * (n + kappa)
        if not (np.isfinite(self._spread) and self._spread > 0 and np.isfinite(beta)):
            raise ValueError(f"alpha, beta, kappa: expected finite numbers with alpha²(n + kappa) > 0, got {alpha}, {beta}, {kappa}")
        if self.P.ndim == 2:
            self.P = np.repeat(self.P[:, :, None], self.runs, axis=2)
        self.Wm = np.full(2 * n + 1, 0.5 / self._spread)
        self.Wm[0] = 1 - n / self._spread
        self.Wc = self.Wm.copy()
        self.Wc[0] += 1 - alpha**2 + beta

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        with np.errstate(**_QUIET):
            Q = self.model.Q(self.x, dt)
            moved = self.model.f(self._sigma_points(self.x, self.P), dt)
            self.x = angles.mean(moved, self.Wm, self.model.angles)
            deviation = angles.residual(moved, self.x[:, None], self.model.angles)
            self.P = self._spread_of(deviation, deviation) + Q
            mirror(self.P)

    def _corrected(self, x, P, z, sensor):
        points = self._sigma_points(x, P)
        seen = sensor.h(points)
        z_hat = angles.mean(seen, self.Wm, sensor.angles)
        deviation = sensor.residual(seen, z_hat[:, None])
        S = self._spread_of(deviation, deviation) + sensor.R[..., None]
        mirror(S)
        cross = self._spread_of(angles.residual(points, x[:, None], self.model.angles), deviation)
        K = gain(cross, S)
        y = sensor.residual(z, z_hat)
        P = P - np.einsum("im...,jm...->ij...", K, cross)  # K S Kᵀ = K (P_xz)ᵀ
        mirror(P)
        return angles.wrap_components(x + matvec(K, y), self.model.angles), P, y, S, K

    def _spread_of(self, a, b):
        return np.einsum("ik...,jk...->ij...", a * self.Wc[:, None], b)

    def _sigma_points(self, x, P):
        root = np.sqrt(self._spread) * _root(P)
        return np.concatenate([x[:, None], x[:, None] + root, x[:, None] - root], axis=1)


def _root(P):
    """L with L Lᵀ = P (n, n, M): Cholesky's factor, an eigenvalue root in the runs where P is only semidefinite, NaN where it is not even that."""
    L = cholesky(P)
    doubtful = ~np.isfinite(L).all(axis=(0, 1)) & np.isfinite(P).all(axis=(0, 1))
    if np.any(doubtful):
        values, vectors = np.linalg.eigh(np.moveaxis(P[..., doubtful], -1, 0))
        indefinite = values[:, 0] < -1e-9 * np.maximum(values[:, -1], 0)
        root = vectors * np.sqrt(np.maximum(values, 0))[:, None, :]
        root[indefinite] = np.nan
        L[..., doubtful] = np.moveaxis(root, 0, -1)
    return L

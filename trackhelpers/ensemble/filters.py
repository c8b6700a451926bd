"""Kalman filters over an ensemble: one object, M runs, the models and sensors of the single-target filters.

    ens = EnsembleEKF(model, x0, P0)        # x0 (n, M), P0 (n, n) or (n, n, M)
    ens.predict(dt)
    ens.update(z, sensor, mask=None)        # z (m, M); mask (M,) bool: the runs that have a measurement

A run that diverges or whose innovation covariance is no longer positive definite turns to NaN, is named by `failed`, and leaves its neighbours alone.
"""

import numpy as np

from trackhelpers import angles, fused
from trackhelpers.arrays import all_finite, check_dt, cholesky, matvec
from trackhelpers.ensemble import unscented_compiled
from trackhelpers.ensemble.base import QUIET, Ensemble
from trackhelpers.ensemble.covariance import correct, gain, mirror, propagate
from trackhelpers.filters.motion_ukf import check_known, check_sigma_points, warn_unknown
from trackhelpers.filters.on_model import check_fit
from trackhelpers.manoeuvre import check_window


class EnsembleEKF(Ensemble):
    """`trackhelpers.filters.MotionEKF` over M runs.

    Parameters
    ----------
    model : trackhelpers.motion.Model
    x0 : array_like, shape (n, M)
        Initial estimates, SI units and rad.
    P0 : array_like, shape (n, n) or (n, n, M)
        Their covariance.
    iterations : int
        As for `MotionEKF`.

    Attributes
    ----------
    x : numpy.ndarray, shape (n, M)
        The state; P, shape (n, n, M), is its covariance.
    y : numpy.ndarray, shape (m, M)
        Innovation of the last update, with S, shape (m, m, M), and K, shape (n, m, M).
    """

    def __init__(self, model, x0, P0, iterations=1):
        super().__init__(model, x0, P0)
        self.iterations = check_window(iterations, "iterations")
        if self.P.ndim == 2:
            self.P = np.repeat(self.P[:, :, None], self.runs, axis=2)

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        self.x, self.P = _linearised(self, check_dt(dt))

    def _run(self, zs, sensors, steps, truth, keep):
        """Move on by many steps at once and return what `fused.run` keeps of them; None, and nothing is moved, where they are to be taken one by one, or one is to be refused."""
        if type(self) is not EnsembleEKF or self.iterations > 1 or not all(map(self._usable, zs, sensors)):
            return None
        taken = [None if z is None else sensor for z, sensor in zip(zs, sensors, strict=True)]
        try:
            for sensor in {id(each): each for each in taken if each is not None}.values():
                check_fit(sensor, self.model)
        except ValueError:
            return None
        ran = fused.run(self.model, self.x, self.P, zs, taken, steps, truth, keep)
        if ran is None:
            return None
        history, last = ran
        self.x, self.P, self.y, self.S, self.K = (last[name] for name in ("x", "P", "y", "S", "K"))
        return history

    def _usable(self, z, sensor):
        """Whether a measurement, if it is one, is an array that the compiled code reads as it is."""
        if z is None or sensor is None:
            return z is None
        return type(z) is np.ndarray and z.dtype == float and z.shape == (sensor.m, self.runs) and all_finite(z)

    def _corrected(self, x, P, z, sensor, R):
        corrected = fused.update(sensor, self.model, x, P, z, R, self.iterations)
        if corrected is not None:
            return corrected
        with np.errstate(**QUIET):
            z_hat, entries = sensor.linearised(x)
            K, S, corrected = correct(P, entries, R)
            y = sensor.residual(z, z_hat)
            for _ in range(self.iterations - 1):
                step = matvec(K, y)
                z_hat, entries = sensor.linearised(x + step)
                K, S, corrected = correct(P, entries, R)
                y = sensor.residual(z, z_hat)  # of the sensor linearised there: z − h(xᵢ) − Hᵢ (x⁻ − xᵢ)
                for (i, j), value in entries.items():
                    y[i] += value * step[j]
            return self._moved(x, K, y), corrected, y, S, K


class EnsembleUKF(Ensemble):
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
        self._spread = check_sigma_points(n, alpha, beta, kappa)
        check_known(self.P, model, "P0")
        if self.P.ndim == 2:
            self.P = np.repeat(self.P[:, :, None], self.runs, axis=2)
        self.Wm = np.full(2 * n + 1, 0.5 / self._spread)
        self.Wm[0] = 1 - n / self._spread
        self.Wc = self.Wm.copy()
        self.Wc[0] += 1 - alpha**2 + beta

    def predict(self, dt):
        """Predict over `dt` seconds, dt ≥ 0."""
        dt = check_dt(dt)
        # the transform of a linear model is F x and F P Fᵀ, which needs no points
        self.x, self.P = _linearised(self, dt) if self.model.linear else self._transformed(dt)
        warn_unknown(self.P, self.model)

    def _transformed(self, dt):
        with np.errstate(**QUIET):
            Q = self.model.Q(self.x, dt)
            moved = self.model.f(self._root_and_points(self.x, self.P)[1], dt)
            compiled = unscented_compiled.moments(moved, Q, self._weights)
            if compiled is not None:
                x, P = compiled
            else:
                x = np.einsum("k,nk...->n...", self.Wm, moved)
                P = self._spread_about(moved, x)[0]
                P += Q
                mirror(P)
        return self.model._normalise(x), P

    @property
    def _weights(self):
        """Of each point but the first, and of the first in the covariance."""
        return self.Wc[-1], self.Wc[0]

    def _corrected(self, x, P, z, sensor, R):
        whole = unscented_compiled.update(sensor, self.model, x, P, z, R, self._spread, self._weights)
        if whole is None:
            return self._corrected_by_points(x, P, z, sensor, R)
        doubtful = ~np.isfinite(whole[0]).all(axis=0)
        if doubtful.any():  # a P that is only semidefinite has a root that takes longer
            R = R[..., doubtful] if R.ndim == 3 else R
            parts = self._corrected_by_points(x[:, doubtful], P[..., doubtful], z[:, doubtful], sensor.of_runs(doubtful), R)
            for part, value in zip(whole, parts, strict=True):
                part[..., doubtful] = value
        return whole

    def _corrected_by_points(self, x, P, z, sensor, R):
        with np.errstate(**QUIET):
            root, points = self._root_and_points(x, P)
            seen = sensor.h(points)
            compiled = unscented_compiled.corrected(root, seen, P, R, self._weights, sensor.angles)
            if compiled is not None:
                z_hat, S, K, P_post = compiled
                y = sensor.residual(z, z_hat)
                return self._moved(x, K, y), P_post, y, S, K
            z_hat = angles.mean(seen, self.Wm, sensor.angles)
            S, deviation = self._spread_about(seen, z_hat, sensor.angles)
            S += R if R.ndim == 3 else R[..., None]
            n = len(x)  # of the points' deviations from x one is zero, and the others are pairs ±
            pairs = deviation[:, 1 : n + 1] - deviation[:, n + 1 :]
            cross = np.einsum("ik...,jk...->ij...", root, pairs)
            cross *= self.Wc[-1]
            K = gain(cross, S)
            y = sensor.residual(z, z_hat)
            P_post = np.einsum("im...,jm...->ij...", K, cross)  # K S Kᵀ = K (P_xz)ᵀ
            np.subtract(P, P_post, out=P_post)
            mirror(P_post)
            return self._moved(x, K, y), P_post, y, S, K

    def _spread_about(self, points, mean, angular=()):
        """Weighted second moment (m, m, M) of sigma points (m, k, M) about `mean`, and their deviations from it."""
        deviation = angles.residual(points, mean[:, None], angular)
        w, first = self.Wc[-1], deviation[:, 0]  # all points but the first weigh the same
        spread = np.empty((len(points), *mean.shape))
        for i, row in enumerate(deviation):
            np.einsum("k...,jk...->j...", row, deviation[: i + 1], out=spread[i, : i + 1])
            spread[i, : i + 1] += (self.Wc[0] / w - 1) * row[0] * first[: i + 1]
            spread[:i, i] = spread[i, :i]
        spread *= w
        return spread, deviation

    def _root_and_points(self, x, P):
        """A root of the spread times P, (n, n, M), and the sigma points (n, 2 n + 1, M)."""
        compiled = unscented_compiled.sigma_points(x, P, self._spread)
        if compiled is None:
            root = self._displacements(P)
            return root, self._sigma_points(x, root)
        root, points = compiled
        doubtful = ~np.isfinite(root).all(axis=(0, 1))
        if doubtful.any():  # these alone: the others' numbers do not depend on their neighbours
            root[..., doubtful] = self._displacements(P[..., doubtful])
            points[..., doubtful] = self._sigma_points(x[:, doubtful], root[..., doubtful])
        return root, points

    def _displacements(self, P):
        """How far the sigma points lie from the mean: the columns of a root of the spread times P, (n, n, M)."""
        root = _root(P)
        root *= np.sqrt(self._spread)
        return root

    def _sigma_points(self, x, root):
        n = len(x)
        points = np.empty((n, 2 * n + 1, *x.shape[1:]))
        points[:, 0] = x
        np.add(x[:, None], root, out=points[:, 1 : n + 1])
        np.subtract(x[:, None], root, out=points[:, n + 1 :])
        return points


def _linearised(ens, dt):
    """x and P of the runs after `dt` seconds by the model's F."""
    moved = fused.predict(ens.model, ens.x, ens.P, dt)
    if moved is not None:
        return moved
    with np.errstate(**QUIET):
        x, transition, noise = ens.model.linearised(ens.x, dt)
        P = propagate(ens.P, transition, noise)
    return ens.model._normalise(x), P


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

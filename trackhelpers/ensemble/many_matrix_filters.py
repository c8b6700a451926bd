"""What the ensembles of matrix filters share: constant F, H, Q and R, a covariance of its own for every run, and runs that miss a measurement."""

from copy import copy

import numpy as np

from trackhelpers import matrix_steps
from trackhelpers.arrays import all_finite, check_array, check_covariance, check_matrix, congruence, matvec
from trackhelpers.checks import check_mask, check_numbers
from trackhelpers.consistency import nees
from trackhelpers.ensemble.base import QUIET
from trackhelpers.ensemble.covariance import correct, propagate
from trackhelpers.filters.base import atomic
from trackhelpers.hooks import entries_of
from trackhelpers.manoeuvre import with_runs


class Matrices:
    """F, H, Q and R of one model, and the products that a filter on M runs makes with them."""

    def __init__(self, F, H, Q, R):
        n = len(F)
        self.F, self.H, self.Q, self.R = F, H, Q, R
        self.seen = entries_of(H)
        self._transition = {(i, i): float(F[i, i]) for i in range(n) if F[i, i] != 1} | {
            k: v for k, v in entries_of(F).items() if k[0] != k[1]
        }
        self.difference, self.noise = entries_of(F - np.eye(n)), entries_of(np.tril(Q))

    def predict(self, x, P):
        """F x and F P Fᵀ + Q for x (n, M) and P (n, n, M)."""
        return matrix_steps.move(self, x, P) or (self.F @ x, propagate(P, self._transition, self.noise))

    def moved(self, P):
        """F P Fᵀ."""
        return propagate(P, self._transition, {})

    def correct(self, x, P, z, R):
        """x, P, y, S, K after the measurement z (m, M) with noise R, (m, m) or (m, m, M); NaN in a run whose S is not positive definite."""
        alike = {x.shape[1], z.shape[1], P.shape[2], *R.shape[2:]}  # not so while all runs share a covariance
        if len(alike) == 1 and (corrected := matrix_steps.correct(self, x, P, z, R)) is not None:
            return corrected
        with np.errstate(**QUIET):
            if R.ndim == 3 and P.shape[2] == 1:  # a covariance that all runs shared so far
                P = np.repeat(P, R.shape[2], axis=2)
            K, S, P = correct(P, self.seen, R)
            y = z - self.H @ x
            return x + matvec(K, y), P, y, S, K

    def innovation_covariance(self, P, R=None):
        """H P Hᵀ + R, shape (m, m, M)."""
        return congruence(self.H, P) + with_runs(self.R if R is None else R, P)


def check_runs(value, name, components):
    """`value` as finite floats of shape (components, M), runs on the last axis; ValueError otherwise."""
    array = check_array(value, name, components)
    if array.ndim != 2 or array.shape[1] == 0:
        raise ValueError(f"{name}: expected shape ({components}, M), runs on the last axis, got {array.shape}")
    if not all_finite(array):
        raise ValueError(f"{name}: expected finite numbers, got {np.count_nonzero(~np.isfinite(array))} that are not")
    return array


def of_runs(value, runs):
    """The part that belongs to some runs, a mask or numbers: of an array with runs last, of a tuple of such, or of what all runs share (last axis 1)."""
    if isinstance(value, tuple):
        return tuple(of_runs(each, runs) for each in value)
    return value if value.shape[-1] == 1 else value[..., runs]


class MatrixEnsemble:
    """M runs of a filter on constant matrices: measurements that some runs miss, their noise, and how far the estimates are off.

    A subclass writes `predict`, `_update` for runs that are all measured, and names in `_by_run` the attributes that have an axis of runs.
    """

    _by_run, _results = ("x", "P", "_steps"), ("y", "S")

    def _start(self, x0, R):
        """Runs and measured components, from a start (n, M) and R (m, m)."""
        self.runs, self.m, self.R = x0.shape[1], len(R), R
        self._steps = np.zeros(self.runs, dtype=int)  # predictions since the last measurement
        self._no_measurement()

    @property
    def failed(self):
        """Which runs have diverged: shape (M,), True where the estimate or its covariance is not finite."""
        return ~(np.isfinite(self.estimate).all(axis=0) & np.isfinite(self.estimate_P).all(axis=(0, 1)))

    def nees(self, truth):
        """Normalised estimation error squared of `estimate` against `truth`, (n,) or (n, M): shape (M,); see `trackhelpers.consistency.nees`."""
        return nees(check_array(truth, "truth", len(self.estimate)), self.estimate, self.estimate_P)

    @atomic
    def update(self, z, R=None, mask=None):
        """Correct the runs that have a measurement.

        Parameters
        ----------
        z : array_like, shape (m, M) or (m, 1), or None
            Measurements; (m, 1) is one measurement for all runs; None: nobody has one.
        R : array_like, shape (m, m) or (m, m, M), optional
            Covariance of their noise, in this call only.
        mask : array_like of bool, shape (M,), optional
            The runs that are measured; y, S and K are NaN in the others.

        Raises
        ------
        ValueError
            Shapes that do not fit, a measurement that is not finite or an R that is no covariance in a run that is measured.
        RuntimeError
            A second measurement after one prediction, from filters whose memory counts steps.
        """
        if mask is not None:
            mask = check_mask(mask, "mask", self.runs)
            mask = None if mask.all() else mask
        if z is None or (mask is not None and not mask.any()):
            self._no_measurement()
            return
        z = check_array(z, "z", self.m)
        if z.shape not in ((self.m, self.runs), (self.m, 1)):
            raise ValueError(f"z: expected shape ({self.m}, {self.runs}), runs on the last axis, or ({self.m}, 1) for all, got {z.shape}")
        z = z + np.zeros(self.runs)
        z = check_runs(z if mask is None else z[:, mask], "z", self.m)
        if R is None:
            R = self.R
        elif mask is not None and check_numbers(R, "R").shape == (self.m, self.m, self.runs):
            R = check_covariance(check_numbers(R, "R")[..., mask], "R", self.m, runs=z.shape[1])
        else:
            R = check_covariance(R, "R", self.m, runs=self.runs)
        if mask is None:
            self._update(z, R)
            return
        part = copy(self)
        part.runs = z.shape[1]
        part.__dict__.update({name: of_runs(getattr(self, name), mask) for name in self._by_run})
        part._update(z, R)
        for name in self._results:
            setattr(self, name, np.full((*getattr(part, name).shape[:-1], self.runs), np.nan))
        self._put(mask, **{name: getattr(part, name) for name in (*self._by_run, *self._results)})

    def _put(self, runs, **parts):
        """New values of some runs, a mask or numbers, in new arrays."""
        for name, part in parts.items():
            setattr(self, name, self._merged(getattr(self, name), runs, part))

    def _merged(self, whole, runs, part):
        if isinstance(whole, tuple):
            return tuple(self._merged(*pair) for pair in zip(whole, [runs] * len(whole), part, strict=True))
        if whole is part:  # what all runs share
            return whole
        if whole.shape[-1] != self.runs:
            whole = np.broadcast_to(whole, (*whole.shape[:-1], self.runs))
        whole = whole.copy()
        whole[..., runs] = part
        return whole

    def _no_measurement(self):
        self.y, self.S = np.zeros((0, self.runs)), np.zeros((0, 0, self.runs))

    def _update(self, z, R):
        """Correct all runs by z (m, M) with R (m, m) or (m, m, M), checked."""
        raise NotImplementedError


class EnsembleMatrixKF(MatrixEnsemble):
    """The Kalman filter on constant matrices over M runs, `trackhelpers.filters.MatrixKF` for each: base of the ensembles whose gain depends on the data.

    Parameters
    ----------
    F, H, Q, R : array_like, shapes (n, n), (m, n), (n, n) and (m, m)
    x0 : array_like, shape (n, M)
    P0 : array_like, shape (n, n)
        The same for all runs.

    Attributes
    ----------
    x : numpy.ndarray, shape (n, M)
        The state, also called `estimate`; P or `estimate_P`, shape (n, n, M), is its covariance.
    y : numpy.ndarray, shape (m, M)
        Innovation of the last update, with S, shape (m, m, M), and K, shape (n, m, M); empty, m = 0, where nobody was measured.

    Raises
    ------
    ValueError
        Wrong shapes, numbers that are not finite, Q, R or P0 that are no covariances.
    """

    _results = ("y", "S", "K")

    def __init__(self, F, H, Q, R, x0, P0):
        n, H = len(check_array(F, "F", None)), np.atleast_2d(check_numbers(H, "H"))
        m = len(H)
        if not n or not m:
            raise ValueError(f"F, H: expected a state and a measurement of one component or more, got {n} and {m}")
        self.x = check_runs(x0, "x0", n).copy()
        F, H = check_matrix(F, "F", (n, n)).copy(), check_matrix(H, "H", (m, n)).copy()
        self.matrices = Matrices(F, H, check_covariance(Q, "Q", n), check_covariance(R, "R", m))
        self._start(self.x, self.matrices.R)
        self.P = np.repeat(check_covariance(P0, "P0", n)[..., None], self.runs, axis=2)

    @property
    def estimate(self):
        """The state, shape (n, M)."""
        return self.x

    @property
    def estimate_P(self):
        """Its covariance, shape (n, n, M)."""
        return self.P

    def predict(self):
        """Predict all runs."""
        self.x, self.P = self.matrices.predict(self.x, self.P)
        self._steps = self._steps + 1

    def _update(self, z, R):
        self.x, self.P, self.y, self.S, self.K = self.matrices.correct(self.x, self.P, z, R)
        self._steps = 0 * self._steps

    def _no_measurement(self):
        super()._no_measurement()
        self.K = np.zeros((len(self.x), 0, self.runs))

"""Where an emitter is, and how fast it sails, from all range differences of a while at once: weighted least squares over M runs, paper 4, section 3.1."""

from typing import NamedTuple

import numpy as np

from trackhelpers.arrays import check_array, check_covariance, cholesky, inverse, matvec
from trackhelpers.charts import check_chart
from trackhelpers.checks import check_count, check_number, check_numbers
from trackhelpers.sensors.tdoa import check_stations, differences_and_gradients

_BLOCK = 16384  # differences at a time of the searches that go side by side, which fit into the processor's cache
_QUIET = {"over": "ignore", "invalid": "ignore", "divide": "ignore"}


class BatchFix(NamedTuple):
    """x (n, ...) the estimate at the time t0, P (n, n, ...) its covariance to first order, cost (...) the weighted sum of squared residuals; NaN in a run without."""

    x: np.ndarray
    P: np.ndarray
    cost: np.ndarray


def batch_fix(z, t, satellites, R, chart, x0, t0=0.0, there=None, iterations=100):
    """The position, or position and velocity, that fits range differences best.

    Minimises Σ yᵀ R⁻¹ y, where y are the residuals of what was measured and R the part of the covariance that belongs to it, by the method of Levenberg and
    Marquardt: a step of Gauss and Newton, shortened in the runs where it would not make the sum smaller.

    Parameters
    ----------
    z : array_like, shape (2, N) or (2, N, M)
        Range differences at N times, of one run or of M.
    t : array_like, shape (N,)
        s.
    satellites : array_like, shape (3, 3, N)
    R : array_like, shape (2, 2)
        Covariance of a pair, m².
    chart : trackhelpers.charts.Chart
    x0 : array_like, shape (n,) or (n, M)
        Where the search begins: (x, y) in the chart for an emitter that stands still, (x, y, vx, vy) for one that moves with constant velocity in the chart.
    t0 : float
        The time of x and of the estimate, s.
    there : array_like of bool, shape (2, N) or (2, N, M), optional
        Which differences there are; by default those that are finite.
    iterations : int
        At most so many.

    Returns
    -------
    BatchFix

    Raises
    ------
    ValueError
        Shapes that do not fit; for one run also fewer differences than unknowns, a search that ends nowhere, and unknowns that the differences do not tell.
    """
    iterations = check_count(iterations, "iterations")
    problem, x = _checked(z, t, satellites, R, check_chart(chart), x0, check_number(t0, "t0"), there)
    one = np.ndim(z) == 2
    n, M = x.shape
    best, P, final = np.full((n, M), np.nan), np.full((n, n, M), np.nan), np.full(M, np.nan)
    enough = problem.there.sum(axis=(0, 1)) >= n
    if one and not enough[0]:
        raise ValueError(f"z: expected at least {n} range differences, got {problem.there.sum()}")
    start, runs = x, np.flatnonzero(enough)
    with np.errstate(**_QUIET):
        for some in np.array_split(runs, max(1, len(runs) * problem.there.shape[1] // _BLOCK)):
            _search(problem, start[:, some], some, iterations, best, P, final)
    lost = ~np.isfinite(P).all(axis=(0, 1))
    best[:, lost] = np.nan
    if not one:
        return BatchFix(best, P, final)
    if lost[0]:
        raise ValueError(
            f"x0: the search from {np.asarray(x0)} ends nowhere, expected a start from which it comes to a minimum that the range differences tell"
        )
    return BatchFix(best[:, 0], P[..., 0], final[0])


def _search(problem, x, runs, iterations, best, P, final):
    """Write the minima of the runs, begun at x (n, M'), with their covariances and sums into best, P, final of all M."""
    damping = np.full(len(runs), 1e-3)
    cost, A, g = problem.normal_equations(x, runs)
    for _ in range(iterations):
        if not len(runs):
            break
        scale = np.sqrt(np.einsum("iim->im", A))
        C, slope = A / scale[:, None] / scale, g / scale
        damped = C + damping * np.eye(len(x))[..., None]
        step = matvec(inverse(damped), slope)
        gain = np.sum(step * slope, axis=0)  # twice what the step would win in the sum if all were linear, at least
        other = x + step / scale
        new, A_new, g_new = problem.normal_equations(other, runs)
        better = new <= cost + 1e-9 * (1 + cost)
        x, cost = np.where(better, other, x), np.where(better, new, cost)
        A, g = np.where(better, A_new, A), np.where(better, g_new, g)
        done = better & (gain < 1e-8) & (damping < 1e-2)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-14, 1e8)
        if done.any():
            found = runs[done]
            best[:, found], P[..., found], final[found] = x[:, done], _inverse(A[..., done]), cost[done]
            keep = ~done
            x, cost, A, g, damping, runs = x[:, keep], cost[keep], A[..., keep], g[:, keep], damping[keep], runs[keep]


class _Problem:
    """What is measured, and its normal equations."""

    def __init__(self, z, lag, satellites, R, chart, there):
        self.z, self.lag, self.satellites, self.chart, self.there = (
            np.where(there, z, 0.0),
            lag[:, None],
            satellites[..., None],
            chart,
            there,
        )
        W, pair = np.linalg.inv(R), there.all(axis=0)
        self.weights = [np.where(pair, W[i, i], there[i] / R[i, i]) for i in (0, 1)] + [np.where(pair, W[0, 1], 0.0)]

    def normal_equations(self, x, runs):
        """Sum of squares (M,), Σ Hᵀ W H (n, n, M) and Σ Hᵀ W y (n, M) at x (n, M) of the runs; the sum is infinite outside the chart."""
        n, lag = len(x), self.lag
        q = x[:2, None] + (lag * x[2:, None] if n == 4 else np.zeros((2, len(lag), 1)))
        p = self.chart.position(q)
        d, slopes = differences_and_gradients(p, self.satellites)
        y1, y2 = self.z[..., runs] - d
        H = np.einsum("ik...,kj...->ij...", slopes, self.chart.jacobian(q))
        w1, w2, w12 = (w[:, runs] for w in self.weights)
        v1, v2 = w1 * y1 + w12 * y2, w12 * y1 + w2 * y2
        cost = np.sum(y1 * v1 + y2 * v2, axis=0)
        g = H[0] * v1 + H[1] * v2
        G = np.stack(
            [
                np.stack([(w1 * H[0, i] + w12 * H[1, i]) * H[0, j] + (w12 * H[0, i] + w2 * H[1, i]) * H[1, j] for j in (0, 1)])
                for i in (0, 1)
            ]
        )
        powers = [np.ones_like(lag)] if n == 2 else [np.ones_like(lag), lag]
        A = np.concatenate([np.concatenate([np.sum(a * b * G, axis=2) for b in powers], axis=1) for a in powers])
        return np.where(np.isfinite(cost), cost, np.inf), A, np.concatenate([np.sum(a * g, axis=1) for a in powers])


def _inverse(A):
    """Inverse of A (n, n, M), NaN where its correlations are singular to rounding."""
    scale = np.sqrt(np.einsum("iim->im", A))
    C = A / scale[:, None] / scale
    L = cholesky(C)
    lost = np.einsum("iim->im", L).min(axis=0) < 1e-7
    return np.where(lost, np.nan, inverse(C)) / scale[:, None] / scale


def _checked(z, t, satellites, R, chart, x0, t0, there):
    z = check_numbers(z, "z")
    if z.ndim not in (2, 3) or z.shape[0] != 2:
        raise ValueError(f"z: expected shape (2, N) or (2, N, M), got {z.shape}")
    there = np.isfinite(z) if there is None else np.asarray(there)
    if there.dtype != bool or there.shape != z.shape:
        raise ValueError(f"there: expected booleans of shape {z.shape}, got {there.dtype} of shape {there.shape}")
    if not np.isfinite(z[there]).all():
        raise ValueError("z: expected finite range differences where there says that there are some")
    N, M = z.shape[1], 1 if z.ndim == 2 else z.shape[2]
    t, s = check_array(t, "t", N, ()), check_stations(satellites, "satellites")
    if s.shape != (3, 3, N):
        raise ValueError(f"satellites: expected shape (3, 3, {N}), got {s.shape}")
    x0 = check_array(x0, "x0", None)
    if x0.shape not in ((2,), (4,), (2, M), (4, M)) or (z.ndim == 2 and x0.ndim == 2):
        raise ValueError(f"x0: expected shape (2,) or (4,){'' if z.ndim == 2 else f' or with the axis {M}'}, got {x0.shape}")
    x = np.broadcast_to(x0.reshape(len(x0), -1), (len(x0), M)).copy()
    z, there = z.reshape(2, N, M), there.reshape(2, N, M)
    return _Problem(z, t - t0, s, check_covariance(R, "R", 2, definite=True), chart, there), x

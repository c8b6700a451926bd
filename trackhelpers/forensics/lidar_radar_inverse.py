"""The noise behind the filter columns of Tables 7 and 8: which errors of the first eight measurements make a given filter print them?

An error of the measurements at k = 1, …, 8 is sought that is as small as it can be and brings all 24 printed cells back. Where no such error exists,
however large, the program that printed the tables was another filter.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from trackhelpers.arrays import check_scale
from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.forensics.lidar_radar_truth import half_units, printed_estimates
from trackhelpers.scenarios.thesis.lidar_radar import components, estimates, measure, measure_displaced, start

ROWS = slice(2, 8)  # of the samples, those that Tables 7 and 8 print: k = 3, …, 8
SAMPLES = 8
ROUNDING = 1 / np.sqrt(3)  # standard deviation of a uniform rounding error, in half units of the last digit
STEP = 1e-6  # of the differences that give the Jacobian, in units of the noise
EVALUATIONS = 60  # of the filter, after which a search that has not settled is given up where it stands


class Fit(NamedTuple):
    """The smallest noise under which a filter comes closest to the printed cells."""

    noise: np.ndarray  # (8, c): in units of the σ supposed
    deviation: np.ndarray  # (8, c): its posterior standard deviation, in the same units
    misfit: np.ndarray  # (6, 4): filter minus printed, in half units of the last digit; ≤ 1 rounds to what is printed
    x: np.ndarray  # (4, 8): x, y, v_x, v_y of the filter

    @property
    def largest(self):
        """Largest misfit of a cell, in half units."""
        return np.max(np.abs(self.misfit))

    @property
    def root_mean_square(self):
        """Root mean square of the misfits, in half units; pure rounding would give 0.58 before anything is fitted."""
        return np.sqrt(np.mean(self.misfit**2))


def displaced_by(sigma, radar=None):
    """Measurements with one error of the position for both sensors, standard deviation `sigma` (m): a function of noise (8, 2, M)."""
    sigma = check_scale(sigma, "sigma")

    def zs(noise):
        return measure_displaced(sigma * noise, radar=radar)

    zs.width = 2
    return zs


def noisy_components(lidar=None, radar=None):
    """Measurements with an error of each component, of the sensors' σ: a function of noise (8, 3, M)."""

    def zs(noise):
        return measure(noise, lidar, radar)

    zs.width = 3
    return zs


def fit_noise(measurements, filter=EnsembleEKF, model=None, P0=None, lidar=None, radar=None, reuse_first=True):
    """Find the most probable noise of the first eight measurements, given the printed filter columns.

    Minimises Σ(noise)² + Σ(misfit / `ROUNDING`)² by Gauss and Newton's method; the columns of the Jacobian are runs of one ensemble.

    Parameters
    ----------
    measurements : callable
        `displaced_by` or `noisy_components`: what the noise does.
    filter, model, P0, lidar, radar, reuse_first
        The filter that is supposed, as for `lidar_radar.start` and `lidar_radar.steps`; the sensors are the filter's.

    Returns
    -------
    Fit
    """
    printed = printed_estimates()
    value, half = printed.to_numpy(dtype=float), half_units(printed)
    shape = (SAMPLES, measurements.width)
    size = SAMPLES * measurements.width

    def tracked(noise):
        zs = measurements(noise.reshape(*shape, -1))
        return components(estimates(start(filter, zs[0], model, P0), zs, lidar, radar, reuse_first))

    def misfits(noise):
        return (np.moveaxis(tracked(noise)[:, ROWS], 0, 1) - value[..., None]) / half[..., None]

    def residual(noise):
        return np.concatenate([misfits(noise[:, None]).ravel() / ROUNDING, noise])

    def jacobian(noise):
        moved = misfits(np.column_stack([noise, noise[:, None] + STEP * np.eye(size)])).reshape(value.size, -1)
        return np.concatenate([(moved[:, 1:] - moved[:, :1]) / STEP / ROUNDING, np.eye(size)])

    solution = least_squares(residual, np.zeros(size), jacobian, method="lm", max_nfev=EVALUATIONS).x
    J = jacobian(solution)
    deviation = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    return Fit(solution.reshape(shape), deviation.reshape(shape), misfits(solution[:, None])[..., 0], tracked(solution[:, None])[..., 0])

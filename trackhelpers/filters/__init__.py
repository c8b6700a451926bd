"""Filters: thin subclasses of filterpy's, one target at a time, to be read and stepped through."""

from trackhelpers.filters.augmented_bias import READINGS, AugmentedBiasKF, augmented_matrices
from trackhelpers.filters.factors import cholupdate
from trackhelpers.filters.imm import ManoeuvreIMM
from trackhelpers.filters.input_estimation import InputEstimationKF
from trackhelpers.filters.matrix_filter import MatrixKF
from trackhelpers.filters.motion_ekf import MotionEKF
from trackhelpers.filters.motion_imm import MotionIMM
from trackhelpers.filters.motion_kf import MotionKF
from trackhelpers.filters.motion_square_root_ukf import MotionSquareRootUKF
from trackhelpers.filters.motion_ukf import MotionUKF
from trackhelpers.filters.square_root_ukf import SquareRootUKF
from trackhelpers.filters.strong_tracking import StrongTrackingKF
from trackhelpers.filters.variable_dimension import VariableDimensionKF
from trackhelpers.filters.variance_inflation import VarianceInflationKF

__all__ = [
    "READINGS",
    "AugmentedBiasKF",
    "InputEstimationKF",
    "ManoeuvreIMM",
    "MatrixKF",
    "MotionEKF",
    "MotionIMM",
    "MotionKF",
    "MotionSquareRootUKF",
    "MotionUKF",
    "SquareRootUKF",
    "StrongTrackingKF",
    "VariableDimensionKF",
    "VarianceInflationKF",
    "augmented_matrices",
    "cholupdate",
]

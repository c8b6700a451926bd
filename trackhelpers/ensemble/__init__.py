"""The same models and sensors over thousands of Monte Carlo runs at once, runs on the last axis."""

from trackhelpers.ensemble.filters import EnsembleEKF, EnsembleUKF
from trackhelpers.ensemble.linear import EnsembleKF
from trackhelpers.ensemble.montecarlo import monte_carlo, standard_normal
from trackhelpers.exact import exact_error

__all__ = ["EnsembleEKF", "EnsembleKF", "EnsembleUKF", "exact_error", "monte_carlo", "standard_normal"]

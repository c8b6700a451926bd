"""Sensors: the measurement h, its Jacobian H, the noise covariance R, and the residual that knows which components are angles.

A sensor learns the layout of the state from the names of the model, ``Radar(sigma, state=model.state)``; without them it takes CTRV's.
"""

from trackhelpers.sensors.base import CTRV_STATE, Sensor
from trackhelpers.sensors.fdoa import FDOA
from trackhelpers.sensors.linear import Lidar, LinearSensor, Position
from trackhelpers.sensors.polar import Radar, RangeBearing
from trackhelpers.sensors.tdoa import TDOA, difference_gradients, range_differences

__all__ = [
    "CTRV_STATE",
    "FDOA",
    "TDOA",
    "Lidar",
    "LinearSensor",
    "Position",
    "Radar",
    "RangeBearing",
    "Sensor",
    "difference_gradients",
    "range_differences",
]

"""Filters: thin subclasses of filterpy's, one target at a time, to be read and stepped through."""

from trackhelpers.filters.motion import MotionEKF, MotionKF, MotionUKF

__all__ = ["MotionEKF", "MotionKF", "MotionUKF"]

"""Stone Soup: its extended predictor and updater on CTRV, which it does not have, written as a model of its own kind."""

import datetime

import numpy as np

from benchmarks.peers import ctrv
from benchmarks.peers.loops import one_by_one

START = datetime.datetime(2000, 1, 1)


def stone_soup_ekf(problem):
    """Stone Soup's ExtendedKalmanPredictor and ExtendedKalmanUpdater in Joseph's form, NEES by a solve."""
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.angle import Bearing
    from stonesoup.types.array import StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    predictor = ExtendedKalmanPredictor(_ctrv_model(problem.model.sigmas))
    updater = ExtendedKalmanUpdater(None, use_joseph_cov=True)
    radar, lidar = _measurement_models(*problem.sensors)
    times = [START + datetime.timedelta(seconds=problem.T * k) for k in range(problem.steps + 1)]
    detections = [
        [
            Detection(
                StateVector(z[:, i]) if problem.sensor(k).m == 2 else StateVector([z[0, i], Bearing(z[1, i]), z[2, i]]),
                timestamp=times[k + 1],
                measurement_model=lidar if problem.sensor(k).m == 2 else radar,
            )
            for k, z in enumerate(problem.zs)
        ]
        for i in range(problem.runs)
    ]

    class Track:
        """What `one_by_one` reads: x and P of the latest state."""

        def __init__(self, i):
            self.state = GaussianState(StateVector(problem.x0[:, i]), problem.P0, timestamp=START)

        @property
        def x(self):
            return np.asarray(self.state.state_vector, dtype=float)[:, 0]

        @property
        def P(self):
            return np.asarray(self.state.covar, dtype=float)

    def step(track, k, i):
        prediction = predictor.predict(track.state, timestamp=times[k + 1], heading=float(track.state.state_vector[3]))
        track.state = updater.update(SingleHypothesis(prediction, detections[i][k]))

    return lambda: one_by_one(problem, Track, step, with_nees=True)


def _ctrv_model(sigmas):
    from stonesoup.models.transition.nonlinear import GaussianTransitionModel
    from stonesoup.types.array import CovarianceMatrix, StateVector

    class CTRV(GaussianTransitionModel):
        ndim_state = 5

        def function(self, state, noise=False, time_interval=None, **kwargs):
            return StateVector(ctrv.transition(np.asarray(state.state_vector)[:, 0], time_interval.total_seconds()))

        def jacobian(self, state, time_interval=None, **kwargs):
            return ctrv.jacobian(np.asarray(state.state_vector)[:, 0], time_interval.total_seconds())

        def covar(self, time_interval=None, heading=None, **kwargs):
            # Stone Soup does not hand the state to the noise, but it does hand on what `predict` was given by name
            return CovarianceMatrix(ctrv.noise(heading, time_interval.total_seconds(), sigmas))

    return CTRV()


def _measurement_models(radar, lidar):
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
    from stonesoup.types.angle import Bearing
    from stonesoup.types.array import StateVector

    class RangeBearingRate(NonLinearGaussianMeasurement):
        ndim_meas = 3

        def function(self, state, noise=False, **kwargs):
            rho, bearing, rate = ctrv.radar(np.asarray(state.state_vector)[:, 0])
            return StateVector([rho, Bearing(bearing), rate])

        def jacobian(self, state, **kwargs):
            return ctrv.radar_jacobian(np.asarray(state.state_vector)[:, 0])

    return (
        RangeBearingRate(ndim_state=5, mapping=(0, 1), noise_covar=radar.R),
        LinearGaussian(ndim_state=5, mapping=(0, 1), noise_covar=lidar.R),
    )

"""simdkalman: many linear filters in NumPy arrays, runs on the first axis."""

import numpy as np


def simd_kalman(problem):
    """simdkalman's compute, filtering alone."""
    import simdkalman

    model, x, P = problem.model, problem.x0, problem.P0
    (sensor,) = problem.sensors
    F, Q = model.F(x[:, 0], problem.T), model.Q(x[:, 0], problem.T)
    kf = simdkalman.KalmanFilter(F, Q, sensor.H(x[:, 0]), sensor.R)
    data = np.stack([z.T for z in problem.zs], axis=1)
    first = (F @ x).T[..., None]  # it starts at the first measurement

    def run():
        states = kf.compute(
            data,
            n_test=0,
            initial_value=first,
            initial_covariance=F @ P @ F.T + Q,
            smoothed=False,
            filtered=True,
            observations=False,
        ).filtered.states
        return {"x": states.mean[:, -1].T, "P": np.moveaxis(states.cov[:, -1], 0, -1)}

    return run

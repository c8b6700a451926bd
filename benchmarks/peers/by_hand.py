"""filterpy's classes as its users drive them."""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, IMMEstimator, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from benchmarks.peers import ctrv
from benchmarks.peers.loops import one_by_one
from benchmarks.workloads import QUIET


class _ByHand(ExtendedKalmanFilter):
    def predict_x(self, u=0):
        self.x = ctrv.transition(self.x, self.T)


def filterpy_ekf(problem, with_nees=True):
    """filterpy's ExtendedKalmanFilter, NEES by a solve."""
    T, sigmas, (radar, lidar) = problem.T, problem.model.sigmas, problem.sensors

    def start(i):
        kf = _ByHand(dim_x=5, dim_z=2)
        kf.x, kf.P, kf.T = problem.x0[:, i], problem.P0, T
        return kf

    def step(kf, k, i):
        kf.F, kf.Q = ctrv.jacobian(kf.x, T), ctrv.noise(float(kf.x[3]), T, sigmas)
        kf.predict()
        z = problem.zs[k][:, i]
        if problem.sensor(k) is radar:
            kf.update(z, ctrv.radar_jacobian, ctrv.radar, R=radar.R, residual=ctrv.radar_residual)
        else:
            kf.update(z, ctrv.lidar_jacobian, ctrv.lidar, R=lidar.R)
        kf.x[3] = ctrv.wrap(kf.x[3])

    return lambda: one_by_one(problem, start, step, with_nees)


def filterpy_kf(problem):
    """filterpy's KalmanFilter."""
    F, Q = problem.model.F(problem.x0[:, 0], problem.T), problem.model.Q(problem.x0[:, 0], problem.T)
    (sensor,) = problem.sensors
    H = sensor.H(problem.x0[:, 0])

    def start(i):
        kf = KalmanFilter(dim_x=len(F), dim_z=len(H))
        kf.x, kf.P, kf.F, kf.Q, kf.H, kf.R = problem.x0[:, i], problem.P0, F, Q, H, sensor.R
        return kf

    def step(kf, k, i):
        kf.predict()
        kf.update(problem.zs[k][:, i])

    return lambda: one_by_one(problem, start, step)


def filterpy_ukf(problem, redrawn=False):
    """filterpy's UnscentedKalmanFilter, means and differences of angles by hand.

    Where `redrawn`, sigma points are drawn anew before every update, for more than one sensor may follow a prediction, and filterpy's `subtract` and
    `state_add` wrap the heading of every point and of the corrected state; else it is wrapped once a step.
    """
    T, sigmas, (radar, lidar) = problem.T, problem.model.sigmas, problem.sensors

    def mean_about_the_first(points, Wm, angle):
        average = Wm @ points
        average[angle] = ctrv.wrap(points[0, angle] + Wm @ ctrv.wrap(points[:, angle] - points[0, angle]))
        return average

    def state_residual(a, b):
        difference = a - b
        difference[3] = ctrv.wrap(difference[3])
        return difference

    def wrapped_sum(x, dx):
        total = x + dx
        total[3] = ctrv.wrap(total[3])
        return total

    def start(i):
        kf = UnscentedKalmanFilter(
            dim_x=5,
            dim_z=3,
            dt=T,
            hx=None,
            fx=ctrv.transition,
            points=MerweScaledSigmaPoints(5, alpha=1.0, beta=2.0, kappa=0.0, subtract=state_residual if redrawn else None),
            x_mean_fn=lambda points, Wm: mean_about_the_first(points, Wm, 3),
            residual_x=state_residual,
            state_add=wrapped_sum if redrawn else None,
        )
        kf.x, kf.P = problem.x0[:, i], problem.P0
        return kf

    def step(kf, k, i):
        kf.Q = ctrv.noise(float(kf.x[3]), T, sigmas)
        kf.predict()
        if redrawn:
            kf.sigmas_f = kf.points_fn.sigma_points(kf.x, kf.P)
        if problem.sensor(k) is radar:
            kf.z_mean, kf.residual_z = lambda points, Wm: mean_about_the_first(points, Wm, 1), ctrv.radar_residual
            kf.update(problem.zs[k][:, i], R=radar.R, hx=ctrv.radar)
        else:
            kf.z_mean, kf.residual_z = None, np.subtract
            kf.update(problem.zs[k][:, i], R=lidar.R, hx=ctrv.lidar)
        if not redrawn:
            kf.x[3] = ctrv.wrap(kf.x[3])

    return lambda: one_by_one(problem, start, step)


def filterpy_imm(problem):
    """filterpy's IMMEstimator on two of its KalmanFilters, the quiet one written in the state of the other."""
    (sensor,), model, T = problem.sensors, problem.model, problem.T
    E = np.array([[float(a == b) for b in QUIET.state] for a in model.state])
    still, nought, H = np.zeros(QUIET.n), np.zeros(model.n), sensor.H(problem.x0[:, 0])
    pair = [(E @ QUIET.F(still, T) @ E.T, E @ QUIET.Q(still, T) @ E.T), (model.F(nought, T), model.Q(nought, T))]
    transition = np.array([[0.98, 0.02], [0.02, 0.98]])

    def start(i):
        filters = [KalmanFilter(dim_x=len(nought), dim_z=len(H)) for _ in pair]
        for kf, (F, Q) in zip(filters, pair, strict=True):
            kf.x, kf.P, kf.F, kf.Q, kf.H, kf.R = problem.x0[:, i], problem.P0, F, Q, H, sensor.R
        return IMMEstimator(filters, (0.9, 0.1), transition)

    def step(kf, k, i):
        kf.predict()
        kf.update(problem.zs[k][:, i])

    return lambda: one_by_one(problem, start, step)

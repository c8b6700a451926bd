"""Exact error statistics of a linear filter on a fixed track: what Monte Carlo would converge to."""

import numpy as np

from trackhelpers.arrays import check_covariance


def exact_error(model, sensor, truth, dt, x0, P0, error0=None):
    """Bias and covariance of a linear filter's error along a fixed track, by recursion instead of sampling.

    The filter's gain K_k does not depend on the data. With the filter's own F, Q, H, R and the true track x_k its error e = x̂ − x obeys
    e_k = (I − K_k H)(F e_{k−1} + F x_{k−1} − x_k) + K_k v_k: the mean carries what the model gets wrong, the covariance carries the noise v alone.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        Linear model of the filter.
    sensor : trackhelpers.sensors.Sensor
        Linear sensor; its R is the filter's and the truth's.
    truth : array_like, shape (n, N)
        True state at steps 0 … N−1, the filter starting at step 0 and measuring from step 1 on.
    dt : float
        Step, s.
    x0 : array_like, shape (n,)
        Mean of the filter's first estimate.
    P0 : array_like, shape (n, n)
        Covariance that the filter is told.
    error0 : array_like, shape (n, n), optional
        True covariance of the first estimate's error; default 0, a start that is the same in every run.

    Returns
    -------
    bias : numpy.ndarray, shape (n, N)
    covariance : numpy.ndarray, shape (n, n, N)
        True mean and covariance of the error.
    believed : numpy.ndarray, shape (n, n, N)
        The filter's own P.
    """
    if not (model.linear and sensor.linear):
        raise ValueError("model, sensor: expected linear ones, for which the gain does not depend on the data")
    truth = np.asarray(truth, dtype=float)
    n = model.n
    if truth.ndim != 2 or len(truth) != n:
        raise ValueError(f"truth: expected shape ({n}, N), got {truth.shape}")
    reference = np.zeros(n)
    F, Q, H, R = model.F(reference, dt), model.Q(reference, dt), sensor.H(reference), sensor.R
    P = check_covariance(P0, "P0", n)
    C = np.zeros((n, n)) if error0 is None else check_covariance(error0, "error0", n)
    e = np.asarray(x0, dtype=float) - truth[:, 0]
    bias, covariance, believed = [e], [C], [P]
    for k in range(1, truth.shape[1]):
        P = F @ P @ F.T + Q
        K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
        A = np.eye(n) - K @ H
        P = A @ P @ A.T + K @ R @ K.T
        e = A @ (F @ e + F @ truth[:, k - 1] - truth[:, k])
        C = A @ F @ C @ F.T @ A.T + K @ R @ K.T
        bias.append(e)
        covariance.append(C)
        believed.append(P)
    return np.stack(bias, axis=-1), np.stack(covariance, axis=-1), np.stack(believed, axis=-1)

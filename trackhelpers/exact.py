"""Linear filters without sampling: gains, mean and covariance of the error, the steady state, and two closed forms.

The gain of a linear filter does not depend on the data, so everything here is a recursion over matrices. Step k leads from k − 1 to k and ends with the measurement at k; results over
N steps carry them on the last axis. A matrix that changes from step to step is given as a list of N matrices, or as an array with the steps last.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from trackhelpers.arrays import check_array, check_covariance, check_matrix, symmetrised
from trackhelpers.by_step import check_by_step, check_finite, check_size, check_system
from trackhelpers.checks import check_count, check_number, check_numbers, check_positive
from trackhelpers.model import check_model


class Gains(NamedTuple):
    """What a Kalman filter knows before it sees any data, over N steps; in the steady state without the last axis."""

    prior: np.ndarray  # (n, n, N) P⁻
    S: np.ndarray  # (m, m, N) H P⁻ Hᵀ + R
    K: np.ndarray  # (n, m, N)
    A: np.ndarray  # (n, n, N) I − K H, what a measurement leaves of the error before it
    P: np.ndarray  # (n, n, N + 1) posterior covariance, P0 the first


def gain(P, H, R):
    """S = H P Hᵀ + R, K = P Hᵀ S⁻¹ and I − K H of one measurement, for the predicted covariance P (n, n); ValueError unless S is positive definite."""
    P = check_covariance(P, "P", len(check_array(P, "P", None)))
    H = check_matrix(H, "H", (None, len(P)))
    return _gain(P, H, check_covariance(R, "R", len(H)))


def _gain(P, H, R):
    S = symmetrised(H @ P @ H.T) + R  # inverted by its Cholesky root, which also tells whether it is positive definite
    try:
        root = np.linalg.inv(np.linalg.cholesky(S))
    except np.linalg.LinAlgError:
        raise ValueError(f"R: expected H P⁻ Hᵀ + R to be positive definite, got {S.tolist()}") from None
    K = P @ H.T @ (root.T @ root)
    return S, K, np.eye(len(P)) - K @ H


def gains(F, H, Q, R, P0, steps, joseph=True):
    """Gains and believed covariances of a Kalman filter.

    Parameters
    ----------
    F, H, Q, R : array_like, shapes (n, n), (m, n), (n, n), (m, m)
        Constant, or one a step.
    P0 : array_like, shape (n, n)
        Posterior covariance before the first step.
    steps : int
        Number N of steps, ≥ 0.
    joseph : bool
        False takes P = (I − K H) P⁻, which round-off can make indefinite.

    Returns
    -------
    Gains

    Raises
    ------
    ValueError
        For shapes that do not fit, numbers that are not finite, a Q, R or P0 that is no covariance, and a singular H P⁻ Hᵀ + R.
    """
    steps = check_count(steps, "steps", 0)
    F, H, Q, R = check_system(F, H, Q, R, steps)
    n, m = F.shape[1], R.shape[1]
    prior, S, K, A, P = (np.empty((steps, *shape)) for shape in ((n, n), (m, m), (n, m), (n, n), (n, n)))
    P = np.concatenate([check_covariance(P0, "P0", n)[None], P])
    constant = not any(matrix.strides[0] for matrix in (F, H, Q, R))
    for k in range(steps):
        prior[k] = symmetrised(F[k] @ P[k] @ F[k].T) + Q[k]
        S[k], K[k], A[k] = _gain(prior[k], H[k], R[k])
        P[k + 1] = symmetrised(A[k] @ prior[k] @ A[k].T + K[k] @ R[k] @ K[k].T if joseph else A[k] @ prior[k])
        if constant and (P[k + 1] == P[k]).all():  # settled to the last bit: all later steps are this one
            for found in (prior, S, K, A, P):
                found[k + 1 :] = found[k]
            break
    return Gains(*(np.moveaxis(a, 0, -1) for a in (prior, S, K, A, P)))


def errors(F, A, K, R, d=None, Q=None, bias0=None, covariance0=None):
    """Mean and covariance of the error x̂ − x of a linear filter with given gains, right or wrong, on a target that moves as it likes.

    With true steps x_k = F x_{k−1} + d_k + w_k the error obeys e_k = A_k (F e_{k−1} − d_k − w_k) + K_k v_k, A = I − K H: the mean carries what the model gets wrong, the
    covariance the noise. Several filters of one target are one: their errors stacked, A block by block, K the gains of all on the measurements of all.

    Parameters
    ----------
    F : array_like, shape (n, n)
        Constant, or one a step.
    A, K : array_like, shapes (n, n, N), (n, m, N)
        As `gains` returns them.
    R : array_like, shape (m, m)
        True covariance of the measurement noise v, constant or one a step.
    d : array_like, shape (n, N), optional
        Default 0: a target that moves as the model says.
    Q : array_like, shape (n, n), optional
        *True* covariance of w, constant or one a step; default 0, a fixed track.
    bias0, covariance0 : array_like, shapes (n,), (n, n), optional
        Of the error before the first step; default 0.

    Returns
    -------
    bias : numpy.ndarray, shape (n, N + 1)
    covariance : numpy.ndarray, shape (n, n, N + 1)

    Raises
    ------
    ValueError
        For shapes that do not fit, numbers that are not finite, and an R, Q or covariance0 that is no covariance.
    """
    K = K if isinstance(K, (list, tuple)) else check_numbers(K, "K")
    if check_numbers(K, "K").ndim != 3:
        raise ValueError(f"K: expected shape (n, m, N), a gain for each step, got {np.shape(K)}")
    n, m, steps = np.shape(K)
    A, K, F = check_by_step(A, "A", (n, n), steps), check_by_step(K, "K", (n, m), steps), check_by_step(F, "F", (n, n), steps)
    R = check_by_step(R, "R", (m, m), steps, covariance=True)
    Q = check_by_step(np.zeros((n, n)) if Q is None else Q, "Q", (n, n), steps, covariance=True)
    d = check_finite(np.zeros((n, steps)) if d is None else check_array(d, "d", n, (steps,)), "d")
    bias, C = np.zeros((steps + 1, n)), np.zeros((steps + 1, n, n))
    if bias0 is not None:
        bias[0] = check_array(bias0, "bias0", n, ())
    if covariance0 is not None:
        C[0] = check_covariance(covariance0, "covariance0", n)
    loop, pushes = A @ F, (A @ d.T[..., None])[..., 0]  # what does not hang on the step before, at once
    noise = A @ Q @ np.swapaxes(A, 1, 2) + K @ R @ np.swapaxes(K, 1, 2)
    for k, M in enumerate(loop):
        bias[k + 1] = M.dot(bias[k]) - pushes[k]
        C[k + 1] = M.dot(C[k]).dot(M.T) + noise[k]
    return bias.T, np.moveaxis(C, 0, -1)


def exact_error(model, sensor, truth, dt, x0, P0, error0=None):
    """Bias and covariance of a linear filter's error along a fixed track: what Monte Carlo would converge to.

    Parameters
    ----------
    model : trackhelpers.motion.Model
        Linear model of the filter.
    sensor : trackhelpers.sensors.Sensor
        Linear sensor made for the model's state; its R is the filter's and the truth's.
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

    Raises
    ------
    ValueError
        For a model or a sensor that is not linear, a sensor of another layout, shapes that do not fit, numbers that are not finite, and a Q, R, P0 or error0 that is no covariance.
    """
    check_model(model)
    for name, value in (("model", model), ("sensor", sensor)):
        if not getattr(value, "linear", False):
            raise ValueError(f"{name}: expected a linear one, for which the gain does not depend on the data, got {value!r}")
    if tuple(sensor.state) != tuple(model.state):
        raise ValueError(f"sensor: expected one made for the state {tuple(model.state)}, got one for {tuple(sensor.state)}")
    truth = check_finite(check_array(truth, "truth", model.n), "truth")
    if truth.ndim != 2 or truth.shape[1] == 0:
        raise ValueError(f"truth: expected shape ({model.n}, N) with N ≥ 1, got {truth.shape}")
    start = check_array(x0, "x0", model.n, ()) - truth[:, 0]
    error0 = None if error0 is None else check_covariance(error0, "error0", model.n)
    nought = np.zeros(model.n)
    F = model.F(nought, dt)
    known = gains(F, sensor.H(nought), model.Q(nought, dt), sensor.R, P0, truth.shape[1] - 1)
    return *errors(F, known.A, known.K, sensor.R, truth[:, 1:] - F @ truth[:, :-1], None, start, error0), known.P


def steady_state(F, H, Q, R):
    """Where `gains` settles, from every start, if it does: the discrete algebraic Riccati equation.

    Parameters
    ----------
    F, H, Q, R : array_like, shapes (n, n), (m, n), (n, n), (m, m)
        R positive definite.

    Returns
    -------
    Gains
        Without the last axis.

    Raises
    ------
    ValueError
        As for `gains`, and where there is no steady state or the equation is too ill-conditioned to be solved.
    """
    F, H, Q, R = (matrix[0] for matrix in check_system(F, H, Q, R, 1))
    check_covariance(R, "R", len(R), definite=True)
    try:
        prior = solve_discrete_are(F.T, H.T, Q, R)
        S, K, A = _gain(prior, H, R)
        P = symmetrised(A @ prior @ A.T + K @ R @ K.T)
        settled = np.abs(F @ P @ F.T + Q - prior).max() <= 1e-6 * np.abs(prior).max()
    except np.linalg.LinAlgError:
        settled = False
    if not settled:
        raise ValueError(
            f"F, H, Q, R: expected a Riccati equation with a steady state, well conditioned, got F = {F.tolist()}, Q = {Q.tolist()}"
        )
    return Gains(prior, S, K, A, P)


def steady_errors(F, A, K, R, d=None, Q=None):
    """Where `errors` settles under constant matrices: mean (n,) and covariance (n, n), the latter by a Lyapunov equation.

    Parameters are those of `errors` without the axis of the steps, d of shape (n,). ValueError where A F does not damp every error.
    """
    n, m = check_size(F, "F"), check_size(R, "R")
    A, K, R = check_by_step(A, "A", (n, n), 1)[0], check_by_step(K, "K", (n, m), 1)[0], check_covariance(R, "R", m)
    Q = np.zeros((n, n)) if Q is None else check_covariance(Q, "Q", n)
    d = np.zeros(n) if d is None else check_array(d, "d", n, ())
    loop = A @ check_by_step(F, "F", (n, n), 1)[0]
    if (radius := np.abs(np.linalg.eigvals(loop)).max()) >= 1:
        raise ValueError(f"A, F: expected A F to damp every error, got a spectral radius of {radius:.6g}")
    return -np.linalg.solve(np.eye(n) - loop, A @ d), solve_discrete_lyapunov(loop, A @ Q @ A.T + K @ R @ K.T, method="direct")


def alpha_beta(index):
    """Steady gains of a constant-velocity filter by its tracking index Γ = σ_a T²/σ: K = [α; β/T] (Kalata 1984).

    r = (4 + Γ − √(8Γ + Γ²))/4, α = 1 − r², β = 2(2 − α) − 4√(1 − α). ValueError for an index that is no number ≥ 0.
    """
    index = check_numbers(index, "index")[()]
    if not np.all((index >= 0) & (index < np.inf)):
        raise ValueError(f"index: expected tracking indices ≥ 0, got {index}")
    r = (4 + index - np.sqrt(8 * index + index**2)) / 4
    alpha = 1 - r**2
    return alpha, 2 * (2 - alpha) - 4 * np.sqrt(1 - alpha)


def steady_lag(index, a=1.0, dt=1.0):
    """Error (position, velocity) of a settled constant-velocity filter under a constant acceleration: −(1 − α)aT²/β and −(α/β − ½)aT. ValueError for an index or a step that is not > 0."""
    if not np.all(check_numbers(index, "index") > 0):
        raise ValueError(f"index: expected tracking indices > 0, got {index!r}")
    a, dt = check_number(a, "a"), check_positive(dt, "dt", "a time step > 0, seconds as a number")
    alpha, beta = alpha_beta(index)
    return -(1 - alpha) * a * dt**2 / beta, -(alpha / beta - 0.5) * a * dt

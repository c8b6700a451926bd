"""Linear filters without sampling: against filterpy, against runs, and against each other in the limit."""

import numpy as np
import pytest

from trackhelpers.ensemble import exact_error
from trackhelpers.exact import Gains, alpha_beta, errors, gains, steady_errors, steady_lag, steady_state
from trackhelpers.filters import MatrixKF
from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import Lidar, LinearSensor, Position

F, H, R = np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[1.0, 0.2]]), np.array([[0.7]])
Q, P0 = np.array([[0.3, 0.1], [0.1, 0.2]]), np.array([[2.0, 0.3], [0.3, 1.0]])
STEPS, RUNS = 12, 40_000


def settled(index, dt=1.0, sigma=1.0):
    """The steady state of one axis with a tracking index, and its F and R."""
    G = index * sigma / dt**2 * np.array([[dt**2 / 2], [dt]])
    transition, noise = np.array([[1, dt], [0, 1]]), np.array([[sigma**2]])
    return steady_state(transition, [[1, 0]], G @ G.T, noise), transition, noise


def test_gains_are_those_of_filterpy():
    known, kf = gains(F, H, Q, R, P0, STEPS), MatrixKF(F, H, Q, R, np.zeros(2), P0)
    for k in range(STEPS):
        kf.predict()
        np.testing.assert_allclose(known.prior[..., k], kf.P, rtol=1e-12)
        kf.update([1.0])
        for found, expected in ((known.S, kf.S), (known.K, kf.K), (known.P[..., 1:], kf.P)):
            np.testing.assert_allclose(found[..., k], expected, rtol=1e-12)
        np.testing.assert_allclose(known.A[..., k], np.eye(2) - kf.K @ H, atol=1e-14)


def test_a_list_of_matrices_and_an_array_with_the_steps_last_are_one_thing_and_end_to_end_is_one_after_the_other():
    Fs, Rs = [F, F @ F, np.eye(2)], np.array([0.7, 3.0, 0.1]).reshape(1, 1, 3)
    listed, stacked = gains(Fs, H, Q, list(np.moveaxis(Rs, -1, 0)), P0, 3), gains(np.stack(Fs, axis=-1), H, Q, Rs, P0, 3)
    P = P0
    for k in range(3):
        step = gains(Fs[k], H, Q, Rs[..., k], P, 1)
        P = step.P[..., 1]
        for each in (listed, stacked):
            np.testing.assert_array_equal(each.K[..., k], step.K[..., 0])
            np.testing.assert_array_equal(each.P[..., k + 1], P)


@pytest.mark.parametrize("joseph", [True, False])
def test_gains_that_have_settled_are_those_of_the_recursion_to_its_end(joseph):
    F, H, Q, R = np.array([[1.0, 1], [0, 1]]), np.array([[1.0, 0]]), 0.01 * np.array([[0.25, 0.5], [0.5, 1]]), np.array([[3.0]])
    P0, N = np.diag([3.0, 1.0]), 400
    ends, goes_on = gains(F, H, Q, R, P0, N, joseph), gains([F] * N, H, Q, R, P0, N, joseph)
    assert np.array_equal(ends.P[..., -1], ends.P[..., -2])
    for one, other in zip(ends, goes_on, strict=True):
        np.testing.assert_array_equal(one, other)


def test_no_steps_leave_the_start():
    known = gains(F, H, Q, R, P0, 0)
    assert known.K.shape == (2, 1, 0)
    np.testing.assert_array_equal(known.P[..., 0], P0)


def test_where_the_model_is_right_the_filter_believes_the_truth():
    known = gains(F, H, Q, R, P0, STEPS)
    bias, covariance = errors(F, known.A, known.K, R, Q=Q, covariance0=P0)
    np.testing.assert_array_equal(bias, 0)
    np.testing.assert_allclose(covariance, known.P, rtol=1e-12)


def test_recursion_is_what_runs_with_wrong_gains_on_a_wrong_model_come_to():
    rng = np.random.default_rng(0)
    K, d = rng.uniform(0.2, 0.6, size=(2, 1, STEPS)), rng.normal(size=(2, STEPS))
    A = np.eye(2)[..., None] - np.einsum("ijk,jl->ilk", K, H)
    bias, covariance = errors(F, A, K, R, d, 0.5 * Q, [1.0, -2.0], P0)
    x, root = np.zeros((2, RUNS)), np.linalg.cholesky
    estimate = np.array([[1.0], [-2.0]]) + root(P0) @ rng.standard_normal((2, RUNS))
    for k in range(STEPS):
        x = F @ x + d[:, k : k + 1] + root(0.5 * Q) @ rng.standard_normal((2, RUNS))
        z = H @ x + root(R) @ rng.standard_normal((1, RUNS))
        estimate = F @ estimate + K[..., k] @ (z - H @ F @ estimate)
        e, sigma = estimate - x, np.sqrt(np.diag(covariance[..., k + 1]))
        assert np.all(np.abs(e.mean(axis=1) - bias[:, k + 1]) < 4.5 * sigma / np.sqrt(RUNS))
        assert np.abs((np.cov(e) - covariance[..., k + 1]) / np.outer(sigma, sigma)).max() < 4.5 * np.sqrt(2 / RUNS)


def test_two_filters_stacked_err_as_each_alone_and_share_the_targets_noise():
    one, other = gains(F, H, Q, R, P0, STEPS), gains(F, H, Q, 4 * R, P0, STEPS)
    d = np.random.default_rng(1).normal(size=(2, STEPS))
    A, K = np.zeros((4, 4, STEPS)), np.zeros((4, 2, STEPS))
    A[:2, :2], A[2:, 2:], K[:2, :1], K[2:, 1:] = one.A, other.A, one.K, other.K
    E = np.tile(np.eye(2), (2, 1))
    bias, covariance = errors(np.kron(np.eye(2), F), A, K, np.diag([0.7, 2.8]), E @ d, E @ Q @ E.T)
    for rows, known, noise in ((slice(0, 2), one, R), (slice(2, 4), other, 4 * R)):
        alone = errors(F, known.A, known.K, noise, d, Q)
        np.testing.assert_allclose(bias[rows], alone[0], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(covariance[rows, rows], alone[1], rtol=1e-12)
    crossed = errors(np.kron(np.eye(2), F), A, K, np.diag([0.7, 2.8]), E @ d)[1]
    np.testing.assert_array_equal(crossed[:2, 2:], 0)
    assert np.all(covariance[:2, 2:, -1] > 0.01)


def test_steady_state_is_a_fixed_point_and_the_limit():
    limit, known = steady_state(F, H, Q, R), gains(F, H, Q, R, P0, 300)
    again = gains(F, H, Q, R, limit.P, 1)
    for name in Gains._fields:
        np.testing.assert_allclose(getattr(again, name)[..., -1], getattr(limit, name), rtol=1e-10)
        np.testing.assert_allclose(getattr(known, name)[..., -1], getattr(limit, name), rtol=1e-10)


def test_steady_errors_are_a_fixed_point():
    limit, d = steady_state(F, H, Q, R), np.array([0.3, -0.1])
    bias, covariance = steady_errors(F, limit.A, limit.K, 2 * R, d, 0.5 * Q)
    again = errors(F, limit.A[..., None], limit.K[..., None], 2 * R, d[:, None], 0.5 * Q, bias, covariance)
    np.testing.assert_allclose(again[0][:, 1], bias, rtol=1e-12)
    np.testing.assert_allclose(again[1][..., 1], covariance, rtol=1e-12)
    np.testing.assert_allclose(steady_errors(F, limit.A, limit.K, R, Q=Q)[1], limit.P, rtol=1e-10)


@pytest.mark.parametrize("dt", [1.0, 0.1])
@pytest.mark.parametrize("index", [1e-3, 0.0577, 1.0, 20.0])
def test_closed_forms_are_the_steady_state(index, dt):
    limit, transition, noise = settled(index, dt, sigma=3.0)
    alpha, beta = alpha_beta(index)
    np.testing.assert_allclose(limit.K[:, 0], [alpha, beta / dt], rtol=1e-6)
    bias, _ = steady_errors(transition, limit.A, limit.K, noise, 0.7 * np.array([dt**2 / 2, dt]))
    np.testing.assert_allclose(bias, steady_lag(index, a=0.7, dt=dt), rtol=1e-6)


def exact(model=None, sensor=None, truth=np.zeros((4, 9)), dt=1.0, x0=np.zeros(4), P0=np.eye(4), error0=None):  # noqa: B008
    model = CV(0.2) if model is None else model
    return exact_error(model, Position(1.0, CV().state) if sensor is None else sensor, truth, dt, x0, P0, error0)


def with_R(value):
    sensor = Position(1.0, CV().state)
    sensor.R = np.asarray(value)
    return sensor


NAN = np.full((2, 2), np.nan)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: exact(model=CTRV()), "model"),
        (lambda: exact(model=None, sensor=Lidar(state=("x", "y", "vx", "vy"))), "sensor"),
        (lambda: exact(sensor=LinearSensor(np.eye(2, 6), np.eye(2), [f"c{i}" for i in range(6)])), "sensor"),
        (lambda: exact(truth=np.zeros(4)), "truth"),
        (lambda: exact(truth=np.zeros((4, 0))), "truth"),
        (lambda: exact(truth=np.full((4, 3), np.nan)), "truth"),
        (lambda: exact(dt=-1.0), "dt"),
        (lambda: exact(x0=0.0), "x0"),
        (lambda: exact(x0=np.full(4, np.nan)), "x0"),
        (lambda: exact(x0=np.ma.masked_array(np.zeros(4), [1, 0, 0, 0])), "x0"),
        (lambda: exact(P0=-np.eye(4)), "P0"),
        (lambda: exact(error0=np.eye(3)), "error0"),
        (lambda: exact(sensor=with_R(-np.eye(2))), "R"),
        (lambda: gains(F, H, [[0.3, 0.2], [0.1, 0.2]], R, P0, 3), "Q"),
        (lambda: gains(F, H, [Q, Q, -Q], R, P0, 3), "Q"),
        (lambda: gains(F, H, Q, -R, P0, 3), "R"),
        (lambda: gains(F, H, Q, 0.7, P0, 3), "R"),
        (lambda: gains(NAN, H, Q, R, P0, 3), "F"),
        (lambda: gains(np.ma.masked_array(F, F == 0), H, Q, R, P0, 3), "F"),
        (lambda: gains([F, F], H, Q, R, P0, 3), "F"),
        (lambda: gains(F, H.T, Q, R, P0, 3), "H"),
        (lambda: gains(F, H, Q, R, [[1.0]], 3), "P0"),
        (lambda: gains(F, H, Q, R, P0, -1), "steps"),
        (lambda: gains(F, H, Q, R, P0, 2.0), "steps"),
        (lambda: gains(F, H, 0 * Q, 0 * R, 0 * P0, 1), "R"),
        (lambda: errors(F, np.zeros((2, 2, 3)), np.zeros((2, 1)), R), "K"),
        (lambda: errors(F, np.zeros((2, 2, 4)), np.zeros((2, 1, 3)), R), "A"),
        (lambda: errors(F, np.zeros((2, 2, 3)), np.zeros((2, 1, 3)), R, d=np.zeros((2, 4))), "d"),
        (lambda: errors(F, np.zeros((2, 2, 3)), np.zeros((2, 1, 3)), R, d=np.full((2, 3), np.nan)), "d"),
        (lambda: errors(F, np.zeros((2, 2, 3)), np.zeros((2, 1, 3)), R, bias0=0.0), "bias0"),
        (lambda: errors(F, np.zeros((2, 2, 3)), np.zeros((2, 1, 3)), R, covariance0=-P0), "covariance0"),
        (lambda: steady_state(F, 0 * H, Q, R), "F, H, Q, R"),
        (lambda: steady_state(F, H, Q, 0 * R), "R"),
        (lambda: steady_errors(F, np.eye(2), np.zeros((2, 1)), R), "A, F"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=f"^{name}:"):
        call()

"""Exact recursions: matrices by step in either order, what is left out, and where there is no steady state."""

import numpy as np
import pytest

from trackhelpers.by_step import check_by_step, check_finite, check_size, check_system
from trackhelpers.exact import alpha_beta, errors, exact_error, gain, gains, steady_errors, steady_lag, steady_state
from trackhelpers.motion import CV
from trackhelpers.sensors import Position

F, H, Q, R = np.array([[1.0, 0.5], [-0.1, 0.9]]), np.array([[1.0, 0.3]]), np.array([[0.2, 0.05], [0.05, 0.1]]), np.array([[0.7]])
P0 = np.array([[2.0, 0.4], [0.4, 1.0]])


def by_hand(F, H, Q, R, P):
    prior = F @ P @ F.T + Q
    S = H @ prior @ H.T + R
    K = prior @ H.T @ np.linalg.inv(S)
    return prior, S, K, np.eye(2) - K @ H, prior - K @ S @ K.T


def test_one_measurement_and_steps_by_hand():
    S, K, A = gain(P0, H, R)
    np.testing.assert_allclose(S, H @ P0 @ H.T + R)
    np.testing.assert_allclose(K, P0 @ H.T / S)
    np.testing.assert_allclose(A, np.eye(2) - K @ H)
    known = gains([F, 2 * F], H, Q, np.stack([R, 3 * R], axis=-1), P0, 2)
    P = P0
    for k, (f, r) in enumerate(((F, R), (2 * F, 3 * R))):
        *expected, P = by_hand(f, H, Q, r, P)
        for name, value in zip(("prior", "S", "K", "A"), expected, strict=True):
            np.testing.assert_allclose(getattr(known, name)[..., k], value, atol=1e-12)
        np.testing.assert_allclose(known.P[..., k + 1], P, atol=1e-12)
    np.testing.assert_allclose(gains([F, 2 * F], H, Q, [R, 3 * R], P0, 2, joseph=False).P, known.P, atol=1e-12)
    assert (
        np.array_equal(known.P[..., 0], P0)
        and gains(F, H, Q, R, P0, 0).P.shape == (2, 2, 1)
        and gains(F, H, Q, R, P0, 0).K.shape == (2, 1, 0)
    )


def test_josephs_form_forgives_a_gain_that_is_not_the_best():
    """At 1e16 between prior and noise P = (I − K H) P⁻ has lost its digits, and Joseph's form has not."""
    wide = 1e10 * np.eye(2)
    both = [
        gains(np.eye(2), np.array([[1.0, 1.0]]), np.zeros((2, 2)), [[1e-8]], wide, 3, joseph=joseph).P[..., -1] for joseph in (True, False)
    ]
    assert np.linalg.eigvalsh(both[0]).min() > -1e-8 and not np.array_equal(both[0], both[1])


def test_errors_of_wrong_gains_by_hand():
    rng = np.random.default_rng(0)
    K, d = rng.standard_normal((2, 1, 3)), rng.standard_normal((2, 3))
    A = np.eye(2)[..., None] - np.einsum("imk,mj->ijk", K, H)
    bias, C = errors(F, A, K, R, d, Q, [1.0, -1.0], P0)
    b, c = np.array([1.0, -1.0]), P0
    for k in range(3):
        b = A[..., k] @ (F @ b - d[:, k])
        c = A[..., k] @ (F @ c @ F.T + Q) @ A[..., k].T + K[..., k] @ R @ K[..., k].T
        np.testing.assert_allclose(bias[:, k + 1], b)
        np.testing.assert_allclose(C[..., k + 1], c)
    assert bias.shape == (2, 4) and C.shape == (2, 2, 4)
    plain = errors(F, A, K, R)
    assert not plain[0].any() and not plain[1][..., 0].any()
    np.testing.assert_allclose(plain[1][..., 1], K[..., 0] @ R @ K[..., 0].T)
    listed = errors([F] * 3, list(np.moveaxis(A, -1, 0)), K, [R] * 3, d, [Q] * 3, [1.0, -1.0], P0)
    np.testing.assert_allclose(listed[1], C)


def test_an_exact_error_is_of_a_start_and_a_track():
    model, sensor = CV(0.3, axes=1), Position(0.5, CV(axes=1).state)
    truth = np.array([[0.0, 1.0, 4.0], [1.0, 2.0, 3.0]])
    bias, C, believed = exact_error(model, sensor, truth, 1.0, [0.5, 1.0], np.eye(2), 0.1 * np.eye(2))
    known = gains(model.F(np.zeros(2), 1.0), sensor.H(np.zeros(2)), model.Q(np.zeros(2), 1.0), sensor.R, np.eye(2), 2)
    assert bias[:, 0].tolist() == [0.5, 0.0] and np.array_equal(C[..., 0], 0.1 * np.eye(2))
    np.testing.assert_allclose(believed, known.P)
    e = np.array([0.5, 0.0])
    for k in range(2):
        e = known.A[..., k] @ (model.F(e, 1.0) @ (e + truth[:, k]) - truth[:, k + 1])
        np.testing.assert_allclose(bias[:, k + 1], e, atol=1e-12)
    assert not exact_error(model, sensor, truth, 1.0, truth[:, 0], np.eye(2))[1][..., 0].any()
    with pytest.raises(ValueError, match="sensor: expected a linear one"):
        exact_error(model, object(), truth, 1.0, truth[:, 0], np.eye(2))


@pytest.mark.parametrize(
    "system",
    [
        (np.diag([2.0, 0.5]), [[0.0, 1.0]], np.eye(2), [[1.0]]),
        (np.diag([1.0, 0.5]), [[0.0, 1.0]], np.eye(2), [[1.0]]),
    ],
)
def test_where_nothing_settles_it_is_said(system):
    with pytest.raises(ValueError, match=r"^F, H, Q, R: expected a Riccati equation with a steady state, well conditioned, got F = "):
        steady_state(*system)


def test_steady_errors_by_hand():
    limit = steady_state(F, H, Q, R)
    d = np.array([0.4, -0.3])
    bias, C = steady_errors(F, limit.A, limit.K, R, d, Q)
    np.testing.assert_allclose(bias, limit.A @ (F @ bias - d), atol=1e-12)
    np.testing.assert_allclose(C, limit.A @ (F @ C @ F.T + Q) @ limit.A.T + limit.K @ R @ limit.K.T, atol=1e-12)
    np.testing.assert_allclose(C, limit.P, atol=1e-9)
    assert not steady_errors(F, limit.A, limit.K, R)[0].any()
    by_step = steady_errors(F[..., None], limit.A[..., None], limit.K[..., None], R, d, Q)  # one step is a constant
    np.testing.assert_allclose(by_step[0], bias)
    for name in ("F", "A", "K"):
        with pytest.raises(ValueError, match=f"^{name}: expected shape"):
            steady_errors(**{"F": F, "A": limit.A, "K": limit.K, "R": R} | {name: [{"F": F, "A": limit.A, "K": limit.K}[name]] * 2})
    with pytest.raises(ValueError, match=r"^A, F: expected A F to damp every error, got a spectral radius of 1"):
        steady_errors(np.eye(2), np.eye(2), np.zeros((2, 1)), R)
    for change, word in (
        ({"d": np.zeros(3)}, "d"),
        ({"Q": -Q}, "Q"),
        ({"K": np.zeros((3, 1))}, "K"),
        ({"A": np.eye(3)}, "A"),
        ({"F": np.eye(3)}, "A"),
        ({"R": -R}, "R"),
    ):
        with pytest.raises(ValueError, match=f"^{word}: expected"):
            steady_errors(**{"F": F, "A": limit.A, "K": limit.K, "R": R} | change)


def test_indices_of_tracking_are_not_negative():
    alpha, beta = alpha_beta(0.0)
    assert (alpha, beta) == (0.0, 0.0)
    alpha, beta = alpha_beta([0.5, 2.0])
    r = (4 + np.array([0.5, 2.0]) - np.sqrt(8 * np.array([0.5, 2.0]) + np.array([0.25, 4.0]))) / 4
    np.testing.assert_allclose(alpha, 1 - r**2)
    np.testing.assert_allclose(beta, 2 * (2 - alpha) - 4 * np.sqrt(1 - alpha))
    np.testing.assert_allclose(steady_lag(0.5, 3.0, 2.0), (-(1 - alpha[0]) * 12 / beta[0], -(alpha[0] / beta[0] - 0.5) * 6))
    np.testing.assert_allclose(steady_lag(0.5), (-(1 - alpha[0]) / beta[0], -(alpha[0] / beta[0] - 0.5)))
    for wrong in (-1e-9, np.inf, np.nan, [1.0, -1.0]):
        with pytest.raises(ValueError, match=r"^index: expected tracking indices ≥ 0"):
            alpha_beta(wrong)
    for arguments, word in (
        ((0.0,), "index"),
        (([1.0, 0.0],), "index"),
        ((1.0, np.inf), "a"),
        ((1.0, 1.0, 0.0), "dt"),
        ((1.0, 1.0, -1.0), "dt"),
    ):
        with pytest.raises(ValueError, match=f"^{word}: expected"):
            steady_lag(*arguments)


def test_matrices_are_constant_or_by_step_in_either_order():
    steps = np.stack([F, 2 * F, 3 * F], axis=-1)
    for value in (steps, [F, 2 * F, 3 * F], (F, 2 * F, 3 * F)):
        found = check_by_step(value, "F", (2, 2), 3)
        assert found.shape == (3, 2, 2) and np.array_equal(found[2], 3 * F)
    assert (
        check_by_step(F.tolist(), "F", (2, 2), 4).shape == (4, 2, 2)
        and check_size(F, "F") == check_size(steps, "F") == check_size([F] * 5, "F") == 2
    )
    two = np.stack([F, 2 * F], axis=-1)  # two steps of two: which axis is meant is told by the kind
    assert np.array_equal(check_by_step(two, "F", (2, 2), 2)[1], 2 * F) and np.array_equal(
        check_by_step([F, 2 * F], "F", (2, 2), 2)[1], 2 * F
    )
    assert [a.shape for a in check_system(F, H, Q, [R] * 3, 3)] == [(3, 2, 2), (3, 1, 2), (3, 2, 2), (3, 1, 1)]
    for value, steps_ in ((steps, 2), ([F, F], 3), (F[:1], 3), (np.ones((2, 3, 3)), 3), ([], 0)):
        with pytest.raises(ValueError, match=r"^F: expected"):
            check_by_step(value, "F", (2, 2), steps_)
    for value in (1.0, [1.0], np.zeros((0, 0)), np.zeros((2, 0, 3)), np.zeros((2, 2, 2, 2))):
        with pytest.raises(ValueError, match=r"^F: expected a square matrix, or one a step, got shape"):
            check_size(value, "F")
    with pytest.raises(ValueError, match=r"^Q: expected a positive"):
        check_by_step([Q, -Q], "Q", (2, 2), 2, covariance=True)
    assert check_by_step([Q, -Q], "Q", (2, 2), 2).shape == (2, 2, 2)
    with pytest.raises(ValueError, match=r"^F: expected finite numbers, got 1 that are not"):
        check_finite(np.array([[1.0, np.nan]]), "F")

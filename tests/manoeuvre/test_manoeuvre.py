"""The statistics of the switching filters: their limits hold, and what they estimate is what entered."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from trackhelpers.filters import MatrixKF
from trackhelpers.manoeuvre import (
    check_forgetting,
    check_inflation,
    check_input,
    check_switching,
    constant_input,
    fading_limit,
    manoeuvre_start,
)
from trackhelpers.motion import CV

T = 1.0
MODEL = CV(0.1)
F, Q, G = (getattr(MODEL, name)(np.zeros(4), T) for name in "FQG")
H, R = np.eye(4)[[0, 2]], 3.0 * np.eye(2)


@pytest.mark.parametrize(("dim", "window"), [(2, 1), (2, 5), (1, 5), (3, 20)])
def test_a_fading_sum_of_white_nis_exceeds_its_limit_as_often_as_promised(dim, window):
    """250,000 sums: at 0.999 two hundred and fifty of them exceed the limit, give or take 16."""
    rng, total = np.random.default_rng(0), np.full(250_000, float(dim * window))  # they start at their mean,
    for _ in range(7 * window):  # of which a thousandth is left
        total = (1 - 1 / window) * total + rng.chisquare(dim, total.size)
    for probability in (0.9, 0.99, 0.999):
        expected = (1 - probability) * total.size
        assert abs(np.sum(total > fading_limit(dim, window, probability)) - expected) < 0.06 * expected + 4 * np.sqrt(expected)


def test_a_fading_limit_below_the_mean_is_refused():
    with pytest.raises(ValueError, match="probability"):
        fading_limit(2, 20, 0.3)


def filtered(z, x0=(0.0, 5.0, 0.0, 5.0)):
    kf, past = MatrixKF(F, H, Q, R, x0, np.eye(4)), []
    for measured in z:
        kf.predict()
        kf.update(measured)
        past.append((kf.y, kf.S, kf.K, 1))
    return kf, zip(*past, strict=True)


def test_without_noise_the_input_of_a_window_is_found_exactly_and_the_state_with_it():
    u, x = np.array([2.0, -1.0]), np.array([0.0, 5.0, 0.0, 5.0])
    z = []
    for _ in range(12):
        x = F @ x + G @ u
        z.append(H @ x)
    kf, past = filtered(z)
    found, covariance, shift, significance = constant_input(*past, F, G, H)
    np.testing.assert_allclose(found, u, atol=1e-12)
    np.testing.assert_allclose(kf.x + shift @ found, x, atol=1e-11)
    np.testing.assert_allclose(significance, u @ np.linalg.solve(covariance, u))


def test_without_an_input_the_significance_is_chi_square():
    rng, found = np.random.default_rng(1), []
    for _ in range(300):
        x, z = rng.multivariate_normal([0, 5, 0, 5], np.eye(4)), []
        for _ in range(10):
            x = F @ x + G @ (0.1 * rng.standard_normal(2))
            z.append(H @ x + np.sqrt(3) * rng.standard_normal(2))
        _, past = filtered(z)
        found.append(constant_input(*past, F, G, H)[3])
    assert abs(np.mean(found) - 2) < 4 * 2 / np.sqrt(300)
    assert abs(np.mean(np.array(found) > 5.991) - 0.05) < 0.04


def test_many_runs_at_once_give_what_each_gives_alone():
    z = np.random.default_rng(2).normal(size=(8, 2, 3)).cumsum(axis=0)
    alone = [constant_input(*filtered(z[..., r])[1], F, G, H) for r in range(3)]
    pasts = [list(filtered(z[..., r])[1]) for r in range(3)]
    together = [[np.stack([past[part][k] for past in pasts], axis=-1) for k in range(8)] for part in range(4)]
    for one, all_ in zip(zip(*alone, strict=True), constant_input(*together, F, G, H), strict=True):
        np.testing.assert_allclose(np.stack(one, axis=-1), all_, atol=1e-10)


def test_a_missed_scan_is_a_step_of_the_input_without_a_measurement():
    """The window's weighted least squares written out: each column of the regression is the filter's own answer to one unit of the input."""
    rng, seen = np.random.default_rng(4), [0, 1, 4, 5, 8, 11, 12]
    z, columns = rng.normal(size=(13, 2)).cumsum(axis=0), []
    for unit in np.eye(2):
        x, answer = np.zeros(4), MatrixKF(F, H, Q, R, np.zeros(4), np.eye(4))
        columns.append([])
        for k in range(13):
            x = F @ x + G @ unit
            answer.predict()
            answer.update(H @ x if k in seen else None)
            columns[-1].extend(answer.y)
    kf, past = MatrixKF(F, H, Q, R, np.zeros(4), np.eye(4)), []
    for k in range(13):
        kf.predict()
        kf.update(z[k] if k in seen else None)
        if k in seen:
            past.append((kf.y, kf.S, kf.K, k - max([s for s in seen if s < k], default=-1)))
    white = np.linalg.inv(np.linalg.cholesky(block_diag(*[S for _, S, _, _ in past])))
    D, y = white @ np.array(columns).T, white @ np.concatenate([y for y, *_ in past])
    found, covariance, _, significance = constant_input(*zip(*past, strict=True), F, G, H)
    np.testing.assert_allclose(found, np.linalg.lstsq(D, y)[0], atol=1e-12)
    np.testing.assert_allclose(covariance, np.linalg.inv(D.T @ D), atol=1e-12)
    np.testing.assert_allclose(significance, found @ D.T @ D @ found, rtol=1e-10)


def test_a_manoeuvre_may_have_begun_several_steps_ago_and_longer_ago_in_some_runs_than_in_others():
    steps, R_runs = np.array([1, 3, 2]), np.stack([3.0 * np.eye(2), np.diag([1.0, 5.0]), [[2.0, 1.0], [1.0, 2.0]]], axis=-1)
    rng = np.random.default_rng(5)
    x, z, P = rng.normal(size=(4, 3)), rng.normal(size=(2, 3)), np.stack([k * np.eye(4) for k in (1.0, 2.0, 3.0)], axis=-1)
    states, Ps = manoeuvre_start(x, P, z, R_runs, steps * T)
    for r, count in enumerate(steps):
        alone = manoeuvre_start(x[:, r], P[..., r], z[:, r], R_runs[..., r], count * T)
        np.testing.assert_allclose(states[:, r], alone[0], atol=1e-13)
        np.testing.assert_allclose(Ps[..., r], alone[1], atol=1e-13)
        a = states[[2, 5], r]  # as if it had accelerated all the time
        np.testing.assert_allclose(H @ x[:, r] + count * x[[1, 3], r] + a * count**2 / 2, z[:, r], atol=1e-12)
        np.testing.assert_allclose(states[[1, 4], r], x[[1, 3], r] + a * count, atol=1e-12)


def test_the_start_of_a_manoeuvre_is_exact_without_noise_and_its_covariance_is_that_of_the_linear_map():
    x, a = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.5, -0.2])
    ahead = F @ x + G @ a
    state, P = manoeuvre_start(x, np.zeros((4, 4)), H @ ahead, R, T)
    np.testing.assert_allclose(state, [ahead[0], ahead[1], a[0], ahead[2], ahead[3], a[1]])
    np.testing.assert_allclose(P[:3, :3], 3.0 * np.array([[1, 2, 2], [2, 4, 4], [2, 4, 4]]))  # T = 1
    rng = np.random.default_rng(3)
    A = rng.normal(size=(4, 4))
    xs, zs = x[:, None] + A @ rng.normal(size=(4, 40_000)), (H @ ahead)[:, None] + np.sqrt(3) * rng.normal(size=(2, 40_000))
    states, _ = manoeuvre_start(xs, np.zeros((4, 4, 40_000)), zs, R, T)
    _, P = manoeuvre_start(x, A @ A.T, H @ ahead, R, T)
    np.testing.assert_allclose(np.cov(states), P, atol=0.05 * np.abs(P).max())


@pytest.mark.parametrize(
    "bad", [{"window": 0}, {"window": 2.5}, {"probability": 0.0}, {"probability": 1.0}, {"window": True}, {"dim": 0}, {"dim": np.nan}]
)
def test_bad_arguments_are_named(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        fading_limit(**{"dim": 2, "window": 5, "probability": 0.9} | bad)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: manoeuvre_start(np.zeros(4), np.eye(4), np.zeros(2), R, 0.0), "dt"),
        (lambda: manoeuvre_start(np.zeros(4), np.eye(4), np.zeros(2), R, -1.0), "dt"),
        (lambda: check_input(F, G[:, 0], H, 10), "G"),
        (lambda: check_input(F, np.zeros((4, 0)), H, 10), "G"),
        (lambda: check_input(F, np.full((4, 2), np.nan), H, 10), "G"),
        (lambda: check_input(F, G, H, 0), "window"),
        (lambda: check_input(F, np.eye(4)[:, [1]], H, 1), "window"),  # a step of velocity is not seen at once
        (lambda: check_switching((0.9, 1.5), (0.5, 0.5)), "stay"),
        (lambda: check_switching((0.9, 0.9), (0.5, 0.6)), "mu"),
        (lambda: check_inflation(0.9), "inflation"),
        (lambda: check_forgetting(0.0), "rho"),
    ],
)
def test_bad_settings_are_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_an_input_that_is_seen_after_two_steps_is_accepted_with_two():
    B, window = check_input(F, np.eye(4)[:, [1]], H, 2)
    assert B.shape == (4, 1) and window == 2

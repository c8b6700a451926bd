"""Fusion at its edges: no variance at all, tracks that share everything, what does not fit, and rules written out for two numbers."""

import numpy as np
import pytest

from trackhelpers.fusion import (
    bar_shalom_campo,
    convex_combination,
    covariance_intersection,
    cross_covariance,
    information_fusion,
    maximum_likelihood,
)
from trackhelpers.tracks import alike, check_cross, check_estimates, runs_of

RNG = np.random.default_rng(0)


def covariance(n):
    A = RNG.standard_normal((n, n))
    return A @ A.T + 0.1 * np.eye(n)


P1, P2, P3 = covariance(2), covariance(2), covariance(2)
X1, X2 = np.array([1.0, 2.0]), np.array([-1.0, 4.0])


def test_what_all_tracks_are_certain_of_stays_as_it_is():
    joint = np.zeros((4, 4))
    joint[np.ix_([0, 2], [0, 2])] = [[2.0, 0.5], [0.5, 1.0]]
    x, P = maximum_likelihood([[1.0, 7.0], [3.0, 7.0]], joint)
    weight = (2 - 0.5) / (2 + 1 - 1.0)
    np.testing.assert_allclose(x, [1 + weight * 2, 7.0], atol=1e-9)
    np.testing.assert_allclose(P, [[2 - weight * 1.5, 0], [0, 0]], atol=1e-9)
    certain = maximum_likelihood([[1.0, 7.0], [3.0, 9.0]], np.diag([2.0, 3.0, 1.0, 0.0]))
    np.testing.assert_allclose(certain[0], [1 + 2 * 2 / 3, 9.0], atol=1e-9)
    np.testing.assert_allclose(certain[1], [[2 / 3, 0], [0, 0]], atol=1e-9)
    x, P = bar_shalom_campo([1.0, 7.0], np.diag([2.0, 0.0]), [3.0, 7.0], np.diag([1.0, 0.0]), np.diag([0.5, 0.0]))
    np.testing.assert_allclose(x, [1 + weight * 2, 7.0], atol=1e-12)
    np.testing.assert_allclose(P, np.diag([2 - weight * 1.5, 0]), atol=1e-12)


def test_rules_for_two_numbers_by_hand():
    x, P = convex_combination([[1.0], [3.0]], [[[2.0]], [[6.0]]])
    assert x == pytest.approx([1.5]) and P == pytest.approx(np.array([[1.5]]))
    x, P = bar_shalom_campo([1.0], [[2.0]], [3.0], [[6.0]], [[1.0]])
    assert x == pytest.approx([1 + 2 / 6]) and P == pytest.approx(np.array([[2 - 1 / 6]]))
    for first, second, expected in (
        ((1.0, 2.0), (3.0, 6.0), (1.0, 2.0)),
        ((1.0, 6.0), (3.0, 2.0), (3.0, 2.0)),
        ((1.0, 2.0), (3.0, 2.0), (2.0, 2.0)),
    ):
        x, P = covariance_intersection([first[0]], [[first[1]]], [second[0]], [[second[1]]])
        assert x == pytest.approx([expected[0]], abs=1e-9) and P == pytest.approx(np.array([[expected[1]]]), abs=1e-9)
    x, P = information_fusion([0.0], [[4.0]], [[1.0], [2.0]], [[[1.0]], [[2.0]]], [[0.5], [0.0]], [[[2.0]], [[4.0]]])
    information = 1 / 4 + (1 - 1 / 2) + (1 / 2 - 1 / 4)
    assert P == pytest.approx(np.array([[1 / information]])) and x == pytest.approx([(0 + (1 - 0.25) + (1 - 0)) / information])


def test_every_track_counts():
    xs, Ps = [X1, X2, X1 + X2], [P1, P2, P3]
    information = sum(np.linalg.inv(P) for P in Ps)
    state = sum(np.linalg.solve(P, x) for P, x in zip(Ps, xs, strict=True))
    x, P = convex_combination(xs, Ps)
    np.testing.assert_allclose(P, np.linalg.inv(information), atol=1e-12)
    np.testing.assert_allclose(x, np.linalg.solve(information, state), atol=1e-12)
    priors, before = [0.5 * each for each in xs], [3 * each for each in Ps]
    x, P = information_fusion(X2, P3, xs, Ps, priors, before)
    information = np.linalg.inv(P3) + information * (1 - 1 / 3)
    state = np.linalg.solve(P3, X2) + state * (1 - 0.5 / 3)
    np.testing.assert_allclose(P, np.linalg.inv(information), atol=1e-12)
    np.testing.assert_allclose(x, np.linalg.solve(information, state), atol=1e-12)
    one = convex_combination([X1], [P1])
    np.testing.assert_allclose(one[0], X1)
    np.testing.assert_allclose(one[1], P1)


def test_a_step_of_the_cross_covariance_by_hand():
    F, Q, P12 = RNG.standard_normal((2, 2)), P3, RNG.standard_normal((2, 2))
    K1, H1, K2, H2 = RNG.standard_normal((2, 1)), RNG.standard_normal((1, 2)), RNG.standard_normal((2, 3)), RNG.standard_normal((3, 2))
    expected = (np.eye(2) - K1 @ H1) @ (F @ P12 @ F.T + Q) @ (np.eye(2) - K2 @ H2).T
    np.testing.assert_allclose(cross_covariance(P12, F, Q, K1, H1, K2, H2), expected)
    np.testing.assert_allclose(
        cross_covariance(P12, F, Q, K1, H1, np.zeros((2, 0)), np.zeros((0, 2))), (np.eye(2) - K1 @ H1) @ (F @ P12 @ F.T + Q)
    )


def test_tracks_of_one_target_of_runs_and_of_both():
    assert runs_of([X1]) is None and runs_of([np.zeros((2, 3))]) == 3
    assert [A.shape for A in alike(P1, np.zeros((2, 2, 3)))] == [(2, 2, 3)] * 2 and [A.shape for A in alike(P1, P2)] == [(2, 2)] * 2
    assert check_cross(P1, "C", 2, None).shape == check_cross(P1, "C", 2, 3).shape == (2, 2) and check_cross(
        np.ones((2, 2, 3)), "C", 2, 3
    ).shape == (2, 2, 3)
    for value, runs in ((np.ones((2, 2, 3)), None), (np.ones((2, 2, 3)), 4), (np.ones((2, 3)), 3), (np.full((2, 2), np.nan), None)):
        with pytest.raises(ValueError, match=r"^C: expected"):
            check_cross(value, "C", 2, runs)
    xs = check_estimates([[3.0, 3.0], [-3.0, -3.0]], ["a", "b"], (1,))
    np.testing.assert_allclose(xs, [[3, 3], [-3, 2 * np.pi - 3]])
    given = np.array([[3.0, 3.0], [-3.0, -3.0]])
    check_estimates(list(given), ["a", "b"], (1,))
    assert given.tolist() == [[3, 3], [-3, -3]]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: convex_combination(3, [P1]), "xs"),
        (lambda: convex_combination([X1], 3), "Ps"),
        (lambda: convex_combination([X1, X2], [P1, P2, P3]), "xs, Ps|Ps|xs"),
        (lambda: convex_combination([X1[:, None, None]], [P1]), r"xs\[0\]"),
        (lambda: convex_combination([X1, X2], [P1, P2], angles=(2,)), "angles"),
        (lambda: bar_shalom_campo(X1, P1, X2, P2, np.full((2, 2), np.inf)), "P12"),
        (lambda: maximum_likelihood([X1, X2], np.eye(5)), "P_joint"),
        (lambda: covariance_intersection(X1, np.diag([1.0, 0.0]), X2, P2), "P1"),
        (lambda: information_fusion(X1, P1, [X1, X2], [P1, P2], [X1], [P1]), "x_priors: expected 2 tracks, as in xs, got 1"),
        (lambda: information_fusion(X1, 10 * P1, [X1], [P1], [X1], [0.5 * P1]), "P_priors: expected predictions no surer"),
        (lambda: cross_covariance(P1, np.eye(2), -np.eye(2), P1, P1, P1, P1), "Q"),
        (lambda: cross_covariance(P1, np.eye(2), P2, P1, np.ones((2, 3)), P1, P1), "H1"),
        (lambda: cross_covariance(P1[:1], np.eye(2), P2, P1, P1, P1, P1), "P12"),
    ],
)
def test_what_does_not_fit_is_named(call, words):
    with pytest.raises(ValueError, match=f"^({words})"):
        call()

"""Shapes that NEES and NIS take: one target, runs, whole histories; and the bound written out with noise."""

import numpy as np
import pytest
from scipy import stats

from trackhelpers import fused
from trackhelpers.consistency import chi2_band, cramer_rao, nees, nis

RNG = np.random.default_rng(0)
N, M = 4, 5
A = RNG.standard_normal((3, 3, N, M))
P = np.einsum("ikst,jkst->ijst", A, A) + np.eye(3)[..., None, None]
X, TRUTH = RNG.standard_normal((2, 3, N, M))


def by_hand(error, P):
    return error @ np.linalg.solve(P, error)


@pytest.mark.parametrize("compiled", [True, False])
def test_scores_of_runs_and_of_histories_are_those_of_each(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(fused, "binding", None)
    runs = nees(TRUTH[:, 0], X[:, 0], P[:, :, 0])
    np.testing.assert_allclose(runs, [by_hand((TRUTH - X)[:, 0, r], P[:, :, 0, r]) for r in range(M)])
    np.testing.assert_allclose(
        nees(TRUTH[:, 0, :1], X[:, 0], P[:, :, 0]), [by_hand(TRUTH[:, 0, 0] - X[:, 0, r], P[:, :, 0, r]) for r in range(M)]
    )
    np.testing.assert_allclose(nees(TRUTH[:, 0], X[:, 0], P[:, :, 0, 0]), [by_hand((TRUTH - X)[:, 0, r], P[:, :, 0, 0]) for r in range(M)])
    for covariance in (P, P[..., :1]):
        history = nees(TRUTH, X, covariance)
        assert history.shape == (N, M)
        np.testing.assert_allclose(history[2, 3], by_hand((TRUTH - X)[:, 2, 3], covariance[..., 2, 3 % covariance.shape[3]]))
    common = nees(TRUTH[..., :1], X, P)
    np.testing.assert_allclose(common[1, 4], by_hand(TRUTH[:, 1, 0] - X[:, 1, 4], P[:, :, 1, 4]))
    np.testing.assert_allclose(nis((TRUTH - X)[:, 0], P[:, :, 0]), runs)
    np.testing.assert_allclose(nis(TRUTH - X, P), nees(TRUTH, X, P))
    spoilt = P[:, :, 0].copy()
    spoilt[1, 1, 2] = -3.0
    assert np.isnan(nees(TRUTH[:, 0], X[:, 0], spoilt)).tolist() == [False, False, True, False, False]


@pytest.mark.parametrize("compiled", [True, False])
def test_angles_are_compared_the_short_way_round_in_every_shape(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(fused, "binding", None)
    truth, x = TRUTH[:, 0].copy(), X[:, 0].copy()
    truth[1], x[1] = 3.1, -3.1
    error = truth - x
    error[1] = 6.2 - 2 * np.pi
    expected = [by_hand(error[:, r], P[:, :, 0, r]) for r in range(M)]
    np.testing.assert_allclose(nees(truth, x, P[:, :, 0], angles=(1,)), expected)
    np.testing.assert_allclose([nees(truth[:, r], x[:, r], P[:, :, 0, r], [1]) for r in range(M)], expected)
    assert abs(nees(truth[:, 0], x[:, 0], P[:, :, 0, 0]) - expected[0]) > 1


def test_one_number_is_a_vector_of_one():
    assert nis(3.0, [[4.0]]) == nis([3.0], [[4.0]]) == nis(np.array(3.0), [[4.0]]) == pytest.approx(2.25)
    np.testing.assert_allclose(nis([[3.0, 4.0]], [[4.0]]), [2.25, 4.0])
    assert nees([1.0], [3.0], [[2.0]]) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: nees(np.zeros(0), np.zeros(0), np.zeros((0, 0))), r"x_true, x: expected shapes \(n,\) or \(n, M\), got \(0,\) and \(0,\)"),
        (lambda: nees(np.zeros((2, 0)), np.zeros((2, 0)), np.eye(2)), "x_true, x: expected shapes"),
        (lambda: nees(np.zeros((2, 3)), np.zeros((2, 4)), np.eye(2)), "x_true, x: expected shapes"),
        (lambda: nees(np.zeros((2, 3, 4)), np.zeros((2, 2, 4)), np.eye(2)), "x_true, x: expected shapes"),
        (lambda: nees(np.zeros(3), np.zeros(2), np.eye(2)), "x_true: expected shape"),
        (lambda: nees(np.zeros((2, 3)), np.zeros((2, 3)), np.eye(3)), "P: expected shape"),
        (lambda: nees(np.zeros((2, 3)), np.zeros((2, 3)), np.ones((2, 3))), r"P: expected shape \(2, 2\) or \(2, 2, 3\), got \(2, 3\)"),
        (
            lambda: nees(np.zeros((2, 3)), np.zeros((2, 3)), np.ones((2, 2, 4))),
            r"P: expected shape \(2, 2\) or \(2, 2, 3\), got \(2, 2, 4\)",
        ),
        (lambda: nees(np.zeros((2, 3)), np.zeros((2, 3)), np.ones((2, 2, 3, 1))), "P: expected shape"),
        (lambda: nees(np.zeros(2), np.zeros(2), [[1, 0.5], [0.4, 1]]), "P: expected a symmetric"),
        (lambda: nis(np.zeros((0, 3)), np.eye(2)), r"y: expected shape \(m,\) or \(m, M\), got \(0, 3\)"),
        (lambda: nis(np.zeros((2, 0)), np.eye(2)), "y: expected shape"),
        (lambda: nis([1.0, 2.0], np.diag([1.0, 0.0])), "S: expected a positive definite"),
        (lambda: chi2_band(2, 0), "runs: expected a whole number"),
        (lambda: chi2_band(2, 1, 0.0), "level: expected a probability"),
        (
            lambda: cramer_rao([np.eye(1)], [np.eye(1)] * 2, [None], [None], np.eye(1)),
            "Fs, Qs, Hs, Rs: expected equal lengths, got 1, 2, 1, 1",
        ),
        (lambda: cramer_rao([np.eye(1)], [np.eye(1)], None, [None], np.eye(1)), "Hs: expected a sequence, one a step"),
        (lambda: cramer_rao(3, [np.eye(1)], [None], [None], np.eye(1)), "Fs: expected a sequence"),
        (lambda: cramer_rao([], [], [], [], np.ones((1, 2))), "P0: expected shape"),
    ],
)
def test_what_does_not_fit_is_named(call, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        call()


def test_a_band_is_central_and_holds_what_it_promises():
    assert chi2_band(4) == pytest.approx(tuple(stats.chi2.ppf([0.025, 0.975], 4)))
    assert chi2_band(3, 10, 0.5) == pytest.approx(tuple(stats.chi2.ppf([0.25, 0.75], 30) / 10))


def test_the_bound_is_the_riccati_recursion_with_noise():
    F, Q, H, R = np.array([[1.0, 0.5], [-0.2, 0.9]]), np.array([[0.3, 0.1], [0.1, 0.2]]), np.array([[1.0, 0.4]]), np.array([[0.7]])
    bound, covariance = cramer_rao(np.array([F] * 4), (Q,) * 4, [H, None, H, H], [R, None, R, 2 * R], np.eye(2)), np.eye(2)
    assert bound.shape == (4, 2, 2) and cramer_rao([], [], [], [], np.eye(2)).shape == (0,)
    for k, noise in enumerate((R, None, R, 2 * R)):
        covariance = F @ covariance @ F.T + Q
        if noise is not None:
            covariance = np.linalg.inv(np.linalg.inv(covariance) + H.T @ np.linalg.inv(noise) @ H)
        np.testing.assert_allclose(bound[k], covariance, rtol=1e-10)

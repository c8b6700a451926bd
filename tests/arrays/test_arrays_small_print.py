"""Edges of the checks and of the algebra over runs: what still passes, what no longer does, and in which words."""

import sys

import numpy as np
import pytest

from trackhelpers import arrays, checks, fused

RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    ("call", "shapes"),
    [
        (
            lambda: arrays.congruence(np.ones((2, 3, 4)), np.ones((3, 3, 5))),
            r"\(p, q, \.\.\.\) and \(q, q, \.\.\.\), got \(2, 3, 4\) and \(3, 3, 5\)",
        ),
        (lambda: arrays.congruence(np.ones(3), np.ones((3, 3))), r"\(p, q, \.\.\.\) and \(q, q, \.\.\.\)"),
        (lambda: arrays.congruence(np.ones((3, 2)), np.ones((3, 3))), r"\(p, q, \.\.\.\) and \(q, q, \.\.\.\)"),
        (
            lambda: arrays.matmul(np.ones((2, 3, 4)), np.ones((3, 2, 5))),
            r"\(p, q, \.\.\.\) and \(q, r, \.\.\.\), got \(2, 3, 4\) and \(3, 2, 5\)",
        ),
        (lambda: arrays.matmul(np.ones((2, 3)), np.ones(3)), r"\(p, q, \.\.\.\) and \(q, r, \.\.\.\)"),
        (lambda: arrays.matvec(np.ones((2, 3, 4)), np.ones((3, 5))), r"\(p, q, \.\.\.\) and \(q, \.\.\.\), got \(2, 3, 4\) and \(3, 5\)"),
        (lambda: arrays.matvec(np.ones((2, 3)), np.array(1.0)), r"\(p, q, \.\.\.\) and \(q, \.\.\.\)"),
        (lambda: arrays.solve_lower(np.ones((2, 3)), np.ones(2)), r"L: expected shape \(n, n, \.\.\.\), got \(2, 3\)"),
        (
            lambda: arrays.eliminate(np.ones((2, 2, 3)), np.ones((1, 2, 4))),
            r"\(m, m, \.\.\.\) and \(q, m, \.\.\.\), got \(2, 2, 3\) and \(1, 2, 4\)",
        ),
        (lambda: arrays.eliminate(np.ones((2, 2)), np.ones(2)), r"\(m, m, \.\.\.\) and \(q, m, \.\.\.\)"),
        (
            lambda: arrays.mahalanobis(np.ones((2, 3)), np.ones((2, 2, 4))),
            r"\(m, \.\.\.\) and \(m, m, \.\.\.\), got \(2, 3\) and \(2, 2, 4\)",
        ),
        (lambda: arrays.mahalanobis(np.array(1.0), np.ones((1, 1))), r"\(m, \.\.\.\) and \(m, m, \.\.\.\)"),
        (lambda: arrays.mahalanobis(np.ones((2, 3, 4)), np.ones((2, 2, 5, 4))), r"\(m, \.\.\.\) and \(m, m, \.\.\.\)"),
    ],
)
def test_shapes_that_do_not_fit_are_told_with_what_was_expected(call, shapes):
    with pytest.raises(ValueError, match=shapes):
        call()


def test_trailing_axes_broadcast_from_the_right():
    A, P = RNG.standard_normal((2, 3, 4, 5)), RNG.standard_normal((3, 3, 1, 5))
    x, S = RNG.standard_normal((3, 4, 1)), RNG.standard_normal((3, 3, 4, 5))
    S = np.einsum("ik...,jk...->ij...", S, S) + np.eye(3)[..., None, None]
    assert (
        arrays.matmul(A, P).shape == (2, 3, 4, 5)
        and arrays.congruence(A, P).shape == (2, 2, 4, 5)
        and arrays.matvec(A, x).shape == (2, 4, 5)
    )
    np.testing.assert_allclose(arrays.congruence(A, P)[..., 2, 3], A[..., 2, 3] @ P[..., 0, 3] @ A[..., 2, 3].T)
    np.testing.assert_allclose(arrays.matvec(A, x)[..., 2, 3], A[..., 2, 3] @ x[:, 2, 0])
    y = RNG.standard_normal((3, 4, 5))
    for other in (S, S[:, :, :1], S[..., :1], S[..., 0, 0][..., None, None], S[..., 0, 0]):
        scores = arrays.mahalanobis(y, other)
        wide = np.broadcast_to(other.reshape(*other.shape, *[1] * (4 - other.ndim)), S.shape)
        assert scores.shape == (4, 5)
        np.testing.assert_allclose(scores[2, 3], y[:, 2, 3] @ np.linalg.solve(wide[..., 2, 3], y[:, 2, 3]))
    assert np.isnan(arrays.mahalanobis(y, -np.eye(3))).all()


def test_elimination_broadcasts_the_runs_of_either():
    A = RNG.standard_normal((2, 2, 5))
    S, below = np.einsum("ikm,jkm->ijm", A, A) + np.eye(2)[..., None], RNG.standard_normal((3, 2, 5))
    for one, other in ((S, below[..., :1]), (S[..., :1], below), (S, below)):
        factors, D = arrays.eliminate(one, other)
        assert factors.shape == (5, 2, 5) and D.shape == (2, 5)
        for r in range(5):
            s, b = one[..., r % one.shape[2]], other[..., r % other.shape[2]]
            np.testing.assert_allclose(factors[2:, :, r] @ np.diag(D[:, r]) @ np.array([[1, factors[1, 0, r]], [0, 1]]), b, atol=1e-12)
            np.testing.assert_allclose(D[0, r], s[0, 0])
    upper = S.copy()
    upper[0, 1] = np.nan  # only the lower half is read
    assert np.array_equal(arrays.eliminate(upper, below)[1], arrays.eliminate(S, below)[1])
    nothing = arrays.eliminate(0 * S, below)
    assert np.isnan(nothing[0]).all() and np.isnan(nothing[1]).all()
    nobody = arrays.eliminate(S[:1, :1], below[:0, :1])  # one row, and none below
    assert nobody[0].shape == (1, 1, 5) and np.array_equal(nobody[1], S[:1, 0])
    single = arrays.eliminate(S[..., 0], below[..., 0])
    assert single[0].shape == (5, 2) and np.allclose(single[1], arrays.eliminate(S, below)[1][:, 0])


def test_roots_and_triangular_solutions_of_one_and_of_many():
    A = RNG.standard_normal((3, 3, 4))
    P = np.einsum("ikm,jkm->ijm", A, A) + np.eye(3)[..., None]
    before = P.copy()
    L = arrays.cholesky(P)
    assert np.array_equal(P, before) and np.array_equal(L[0, 1:], np.zeros((2, 4)))
    B = RNG.standard_normal((3, 2, 4))
    solved = arrays.solve_lower(L, B)
    np.testing.assert_allclose(solved[..., 1], np.linalg.solve(L[..., 1], B[..., 1]))
    np.testing.assert_allclose(arrays.solve_lower(L, np.ones((3, 1)))[:, 2], np.linalg.solve(L[..., 2], np.ones(3)))
    np.testing.assert_allclose(arrays.solve_lower(L[..., 0], np.ones(3)), np.linalg.solve(L[..., 0], np.ones(3)))
    for P0 in (np.zeros((2, 2)), np.diag([1.0, 0.0]), np.diag([-1.0, 1.0])):
        assert np.isnan(arrays.cholesky(P0)).any() and np.isnan(arrays.inverse(P0)).any()
    np.testing.assert_allclose(arrays.inverse(P[..., 0]), np.linalg.inv(P[..., 0]), atol=1e-13)
    np.testing.assert_allclose(arrays.transpose(B), B.swapaxes(0, 1))
    with pytest.raises(ValueError, match=r"^A: expected shape \(p, q, \.\.\.\), got \(3,\)"):
        arrays.transpose(np.ones(3))


@pytest.mark.parametrize(
    ("A", "P", "words"),
    [
        (np.ones((1, 2)), np.eye(3), "A: expected shape"),
        (np.ones(2), np.eye(2), "A: expected shape"),
        (np.ones((1, 2)), np.ones((2, 3)), "P: expected shape"),
        (np.ones((1, 2)), 1.0, "A: expected shape"),
        (np.ones((1, 2)), np.diag([1.0, np.nan]), "P: expected finite"),
        (np.ones((1, 2)), np.diag([1.0, -1e-9]), "P: expected a covariance, got a variance of -1e-09"),
    ],
)
def test_quotients_that_are_none_are_named(A, P, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        arrays.divide(A, P)


def test_a_time_step_ends_at_a_million_million_seconds():
    for dt in (0, 0.0, 1e12, 10**12, np.float64(1e12), np.float32(1.0), np.array(5)):
        assert type(checks.check_dt(dt)) is float and checks.check_dt(dt) == dt
    for dt in (np.nextafter(1e12, 2e12), 10**12 + 1, -5e-324, -1):
        with pytest.raises(ValueError, match=r"^step: expected a finite time step ≥ 0 and ≤ 1e12, seconds as a number, got"):
            checks.check_dt(dt, "step")
    assert checks.check_scale(sys.float_info.max, "a") == sys.float_info.max and checks.check_scale(10**12 + 1, "a") == 1e12 + 1
    for value in (10**309, np.inf, -5e-324, True):
        with pytest.raises(ValueError, match=r"^a: expected a finite number ≥ 0, got"):
            checks.check_scale(value, "a")


def test_numbers_say_what_was_wanted():
    assert checks.check_number(1, "a", low=1, high=1) == 1.0 and type(checks.check_number(1, "a")) is float
    for value, bounds in ((np.nextafter(1, 0), {"low": 1}), (np.nextafter(1, 2), {"high": 1})):
        with pytest.raises(ValueError, match=r"^a: expected something near one, got"):
            checks.check_number(value, "a", "something near one", **bounds)
    for value in (np.ones(1), [[1.0]], np.nan, -np.inf):
        with pytest.raises(ValueError, match=r"^a: expected a finite number, got"):
            checks.check_number(value, "a")
    with pytest.raises(ValueError, match=r"^a: expected a wavelength, got 0"):
        checks.check_positive(0, "a", "a wavelength")
    with pytest.raises(ValueError, match=r"^a: expected a whole number ≥ 3, got 2"):
        checks.check_count(2, "a", 3)
    assert checks.check_count(sys.maxsize, "a") == sys.maxsize
    with pytest.raises(ValueError, match=r"^a: expected a whole number ≥ 1"):
        checks.check_count(sys.maxsize + 1, "a")


def test_finite_arrays_whatever_their_size():
    big = np.full(3, 1e200)
    assert checks.all_finite(big) and checks.all_finite([1, 2]) and checks.all_finite(np.zeros(0))
    assert not checks.all_finite([1.0, np.inf]) and not checks.all_finite([[np.nan]])
    assert checks.check_array(big, "a", 3) is big and checks.check_matrix(big[None], "a", (1, 3)).shape == (1, 3)
    value = np.array([1.0, 2.0])
    assert checks.check_vector(value, "a", 2) is value and checks.check_vector(value, "a").tolist() == [1, 2]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: checks.check_array(np.zeros((2, 3)), "a", 3),
            r"a: expected shape \(3, \.\.\.\), components on the first axis, got \(2, 3\)",
        ),
        (
            lambda: checks.check_array(np.zeros((2, 3)), "a", 2, (4,)),
            r"a: expected shape \(2, 4\), components on the first axis, got \(2, 3\)",
        ),
        (lambda: checks.check_array(np.zeros(2), "a", None, (4,)), r"a: expected shape \(n, 4\), components"),
        (lambda: checks.check_array("x", "a", None), r"a: expected numbers of shape \(n,\) or \(n, \.\.\.\)"),
        (lambda: checks.check_array([1.0, np.inf], "a", 2), r"a: expected finite numbers, got \[ *1\. *inf\]"),
        (lambda: checks.check_vector([1.0, 2.0], "a", 3), r"a: expected shape \(3,?\)"),
        (lambda: checks.check_matrix([[1, np.nan], [np.inf, 0]], "a", (2, 2)), "a: expected finite numbers, got 2 that are not"),
        (lambda: checks.check_covariance([[1, np.nan], [np.nan, 1]], "a", 2), "a: expected finite numbers, got 2 that are not"),
        (lambda: checks.check_covariance(np.eye(2), "a", 3, 4), r"a: expected shape \(3, 3\) or \(3, 3, 4\), got \(2, 2\)"),
        (lambda: checks.check_covariance(np.ones((2, 2, 3)), "a", 2), r"a: expected shape \(2, 2\), got \(2, 2, 3\)"),
        (
            lambda: checks.check_covariance([[1, 0.5], [0.25, 1]], "a", 2),
            "a: expected a symmetric matrix, got one that differs from its transpose by up to 0.25",
        ),
        (lambda: checks.check_covariance(np.diag([1.0, -2.0]), "a", 2), "a: expected a positive semidefinite matrix, got a variance of -2"),
        (
            lambda: checks.check_covariance(np.diag([1.0, -2.0]), "a", 2, definite=True),
            "a: expected a positive definite matrix, got a variance of -2",
        ),
        (
            lambda: checks.check_covariance([[1, 0.1], [0.1, 0]], "a", 2),
            "a: expected a positive semidefinite matrix, got a covariance with a component that has no variance",
        ),
        (
            lambda: checks.check_covariance([[1, 1.5], [1.5, 1]], "a", 2),
            r"a: expected a positive semidefinite matrix, got one whose correlations have the eigenvalue -0\.5",
        ),
        (
            lambda: checks.check_covariance(np.diag([1.0, 0.0]), "a", 2, definite=True),
            "a: expected a positive definite matrix, got one whose",
        ),
        (lambda: checks.check_mask([1, 0], "a", 2), r"a: expected booleans of shape \(2,\), got int64 of shape \(2,\)"),
        (lambda: checks.check_choice("c", "a", ["x", "y"]), r"a: expected one of \('x', 'y'\), got 'c'"),
        (lambda: checks.check_names(["x", "x"], "a"), "a: expected a sequence of names, each once, got"),
        (lambda: checks.check_angles([2], 2), r"angles: expected indices from 0 to 1, got \[2\]"),
        (
            lambda: checks.check_together(a=[1, 2], b=[1, 2, 3]),
            r"a, b: expected one number, or arrays of one length, got the shapes \(2,\), \(3,\)",
        ),
        (lambda: checks.check_lengths(a=[1, 2], b=[1]), r"a, b: expected arrays of one length, got the shapes \(2,\), \(1,\)"),
        (lambda: checks.check_lengths(a=[1, 2], b=1.0), r"a, b: expected arrays of one length, got the shapes \(2,\), \(\)"),
    ],
)
def test_what_is_refused_is_said_in_words(call, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        call()


@pytest.mark.parametrize("units", [[1.0, 1.0], [1e4, 1e-4]])
@pytest.mark.parametrize("runs", [None, 3])
def test_rounding_of_a_covariance_is_a_thousand_millionth_of_a_correlation(units, runs):
    def covariance(upper, lower):
        P = np.outer(units, units) * [[1.0, upper], [lower, 1.0]]
        return P if runs is None else np.stack([np.diag(np.square(units))] * (runs - 1) + [P], axis=-1)

    for upper, lower in ((0.5, 0.5 + 5e-10), (0.5 + 5e-10, 0.5), (1 + 5e-10, 1 + 5e-10), (-1 - 5e-10, -1 - 5e-10)):
        assert checks.check_covariance(covariance(upper, lower), "P", 2, runs).shape[:2] == (2, 2)
    for upper, lower, words in ((0.5, 0.5 + 2e-9, "symmetric"), (0.5 + 2e-9, 0.5, "symmetric"), (1 + 2e-9, 1 + 2e-9, "eigenvalue")):
        with pytest.raises(ValueError, match=words):
            checks.check_covariance(covariance(upper, lower), "P", 2, runs)
    with pytest.raises(ValueError, match="definite"):
        checks.check_covariance(covariance(1.0, 1.0), "P", 2, runs, definite=True)
    nought = np.zeros((2, 2)) if runs is None else np.zeros((2, 2, runs))
    assert np.array_equal(checks.check_covariance(nought, "P", 2, runs), nought)


def test_units_of_a_covariance_and_correlations_in_them():
    P = np.array([[4.0, 3.0, 0.0], [3.0, 9.0, 0.0], [0.0, 0.0, 0.0]])
    assert checks.deviations(P).tolist() == [2.0, 3.0, 1.0]
    np.testing.assert_allclose(checks.correlations(P), [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 0]])
    many = np.stack([P, 4 * P], axis=-1)
    assert checks.deviations(many).tolist() == [[2.0, 4.0], [3.0, 6.0], [1.0, 1.0]]
    np.testing.assert_allclose(checks.correlations(many)[..., 1], checks.correlations(P))


def test_lengths_and_names_that_fit():
    a, b = checks.check_lengths(("b",), a=np.ones((3, 2)), b=1.0)
    assert a.shape == (3, 2) and b.shape == ()
    assert checks.check_names(("a", "b"), "a") == ("a", "b") and checks.check_names([], "a", empty=True) == ()
    assert [c.shape for c in checks.check_together(a=np.ones((2, 1)), b=np.ones(3))] == [(2, 1), (3,)]
    assert (
        checks.check_angles((), 0) == ()
        and checks.check_angles(iter([1, 0]), 2) == (1, 0)
        and checks.check_angles((np.int64(1),), 2) == (1,)
    )


def test_scores_without_a_compiler_are_the_same(monkeypatch):
    A, y = RNG.standard_normal((3, 3, 5)), RNG.standard_normal((3, 5))
    S = np.einsum("ikm,jkm->ijm", A, A) + np.eye(3)[..., None]
    S[1, 1, 2] = -9.0
    compiled = arrays.mahalanobis(y, S)
    monkeypatch.setattr(fused, "binding", None)
    plain = arrays.mahalanobis(y, S)
    np.testing.assert_allclose(plain, compiled)
    assert np.isnan(plain).tolist() == [False, False, True, False, False]
    np.testing.assert_allclose(plain[4], y[:, 4] @ np.linalg.solve(S[..., 4], y[:, 4]))

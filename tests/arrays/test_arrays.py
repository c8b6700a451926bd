import numpy as np
import pytest

from trackhelpers import arrays


@pytest.fixture
def stack():
    """Five positive definite 4×4 matrices, runs last, and as a stack NumPy's own functions take."""
    A = np.random.default_rng(1).normal(size=(5, 4, 4))
    P = A @ np.swapaxes(A, 1, 2) + np.eye(4)
    return np.moveaxis(P, 0, -1), P


def test_products_equal_numpys_run_by_run(stack):
    P, rows = stack
    A = np.random.default_rng(2).normal(size=(3, 4, 5))
    for m in range(5):
        np.testing.assert_allclose(arrays.matmul(A, P)[..., m], A[..., m] @ rows[m])
        np.testing.assert_allclose(arrays.congruence(A, P)[..., m], A[..., m] @ rows[m] @ A[..., m].T)
        np.testing.assert_allclose(arrays.matvec(A, P[0])[..., m], A[..., m] @ P[0][:, m])


def test_cholesky_inverse_and_mahalanobis_equal_numpys(stack):
    P, rows = stack
    y = np.random.default_rng(3).normal(size=(4, 5))
    np.testing.assert_allclose(arrays.cholesky(P), np.moveaxis(np.linalg.cholesky(rows), 0, -1))
    np.testing.assert_allclose(arrays.inverse(P), np.moveaxis(np.linalg.inv(rows), 0, -1), atol=1e-14)
    np.testing.assert_allclose(arrays.mahalanobis(y, P), [y[:, m] @ np.linalg.solve(rows[m], y[:, m]) for m in range(5)])
    np.testing.assert_allclose(arrays.mahalanobis(y[:, 0], P[..., 0]), y[:, 0] @ np.linalg.solve(rows[0], y[:, 0]))


def test_an_indefinite_run_becomes_nan_and_leaves_its_neighbours(stack):
    P, _ = stack
    clean = arrays.inverse(P)
    P = P.copy()
    P[0, 0, 2] = -1
    spoilt = arrays.inverse(P)
    assert np.isnan(spoilt[..., 2]).any()
    assert np.array_equal(np.delete(spoilt, 2, -1), np.delete(clean, 2, -1))


def test_elimination_is_a_triangular_factorisation_carried_on(stack):
    P, rows = stack
    below = np.random.default_rng(4).normal(size=(2, 4, 5))
    A, D = arrays.eliminate(P, below)
    for m in range(5):
        L = np.tril(A[:4, :, m], -1) + np.eye(4)
        np.testing.assert_allclose(L @ np.diag(D[:, m]) @ L.T, rows[m], atol=1e-13)
        np.testing.assert_allclose(A[4:, :, m] @ np.diag(D[:, m]) @ L.T, below[..., m], atol=1e-13)


@pytest.mark.parametrize(
    "function", [lambda P: arrays.eliminate(P, np.ones((2, 4, 5)))[0][4:], lambda P: arrays.mahalanobis(np.ones((4, 5)), P)]
)
@pytest.mark.parametrize("place", [(0, 0), (3, 3)])
def test_elimination_marks_an_indefinite_run_and_leaves_its_neighbours(stack, function, place):
    spoilt = stack[0].copy()
    spoilt[(*place, 2)] = -50
    clean, marked = function(stack[0]), function(spoilt)
    assert np.isnan(marked[..., 2]).all()
    assert np.array_equal(np.delete(marked, 2, -1), np.delete(clean, 2, -1))
    spoilt[..., 2] = np.eye(4)
    spoilt[(*place, 2)] = 0.0  # certain, which is not positive definite either
    assert np.isnan(function(spoilt)[..., 2]).all()


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_all_finite_sees_one_number_that_is_not(number):
    a = np.full((2, 3), 1e200)  # whose square overflows
    assert arrays.all_finite(a) and arrays.all_finite(a[:, ::2]) and arrays.all_finite(np.zeros((2, 0)))
    a[1, 1] = number
    assert not arrays.all_finite(a) and not arrays.all_finite(a / 1e200)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_factors_and_quotients_are_those_of_any_scale(stack, scale):
    P, rows = scale * stack[0], scale * stack[1]
    A = np.random.default_rng(5).normal(size=(3, 4))
    np.testing.assert_allclose(arrays.divide(A, rows[0]) @ rows[0], A)
    many = arrays.divide(np.repeat(A[..., None], len(rows), axis=2), P)
    for k, each in enumerate(rows):
        np.testing.assert_allclose(many[..., k], arrays.divide(A, each), rtol=1e-10)
    factors, D = arrays.eliminate(P, np.ones((1, 4, 5)))
    np.testing.assert_allclose(np.prod(D, axis=0), np.linalg.det(rows))
    assert np.isfinite(factors).all()
    np.testing.assert_allclose(arrays.inverse(P), np.moveaxis(np.linalg.inv(rows), 0, -1))


def test_a_quotient_leaves_out_what_has_no_variance_and_keeps_what_has_little():
    np.testing.assert_allclose(arrays.divide(np.ones((1, 3)), np.diag([4.0, 0.0, 1e-12])), [[0.25, 0, 1e12]])
    nearly = np.array([[1.0, 1 - 1e-9], [1 - 1e-9, 1.0]])
    np.testing.assert_allclose(arrays.divide(nearly[:1], nearly), [[1, 0]], atol=1e-6)
    np.testing.assert_allclose(arrays.divide(np.ones((1, 2)), np.ones((2, 2))), [[0.5, 0.5]])
    with pytest.raises(ValueError, match=r"variance of -0\.1"):
        arrays.divide(np.ones((1, 2)), np.diag([1.0, -0.1]))


def test_a_symmetric_part_is_the_mean_of_a_matrix_and_its_transpose(stack):
    A = np.random.default_rng(6).normal(size=(3, 3, 2))
    np.testing.assert_allclose(arrays.symmetrised(A), (A + A.swapaxes(0, 1)) / 2)
    np.testing.assert_allclose(arrays.symmetrised(A[..., 0]), (A[..., 0] + A[..., 0].T) / 2)


@pytest.mark.parametrize(
    "call",
    [
        lambda: arrays.matmul(np.ones((2, 3)), np.ones((2, 3))),
        lambda: arrays.matmul(np.ones(2), np.ones((2, 3))),
        lambda: arrays.matmul(np.ones((2, 2, 4)), np.ones((2, 2, 3))),
        lambda: arrays.matvec(np.ones((2, 3)), np.ones(2)),
        lambda: arrays.matvec(np.ones((2, 3, 4)), np.ones((3, 2))),
        lambda: arrays.matvec(np.ones(3), np.ones(3)),
        lambda: arrays.transpose(np.ones(3)),
        lambda: arrays.congruence(np.ones((2, 3)), np.ones((2, 2))),
        lambda: arrays.symmetrised(np.ones((2, 3))),
        lambda: arrays.cholesky(np.ones(4)),
        lambda: arrays.solve_lower(np.eye(2), np.ones(3)),
        lambda: arrays.solve_lower(np.eye(2), np.array(1.0)),
        lambda: arrays.eliminate(np.eye(2), np.ones((1, 3))),
        lambda: arrays.mahalanobis(np.ones(3), np.eye(2)),
        lambda: arrays.mahalanobis(np.ones((2, 3)), np.ones((2, 2, 4))),
    ],
)
def test_shapes_that_do_not_fit_are_told(call):
    with pytest.raises(ValueError, match=r"expected shapes? .*, got "):
        call()


def test_runs_broadcast_where_one_has_none_or_one(stack):
    P, rows = stack
    one = np.random.default_rng(7).normal(size=(4, 4))
    for A in (one, one[..., None]):
        np.testing.assert_allclose(arrays.matmul(A, P)[..., 3], one @ rows[3])
        np.testing.assert_allclose(arrays.congruence(A, P)[..., 3], one @ rows[3] @ one.T)

"""Residuals of equations: random systems, the largest difference, derivatives that are exact to rounding."""

import numpy as np
import pytest

from trackhelpers.scenarios.thesis.equations import gradient, largest_difference, minimise_quadratic, random_systems


def test_random_systems_fit_together_and_have_definite_covariances():
    systems = random_systems(np.random.default_rng(0), count=40)
    assert {len(s.A) for s in systems} == {1, 2, 3, 4}
    assert {len(s.H) for s in systems} == {1, 2, 3}
    for s in systems:
        n, m, inputs = len(s.A), len(s.H), len(s.u)
        shapes = [part.shape for part in s]
        assert shapes == [(n, n), (n, inputs), (m, n), (n, n), (n, n), (m, m), (n,), (inputs,), (n,), (m,)]
        np.testing.assert_array_equal(s.z, s.H @ s.x + s.v)
        for P in (s.P, s.Q, s.R):
            np.testing.assert_array_equal(P, P.T)
            assert np.linalg.eigvalsh(P)[0] >= 0.2 - 1e-12


def test_random_systems_repeat_with_their_seed_and_keep_the_sizes_asked_for():
    one, other = (random_systems(np.random.default_rng(1), count=3, n=4, m=2) for _ in range(2))
    for s, t in zip(one, other, strict=True):
        assert s.H.shape == (2, 4)
        assert all(np.array_equal(a, b) for a, b in zip(s, t, strict=True))


def test_largest_difference_finds_one_wrong_entry_at_one_point():
    points = range(25)
    wrong = np.zeros((2, 3))
    wrong[1, 2] = -0.25
    assert largest_difference(points, lambda k: np.ones((2, 3)), lambda k: np.ones((2, 3)) + (k == 17) * wrong) == 0.25


def test_largest_difference_does_not_hide_nan():
    assert np.isnan(largest_difference(range(20), lambda k: np.nan if k == 3 else 0.0, lambda k: 0.0))


def test_gradient_of_a_trace_is_the_transpose():
    rng = np.random.default_rng(2)
    A, K = rng.normal(size=(3, 2)), rng.normal(size=(2, 3))
    np.testing.assert_allclose(gradient(lambda K: np.trace(K @ A), K), A.T, atol=1e-15)
    np.testing.assert_allclose(gradient(lambda K: np.trace(K @ K.T), K), 2 * K, atol=1e-15)


def test_quadratic_is_least_where_its_square_was_completed():
    rng = np.random.default_rng(3)
    S, best = random_systems(rng, count=1, m=3)[0].R, rng.normal(size=(2, 3))
    found, curvature = minimise_quadratic(lambda K: np.trace((K - best) @ S @ (K - best).T), (2, 3))
    np.testing.assert_allclose(found, best, atol=1e-12)
    np.testing.assert_allclose(curvature, np.kron(np.eye(2), 2 * S), atol=1e-12)


def test_of_many_minimisers_the_least_is_taken():
    found, curvature = minimise_quadratic(lambda K: (np.sum(K) - 2) ** 2, (2, 1))
    np.testing.assert_allclose(found, [[1.0], [1.0]], atol=1e-12)
    assert np.linalg.matrix_rank(curvature) == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: random_systems(np.random.default_rng(0), count=0), "count: .*≥ 1.*0"),
        (lambda: random_systems(np.random.default_rng(0), n=1.5), "n: .*1.5"),
        (lambda: largest_difference(range(19), abs, abs), "points: .*20.*19"),
        (lambda: largest_difference(range(20), lambda k: np.ones(2), lambda k: np.ones((2, 1))), r"printed, derived: .*\(2,\).*\(2, 1\)"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

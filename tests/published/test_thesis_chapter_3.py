"""Each printed equation differs from the derived one where the notebook says it does, and nowhere else."""

import numpy as np
import pytest

from trackhelpers.motion import CTRV, PolarCA
from trackhelpers.published import thesis_chapter_3 as thesis

T = 0.7
RIGHT = CTRV(2.0, 0.3)


@pytest.fixture
def x():
    """CTRV states (5, 30) that turn to either side by 0.1 … 1 rad/s."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(5, 30))
    states[4] = rng.choice([-1, 1], 30) * rng.uniform(0.1, 1, 30)
    return states


def differing(A, B, tolerance=1e-9):
    """Index pairs at which two stacks of matrices (n, n, M) differ in any run."""
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(np.max(np.abs(A - B), axis=-1) > tolerance), strict=True)}


def test_36_moves_rightly_but_gives_the_acceleration_to_the_heading(x):
    printed, right = thesis.transition_36(x, T), PolarCA().f(x, T)
    np.testing.assert_allclose(printed[[0, 1, 4]], right[[0, 1, 4]], atol=1e-12)
    np.testing.assert_allclose(printed[2] - right[2], T * x[4], atol=1e-12)
    np.testing.assert_allclose(right[3] - printed[3], T * x[4], atol=1e-12)


def test_38_is_ctrv_where_it_turns_and_not_a_number_where_it_does_not(x):
    np.testing.assert_allclose(thesis.transition_38(x, T), RIGHT.f(x, T), atol=1e-12)
    x[4] = 0
    with np.errstate(invalid="ignore", divide="ignore"):
        assert np.isnan(thesis.transition_38(x, T)[:2]).all()


def test_39_goes_straight_but_sets_the_heading_to_the_turn_rate(x):
    x[4] = 0
    printed, right = thesis.transition_39_straight(x, T), RIGHT.f(x, T)
    np.testing.assert_allclose(printed[[0, 1, 2, 4]], right[[0, 1, 2, 4]], atol=1e-12)
    np.testing.assert_array_equal(printed[3], 0)


def test_310_has_two_columns_exchanged_and_a_factor_that_only_one_second_hides(x):
    printed, right = thesis.jacobian_310(x, T), RIGHT.F(x, T)
    assert differing(printed, right) == {(1, 2), (1, 3), (0, 4), (1, 4)}
    np.testing.assert_allclose(printed[1, [3, 2]], right[1, [2, 3]], atol=1e-12)
    np.testing.assert_allclose(thesis.jacobian_310(x, 1.0)[:, 4], RIGHT.F(x, 1.0)[:, 4], atol=1e-12)
    np.testing.assert_allclose(thesis.jacobian_310_repaired(x, T), right, atol=1e-12)


def test_311_forgets_that_the_turn_rate_moves_the_position(x):
    x[4] = 0
    printed, right = thesis.jacobian_311(x, T), RIGHT.F(x, T)
    assert differing(printed, right) == {(0, 4), (1, 4)}
    half = x[2] * T**2 / 2
    np.testing.assert_allclose((right - printed)[:2, 4], [-half * np.sin(x[3]), half * np.cos(x[3])], atol=1e-12)


def test_312_is_the_straight_line_gain_and_not_the_response_of_the_arc(x):
    mu = np.array([0.5, -0.2])
    straight, arc = (np.einsum("ijm,j->im", CTRV(2.0, 0.3, noise=noise).G(x, T), mu) for noise in ("straight", "exact"))
    np.testing.assert_allclose(thesis.noise_312(x, T, mu), straight, atol=1e-12)
    assert np.max(np.abs(straight - arc)) > 1e-3


def test_316_is_right_for_a_variance_of_one_and_asymmetric_otherwise(x):
    np.testing.assert_allclose(thesis.covariance_316(x, T, 2.0, 1.0), CTRV(2.0, 1.0).Q(x, T), atol=1e-12)
    printed, right = thesis.covariance_316(x, T, 2.0, 0.3), RIGHT.Q(x, T)
    assert differing(printed, right) == {(4, 3), (4, 4)}
    np.testing.assert_allclose(printed[4, 3:] * 0.3, right[4, 3:], rtol=1e-12)
    assert np.all(np.abs(printed[4, 3] - printed[3, 4]) > 1e-3)

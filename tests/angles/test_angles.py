import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackhelpers.angles import cos_sin, mean, residual, wrap, wrap_components

angle = st.floats(-1e3, 1e3)


@given(angle)
def test_wrap_keeps_the_direction_and_lands_in_the_half_open_circle(a):
    w = wrap(a)
    assert -np.pi <= w < np.pi
    np.testing.assert_allclose(np.exp(1j * w), np.exp(1j * a), atol=1e-12)


def test_wrap_leaves_angles_in_the_circle_bit_for_bit_and_takes_pi_to_minus_pi():
    inside = np.array([-np.pi, -1.0, 0.0, 0.1, 3.14159])
    assert np.array_equal(wrap(inside), inside)
    assert [wrap(a) for a in inside] == list(inside)
    assert wrap(np.pi) == -np.pi
    assert np.isnan(wrap(np.nan))


def test_residual_goes_the_short_way_round_in_the_named_rows_only():
    a, b = np.array([[5.0], [3.1]]), np.array([[1.0], [-3.1]])
    np.testing.assert_allclose(residual(a, b, (1,)), [[4.0], [6.2 - 2 * np.pi]])
    np.testing.assert_allclose(residual(a, b), [[4.0], [6.2]])


def test_mean_across_the_cut_equals_the_mean_turned_away_from_it():
    spread, weights = np.array([0.0, 0.3, -0.2]), np.array([-1.0, 1.2, 0.8])
    across = mean((np.pi + spread)[None], weights, (0,))
    np.testing.assert_allclose(across, wrap(np.pi + weights @ spread))


def test_mean_with_large_negative_weight_does_not_flip():
    points = np.array([[0.0, 1.2, -1.2]])
    np.testing.assert_allclose(mean(points, [-9.0, 5.0, 5.0], (0,)), 0, atol=1e-15)


def test_wrap_components_leaves_the_argument_alone():
    x = np.array([10.0, 10.0])
    np.testing.assert_allclose(wrap_components(x, (1,)), [10, 10 - 4 * np.pi])
    assert x[1] == 10


def test_every_named_row_is_wrapped_of_one_vector_and_of_more_than_there_are_components():
    x = np.array([7.0, 7.0, -8.0])
    expected = [7, 7 - 2 * np.pi, -8 + 2 * np.pi]
    np.testing.assert_allclose(wrap_components(x, (1, 2)), expected)
    np.testing.assert_allclose(wrap_components(x[:, None], (1, 2))[:, 0], expected)
    np.testing.assert_allclose(wrap_components(np.tile(x[:, None], 5), (1, 2))[:, 4], expected)
    with pytest.raises(ValueError, match="angles"):
        wrap_components(np.tile(x[:, None], 5), (3,))


@given(angle)
def test_cosine_and_sine_of_a_number_and_of_arrays_are_numpys(a):
    for x in (a, np.array(a), np.array([[a, -a]])):
        np.testing.assert_allclose(cos_sin(x), (np.cos(x), np.sin(x)), atol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_mean_refuses_weights_that_do_not_fit(count):
    with pytest.raises(ValueError, match="weights: expected shape"):
        mean(np.zeros((2, 3)), np.full(count, 1 / count))

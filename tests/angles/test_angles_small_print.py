"""Angles at the cut, of every shape, and what is refused."""

import numpy as np
import pytest

from trackhelpers import angles


def test_the_circle_is_closed_at_minus_pi_and_open_at_pi():
    for shape in ((), (1,), (2, 3)):
        for a, expected in (
            (np.pi, -np.pi),
            (-np.pi, -np.pi),
            (3 * np.pi, -np.pi),
            (np.nextafter(np.pi, 0), np.nextafter(np.pi, 0)),
            (4.0, 4 - 2 * np.pi),
            (-4.0, 2 * np.pi - 4),
        ):
            found = angles.wrap(np.full(shape, a))
            assert np.shape(found) == shape and np.allclose(found, expected, rtol=0, atol=1e-15)
    assert isinstance(angles.wrap(1), float) and angles.NAMES == ("θ", "Φ", "ψ")
    with pytest.raises(ValueError, match=r"^angle: expected numbers"):
        angles.wrap("north")


def test_rows_are_wrapped_in_place_and_a_diverged_run_stays_one():
    x = np.array([[4.0, 1.0, np.inf, np.nan], [4.0, -4.0, 4.0, 4.0]])
    found = angles.wrap_rows(x, (0,))
    assert found is x and x[1].tolist() == [4, -4, 4, 4] and x[0, 1] == 1.0 and np.isnan(x[0, 2:]).all()
    assert x[0, 0] == pytest.approx(4 - 2 * np.pi)
    vector = np.array([4.0, 4.0])
    assert angles.wrap_rows(vector, ()) is vector and vector.tolist() == [4, 4]


def test_differences_broadcast_and_keep_what_is_no_angle():
    a, b = np.array([[3.0], [3.0]]), np.array([[-3.0, 0.0, 3.0], [-3.0, 0.0, 3.0]])
    np.testing.assert_allclose(angles.residual(a, b, [1]), [[6, 3, 0], [6 - 2 * np.pi, 3, 0]])
    np.testing.assert_allclose(angles.residual(a, b, ()), [[6, 3, 0], [6, 3, 0]])
    np.testing.assert_allclose(angles.residual(a, b, []), [[6, 3, 0], [6, 3, 0]])
    assert angles.residual(3.0, 1.0) == 2.0
    for call in (lambda: angles.residual(np.zeros(2), np.zeros(3)), lambda: angles.residual("a", 1.0)):
        with pytest.raises(ValueError, match=r"^a(, b)?: expected"):
            call()
    for wrong in ((2,), (-1,), (0.5,)):
        with pytest.raises(ValueError, match=r"^angles: expected indices from 0 to 1"):
            angles.residual(a, b, wrong)
    with pytest.raises(ValueError, match=r"^angles: expected"):
        angles.residual(3.0, 1.0, (0,))
    with pytest.raises(ValueError, match=r"^angles: expected"):
        angles.wrap_components(3.0, (0,))


def test_means_of_angles_and_of_others_by_hand():
    points = np.array([[1.0, 2.0, 6.0], [3.0, -3.0, 3.1], [3.0, -3.0, 3.1]])
    weights = np.array([0.5, 0.25, 0.25])
    west = 3.0 + 0.25 * (2 * np.pi - 6.0) + 0.25 * 0.1
    np.testing.assert_allclose(angles.mean(points, weights, (1,)), [2.5, west - 2 * np.pi * (west >= np.pi), 0.5 * 3 - 0.75 + 0.775])
    many = angles.mean(np.stack([points, -points], axis=2), weights, [1])
    np.testing.assert_allclose(many[:, 0], angles.mean(points, weights, (1,)))
    np.testing.assert_allclose(many[:, 1], -angles.mean(points, weights, (1,)))
    np.testing.assert_allclose(angles.mean(points, weights), points @ weights)
    for wrong, words in (
        ((points, weights[:2]), r"weights: expected shape \(3,\) for points \(3, 3\), got \(2,\)"),
        ((points[0], weights), r"weights: expected shape \(\?,\) for points \(3,\)"),
        ((points, weights[None]), "weights: expected shape"),
        ((points, weights, (3,)), "angles: expected"),
    ):
        with pytest.raises(ValueError, match=f"^{words}"):
            angles.mean(*wrong)


def test_cosine_and_sine_of_a_number_are_pythons():
    cos, sin = angles.cos_sin(0.3)
    assert type(cos) is type(sin) is float
    np.testing.assert_allclose(
        angles.cos_sin(np.array([0.0, np.pi / 2, -2.0])), [np.cos([0, np.pi / 2, -2.0]), np.sin([0, np.pi / 2, -2.0])], atol=1e-15
    )

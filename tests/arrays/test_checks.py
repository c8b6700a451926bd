from datetime import timedelta
from fractions import Fraction

import numpy as np
import pytest

from trackhelpers import arrays, checks


@pytest.mark.parametrize(
    "dt",
    [
        -1e-9,
        np.nan,
        np.inf,
        10**400,
        "1",
        None,
        [1, 2],
        [1.0],
        True,
        np.array(True),
        1j,
        timedelta(seconds=1),
        np.timedelta64(1, "s"),
        np.ma.masked,
    ],
)
def test_only_a_number_is_a_time_step_or_a_scale(dt):
    with pytest.raises(ValueError, match="dt: expected a finite time step ≥ 0 and ≤ 1e12, seconds as a number, got"):
        arrays.check_dt(dt)
    with pytest.raises(ValueError, match="sigma: expected a finite number ≥ 0, got"):
        arrays.check_scale(dt, "sigma")


@pytest.mark.parametrize("number", [2, 2.0, np.float32(2), np.int8(2), np.array(2.0), np.ma.array(2.0), Fraction(2)])
def test_every_kind_of_number_is_a_float_of_the_same_value(number):
    for value in (arrays.check_dt(number), arrays.check_scale(number, "sigma")):
        assert type(value) is float and value == 2


def test_zero_dt_is_allowed():
    assert arrays.check_dt(0) == 0.0


@pytest.mark.parametrize(
    ("P", "message"),
    [
        (np.eye(3), r"P0: expected shape \(2, 2\), got \(3, 3\)"),
        ([[1, np.nan], [0, 1]], "finite"),
        ([[1, 0.5], [0, 1]], "symmetric"),
        ([[1, 2], [2, 1]], "semidefinite"),
        ("wide", "covariance"),
        (np.diag([1e6, -1e-4]), "semidefinite.*variance of -0.0001"),  # whatever the units of the other component
        ([[1e12, 1e-3], [1e-3, 0]], "no variance"),
        ([[1e12, 1.001], [1.001, 1e-12]], "eigenvalue -0.001"),
        (1j * np.eye(2), "covariance"),
        (np.ma.array(np.eye(2), mask=np.eye(2)), "P0.*masked"),
    ],
)
def test_check_covariance_says_what_is_wrong(P, message):
    with pytest.raises(ValueError, match=message):
        arrays.check_covariance(P, "P0", 2)


def test_check_covariance_admits_semidefinite_matrices_unless_definite_ones_are_wanted():
    assert np.array_equal(arrays.check_covariance(np.zeros((2, 2)), "P0", 2), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="definite"):
        arrays.check_covariance(np.zeros((2, 2)), "P0", 2, definite=True)


def test_check_array_wants_finite_vectors_but_lets_a_diverged_run_pass():
    with pytest.raises(ValueError, match="x: expected finite"):
        arrays.check_array([1, np.nan], "x", 2)
    assert np.isnan(arrays.check_array([[1, np.nan], [0, 0]], "x", 2)[0, 1])


def test_a_vector_of_large_numbers_is_finite():
    x = np.full(2, 1e200)  # whose squares are not
    assert arrays.check_array(x, "x", 2) is x


@pytest.mark.parametrize("definite", [False, True])
def test_a_covariance_is_one_in_all_units(definite):
    """Correlations at the edge of what is allowed get the same verdict whatever the standard deviations."""
    for excess in (-1e-3, -1e-6, 1e-6, 1e-3):
        for units in ([1, 1], [1e6, 1e-6], [1e-9, 1e3]):
            P = np.outer(units, units) * [[1, 1 + excess], [1 + excess, 1]]
            for value, runs in ((P, None), (np.repeat(P[..., None], 3, axis=2), 3)):
                if excess < 0:
                    assert np.array_equal(arrays.check_covariance(value, "P", 2, runs, definite), value)
                else:
                    with pytest.raises(ValueError, match="definite"):
                        arrays.check_covariance(value, "P", 2, runs, definite)


def test_one_run_that_is_no_covariance_is_found_among_many():
    P = np.repeat(np.eye(2)[..., None], 4, axis=2)
    P[0, 1, 2] = P[1, 0, 2] = 1  # semidefinite
    assert np.array_equal(arrays.check_covariance(P, "P", 2, 4), P)
    P[0, 1, 2] = P[1, 0, 2] = 2
    with pytest.raises(ValueError, match="eigenvalue -1"):
        arrays.check_covariance(P, "P", 2, 4)


def test_a_checked_covariance_is_a_copy():
    P = np.eye(2)
    assert not np.shares_memory(arrays.check_covariance(P, "P", 2), P)


@pytest.mark.parametrize(
    "value",
    [
        np.ma.array([1, -999.0], mask=[False, True]),
        [1.0, np.ma.masked],
        [np.ma.array([1, -999.0], mask=[False, True]), [1, 2]],
        [1, 2j],
        np.array([1, 2j], dtype=object),
        ["1", "2"],
        np.array(["1", 2], dtype=object),
        np.array([1, 2], dtype="m8[s]"),
        [[1, 2], [3]],
    ],
)
def test_check_array_takes_nothing_for_something_else(value):
    with pytest.raises(ValueError, match="z: expected numbers"):
        arrays.check_array(value, "z", 2)


def test_an_array_without_a_masked_entry_is_data():
    assert np.array_equal(arrays.check_array(np.ma.array([1, 2]), "z", 2), [1, 2])


def test_check_array_of_any_length_still_wants_a_first_axis():
    assert arrays.check_array([1, 2, 3], "x", None).shape == (3,)
    with pytest.raises(ValueError, match=r"x: expected shape \(n, ...\).*got \(\)"):
        arrays.check_array(1.0, "x", None)


def test_a_matrix_is_finite_and_of_its_shape():
    assert arrays.check_matrix([[1, 2]], "H", (None, 2)).shape == (1, 2)
    for value, message in (([[1, np.inf]], "H: expected finite"), ([1, 2], r"H: expected shape \(n, 2\)"), (np.ones((1, 3)), "H")):
        with pytest.raises(ValueError, match=message):
            arrays.check_matrix(value, "H", (None, 2))


def refused(call, *values):
    """Whether each of the values is refused by a ValueError that names the argument."""
    for value in values:
        with pytest.raises(ValueError, match=r"^a: expected"):
            call(value, "a")
    return True


def test_numbers_at_the_edge_of_what_is_allowed():
    assert arrays.check_scale(0, "a") == 0 and refused(arrays.check_scale, -1e-300, -0.5)
    assert checks.check_positive(1e-300, "a") == 1e-300 and checks.check_positive(0.5, "a") == 0.5
    assert refused(checks.check_positive, 0, 0.0, -0.5, np.inf)
    assert [checks.check_probability(p, "a") for p in (1e-9, 0.5, 1 - 1e-9)] == [1e-9, 0.5, 1 - 1e-9]
    assert refused(checks.check_probability, 0, 1, -0.5, 1.5)
    assert checks.check_number(-0.5, "a") == -0.5 and refused(checks.check_number, np.inf, -np.inf, np.nan, [1.0])
    assert checks.check_number(2, "a", low=2) == checks.check_number(2, "a", high=2) == 2
    assert checks.check_count(1, "a") == 1 and checks.check_count(0, "a", 0) == 0
    assert refused(checks.check_count, 0, -1, True, 1.0, 2**63, np.timedelta64(3, "s"))
    assert type(checks.check_count(np.int8(3), "a")) is int


def test_words_masks_and_indices():
    assert checks.check_choice("one", "a", ("one", "two")) == "one"
    assert refused(lambda value, name: checks.check_choice(value, name, ("one", "two")), "three", 1, None)
    assert checks.check_names("xy", "a") == checks.check_names(["x", "y"], "a") == ("x", "y")
    assert checks.check_names((), "a", empty=True) == () and refused(checks.check_names, (), "xx", ["x", 1], 1, None)
    assert checks.check_mask([True, False], "a", 2).tolist() == [True, False]
    assert refused(lambda value, name: checks.check_mask(value, name, 2), [True], [1, 0], None, np.ones((2, 1), bool))
    assert refused(lambda value, name: checks.check_mask(value, name, 2), np.ma.array([True, False], mask=[True, False]))
    assert checks.check_angles((0, 2), 3) == checks.check_angles([0, 2], 3) == checks.check_angles(np.array([0, 2]), 3) == (0, 2)
    wrong = (3,), (7,), (-1,), [0, 3], [True], (False,), [0.0], 0, None
    assert refused(lambda value, name: checks.check_angles(value, 3, name), *wrong)


def test_a_vector_is_of_one_axis_and_a_number_one_of_one():
    assert checks.check_vector(2, "a", 1).tolist() == checks.check_vector(np.float64(2), "a").tolist() == [2.0]
    assert checks.check_vector([1, 2], "a", 2).tolist() == [1.0, 2.0]
    wrong = 1.0, np.ones(3), np.ones((2, 1)), [1, np.nan], [np.inf, 0], np.array([1 + 0j, 2])
    assert refused(lambda value, name: checks.check_vector(value, name, 2), *wrong)


def test_arrays_that_stand_together_broadcast_or_have_one_length():
    assert [a.shape for a in checks.check_together(a=1, b=[1, 2])] == [(), (2,)]
    with pytest.raises(ValueError, match="a, b: expected one number, or arrays of one length, got the shapes"):
        checks.check_together(a=[1, 2, 3], b=[1, 2])
    assert [a.shape for a in checks.check_lengths(a=[1, 2], b=np.ones((2, 3)).T[:2], numbers=())] == [(2,), (2, 2)]
    assert checks.check_lengths(("b",), a=[1, 2], b=3)[1] == 3
    for wrong in ({"b": 3}, {"b": [1]}):
        with pytest.raises(ValueError, match="a, b: expected arrays of one length"):
            checks.check_lengths(a=[1, 2], **wrong)
    assert checks.check_array(np.ones((2, 3)), "a", 2, (3,)).shape == (2, 3)
    assert refused(lambda value, name: checks.check_array(value, name, 2, (3,)), np.ones(2), np.ones((2, 4)), np.ones((3, 3)))


@pytest.mark.parametrize("check", [checks.check_numbers, lambda value, name: checks.check_array(value, name, 2)])
def test_floats_come_back_as_they_are_and_other_numbers_as_floats(check):
    value = np.array([1.0, 2.0])
    assert check(value, "a") is value
    for other in (np.array([1, 2]), np.float32([1, 2]), [1, 2]):
        assert check(other, "a").dtype == float and check(other, "a").tolist() == [1, 2]
    assert refused(check, np.array([1j, 2]), np.array([True, False]), np.array(["1", "2"]))


def test_large_numbers_pass_without_a_word():
    large = np.array([1e200, -1e308])
    assert checks.check_vector(large, "x", 2) is large
    assert checks.check_array(large, "x", 2, ()) is large
    with pytest.raises(ValueError, match="x: expected finite numbers"):
        checks.check_vector(np.array([1e200, np.inf]), "x", 2)

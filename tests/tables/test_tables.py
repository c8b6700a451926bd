"""What a notebook shows: rounded, the same bytes every time, and the numbers that were meant."""

import html
import re

import numpy as np
import pandas as pd
import pytest

from trackhelpers.published import published
from trackhelpers.tables import Table, as_printed, error_table, matrix, number, residual_text, side_by_side

ERRORS = np.array([[3.0, -4.0, 0.0, 0.0], [-1.0, 1.0, -1.0, 1.0]])


def cells(table):
    """The text between the tags of the table's HTML, row by row."""
    rows = re.findall(r"<tr.*?</tr>", table._repr_html_(), re.DOTALL)
    return [[html.unescape(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)] for row in rows]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.123456, "0.1235"),
        (12345.678, "12346"),
        (9.99996, "10.00"),
        (999999.9, "1.000e+06"),
        (1e-5, "1.000e-05"),
        (-0.0, "0"),
        (7, "7"),
        (np.int64(7), "7"),
        (np.float64(2.0), "2.000"),
        (np.bool_(True), "yes"),
        (np.nan, "–"),
        (None, "–"),
        (-np.inf, "−∞"),
        ("5.27E+00", "5.27E+00"),
    ],
)
def test_number_is_rounded_to_four_significant_digits(value, text):
    assert number(value) == text


def test_a_residual_shows_no_digits_of_rounding():
    assert [residual_text(value) for value in (0.0, -3e-16, 9e-10, 2e-9, -0.4712, 5)] == ["< 1e-9"] * 3 + ["2.0e-09", "-0.47", "5"]


def test_number_trims_zeros_of_decimals_only():
    assert [number(value, trim=True) for value in (0.5, 100.0, 1000000.0, 0.0)] == ["0.5", "100", "1e+06", "0"]


@pytest.mark.parametrize(
    ("value", "printed", "text"),
    [
        (5.2749, "5.13E+00", "5.27E+00"),
        (0.0912345, "0.089057", "0.091234"),
        (5.04, "5.0", "5.0"),
        (-0.001, "0.25", "0.00"),
        (3.0, "13", "3"),
    ],
)
def test_as_printed_has_the_decimals_and_the_exponent_of_the_printed_number(value, printed, text):
    assert as_printed(value, printed) == text


def test_html_and_text_show_the_same_cells():
    table = Table({"name": ["<a>", "b & c"], "value": [0.123456, 20.0]}, caption="x < y")
    assert cells(table) == [["", "name", "value"], ["0", "<a>", "0.1235"], ["1", "b & c", "20.00"]]
    assert repr(table).splitlines()[0] == "x < y"
    assert [line.split() for line in repr(table).splitlines()[1:]] == [
        ["name", "value"],
        ["0", "<a>", "0.1235"],
        ["1", "b", "&", "c", "20.00"],
    ]
    assert "x &lt; y</caption>" in table._repr_html_()


def test_output_is_the_same_for_numbers_that_differ_in_their_last_bits():
    values = np.array([0.1, 2.0 / 3.0, 12.0])
    one, other = Table({"a": values}), Table({"a": values * (1 + 3e-16)})
    assert not np.array_equal(one.frame["a"], other.frame["a"])
    assert one._repr_html_() == other._repr_html_() and repr(one) == repr(other)
    assert not re.search(r'\bid="|0x', one._repr_html_())


def test_minus_zero_is_zero_in_every_format():
    table = Table({"a": [-0.0], "b": [-0.001], "c": [-1e-9]}, formats={"b": ".2f", "c": ".1f"})
    assert table.text.loc[0].tolist() == ["0", "0.00", "0.0"]


def test_formats_are_digits_specifications_or_functions():
    table = Table({"a": [0.123456], "b": [0.123456], "c": [3]}, formats={"a": 2, "b": ".3e", "c": lambda n: f"{n} runs"}, index=False)
    assert table.text.loc[0].tolist() == ["0.12", "1.235e-01", "3 runs"]
    assert cells(table)[0] == ["a", "b", "c"]


def test_a_long_table_and_a_long_cell_are_shown_in_full():
    table = Table({"a": [" ".join(["word"] * 40)] * 200})
    assert sum(" ".join(["word"] * 40) in line for line in table._repr_html_().splitlines()) == 200
    assert len(repr(table).splitlines()) == 201


def test_a_table_leaves_the_numbers_alone():
    frame = pd.DataFrame({"a": [1.23456789]}, index=["row"])
    assert Table(frame).frame.equals(frame) and frame.at["row", "a"] == 1.23456789


@pytest.mark.parametrize(
    ("keywords", "words"), [({"formats": {"z": 2}}, "formats names"), ({"digits": 0}, "digits.*got 0"), ({"digits": 2.5}, "digits")]
)
def test_table_refuses_formats_without_a_column_and_bad_digits(keywords, words):
    with pytest.raises(ValueError, match=words):
        Table({"a": [1.0]}, **keywords)


def test_error_table_is_rms_max_min_mean_of_the_absolute_error():
    table = error_table(ERRORS, ["x", "y"])
    assert list(table.index) == ["RMSE", "max", "min", "mean"]
    assert table["x"].tolist() == [2.5, 4.0, 0.0, 1.75]
    assert table["y"].tolist() == [1.0, 1.0, 1.0, 1.0]


def test_error_table_takes_arrays_dicts_and_frames_alike():
    expected = error_table(ERRORS, ["x", "y"])
    named = dict(zip("xy", ERRORS, strict=True))
    pd.testing.assert_frame_equal(error_table(named), expected)
    pd.testing.assert_frame_equal(error_table(pd.DataFrame(named)), expected)
    pd.testing.assert_frame_equal(error_table(named, ["y", "x"]), expected[["y", "x"]])
    pd.testing.assert_frame_equal(error_table(ERRORS[0], ["x"]), expected[["x"]])


@pytest.mark.parametrize(
    ("errors", "names", "words"),
    [
        (np.array([[1.0, np.nan]]), None, "NaN or infinite"),
        (np.array([[1.0, np.inf]]), None, "NaN or infinite"),
        (np.empty((2, 0)), None, "at least one entry"),
        (np.ones((2, 3, 4)), None, "expected 2 axes"),
        ({}, None, "errors is empty"),
        ({"x": []}, None, r"errors\['x'\]"),
        ({"x": np.ones((2, 2))}, None, r"errors\['x'\]"),
        (ERRORS, ["x"], "expected one for each of the 2 components"),
        (ERRORS, ["x", "x"], "no name twice"),
        ({"x": [1.0]}, ["y"], r"names has \['y'\]"),
    ],
)
def test_error_table_refuses_bad_errors_and_names(errors, names, words):
    with pytest.raises(ValueError, match=words):
        error_table(errors, names)


def test_side_by_side_puts_each_of_our_cells_beside_the_printed_one():
    paper, ours = published("thesis", 9), published("thesis", 9, numeric=True)
    table = side_by_side(paper, ours.iloc[::-1, ::-1])  # the labels count, not the order
    shown = table.text
    assert list(shown.columns) == [(name, part) for name in paper.columns for part in ("paper", "ours")]
    for name in paper.columns:
        assert shown[name, "paper"].tolist() == paper[name].tolist() == shown[name, "ours"].tolist()


def test_side_by_side_shows_the_interval_with_the_digits_asked_for():
    paper, ours = published("thesis", 4), published("thesis", 4, numeric=True)
    table = side_by_side(paper, ours, 0.9 * ours, 1.1 * ours, digits=3)
    assert table.text["max"].iloc[0].tolist() == ["5.0", "5.00", "4.50", "5.50"]


def test_side_by_side_refuses_other_labels_and_half_an_interval():
    paper, ours = published("thesis", 4), published("thesis", 4, numeric=True)
    with pytest.raises(ValueError, match="ours has the labels"):
        side_by_side(paper, ours.rename(columns={"max": "maximum"}))
    with pytest.raises(ValueError, match="ours has the labels"):
        side_by_side(paper, pd.concat([ours, ours]))
    with pytest.raises(ValueError, match="both or neither"):
        side_by_side(paper, ours, low=ours)


def test_matrix_names_its_rows_and_columns_and_hides_rounding_noise():
    table = matrix([[1.0, 0.05, 1e-17], [-0.0, 1.0, 0.00125]], rows=["x", "v"], columns=["x", "v", "a"])
    assert cells(table) == [["", "x", "v", "a"], ["x", "1", "0.05", "0"], ["v", "0", "1", "0.00125"]]
    assert matrix(1e-17 * np.eye(2), names="ab").text.to_numpy().tolist() == [["1e-17", "0"], ["0", "1e-17"]]
    assert matrix([1.0, 2.0], names=["x", "v"]).text.shape == (2, 1)
    assert matrix(np.zeros((2, 2))).text.to_numpy().tolist() == [["0", "0"], ["0", "0"]]


@pytest.mark.parametrize(
    ("M", "names", "words"),
    [
        (np.eye(2), ["x"], "expected 2 and 2 names"),
        (np.eye(2)[:1], ["x", "y"], "expected 1 and 2 names"),
        (np.ones((2, 2, 2)), None, "M has the shape"),
        ([[np.nan]], None, "NaN or infinite"),
        ([], None, "at least one entry"),
    ],
)
def test_matrix_refuses_what_is_no_matrix_and_names_that_do_not_fit(M, names, words):
    with pytest.raises(ValueError, match=words):
        matrix(M, names)

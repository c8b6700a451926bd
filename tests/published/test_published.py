"""The printed tables are complete, and hold only what was printed."""

import re
from itertools import pairwise

import nbformat
import pandas as pd
import pytest

from trackhelpers.published import PAPERS, last_digit, published, tables_of
from trackhelpers.published.augmented_bias import equations
from trackhelpers.suite import NOTEBOOKS

SHAPES = {1: (5, 2), 2: (3, 2), 3: (13, 6), 4: (1, 3), 5: (9, 5), 7: (6, 4), 8: (6, 4), 9: (4, 4)}
PRINTED_NUMBER = re.compile(r"-?\d+(\.\d+)?(E[+-]\d\d)?")


def test_every_table_of_every_paper_is_there():
    assert {paper: tables_of(paper) for paper in PAPERS} == {
        "thesis": (1, 2, 3, 4, 5, 7, 8, 9),
        "track_fusion": (),
        "augmented_bias": (1,),
        "space_tdoa": (),
    }


@pytest.mark.parametrize("table", SHAPES)
def test_every_cell_of_the_thesis_is_there_with_its_heading(table):
    frame = published("thesis", table)
    assert frame.shape == SHAPES[table]
    assert (frame != "").all(axis=None)
    assert set(frame.attrs["headings"]) == set(frame.columns)
    assert frame.attrs["caption"] and frame.attrs["printed_caption"].replace(" ", "").startswith(f"表{table}")


@pytest.mark.parametrize("table", [3, 4, 5, 7, 8, 9])
def test_a_cell_is_a_number_as_printed_and_numeric_is_its_value(table):
    text, values = published("thesis", table), published("thesis", table, numeric=True)
    assert text.map(lambda cell: PRINTED_NUMBER.fullmatch(cell) is not None).all(axis=None)
    assert all(pd.api.types.is_float_dtype(kind) for kind in values.dtypes)
    assert (text.map(float) == values).all(axis=None)


@pytest.mark.parametrize(
    ("table", "row", "column", "cell"),
    [
        (3, 0, "y_measured", "4.45"),
        (3, 4, "t", "1"),
        (3, 12, "y_measured", "25.8"),
        (3, 12, "a_filtered", "4.01E+00"),
        (4, 0, "max", "5.0"),
        (4, 0, "RMSE", "2.4071"),
        (5, 0, "x", "5.27E+00"),
        (5, 3, "psi", "6.28E-02"),
        (5, 8, "rho_dot", "1.60E-01"),
        (7, 5, "y_filtered", "2.40E+00"),
        (8, 5, "vx_filtered", "9.56E-01"),
        (8, 0, "vy_filtered", "5.77E+00"),
        (9, 0, "RMSE", "0.089057"),
        (9, 1, "mean", "0.079330"),
        (9, 3, "max", "3.803371"),
        (9, 1, "min", "0.000002"),
    ],
)
def test_cells_have_the_digits_and_the_trailing_zeros_of_the_source(table, row, column, cell):
    assert published("thesis", table)[column].iloc[row] == cell


def test_true_positions_of_table_7_move_at_the_true_speeds_of_table_8():
    # One table cannot be shifted against the other, nor a cell be mistaken by more than the rounding: p_k − p_{k−1} = v_k · 0.05 s.
    position, speed = published("thesis", 7, numeric=True), published("thesis", 8, numeric=True)
    for axis in "xy":
        step = position[f"{axis}_true"].diff()[1:] - 0.05 * speed[f"v{axis}_true"][1:]
        assert step.abs().max() <= 0.01 + 0.05 * 0.005


def test_true_signal_of_table_3_is_the_printed_polynomial():
    table = published("thesis", 3, numeric=True)
    assert (table["s_true"] - (3 * table["t"] ** 2 - 2 * table["t"] + 5)).abs().max() <= 0.005


def test_error_tables_are_ordered_as_such_figures_are():
    for table in (4, 9):
        values = published("thesis", table, numeric=True)
        assert (values["mean"] <= values["RMSE"]).all() and (values["RMSE"] <= values["max"]).all()


def test_segments_of_the_augmented_bias_paper_follow_each_other_and_every_word_is_translated():
    frame = published("augmented_bias", 1)
    bounds = [tuple(map(int, text.rstrip("s").split("-"))) for text in frame["interval"][1:]]
    assert bounds[0][0] == 1 and bounds[-1][1] == 1300
    assert all(later[0] == earlier[1] + 1 for earlier, later in pairwise(bounds))
    words = set(frame["x"][1:]) | set(frame["y"][1:])
    assert words == set(frame.attrs["english"])
    assert (frame["cell"][1:] == ":xy" + frame["x"][1:] + frame["y"][1:]).all()


def test_callers_cannot_change_each_others_table():
    mine = published("thesis", 9)
    mine.iloc[0, 0] = "changed"
    mine.attrs["headings"].clear()
    assert published("thesis", 9).iloc[0, 0] == "0.089057"
    assert published("thesis", 9).attrs["headings"]["max"] == "最大误差"


@pytest.mark.parametrize(
    ("paper", "table", "words"),
    [
        ("thesis", 6, "numbers no table 6"),
        ("thesis", 10, "thesis: 1, 2, 3, 4, 5, 7, 8, 9"),
        ("track_fusion", 1, "track_fusion: none"),
        ("space_tdoa", 1, "augmented_bias: 1"),
        ("dissertation", 1, "'dissertation', expected one of thesis, track_fusion, augmented_bias, space_tdoa"),
        ("thesis", "9", "table '9' of thesis does not exist"),
    ],
)
def test_unknown_tables_raise_with_the_list_of_what_exists(paper, table, words):
    with pytest.raises(ValueError, match=re.escape(words)) as caught:
        published(paper, table)
    assert "thesis: 1, 2, 3, 4, 5, 7, 8, 9; track_fusion: none; augmented_bias: 1; space_tdoa: none" in str(caught.value)


def test_a_table_of_words_has_no_numbers():
    with pytest.raises(ValueError, match="numeric=True, but table 1 of thesis holds words"):
        published("thesis", 1, numeric=True)


@pytest.mark.parametrize(
    ("text", "half_unit"),
    [("5.27E+00", 0.005), ("6.28E-02", 5e-5), ("0.089057", 5e-7), ("5.0", 0.05), ("13", 0.5), ("1E+03", 500.0), ("−0.30", 0.005)],
)
def test_last_digit_is_half_a_unit_of_it(text, half_unit):
    assert last_digit(text) == half_unit


@pytest.mark.parametrize("text", ["", "nan", "inf", "a", "1.2.3", 0.5, None])
def test_last_digit_refuses_what_is_not_a_printed_number(text):
    with pytest.raises(ValueError, match="expected a finite number"):
        last_digit(text)


def test_published_gives_a_plain_frame():
    assert type(published("thesis", 4)) is pd.DataFrame


def test_all_31_equations_of_the_augmented_bias_paper_are_there_and_the_chapter_shows_their_fragments():
    table = equations()
    assert list(table.index) == list(range(1, 32))
    assert list(table.columns) == ["fragment", "reading"] and (table != "").all(axis=None)
    chapter = nbformat.read(NOTEBOOKS / "3_augmented_bias" / "2_augmented_filter.ipynb", as_version=4)
    text = "\n".join(cell.source for cell in chapter.cells if cell.cell_type == "markdown")
    assert not [n for n, fragment in table["fragment"].items() if f"| ({n}) | `{fragment}`" not in text]

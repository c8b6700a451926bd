"""The verdict follows from the numbers, and from what is stored of them."""

import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest
from hypothesis import given

from trackhelpers.ledger import COLUMNS, KINDS, MARKS, VERDICTS, Ledger, bears_out, read_ledger, shown

WHERE = ("Table 9", "RMSE of x")


@pytest.fixture(autouse=True)
def no_questions(tmp_path, monkeypatch):
    """Rows are for notebooks without a file of questions."""
    monkeypatch.setenv("TRACKHELPERS_QUESTIONS", str(tmp_path / "none"))


@pytest.fixture
def ledger():
    return Ledger("1_thesis", "2_kalman_filter")


@pytest.fixture
def stored(tmp_path, monkeypatch):
    """A function that writes a ledger and gives its rows back as they lie in the file."""
    monkeypatch.setenv("TRACKHELPERS_RESULTS", str(tmp_path))

    def rows(ledger):
        ledger.write()
        return read_ledger(tmp_path)

    return rows


@pytest.mark.parametrize(
    ("paper", "ours", "verdict"),
    [
        ("5.27E+00", 5.2749, "reproduced"),
        ("5.27E+00", 5.275, "reproduced"),  # half a unit, to rounding
        ("5.27E+00", 5.2751, "not reproduced"),
        ("0.089057", 0.0890574, "reproduced"),
        ("0.089057", 0.0890576, "not reproduced"),
        ("−0.30", -0.304, "reproduced"),
    ],
)
def test_cell_agrees_to_half_a_unit_of_the_last_printed_digit(ledger, paper, ours, verdict):
    assert ledger.cell("a", *WHERE, paper, ours) == verdict


def test_cell_takes_a_stated_tolerance(ledger):
    assert ledger.cell("a", *WHERE, "5.27E+00", 5.279, tolerance=0.01) == "reproduced"
    assert ledger.rows[0]["tolerance"] == "0.01"


def test_random_cell_is_judged_by_the_central_95_percent_of_the_runs(ledger):
    draws = np.arange(1001) / 1000  # quantiles are the numbers themselves
    assert ledger.random_cell("a", *WHERE, "0.026", draws) == "reproduced"
    assert ledger.random_cell("b", *WHERE, "0.024", draws) == "not reproduced"
    assert ledger.random_cell("c", *WHERE, "0.974", draws) == "reproduced"
    assert ledger.random_cell("d", *WHERE, "0.976", draws) == "not reproduced"
    row = ledger.rows[0]
    assert (row["ours"], row["low"], row["high"]) == ("0.5", "0.025", "0.975")
    assert row["note"] == "the printed value is at percentile 2.6 of 1001 runs"


@pytest.mark.parametrize("draws", [np.ones(39), np.ones((40, 2)), np.r_[np.ones(50), np.nan], np.r_[np.ones(50), np.inf]])
def test_random_cell_refuses_too_few_and_diverged_runs(ledger, draws):
    with pytest.raises(ValueError, match="draws of row 'a'"):
        ledger.random_cell("a", *WHERE, "1.0", draws)


@pytest.mark.parametrize(
    ("residual", "verdict"), [(0.0, "reproduced"), (3e-16, "reproduced"), (1e-9, "reproduced"), (1.04e-9, "not reproduced")]
)
def test_equation_holds_to_1e_9(ledger, residual, verdict):
    assert ledger.equation("a", "(2.11)", "gain", residual) == verdict
    assert bears_out(ledger.rows[0])


@pytest.mark.parametrize(
    ("inequality", "ours", "low", "high", "satisfied"),
    [
        ("> 0", 1.0, 0.1, 2.0, True),
        ("> 0", 1.0, -0.1, 2.0, False),
        ("> 0", 0.0, None, None, False),
        (">= 0", 0.0, None, None, True),
        ("< 0.05", 0.04, 0.03, 0.05, False),
        ("<= 1", 0.9, 0.8, 1.0, True),
        ("<=1", 0.9, 0.8, 1.1, False),
        ("== 6", 6, None, None, True),
        ("== 6", 5.0, None, None, False),
        ("== 6", 6.0, 5.9, 6.1, False),
        ("in [0, 1]", 0.5, 0.0, 1.0, True),
        ("in [0, 1)", 0.5, 0.0, 1.0, False),
        ("in (0, 1]", 0.5, 0.0, 1.0, False),
        ("in [-1e-3, 2.5E2]", 0.5, -0.001, 250, True),
    ],
)
@pytest.mark.parametrize("method", ["claim", "figure"])
def test_inequality_must_hold_on_the_whole_interval(ledger, method, inequality, ours, low, high, satisfied):
    verdict = getattr(ledger, method)("a", "§4", "q", inequality, ours, low, high)
    assert verdict == ("reproduced" if satisfied else "not reproduced")
    assert ledger.rows[0]["kind"] == method


@pytest.mark.parametrize("inequality", ["", "0", "about 3", "> a", "in [0, 1", "> 0 or < -1", "> inf", None, 3])
def test_claim_refuses_what_is_no_inequality(ledger, inequality):
    with pytest.raises(ValueError, match="expected an inequality"):
        ledger.claim("a", "§4", "q", inequality, 1.0)


def test_assumption_erratum_and_note_choose_among_the_verdicts(ledger):
    assert ledger.cell("a", *WHERE, "1.0", 1.0, assumption="R as in §4.2") == "reproduced under an assumption"
    assert ledger.cell("b", *WHERE, "1.0", 2.0, assumption="R as in §4.2") == "not reproduced"
    assert ledger.cell("c", *WHERE, "0.78", 0.61, erratum="the square root was forgotten") == "paper in error"
    assert ledger.cell("d", *WHERE, "0.78", 0.61, note="nothing fits") == "not reproduced"
    assert [row["note"] for row in ledger.rows] == ["R as in §4.2", "R as in §4.2", "the square root was forgotten", "nothing fits"]
    assert ledger.not_checkable("e", "figure", "Figure 7", "curve", "the image is lost") == "not checkable"
    assert ledger.beyond("f", "claim", "beyond", "NEES", 4.1, 3.8, 4.4) == "beyond the paper"
    assert all(map(bears_out, ledger.rows))


def test_an_erratum_whose_proof_fails_is_refused_and_leaves_no_row(ledger):
    with pytest.raises(ValueError, match="bear the paper out"):
        ledger.equation("a", "(3.11)", "Jacobian", 1e-12, erratum="column 5 is not zero")
    assert ledger.rows == []


@pytest.mark.parametrize(
    "call",
    [
        lambda book: book.cell("a", *WHERE, "1.0", np.nan),
        lambda book: book.cell("a", *WHERE, "1.0", [1.0, 2.0]),
        lambda book: book.cell("a", *WHERE, "one", 1.0),
        lambda book: book.cell("a", *WHERE, "one", 1.0, tolerance=0.1),
        lambda book: book.cell("a", *WHERE, "1.0", 1.0, tolerance=0.0),
        lambda book: book.cell("a", *WHERE, "1.0", 1.0, tolerance=np.nan),
        lambda book: book.cell("", *WHERE, "1.0", 1.0),
        lambda book: book.cell("a", "two\nlines", "q", "1.0", 1.0),
        lambda book: book.cell("a", *WHERE, "1.0", 1.0, note="two\nlines"),
        lambda book: book.cell("a", *WHERE, "1.0", 2.0, assumption="one", erratum="other"),
        lambda book: book.equation("a", *WHERE, np.inf),
        lambda book: book.equation("a", *WHERE, -1e-12),
        lambda book: book.equation("a", *WHERE, None),
        lambda book: book.claim("a", *WHERE, "> 0", 1.0, low=0.5),
        lambda book: book.claim("a", *WHERE, "> 0", 1.0, low=2.0, high=1.0),
        lambda book: book.claim("a", *WHERE, "> 0", 1.0, low=np.nan, high=2.0),
        lambda book: book.claim("a", *WHERE, "> 0", 1.0, kind="opinion"),
        lambda book: book.not_checkable("a", "figure", *WHERE, ""),
        lambda book: book.beyond("a", "claim", *WHERE, np.nan),
        lambda book: book.beyond("a", "timing", *WHERE, 1.0),
    ],
)
def test_bad_rows_are_refused_and_leave_no_row(ledger, call):
    with pytest.raises(ValueError, match=r"expected"):
        call(ledger)
    assert ledger.rows == []


def test_an_id_is_used_once(ledger):
    ledger.equation("a", *WHERE, 0.0)
    with pytest.raises(ValueError, match="'a' was used before"):
        ledger.claim("a", *WHERE, "> 0", 1.0)


@pytest.mark.parametrize(("paper", "notebook"), [("", "a"), ("1__thesis", "a"), ("1_thesis", "../a"), ("1_thesis", None)])
def test_a_ledger_belongs_to_a_named_notebook(paper, notebook):
    with pytest.raises(ValueError, match="expected lower-case words"):
        Ledger(paper, notebook)


def test_stored_numbers_have_six_digits_and_residuals_one(ledger, stored):
    ledger.claim("a", *WHERE, "> 0", 1.23456789, 1.0 / 3.0, 2e10 / 3.0)
    ledger.equation("b", *WHERE, 3.4567e-16)
    ledger.beyond("c", "claim", *WHERE, -0.0)
    rows = stored(ledger).set_index("id")
    assert rows.loc["a", ["ours", "low", "high"]].tolist() == ["1.23457", "0.333333", "6.66667e+09"]
    assert rows.loc["b", ["ours", "tolerance"]].tolist() == ["3e-16", "1e-09"]
    assert rows.loc["c", "ours"] == "0"


def test_more_digits_are_stored_where_the_verdict_needs_them(ledger, stored):
    assert ledger.cell("a", *WHERE, "3.612049", 3.6120492) == "reproduced"
    assert ledger.claim("b", *WHERE, "<= 1", 1.0000001) == "not reproduced"
    rows = stored(ledger)
    assert rows["ours"].tolist() == ["3.612049", "1.0000001"]
    assert all(bears_out(row) for _, row in rows.iterrows())


@given(st.floats(-1e6, 1e6), st.floats(-2.0, 2.0), st.integers(0, 7))
def test_the_stored_row_bears_out_the_verdict_of_the_exact_numbers(value, units, decimals):
    paper = f"{value:.{decimals}f}"
    ours = float(paper) + units * 0.5 * 10.0**-decimals
    ledger = Ledger("1_thesis", "2_kalman_filter")
    verdict = ledger.cell("a", *WHERE, paper, ours)
    exact = abs(ours - float(paper)) <= 0.5 * 10.0**-decimals + 1e-9 * abs(float(paper))
    assert bears_out(ledger.rows[0])
    if abs(abs(units) - 1) > 1e-3:
        assert (verdict == "reproduced") == exact


def good_rows():
    ledger = Ledger("1_thesis", "2_kalman_filter")
    ledger.cell("cell", *WHERE, "1.0", 1.0, assumption="an assumption")
    ledger.cell("error", *WHERE, "1.0", 2.0, erratum="an erratum")
    ledger.random_cell("random", *WHERE, "0.5", np.linspace(0, 1, 100))
    ledger.equation("equation", *WHERE, 1e-12)
    ledger.claim("claim", *WHERE, "> 0", 1.0, 0.5, 2.0)
    ledger.figure("figure", *WHERE, "in [0, 1]", 2.0)
    ledger.not_checkable("lost", "figure", *WHERE, "lost")
    ledger.beyond("beyond", "claim", *WHERE, 1.0)
    return {row["id"]: row for row in ledger.rows}


@pytest.mark.parametrize(
    ("id", "changed"),
    [
        ("cell", {"ours": "1.2"}),
        ("cell", {"verdict": "not reproduced"}),
        ("cell", {"note": ""}),
        ("cell", {"paper": "one"}),
        ("error", {"ours": "1.04"}),
        ("error", {"note": ""}),
        ("random", {"low": "0.6"}),
        ("random", {"low": "", "high": ""}),
        ("equation", {"ours": "2e-09"}),
        ("equation", {"ours": "2e-09", "tolerance": "1"}),
        ("equation", {"ours": ""}),
        ("claim", {"low": "-0.5"}),
        ("claim", {"paper": "> 0.5"}),
        ("claim", {"kind": "opinion"}),
        ("figure", {"ours": "0.5"}),
        ("figure", {"verdict": "excellent"}),
        ("lost", {"note": ""}),
        ("lost", {"ours": "1"}),
        ("beyond", {"paper": "1.0"}),
        ("beyond", {"ours": "nan"}),
        ("beyond", {"ours": ""}),
    ],
)
def test_a_row_whose_numbers_no_longer_fit_is_found(id, changed):
    row = good_rows()[id]
    assert bears_out(row)
    assert not bears_out(row | changed)


def test_bears_out_reads_rows_as_pandas_guesses_them(tmp_path, monkeypatch):
    monkeypatch.setenv("TRACKHELPERS_RESULTS", str(tmp_path))
    ledger = Ledger("1_thesis", "2_kalman_filter")
    ledger.rows = list(good_rows().values())
    ledger.write()
    frame = pd.read_csv(tmp_path / "1_thesis__2_kalman_filter.csv")
    assert frame["ours"].dtype == float and len(frame) == 8
    assert all(bears_out(row) for _, row in frame.iterrows())


def test_the_vocabulary_is_the_documented_one():
    assert COLUMNS == ["id", "kind", "where", "quantity", "paper", "ours", "low", "high", "tolerance", "verdict", "note"]
    assert KINDS == ("table", "equation", "figure", "claim") and len(set(VERDICTS)) == 8 and set(MARKS) == set(VERDICTS)


@pytest.mark.parametrize(
    ("kind", "paper", "ours", "text"),
    [
        ("equation", "", "0", "< 1e-9"),
        ("equation", "", "7e-16", "< 1e-9"),
        ("equation", "", "0.123456", "0.1235"),
        ("claim", "<= 1e-9", "0", "< 1e-9"),
        ("claim", "> 1e-9", "2.2e-16", "< 1e-9"),
        ("claim", "== 0", "0", "0"),
        ("claim", "< 0.01", "5.65792e-11", "0"),
        ("figure", "", "-2.2e-16", "0"),
        ("claim", "> 0", "", ""),
        ("claim", "> 1", "29.23415", "29.23"),
    ],
)
def test_rounding_is_shown_alike_on_every_processor(kind, paper, ours, text):
    assert shown({"kind": kind, "paper": paper, "ours": ours}) == text

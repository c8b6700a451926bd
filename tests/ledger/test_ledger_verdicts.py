"""The verdict is a function of question and answer, and follows from what is stored of the answer."""

from datetime import date

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from trackhelpers.intervals import mean_interval
from trackhelpers.ledger import Found, Question, verdict
from trackhelpers.ledger.verdicts import stored

DRAWS = np.arange(1001) / 1000  # quantiles are the numbers themselves


def question(rule, printed="", **fields):
    return Question("1_thesis/2_kalman_filter", "a", "claim", "§4", "q", rule, date(2026, 11, 22), printed, **fields)


@pytest.mark.parametrize(
    ("rule", "printed", "answer", "expected"),
    [
        ("cell", "5.27E+00", 5.275, "reproduced"),  # half a unit, to rounding
        ("cell", "5.27E+00", 5.2751, "not reproduced"),
        ("cell", "−0.30", -0.304, "reproduced"),
        ("random cell", "0.974", 0.5 + DRAWS / 2, "reproduced"),
        ("random cell", "0.99", 0.5 + DRAWS / 2, "not reproduced"),
        ("random cell", "0.94", DRAWS, "undecided"),  # an interval of 0.95
        ("random cell", "0.96", DRAWS, "reproduced"),
        ("random cell", "0.01", 5 + DRAWS, "not reproduced"),  # however wide, it does not hold the printed value
        ("equation", "", 0.0, "reproduced"),
        ("equation", "", 1e-9, "reproduced"),
        ("equation", "", 1.04e-9, "not reproduced"),
        ("< 0.9", "", 0.8, "reproduced"),
        ("< 0.9", "", (0.8, 0.7, 0.89), "reproduced"),
        ("< 0.9", "", (0.8, 0.7, 0.9), "undecided"),
        ("< 0.9", "", (1.0, 0.9, 1.1), "not reproduced"),
        ("<= 0.9", "", (1.0, 0.9, 1.1), "undecided"),
        (">= 3", "", 3, "reproduced"),
        ("== 6", "", 6, "reproduced"),
        ("== 6", "", 5, "not reproduced"),
        ("== 6", "", (6.5, 5.9, 7.0), "undecided"),
        ("in [0, 1)", "", (0.5, 0.0, 0.99), "reproduced"),
        ("in [0, 1)", "", (0.5, 0.0, 1.0), "undecided"),
        ("in [0, 1)", "", (2.0, 1.0, 3.0), "not reproduced"),
        ("in (0.9, 1.1)", "", (1.0, 0.5, 1.5), "undecided"),
        ("in (0.9, 1.1)", "", (0.5, 0.4, 0.9), "not reproduced"),
        ("beyond", "", 4.1, "beyond the paper"),
        ("beyond", "", DRAWS, "beyond the paper"),
        ("lost", "", None, "not checkable"),
    ],
)
def test_verdict_follows_from_the_rule_and_from_what_is_stored(rule, printed, answer, expected):
    asked = question(rule, printed)
    assert verdict(asked, answer) == expected
    row = stored(asked, answer)
    assert row["verdict"] == expected == verdict(asked, row)
    if expected == "reproduced":
        assert verdict(question(rule, printed, assumption="σ = 1"), answer) == "reproduced under an assumption"


def test_a_tolerance_takes_the_place_of_half_a_unit():
    assert verdict(question("cell", "5.27", tolerance=0.02), 5.289) == "reproduced"


def test_draws_under_an_inequality_are_their_mean_with_its_interval():
    row = stored(question("< 0.6"), DRAWS)
    assert [float(row[name]) for name in ("ours", "low", "high")] == pytest.approx(mean_interval(DRAWS), rel=1e-5)


def test_a_random_cell_stores_quantiles_and_the_percentile_of_the_printed_value():
    row = stored(question("random cell", "0.974"), DRAWS)
    assert (row["ours"], row["low"], row["high"]) == ("0.5", "0.025", "0.975")
    assert row["note"] == "the printed value is at percentile 97.4 of 1001 runs"


@pytest.mark.parametrize(("word", "expected"), [("error", "paper in error"), ("misprint", "misprint")])
def test_error_and_misprint_need_a_printed_form_that_fails(word, expected):
    for rule, fails, passes, open_ in (("equation", 0.3, 1e-15, None), ("< 1", (3, 2, 4), (0.5, 0.4, 0.6), (1.0, 0.9, 1.1))):
        asked = question(rule)
        found = Found(fails, **{word: "the unit is 1/s"}, note="see §4")
        row = stored(asked, found)
        assert verdict(asked, found) == row["verdict"] == expected == verdict(asked, row)
        assert row["note"] == "the unit is 1/s; see §4"
        assert verdict(asked, row | {"note": ""}) == "not reproduced"
        with pytest.raises(ValueError, match="bear the paper out"):
            verdict(asked, Found(passes, **{word: "the unit"}))
        if open_:
            with pytest.raises(ValueError, match="leave it undecided"):
                verdict(asked, Found(open_, **{word: "the unit"}))
    with pytest.raises(ValueError, match="only a note"):
        verdict(question("beyond"), Found(1.0, **{word: "the unit"}))


def test_a_note_changes_no_verdict():
    assert verdict(question("< 1"), Found(0.5, note="by far")) == "reproduced"
    assert stored(question("< 1"), Found(0.5, note="by far"))["note"] == "by far"


@pytest.mark.parametrize(
    ("rule", "printed", "answer"),
    [
        ("< 1", "", np.nan),
        ("< 1", "", None),
        ("< 1", "", "0.5"[:0]),
        ("< 1", "", (0.5, 0.6, 0.7)),
        ("< 1", "", (0.5, 0.4)),
        ("< 1", "", (0.5, 0.4, np.inf)),
        ("< 1", "", DRAWS[:39]),
        ("< 1", "", DRAWS[:40].reshape(2, 20)),
        ("< 1", "", np.r_[DRAWS, np.nan]),
        ("cell", "1.0", (1.0, 0.9, 1.1)),
        ("cell", "1.0", DRAWS),
        ("random cell", "1.0", 1.0),
        ("random cell", "1.0", (1.0, 0.9, 1.1)),
        ("random cell", "1.0", DRAWS[:39]),
        ("equation", "", -1e-12),
        ("equation", "", DRAWS),
        ("beyond", "", np.inf),
        ("lost", "", 1.0),
    ],
)
def test_answers_that_the_rule_cannot_judge_are_refused(rule, printed, answer):
    with pytest.raises(ValueError, match=r"'a'.*expected"):
        verdict(question(rule, printed), answer)


def test_a_withdrawn_question_takes_no_answer():
    with pytest.raises(ValueError, match="withdrawn"):
        verdict(question("< 1", withdrawn={"on": date(2026, 11, 23), "why": "no row", "verdict": "nothing"}), 0.5)


@pytest.mark.parametrize("words", [{"error": "a", "misprint": "b"}, {"note": "two\nlines"}, {"error": " "}, {"note": 3}])
def test_found_takes_one_line_of_words(words):
    with pytest.raises(ValueError, match="expected"):
        Found(1.0, **words)


@pytest.mark.parametrize(
    ("rule", "residual", "text"),
    [
        ("equation", 0.0, "1e-10"),
        ("equation", 3e-16, "1e-10"),
        ("equation", 1e-10, "1e-10"),
        ("equation", 3e-10, "1e-09"),
        ("equation", 1e-9, "1e-09"),
        ("equation", 0.1234, "0.1"),
        ("equation", 1.04e-9, "1.04e-09"),
        ("< 1e-9", 7e-17, "1e-10"),
        ("> 1e-9", 7e-17, "1e-10"),
        ("< 1e-13", 7e-17, "7e-17"),  # the bound would not satisfy the rule
        ("< 0.5", 1.0 / 3.0, "0.333333"),
        ("<= 1", 1.0000001, "1.0000001"),
        ("beyond", -0.0, "0"),
    ],
)
def test_numbers_are_stored_so_that_no_processor_changes_them(rule, residual, text):
    assert stored(question(rule), residual)["ours"] == text


def test_a_small_number_with_an_interval_keeps_all_three():
    row = stored(question("< 1e-6"), (3e-10, 1e-10, 5e-10))
    assert (row["ours"], row["low"], row["high"]) == ("3e-10", "1e-10", "5e-10")


@given(
    st.floats(-1e6, 1e6), st.floats(0, 1.0), st.floats(0, 1.0), st.sampled_from(["< {}", ">= {}", "== {}", "in [{}, 1e7)", "in (-1e7, {}]"])
)
def test_the_stored_row_bears_out_the_verdict_of_the_exact_numbers(bound, below, above, rule):
    asked = question(rule.format(f"{bound:.3f}"))
    answer = (bound, bound - below * 1e-6, bound + above * 1e-6)
    assert verdict(asked, stored(asked, answer)) == verdict(asked, answer)


@pytest.mark.parametrize("changed", [{"ours": ""}, {"low": "0.4"}, {"ours": "nan"}, {"low": "0.6", "high": "0.7"}])
def test_a_stored_row_that_is_none_is_refused(changed):
    asked = question("< 1")
    with pytest.raises(ValueError, match="'a'"):
        verdict(asked, stored(asked, 0.5) | changed)

import numpy as np
import pytest

from trackhelpers.ledger import numbers


def test_six_digits_are_kept_or_as_many_as_the_verdict_needs():
    third = 1 / 3
    assert numbers.enough_digits({"ours": third, "low": 123456789.0}, lambda text: True) == {"ours": "0.333333", "low": "1.23457e+08"}
    assert numbers.enough_digits({"ours": third}, lambda text: True, digits=1) == {"ours": "0.3"}
    kept = numbers.enough_digits({"ours": third}, lambda text: abs(float(text["ours"]) - third) < 1e-8)
    assert kept == {"ours": "0.33333333"}  # the eighth digit is the first that does
    assert float(numbers.enough_digits({"ours": third}, lambda text: float(text["ours"]) == third)["ours"]) == third
    assert float(numbers.enough_digits({"ours": 0.1 + 0.2}, lambda text: False)["ours"]) == 0.1 + 0.2


@pytest.mark.parametrize(
    ("text", "short"),
    [("", ""), ("0.333333", "0.3333"), ("-12.34567", "-12.35"), ("2", "2"), ("9.9e-10", "0"), ("-9.9e-10", "0")],
)
def test_the_table_shows_four_digits_and_nothing_of_rounding(text, short):
    assert numbers.short(text) == short


@pytest.mark.parametrize(
    ("rule", "shown"),
    [
        ("equation", "< 1e-9"),
        ("< 1e-6", "< 1e-9"),
        ("<= 2e-09", "< 1e-9"),
        ("> 1e-12", "< 1e-9"),
        ("< 1e-5", "0"),
        ("cell", "0"),
        ("< 1", "0"),
    ],
)
def test_what_vanishes_is_shown_as_a_bound_where_that_was_asked(rule, shown):
    assert numbers.shown({"ours": "3e-16", "rule": rule}) == shown
    assert numbers.shown({"ours": "0.25", "rule": rule}) == "0.25"


def test_forty_runs_and_more_have_an_interval_and_fewer_have_none():
    draws = np.arange(40.0)
    assert numbers.checked_draws("a", draws) is draws
    for wrong in (draws[:39], draws[None], 1.0):
        with pytest.raises(ValueError, match="draws of row 'a' has the shape"):
            numbers.checked_draws("a", wrong)
    for number in (np.nan, np.inf):
        with pytest.raises(ValueError, match="has 1 NaN or infinite"):
            numbers.checked_draws("a", np.append(draws, number))


@pytest.mark.parametrize(("value", "percentile"), [(-1, "0.0"), (0, "1.2"), (19.5, "50.0"), (39, "98.8"), (40, "100.0")])
def test_a_printed_value_among_the_runs_counts_half_of_those_that_equal_it(value, percentile):
    assert numbers.percentile_note(np.arange(40.0), value) == f"the printed value is at percentile {percentile} of 40 runs"


def test_a_number_that_is_read_is_finite_and_zero_has_no_sign():
    assert str(numbers.finite("a", "ours", -0.0)) == "0.0" and numbers.read_number("a", "ours", "2.5") == 2.5
    for text in ("", "nan", "inf", "two"):
        with pytest.raises(ValueError, match=r"ours of row 'a' is .*expected one finite number"):
            numbers.read_number("a", "ours", text)

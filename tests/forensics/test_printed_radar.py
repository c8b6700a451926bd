"""Section 4.2's radar as printed: the transcription, and what the sensor built on it does."""

import numpy as np
import pytest

from trackhelpers.forensics.printed_radar import PrintedRadar
from trackhelpers.published import thesis_chapter_4
from trackhelpers.sensors import Radar

STATES = np.random.default_rng(5).normal(size=(20, 5)) * [20, 20, 4, 2, 0.5]


def numeric_jacobian(h, x, step=1e-6):
    return np.column_stack([(h(x + d) - h(x - d)) / (2 * step) for d in step * np.eye(len(x))])


@pytest.mark.parametrize("range_rate", ["printed", "right"])
def test_own_jacobian_of_the_printed_radar_is_the_derivative_of_its_h(range_rate):
    sensor = PrintedRadar(range_rate=range_rate, jacobian="own")
    for x in STATES:
        np.testing.assert_allclose(sensor.H(x), numeric_jacobian(sensor.h, x), rtol=1e-5, atol=1e-7)


def test_printed_radar_differs_from_the_right_one_in_the_third_row_only_and_not_at_all_when_both_are_right():
    right, printed = Radar(), PrintedRadar()
    repaired = PrintedRadar(range_rate="right", jacobian="right")
    for x in STATES:
        np.testing.assert_array_equal(repaired.h(x), right.h(x))
        np.testing.assert_array_equal(repaired.H(x), right.H(x))
        np.testing.assert_array_equal(printed.h(x)[:2], right.h(x)[:2])
        np.testing.assert_array_equal(printed.H(x)[:2], right.H(x)[:2])
        assert abs(printed.h(x)[2] - right.h(x)[2]) > 1e-3


def test_printed_row_of_j_h_is_transcribed_in_both_readings():
    x = np.array([3.0, 4.0, 2.0, 0.0, 0.1])  # ρ = 5, v_x + v_y = 2
    common = np.array([-3 * 2 / 125, -4 * 2 / 125, 7 / 5, 0, 0])
    np.testing.assert_allclose(PrintedRadar(jacobian="printed v").H(x)[2], np.add(common, [2 / 5, 2 / 5, 0, 0, 0]), rtol=1e-14)
    np.testing.assert_allclose(PrintedRadar(jacobian="printed y").H(x)[2], np.add(common, [4 / 5, 4 / 5, 0, 0, 0]), rtol=1e-14)


def test_formulas_take_many_states_at_once():
    for form in (thesis_chapter_4.range_rate, thesis_chapter_4.range_rate_row):
        np.testing.assert_allclose(form(STATES.T)[..., 3], form(STATES[3]), rtol=1e-14)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: thesis_chapter_4.range_rate_row(STATES[0], "x"), "front"),
        (lambda: PrintedRadar(range_rate="wrong"), "range_rate"),
        (lambda: PrintedRadar(jacobian="wrong"), "jacobian"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=rf"^{named}\b"):
        call()

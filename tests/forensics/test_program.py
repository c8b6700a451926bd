"""Table 5 is the state of the thesis's program on the public log, which this finds again cell by cell."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trackhelpers import datasets
from trackhelpers.filters import MotionEKF
from trackhelpers.follow import follow
from trackhelpers.forensics.printed_ctrv import PrintedCTRV
from trackhelpers.forensics.printed_radar import PrintedRadar
from trackhelpers.forensics.program import ProgramEKF, window_deviations
from trackhelpers.motion import CTRV
from trackhelpers.published import last_digit, published
from trackhelpers.published.thesis_chapter_3 import covariance_316
from trackhelpers.scenarios.thesis.lidar_radar import T
from trackhelpers.sensors import Lidar, Radar

FIRST = 18  # of the 500 samples, the first of the nine that Table 5 prints
AS_PROGRAMMED = {"filter": ProgramEKF, "model": PrintedCTRV(2.0, 0.3, errors=["3.11"])}


@pytest.fixture(scope="module")
def log():
    """The measurements of the public log, one list; where it cannot be had the test that needs it is skipped by the name of the file."""
    if (reason := datasets.why_not(datasets.LIDAR_RADAR_LOG)) is not None:
        pytest.skip(f"{datasets.LIDAR_RADAR_LOG}: {reason}")
    frame = datasets.lidar_radar_log()
    return [z[np.isfinite(z)] for z in frame[["z1", "z2", "z3"]].to_numpy()]


@pytest.fixture
def short_log():
    """Ten samples of a straight track at 5 m/s, measured without noise."""
    x = np.array([[3 + 4 * t, 1 + 3 * t, 5, np.arctan2(3, 4), 0] for t in T * np.arange(10)])
    return [(Radar() if k % 2 else Lidar()).h(state) for k, state in enumerate(x)]


def track(zs, filter=MotionEKF, model=None, radar=None):
    """History of a filter that starts at the first lidar point with P0 = I, and uses that point again after 0 s."""
    sensors = {2: Lidar(), 3: Radar() if radar is None else radar}
    kf = filter(CTRV(2.0, 0.3) if model is None else model, [*zs[0], 0, 0, 0], np.eye(5))
    return follow(kf, zs, [sensors[len(z)] for z in zs], [0.0, *[T] * (len(zs) - 1)])


def cells():
    printed = published("thesis", 5)
    return printed.to_numpy(dtype=float), printed.map(last_digit).to_numpy()


def table_5(log, **changes):
    return track(log[: FIRST + 9], **changes).x[:, FIRST:].T


def test_every_cell_of_table_5_is_the_ekf_state_within_a_hundredth(log):
    printed, _ = cells()
    assert printed.shape == (9, 5)
    assert np.max(np.abs(table_5(log) - printed)) <= 0.01


def test_every_cell_of_table_5_is_the_programs_state_to_the_last_printed_digit(log):
    printed, half = cells()
    assert_array_equal(np.abs(table_5(log, **AS_PROGRAMMED) - printed) <= half, True)


def test_no_other_window_of_the_log_comes_near_table_5(log):
    printed, _ = cells()
    deviations = window_deviations(track(log).x, printed)
    assert np.argmin(deviations) == FIRST
    assert np.sort(deviations)[1] > 30 * np.min(deviations)


def test_the_printed_range_rate_and_the_printed_noise_are_not_those_of_table_5(log):
    printed, half = cells()
    noise = partial(covariance_316, sigma_a=2.0, sigma_w=0.3)
    for change in ({"radar": PrintedRadar(jacobian="own")}, {"filter": partial(ProgramEKF, Q=noise)}):
        assert np.max(np.abs(table_5(log, **AS_PROGRAMMED | change) - printed) / half) > 10


def test_program_with_everything_put_right_is_the_ekf(short_log):
    right = partial(ProgramEKF, late_F=False, late_Q=False, step=None)
    ours, reference = track(short_log, filter=right), track(short_log)
    assert_allclose(ours.x, reference.x, rtol=1e-12, atol=1e-12)
    assert_allclose(ours.P, reference.P, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("change", [{"late_F": True}, {"late_Q": True}, {"step": 0.05}, {"noise_step": 0.05}])
def test_each_option_of_the_program_matters(short_log, change):
    right = {"late_F": False, "late_Q": False, "step": None, "noise_step": None}
    assert np.max(np.abs(track(short_log, filter=partial(ProgramEKF, **right | change)).P - track(short_log).P)) > 1e-8


def test_window_deviations_are_those_of_each_window():
    rng = np.random.default_rng(6)
    x, table = rng.normal(size=(5, 12)), rng.normal(size=(4, 5))
    expected = [np.max(np.abs(x[:, i : i + 4].T - table)) for i in range(9)]
    assert_array_equal(window_deviations(x, table), expected)
    assert window_deviations(x, x[:, 3:7].T)[3] == 0


def test_bad_arguments_are_named():
    with pytest.raises(ValueError, match=r"table: .*got \(4, 3\) for \(5, 12\)"):
        window_deviations(np.zeros((5, 12)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match=r"step: .*-0\.1"):
        ProgramEKF(CTRV(), np.zeros(5), np.eye(5), step=-0.1)

from functools import partial

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trackhelpers import datasets
from trackhelpers.forensics.printed_ctrv import PrintedCTRV
from trackhelpers.forensics.printed_radar import PrintedRadar
from trackhelpers.forensics.program import ProgramEKF, window_deviations
from trackhelpers.motion import CTRV
from trackhelpers.published import last_digit, published
from trackhelpers.published.thesis_chapter_3 import covariance_316
from trackhelpers.scenarios.thesis.lidar_radar import T
from trackhelpers.scenarios.thesis.public_log import ROWS, track, truth, velocity_errors

AS_PROGRAMMED = {"filter": ProgramEKF, "model": PrintedCTRV(2.0, 0.3, errors=["3.11"])}


@pytest.fixture(scope="module")
def log():
    """The public log; where it cannot be had the test that needs it is skipped by the name of the file."""
    if not datasets.available(datasets.LIDAR_RADAR_LOG):
        pytest.skip(f"{datasets.LIDAR_RADAR_LOG} is neither here nor to be downloaded")
    return datasets.lidar_radar_log()


@pytest.fixture
def short_log():
    """Ten samples of a straight track at 5 m/s, measured without noise, in the form of the public log."""
    t = T * np.arange(10)
    x, y = 3 + 4 * t, 1 + 3 * t
    rho, lidar = np.hypot(x, y), np.arange(10) % 2 == 0
    return pd.DataFrame(
        {
            "sensor": np.where(lidar, "L", "R"),
            "t": t,
            "z1": np.where(lidar, x, rho),
            "z2": np.where(lidar, y, np.arctan2(y, x)),
            "z3": np.where(lidar, np.nan, (4 * x + 3 * y) / rho),
            "x": x,
            "y": y,
            "vx": np.full(10, 4.0),
            "vy": np.full(10, 3.0),
            "yaw": np.full(10, np.arctan2(3, 4)),
            "yaw_rate": np.zeros(10),
        }
    )


def cells():
    printed = published("thesis", 5)
    return printed.to_numpy(dtype=float), printed.map(last_digit).to_numpy()


def test_every_cell_of_table_5_is_the_ekf_state_within_a_hundredth(log):
    printed, _ = cells()
    assert printed.shape == (9, 5)
    assert np.max(np.abs(track(log[: ROWS.stop]).x[:, ROWS].T - printed)) <= 0.01


def test_every_cell_of_table_5_is_the_programs_state_to_the_last_printed_digit(log):
    printed, half = cells()
    assert_array_equal(np.abs(track(log[: ROWS.stop], **AS_PROGRAMMED).x[:, ROWS].T - printed) <= half, True)


def test_no_other_window_of_the_log_comes_near_table_5(log):
    printed, _ = cells()
    deviations = window_deviations(track(log).x, printed)
    assert np.argmin(deviations) == ROWS.start
    assert np.sort(deviations)[1] > 30 * np.min(deviations)


def test_the_printed_range_rate_and_the_printed_noise_are_not_those_of_table_5(log):
    printed, half = cells()
    for change in (
        {"radar": PrintedRadar(jacobian="own")},
        {"filter": partial(ProgramEKF, Q=partial(covariance_316, sigma_a=2.0, sigma_w=0.3))},
        {"first_again": False},
    ):
        deviation = np.abs(track(log[: ROWS.stop], **AS_PROGRAMMED | change).x[:, ROWS].T - printed)
        assert np.max(deviation / half) > 10


def test_the_rmse_over_the_whole_log_meets_what_its_course_asked_for(log):
    rmse = np.sqrt(np.mean(velocity_errors(log, track(log).x) ** 2, axis=1))
    assert np.all(rmse <= [0.11, 0.11, 0.52, 0.52])


def test_truth_has_no_velocity_error(log):
    assert_allclose(velocity_errors(log, truth(log)), 0, atol=1e-5)  # the file has seven significant digits


def test_program_with_everything_put_right_is_the_ekf(short_log):
    right = partial(ProgramEKF, late_F=False, late_Q=False, step=None)
    ours, reference = track(short_log, filter=right), track(short_log)
    assert_allclose(ours.x, reference.x, rtol=1e-12, atol=1e-12)
    assert_allclose(ours.P, reference.P, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("change", [{"late_F": True}, {"late_Q": True}, {"step": 0.05}, {"noise_step": 0.05}])
def test_each_option_of_the_program_matters(short_log, change):
    right = {"late_F": False, "late_Q": False, "step": None, "noise_step": None}
    assert np.max(np.abs(track(short_log, filter=partial(ProgramEKF, **right | change)).P - track(short_log).P)) > 1e-8


def test_a_missing_measurement_leaves_the_prediction(short_log):
    use = np.arange(10) != 6
    result = track(short_log, use=use)
    assert_allclose(result.x[:, 6], CTRV().f(result.x[:, 5], T), rtol=1e-12)
    assert np.isnan(result.nis[6]) and np.all(np.isnan(result.y[:, 6]))
    assert np.linalg.det(result.P[:2, :2, 6]) > np.linalg.det(track(short_log).P[:2, :2, 6])
    assert_array_equal(result.x[:, :6], track(short_log).x[:, :6])


def test_the_first_measurement_narrows_the_start_only_when_it_is_used_again(short_log):
    once, again = track(short_log, first_again=False), track(short_log)
    assert_array_equal(once.P[:, :, 0], np.eye(5))
    assert_allclose(np.diag(again.P[:, :, 0]), [0.0225 / 1.0225, 0.0225 / 1.0225, 1, 1, 1])
    assert np.isnan(once.nis[0]) and again.nis[0] == 0


def test_window_deviations_are_those_of_each_window():
    rng = np.random.default_rng(6)
    x, table = rng.normal(size=(5, 12)), rng.normal(size=(4, 5))
    expected = [np.max(np.abs(x[:, i : i + 4].T - table)) for i in range(9)]
    assert_array_equal(window_deviations(x, table), expected)
    assert window_deviations(x, x[:, 3:7].T)[3] == 0


def test_bad_arguments_are_named(short_log):
    with pytest.raises(ValueError, match=r"use: expected 10 truth values.*\(9,\)"):
        track(short_log, use=np.ones(9, dtype=bool))
    with pytest.raises(ValueError, match=r"use: .*dtype float64"):
        track(short_log, use=np.ones(10))
    with pytest.raises(ValueError, match="log: expected one that begins with a lidar point, got 'R'"):
        track(short_log[1:])
    with pytest.raises(ValueError, match=r"log: .*no row"):
        track(short_log[:0])
    with pytest.raises(ValueError, match=r"table: .*got \(4, 3\) for \(5, 12\)"):
        window_deviations(np.zeros((5, 12)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match=r"step: .*-0\.1"):
        ProgramEKF(CTRV(), np.zeros(5), np.eye(5), step=-0.1)

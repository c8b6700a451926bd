"""A model makes the errors that it is asked for and no others, and a process noise that is no covariance reaches every filter alike."""

from functools import partial

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.forensics.printed_ctrv import ERRORS, PrintedCTRV
from trackhelpers.forensics.program import EnsembleUnsymmetricEKF, ProgramEKF
from trackhelpers.motion import CTRV
from trackhelpers.published import thesis_chapter_3 as thesis
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar

T = 0.7
RIGHT = CTRV(2.0, 0.3)


@pytest.fixture
def x():
    """CTRV states (5, 30) that turn to either side by 0.1 … 1 rad/s."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(5, 30))
    states[4] = rng.choice([-1, 1], 30) * rng.uniform(0.1, 1, 30)
    return states


def differing(A, B, tolerance=1e-9):
    """Index pairs at which two stacks of matrices (n, n, M) differ in any run."""
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(np.max(np.abs(A - B), axis=-1) > tolerance), strict=True)}


def test_without_errors_the_printed_model_is_ctrv(x):
    x[4, :10] = 0
    model = PrintedCTRV(2.0, 0.3)
    for function in ("f", "F", "Q"):
        np.testing.assert_array_equal(getattr(model, function)(x, T), getattr(RIGHT, function)(x, T))


@pytest.mark.parametrize(
    ("error", "places"),
    [
        ("3.10 columns", {(1, 2), (1, 3)}),
        ("3.10 factor", {(0, 4), (1, 4)}),
        ("3.8", set()),
        ("3.11", set()),
        ("3.9", set()),
    ],
)
def test_an_error_changes_its_own_entries_of_F(x, error, places):
    model = PrintedCTRV(2.0, 0.3, [error])
    assert differing(model.F(x, T), RIGHT.F(x, T)) == places
    np.testing.assert_allclose(model.f(x, T), RIGHT.f(x, T), atol=1e-12)
    np.testing.assert_array_equal(model.Q(x, T), RIGHT.Q(x, T))


def test_all_errors_together_are_the_equations_as_printed(x):
    model = PrintedCTRV(2.0, 0.3, [error for error in ERRORS if error != "3.8"])
    np.testing.assert_allclose(model.F(x, T), thesis.jacobian_310(x, T), atol=1e-12)
    np.testing.assert_array_equal(model.Q(x, T), RIGHT.Q(x, T))
    x[4] = 0
    np.testing.assert_allclose(model.F(x, T), thesis.jacobian_311(x, T), atol=1e-12)
    np.testing.assert_allclose(model.f(x, T), thesis.transition_39_straight(x, T), atol=1e-12)


def test_the_switch_says_from_which_turn_rate_on_the_target_turns(x):
    model = PrintedCTRV(errors=["3.9", "3.11"], switch=0.5)
    slow = np.abs(x[4]) <= 0.5
    assert 0 < slow.sum() < 30
    np.testing.assert_array_equal(model.f(x, T)[3] == x[4], slow)
    np.testing.assert_array_equal(np.all(model.F(x, T)[:2, 4] == 0, axis=0), slow)


@pytest.mark.parametrize("arguments", [{"errors": "3.8"}, {"errors": ["3.7"]}, {"errors": ["3.16"]}, {"switch": -0.1}, {"switch": np.nan}])
def test_unknown_errors_and_switches_are_refused(arguments):
    with pytest.raises(ValueError, match=next(iter(arguments))):
        PrintedCTRV(2.0, 0.3, **arguments)


def printed_noise(x, dt):
    return thesis.covariance_316(x, dt, 2.0, 0.3)


def test_with_the_right_noise_the_filter_that_assumes_no_symmetry_is_the_ekf():
    zs = lidar_radar.measurements([np.random.default_rng(9), np.random.default_rng(10)], track=lidar_radar.truth(60))
    usual, careful = (
        lidar_radar.estimates(lidar_radar.start(filter, zs[0]), zs) for filter in (EnsembleEKF, partial(EnsembleUnsymmetricEKF, Q=RIGHT.Q))
    )
    np.testing.assert_allclose(careful, usual, rtol=1e-9, atol=1e-9)


def test_a_singular_innovation_loses_its_own_run_only():
    P0 = np.repeat(np.eye(5)[..., None], 2, axis=2)
    P0[:2, :2, 0] = 0
    ens = EnsembleUnsymmetricEKF(RIGHT, np.ones((5, 2)), P0, RIGHT.Q)
    ens.update(np.ones((2, 2)), Lidar(0.0))
    np.testing.assert_array_equal(ens.failed, [True, False])


def test_316_reaches_single_target_and_ensemble_alike_and_leaves_P_unsymmetric():
    zs = lidar_radar.measurements([np.random.default_rng(9), np.random.default_rng(10)], track=lidar_radar.truth(60))
    ens = lidar_radar.start(partial(EnsembleUnsymmetricEKF, Q=printed_noise), zs[0])
    together = lidar_radar.estimates(ens, zs)
    single = [z[:, 1] for z in zs]
    kf = lidar_radar.start(partial(ProgramEKF, late_F=False, late_Q=False, step=None, Q=printed_noise), single[0])
    np.testing.assert_allclose(together[..., 1], lidar_radar.estimates(kf, single), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(ens.P[..., 1], kf.P, rtol=1e-7, atol=1e-10)
    assert np.abs(kf.P - kf.P.T).max() > 1e-3 * np.abs(kf.P).max()
    usual = lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs)
    assert np.abs(together - usual).max() > 1e-3

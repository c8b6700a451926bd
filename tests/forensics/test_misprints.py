"""Each printed equation differs from the derived one where the notebook says it does, and nowhere else."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from trackhelpers.angles import wrap
from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.filters import MotionEKF
from trackhelpers.forensics.misprints import compare, driven
from trackhelpers.forensics.printed_ctrv import ERRORS, PrintedCTRV, PrintedPolarCA
from trackhelpers.forensics.program import EnsembleUnsymmetricEKF, ProgramEKF
from trackhelpers.motion import CA, CTRV, PolarCA, PolarCV
from trackhelpers.published import thesis_chapter_3 as thesis
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, Radar

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


def test_36_moves_rightly_but_gives_the_acceleration_to_the_heading(x):
    printed, right = thesis.transition_36(x, T), PolarCA().f(x, T)
    np.testing.assert_allclose(printed[[0, 1, 4]], right[[0, 1, 4]], atol=1e-12)
    np.testing.assert_allclose(printed[2] - right[2], T * x[4], atol=1e-12)
    np.testing.assert_allclose(right[3] - printed[3], T * x[4], atol=1e-12)


def test_38_is_ctrv_where_it_turns_and_not_a_number_where_it_does_not(x):
    np.testing.assert_allclose(thesis.transition_38(x, T), RIGHT.f(x, T), atol=1e-12)
    x[4] = 0
    with np.errstate(invalid="ignore", divide="ignore"):
        assert np.isnan(thesis.transition_38(x, T)[:2]).all()


def test_39_goes_straight_but_sets_the_heading_to_the_turn_rate(x):
    x[4] = 0
    printed, right = thesis.transition_39_straight(x, T), RIGHT.f(x, T)
    np.testing.assert_allclose(printed[[0, 1, 2, 4]], right[[0, 1, 2, 4]], atol=1e-12)
    np.testing.assert_array_equal(printed[3], 0)


def test_310_has_two_columns_exchanged_and_a_factor_that_only_one_second_hides(x):
    printed, right = thesis.jacobian_310(x, T), RIGHT.F(x, T)
    assert differing(printed, right) == {(1, 2), (1, 3), (0, 4), (1, 4)}
    np.testing.assert_allclose(printed[1, [3, 2]], right[1, [2, 3]], atol=1e-12)
    np.testing.assert_allclose(thesis.jacobian_310(x, 1.0)[:, 4], RIGHT.F(x, 1.0)[:, 4], atol=1e-12)
    np.testing.assert_allclose(thesis.jacobian_310_repaired(x, T), right, atol=1e-12)


def test_311_forgets_that_the_turn_rate_moves_the_position(x):
    x[4] = 0
    printed, right = thesis.jacobian_311(x, T), RIGHT.F(x, T)
    assert differing(printed, right) == {(0, 4), (1, 4)}
    half = x[2] * T**2 / 2
    np.testing.assert_allclose((right - printed)[:2, 4], [-half * np.sin(x[3]), half * np.cos(x[3])], atol=1e-12)


def test_312_is_the_straight_line_gain_and_not_the_response_of_the_arc(x):
    mu = np.array([0.5, -0.2])
    straight, arc = (np.einsum("ijm,j->im", CTRV(2.0, 0.3, noise=noise).G(x, T), mu) for noise in ("straight", "exact"))
    np.testing.assert_allclose(thesis.noise_312(x, T, mu), straight, atol=1e-12)
    assert np.max(np.abs(straight - arc)) > 1e-3


def test_316_is_right_for_a_variance_of_one_and_asymmetric_otherwise(x):
    np.testing.assert_allclose(thesis.covariance_316(x, T, 2.0, 1.0), CTRV(2.0, 1.0).Q(x, T), atol=1e-12)
    printed, right = thesis.covariance_316(x, T, 2.0, 0.3), RIGHT.Q(x, T)
    assert differing(printed, right) == {(4, 3), (4, 4)}
    np.testing.assert_allclose(printed[4, 3:] * 0.3, right[4, 3:], rtol=1e-12)
    assert np.all(np.abs(printed[4, 3] - printed[3, 4]) > 1e-3)


def test_a_driven_target_obeys_its_differential_equation(x):
    rng = np.random.default_rng(1)
    mu = rng.normal(size=(2, 30))
    ends = driven(x, T, mu)
    for i in range(3):
        a, alpha = mu[:, i]
        solution = solve_ivp(
            lambda t, s, a=a, alpha=alpha: [s[2] * np.cos(s[3]), s[2] * np.sin(s[3]), a, s[4], alpha],
            (0, T),
            x[:, i],
            rtol=1e-11,
            atol=1e-12,
        )
        np.testing.assert_allclose(ends[:, i], solution.y[:, -1], atol=1e-9)
    np.testing.assert_allclose(driven(x, T, np.zeros((2, 30))), RIGHT.f(x, T), atol=1e-12)


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


def test_F_of_the_printed_polar_model_is_the_derivative_of_its_f(x):
    model, h = PrintedPolarCA(1.0), 1e-6
    steps = h * np.eye(5)[..., None]
    difference = np.stack([(model.f(x + step, T) - model.f(x - step, T)) / (2 * h) for step in steps], axis=1)
    np.testing.assert_allclose(model.F(x, T), difference, atol=1e-8)


@pytest.mark.parametrize("arguments", [{"errors": "3.8"}, {"errors": ["3.7"]}, {"errors": ["3.16"]}, {"switch": -0.1}, {"switch": np.nan}])
def test_unknown_errors_and_switches_are_refused(arguments):
    with pytest.raises(ValueError, match=next(iter(arguments))):
        PrintedCTRV(2.0, 0.3, **arguments)


def test_an_outcome_is_that_of_the_single_target_filter():
    track = lidar_radar.truth(60)
    outcome = compare({"right": RIGHT}, runs=2, seed=5, track=track)["right"]
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence(5).spawn(2)]
    zs = [z[:, 1] for z in lidar_radar.measurements(rngs, track=track)]
    kf = MotionEKF(RIGHT, [*zs[0], 0, 0, 0], np.eye(5))
    estimates, nees, nis = [], [], []
    for k in range(1, 61):
        kf.predict(0.05 if k > 1 else 0.0)
        kf.update(zs[k - 1], Lidar() if k % 2 else Radar())
        estimates.append(kf.x)
        if k % 5 == 0:
            error = kf.x - track[:, k - 1]
            error[3] = wrap(error[3])
            nees.append(error @ np.linalg.inv(kf.P) @ error)
            nis.append(kf.y @ np.linalg.inv(kf.S) @ kf.y / len(kf.y))
    x = np.transpose(estimates)
    position = np.sqrt(np.mean(np.sum((x[:2] - track[:2]) ** 2, axis=0)))
    velocity = np.sqrt(np.mean(np.sum((lidar_radar.velocity(x) - lidar_radar.velocity(track)) ** 2, axis=0)))
    np.testing.assert_allclose([outcome.position[1], outcome.velocity[1]], [position, velocity], rtol=1e-8)
    np.testing.assert_allclose(outcome.nees[:, 1], nees, rtol=1e-6)
    np.testing.assert_allclose(outcome.nis[:, 1], nis, rtol=1e-6)
    assert not outcome.lost.any()


def test_filters_are_compared_on_the_same_measurements_whoever_else_takes_part():
    track = lidar_radar.truth(30)
    alone = compare({"right": RIGHT}, runs=3, seed=6, track=track)["right"]
    together = compare({"lost": PrintedCTRV(2.0, 0.3, ["3.8"]), "right": RIGHT}, runs=3, seed=6, track=track)
    np.testing.assert_array_equal(alone.position, together["right"].position)
    np.testing.assert_array_equal(alone.nees, together["right"].nees)
    assert together["lost"].lost.all() and together["lost"].useless.all()


def printed_noise(x, dt):
    return thesis.covariance_316(x, dt, 2.0, 0.3)


def test_with_the_right_noise_the_filter_that_assumes_no_symmetry_is_the_ekf():
    zs = lidar_radar.measurements([np.random.default_rng(9), np.random.default_rng(10)], track=lidar_radar.truth(60))
    usual, careful = (
        lidar_radar.estimates(lidar_radar.start(filter, zs[0]), zs) for filter in (EnsembleEKF, partial(EnsembleUnsymmetricEKF, Q=RIGHT.Q))
    )
    np.testing.assert_allclose(careful, usual, rtol=1e-9, atol=1e-9)


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


def test_a_model_with_a_noise_of_its_own_is_compared_by_the_filter_that_assumes_no_symmetry():
    track, models = lidar_radar.truth(30), {"right": RIGHT, "same": (RIGHT, RIGHT.Q), "(3.16)": (RIGHT, printed_noise)}
    right, same, other = compare(models, runs=3, seed=6, track=track).values()
    np.testing.assert_allclose(same.position, right.position, rtol=1e-9)
    assert np.all(np.abs(other.position / right.position - 1) > 1e-6)


def test_a_singular_innovation_loses_its_own_run_only():
    P0 = np.repeat(np.eye(5)[..., None], 2, axis=2)
    P0[:2, :2, 0] = 0
    ens = EnsembleUnsymmetricEKF(RIGHT, np.ones((5, 2)), P0, RIGHT.Q)
    ens.update(np.ones((2, 2)), Lidar(0.0))
    np.testing.assert_array_equal(ens.failed, [True, False])


def test_a_run_that_ends_far_off_is_lost():
    outcome = compare({"cannot turn": PolarCA(2.0)}, runs=2, seed=7)["cannot turn"]
    assert outcome.lost.all() and np.isfinite(outcome.position).all()


@pytest.mark.parametrize("model", [PolarCV(2.0, 1.0), CA(0.3)], ids=lambda m: type(m).__name__)
def test_other_states_are_compared_by_position_and_velocity(model):
    outcome = compare({"model": model}, runs=3, seed=8, track=lidar_radar.truth(200))["model"]
    assert not outcome.useless.any() and np.all(outcome.velocity < 2)
    assert np.isnan(outcome.nees).all() and np.isfinite(outcome.nis).all()


@pytest.mark.parametrize("track", [np.zeros((4, 20)), np.zeros(5), np.zeros((5, 4))])
def test_a_track_of_another_shape_is_refused(track):
    with pytest.raises(ValueError, match="track"):
        compare({"right": RIGHT}, runs=2, track=track)

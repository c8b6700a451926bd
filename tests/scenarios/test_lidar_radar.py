"""Section 4.2: the truth, the measurements, one loop for one target and for runs, the printed radar, and the noise behind Tables 7 and 8."""

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF, monte_carlo
from trackhelpers.filters import MotionEKF
from trackhelpers.forensics import lidar_radar_inverse, lidar_radar_truth
from trackhelpers.forensics.printed_ctrv import PrintedCTRV
from trackhelpers.forensics.printed_radar import LinearisedRadar, PrintedRadar, UnpredictedEKF
from trackhelpers.forensics.program import EnsembleProgramEKF, ProgramEKF
from trackhelpers.motion import CTRV
from trackhelpers.scenarios.thesis import lidar_radar, lidar_radar_runs
from trackhelpers.sensors import Lidar, Radar
from trackhelpers.tables import error_table

STATES = np.random.default_rng(5).normal(size=(20, 5)) * [20, 20, 4, 2, 0.5]


def generators(runs, seed=1):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]


def numeric_jacobian(h, x, step=1e-6):
    return np.column_stack([(h(x + d) - h(x - d)) / (2 * step) for d in step * np.eye(len(x))])


def test_truth_is_the_one_candidate_that_meets_all_24_printed_cells():
    cells = {scheme: lidar_radar_truth.matched_cells(lidar_radar_truth.candidate(scheme)) for scheme in lidar_radar_truth.SCHEMES}
    assert cells.pop("turned velocity") == (24, 3)
    assert max(count for count, _ in cells.values()) < 20
    np.testing.assert_allclose(lidar_radar_truth.candidate(), lidar_radar.components(lidar_radar.truth(20)), rtol=1e-13)


def test_exact_arc_is_the_transition_of_ctrv():
    model = CTRV()
    x = np.array([*lidar_radar.START, lidar_radar.SPEED, lidar_radar.HEADING, lidar_radar.TURN_RATE])
    for place in lidar_radar_truth.candidate("exact arc", samples=5).T:
        x = model.f(x, lidar_radar.T)
        np.testing.assert_allclose(lidar_radar.components(x), place, rtol=1e-13)


def test_a_range_of_matching_values_holds_the_true_one_and_no_neighbour_outside():
    low, high = lidar_radar_truth.matching_range("speed", np.linspace(5.19, 5.21, 201))
    assert low < lidar_radar.SPEED < high
    assert lidar_radar_truth.matched_cells(lidar_radar_truth.candidate(speed=low - 1e-3), 3)[0] < 24


def test_noise_of_zero_measures_the_truth_and_one_sigma_shifts_by_sigma():
    track = lidar_radar.truth(4)
    lidar, radar = Lidar(0.2), Radar((0.5, 0.01, 0.7))
    still, shifted = (lidar_radar.measure(np.full((4, 3, 1), unit), lidar, radar, track) for unit in (0.0, 1.0))
    for k, (a, b) in enumerate(zip(still, shifted, strict=True), start=1):
        sensor = lidar if k % 2 else radar
        np.testing.assert_array_equal(a[:, 0], sensor.h(track[:, k - 1]))
        np.testing.assert_allclose((b - a)[:, 0], sensor.sigma, rtol=1e-9)


def test_measurements_of_a_run_do_not_depend_on_the_other_runs():
    for measure in (lidar_radar.measurements, lidar_radar.position_noise_measurements):
        alone, together = measure(generators(3)[1:2]), measure(generators(3))
        for a, b in zip(alone, together, strict=True):
            np.testing.assert_array_equal(a[:, 0], b[:, 1])


def test_displaced_measurements_are_those_of_a_target_at_the_wrong_place_with_the_true_velocity():
    track, noise = lidar_radar.truth(6), np.random.default_rng(2).normal(size=(6, 2, 4))
    for k, z in enumerate(lidar_radar.measure_displaced(noise, track), start=1):
        p = track[:2, k - 1, None] + noise[k - 1]
        if k % 2:
            np.testing.assert_array_equal(z, p)
        else:
            rho = np.hypot(*p)
            along = np.sum(p * lidar_radar.velocity(track)[:, k - 1, None], axis=0) / rho
            np.testing.assert_allclose(z, [rho, np.arctan2(p[1], p[0]), along], rtol=1e-12)


@pytest.mark.parametrize("reuse_first", [True, False])
def test_the_loop_gives_one_target_what_it_gives_that_run_of_an_ensemble(reuse_first):
    zs = lidar_radar.measurements(generators(3), track=lidar_radar.truth(40))
    together = lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs, reuse_first=reuse_first)
    single = [z[:, 1] for z in zs]
    alone = lidar_radar.estimates(lidar_radar.start(MotionEKF, single[0]), single, reuse_first=reuse_first)
    assert together.shape == (5, 40, 3)
    np.testing.assert_allclose(together[..., 1], alone, rtol=1e-8, atol=1e-10)


def test_the_start_leaves_the_velocity_exactly_zero_as_long_as_table_9_says():
    zs = lidar_radar.measurements(generators(50), track=lidar_radar.truth(3))
    vx, vy = lidar_radar.velocity(lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs))
    assert np.all(vx[0] == 0) and np.all(vy[:2] == 0)
    assert np.all(vx[1] != 0) and np.all(vy[2] != 0)


def test_table_9_of_runs_is_the_error_table_of_each():
    error = np.random.default_rng(3).normal(size=(4, 30, 5))
    table = lidar_radar.table_9(error)
    for run in range(5):
        expected = error_table(error[..., run], names=lidar_radar.COMPONENTS).T[list(lidar_radar.FIGURES)]
        np.testing.assert_allclose(table[..., run], expected, rtol=1e-13)


def test_errors_of_the_truth_are_zero():
    track = lidar_radar.truth(50)
    assert np.all(lidar_radar.errors(track, track) == 0)
    assert lidar_radar.errors(np.repeat(track[..., None], 3, axis=2), track).shape == (4, 50, 3)


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


def test_linearised_radar_takes_the_whole_bearing_for_an_innovation():
    x = STATES.T
    np.testing.assert_allclose(LinearisedRadar().h(x)[0], Radar().h(x)[0], rtol=1e-13)
    np.testing.assert_allclose(LinearisedRadar().h(x)[1], 0, atol=1e-13)


def test_the_printed_list_predicts_the_covariance_and_not_the_state():
    x0, P0 = np.tile([[1.0], [2.0], [3.0], [0.4], [0.5]], 2), np.eye(5)
    listed, whole = UnpredictedEKF(CTRV(2, 0.3), x0, P0), EnsembleEKF(CTRV(2, 0.3), x0, P0)
    listed.predict(0.05)
    whole.predict(0.05)
    np.testing.assert_array_equal(listed.x, x0)
    np.testing.assert_array_equal(listed.P, whole.P)


def test_printed_range_rate_and_jacobian_lose_every_run_and_the_right_ones_none():
    for jacobian in ("printed v", "printed y"):
        assert lidar_radar_runs.follow_with(PrintedRadar(jacobian=jacobian), 20, 3)[0].all()
    lost, rmse = lidar_radar_runs.follow_with(Radar(), 20, 3)
    assert not lost.any()
    assert np.all(rmse < 0.15 * np.sqrt(2))


def test_ensemble_of_the_program_is_the_program_for_each_run():
    model = PrintedCTRV(2.0, 0.3, errors=["3.11"])
    zs = lidar_radar.measurements(generators(2), track=lidar_radar.truth(30))
    together = lidar_radar.estimates(lidar_radar.start(EnsembleProgramEKF, zs[0], model), zs)
    single = [z[:, 1] for z in zs]
    alone = lidar_radar.estimates(lidar_radar.start(ProgramEKF, single[0], model), single)
    # at dt = 0 the program's Q is zero in both, its F is not the identity
    np.testing.assert_allclose(together[..., 1], alone, rtol=1e-8, atol=1e-10)


def test_the_noise_found_gives_the_printed_filter_columns_back_only_when_the_first_point_is_used_twice():
    model = PrintedCTRV(2.0, 0.3, errors=["3.11"])
    displaced, program = lidar_radar_inverse.displaced_by(0.25), EnsembleProgramEKF
    fit = lidar_radar_inverse.fit_noise(displaced, program, model)
    assert fit.largest <= 1
    printed = lidar_radar_truth.printed_estimates()
    again = lidar_radar.estimates(lidar_radar.start(program, *displaced(fit.noise[..., None])[:1], model), displaced(fit.noise[..., None]))
    rounding = lidar_radar_truth.half_units(printed)
    np.testing.assert_array_less(np.abs(lidar_radar.components(again)[:, 2:8, 0].T - printed.to_numpy(dtype=float)), rounding * (1 + 1e-9))
    assert lidar_radar_inverse.fit_noise(displaced, program, model, reuse_first=False).largest > 3


def test_a_noise_that_was_put_in_is_found_again(monkeypatch):
    noise = np.random.default_rng(8).normal(size=(8, 2))
    displaced = lidar_radar_inverse.displaced_by(0.2)
    zs = displaced(noise[..., None])
    rows = lidar_radar.components(lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs))[:, 2:8, 0].T
    frame = lidar_radar_truth.printed_estimates()
    frame.iloc[:] = [[f"{value:.5f}" for value in row] for row in rows]
    monkeypatch.setattr(lidar_radar_inverse, "printed_estimates", lambda: frame)
    fit = lidar_radar_inverse.fit_noise(displaced)
    assert np.all(np.abs(fit.noise - noise) <= 4 * fit.deviation + 1e-6)
    assert np.max(np.abs(fit.noise[2:] - noise[2:])) < 0.05


def test_percentiles_and_hits_of_known_numbers():
    cells = np.tile(np.arange(100.0), (3, 1))
    np.testing.assert_array_equal(lidar_radar_runs.percentiles(cells, [-1, 50, 200]), [0, 50.5, 100])
    assert lidar_radar_runs.hit(np.array([[1.2345674, 1.2345686]]), [1.234568]).tolist() == [[False, False]]
    assert lidar_radar_runs.hit(np.array([[1.2345676, 1.2345684]]), [1.234568]).tolist() == [[True, True]]


def test_joint_share_is_uniform_for_runs_of_the_same_kind_and_blind_to_monotone_units():
    rng = np.random.default_rng(4)
    mix = np.tril(np.ones((4, 4)))
    cells = mix @ rng.normal(size=(4, 2000))
    shares = [lidar_radar_runs.joint_share(cells, mix @ rng.normal(size=4)) for _ in range(60)]
    assert 0.35 < np.mean(shares) < 0.65
    other = mix @ rng.normal(size=4)
    assert lidar_radar_runs.joint_share(np.exp(cells), np.exp(other)) == pytest.approx(
        lidar_radar_runs.joint_share(cells, other), abs=1e-12
    )
    assert lidar_radar_runs.joint_share(cells, [9, -9, 9, -9]) == 0


def test_features_are_ratios_to_what_they_name():
    def task(rngs):
        zs = lidar_radar.measurements(rngs)
        return lidar_radar_runs.features(lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs), zs)

    found = monte_carlo(task, 20, 6, reduce=dict.fromkeys(lidar_radar_runs.FEATURES, "concat"))
    assert set(found) == set(lidar_radar_runs.FEATURES)
    assert np.all(found["first speed"] == 0)
    assert np.all((found["position"] > 0.3) & (found["position"] < 1))
    assert np.all((found["velocity"] > 0.01) & (found["velocity"] < 0.3))


def test_start_is_as_inconsistent_as_its_p0():
    """P0 = I with v = θ = ω = 0: the NEES at k = 1 is 5.2² + 0.803² + 0.35² plus the position's two."""
    nees = lidar_radar_runs.simulate_consistency(2000, 9)["nees"][0]
    position = 2 * 0.15**2 * (1 + 1 / 0.15**2)
    expected = 5.2**2 + lidar_radar.truth(1)[3, 0] ** 2 + 0.35**2 + position
    assert nees == pytest.approx(expected, abs=0.2)


def test_no_filter_beats_the_bound():
    square = lidar_radar_runs.simulate_consistency(100, 7)["square"]
    bound = lidar_radar_runs.lower_bound()
    assert np.sqrt(np.mean(square[:2, 20:].sum(axis=0))) > np.sqrt(np.mean(bound[20:, 0, 0] + bound[20:, 1, 1]))


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: lidar_radar.truth(0), "steps"),
        (lambda: lidar_radar.measure(np.zeros((4, 2, 1))), "noise"),
        (lambda: lidar_radar.measure_displaced(np.zeros((501, 2, 1))), "noise"),
        (lambda: lidar_radar.position_noise_measurements(generators(1), sigma=-1), "sigma"),
        (lambda: lidar_radar.start(MotionEKF, [1, 2, 3]), "z"),
        (lambda: lidar_radar_truth.candidate("leap"), "scheme"),
        (lambda: lidar_radar_truth.candidate(start=(1, 2, 3)), "start"),
        (lambda: lidar_radar_truth.matching_range("speed", [1.0, 2.0]), "values"),
        (lambda: lidar_radar_inverse.displaced_by(np.nan), "sigma"),
        (lambda: PrintedRadar(range_rate="wrong"), "range_rate"),
        (lambda: PrintedRadar(jacobian="wrong"), "jacobian"),
        (lambda: PrintedRadar(state=("x", "y", "vx", "vy")), "state"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=rf"^{named}\b"):
        call()

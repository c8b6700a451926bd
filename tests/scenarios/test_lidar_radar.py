"""Section 4.2: the truth, the measurements, and one loop for one target and for runs."""

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.filters import MotionEKF
from trackhelpers.follow import follow
from trackhelpers.forensics.printed_ctrv import PrintedCTRV
from trackhelpers.forensics.program import EnsembleProgramEKF, ProgramEKF
from trackhelpers.published import last_digit, published
from trackhelpers.scenarios.thesis import lidar_radar
from trackhelpers.sensors import Lidar, Radar


def generators(runs, seed=1):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]


@pytest.mark.parametrize(("table", "names"), [(7, ("x", "y")), (8, ("vx", "vy"))])
def test_truth_meets_every_printed_cell(table, names):
    printed, true = published("thesis", table), dict(zip(lidar_radar.COMPONENTS, lidar_radar.components(lidar_radar.truth()), strict=True))
    for name in names:
        for row, cell in enumerate(printed[f"{name}_true"]):
            assert abs(true[name][row + 2] - float(cell)) <= last_digit(cell) * (1 + 1e-9)


def test_noise_of_zero_measures_the_truth_and_one_sigma_shifts_by_sigma():
    track = lidar_radar.truth(4)
    lidar, radar = Lidar(0.2), Radar((0.5, 0.01, 0.7))
    still, shifted = (lidar_radar.measure(np.full((4, 3, 1), unit), lidar, radar, track) for unit in (0.0, 1.0))
    for k, (a, b) in enumerate(zip(still, shifted, strict=True), start=1):
        sensor = lidar if k % 2 else radar
        np.testing.assert_array_equal(a[:, 0], sensor.h(track[:, k - 1]))
        np.testing.assert_allclose((b - a)[:, 0], sensor.sigma, rtol=1e-9)


def test_measurements_of_a_run_do_not_depend_on_the_other_runs():
    alone, together = lidar_radar.measurements(generators(3)[1:2]), lidar_radar.measurements(generators(3))
    for a, b in zip(alone, together, strict=True):
        np.testing.assert_array_equal(a[:, 0], b[:, 1])


def test_the_loop_gives_one_target_what_it_gives_that_run_of_an_ensemble_and_is_follow():
    zs = lidar_radar.measurements(generators(3), track=lidar_radar.truth(40))
    together = lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs)
    single = [z[:, 1] for z in zs]
    alone = lidar_radar.estimates(lidar_radar.start(MotionEKF, single[0]), single)
    assert together.shape == (5, 40, 3)
    np.testing.assert_allclose(together[..., 1], alone, rtol=1e-8, atol=1e-10)
    dts = [0.0] + [lidar_radar.T] * 39
    again = follow(lidar_radar.start(EnsembleEKF, zs[0]), zs, [Lidar(), Radar()] * 20, dts).x
    np.testing.assert_array_equal(together, again)


def test_the_start_leaves_the_velocity_exactly_zero_as_long_as_table_9_says():
    zs = lidar_radar.measurements(generators(50), track=lidar_radar.truth(3))
    vx, vy = lidar_radar.velocity(lidar_radar.estimates(lidar_radar.start(EnsembleEKF, zs[0]), zs))
    assert np.all(vx[0] == 0) and np.all(vy[:2] == 0)
    assert np.all(vx[1] != 0) and np.all(vy[2] != 0)


def test_errors_of_the_truth_are_zero():
    track = lidar_radar.truth(50)
    assert np.all(lidar_radar.errors(track, track) == 0)
    assert lidar_radar.errors(np.repeat(track[..., None], 3, axis=2), track).shape == (4, 50, 3)


def test_ensemble_of_the_program_is_the_program_for_each_run():
    model = PrintedCTRV(2.0, 0.3, errors=["3.11"])
    zs = lidar_radar.measurements(generators(2), track=lidar_radar.truth(30))
    together = lidar_radar.estimates(lidar_radar.start(EnsembleProgramEKF, zs[0], model), zs)
    single = [z[:, 1] for z in zs]
    alone = lidar_radar.estimates(lidar_radar.start(ProgramEKF, single[0], model), single)
    # at dt = 0 the program's Q is zero in both, its F is not the identity
    np.testing.assert_allclose(together[..., 1], alone, rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: lidar_radar.truth(0), "steps"),
        (lambda: lidar_radar.measure(np.zeros((4, 2, 1))), "noise"),
        (lambda: lidar_radar.measure(np.zeros((501, 3, 1))), "noise"),
        (lambda: lidar_radar.start(MotionEKF, [1, 2, 3]), "z"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=rf"^{named}\b"):
        call()

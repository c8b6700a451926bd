"""Paper 3's introduction: the one manoeuvre, and every filter on it, once for one target and once for all runs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trackhelpers.follow import follow
from trackhelpers.motion import CV
from trackhelpers.scenarios.augmented_bias import contenders
from trackhelpers.scenarios.augmented_bias.one_manoeuvre import BEGIN, END, PARTS, STEPS, accelerations, draw
from trackhelpers.scenarios.augmented_bias.target import P0, T, track_of

TRACK = track_of(accelerations(2.0))
RUNS = draw(TRACK, runs=60, seed=3)
ALL = {
    "SKF": contenders.plain(),
    "CA": contenders.accelerating(),
    "Singer": contenders.accelerating(contenders.CORRELATED, "Singer"),
    "IMM": contenders.interacting(),
    "VDF": contenders.variable_dimension(),
    "inflation": contenders.variance_inflation(),
    "STKF": contenders.strong_tracking(4.0),
    "STKF, per axis": contenders.strong_tracking(4.0, "per axis"),
    "ABMA": contenders.augmented(),
    "input estimation": contenders.input_estimation(),
}


def estimates(contender):
    return contender.followed(RUNS.start, RUNS.z).x


def test_the_track_is_a_parabola_while_accelerated_and_straight_otherwise():
    t = np.arange(181.0)
    x = 10 + 5 * t + np.where(t > 60, (np.minimum(t, 120) - 60) ** 2, 0) + np.where(t > 120, 120 * (t - 120), 0)
    assert_allclose(TRACK[0], x, rtol=0, atol=1e-9)
    assert_allclose(TRACK[2:], [20 + 5 * t, np.full(181, 5.0)], rtol=0, atol=1e-9)


def test_the_parts_cover_the_settled_samples_once():
    covered = np.concatenate([np.arange(181)[PARTS[part]] for part in ("rest", "onset", "manoeuvre", "end", "after")])
    assert_array_equal(covered, np.arange(21, STEPS + 1))
    moved = np.flatnonzero(np.abs(np.diff(TRACK[1])) > 0) + 1
    assert_array_equal(np.arange(181)[PARTS["accelerated"]], moved)
    assert (moved[0], moved[-1]) == (BEGIN + 1, END)


def test_a_run_has_its_noise_whatever_the_track_and_the_number_of_runs():
    other = draw(track_of(accelerations(0.5)), runs=7, seed=3)
    noise = [data.z - data.track[[0, 2], 1:] for data in (RUNS, other)]
    assert_allclose(noise[0][..., :7], noise[1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("a", [-1.0, np.nan, np.inf])
def test_an_acceleration_that_is_none_is_refused(a):
    with pytest.raises(ValueError, match="a:"):
        accelerations(a)


@pytest.mark.parametrize("name", list(ALL))
def test_the_single_filter_is_a_run_of_its_ensemble(name):
    contender, whole = ALL[name], estimates(ALL[name])
    kept = getattr(contender, "to_estimate", np.eye(4))
    for run in (0, 41):
        single = follow(contender.single(RUNS.start[:, run]), RUNS.z[..., run].T)
        assert_allclose(kept @ single.x, whole[..., run], rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["SKF", "CA", "Singer", "ABMA"])
def test_runs_agree_with_the_recursion(name):
    bias, C, _ = contenders.exact_errors(ALL[name], TRACK)
    squares = (estimates(ALL[name]) - TRACK[:, 1:, None])[0] ** 2
    expected = (bias[0] ** 2 + C[0, 0])[1:]
    for part in PARTS.values():
        some = slice(part.start - 1, part.stop - 1)
        by_run = squares[some].mean(axis=0)
        assert abs(by_run.mean() - expected[some].mean()) < 4 * by_run.std() / np.sqrt(60)


def test_the_plain_filter_is_on_the_printed_model_and_begins_at_its_start():
    assert_allclose(ALL["SKF"].Q, CV(0.1).Q(np.zeros(4), T))
    many = draw(TRACK, runs=4000, seed=5)
    assert_allclose(np.cov(many.start - many.track[:, 0]), P0, atol=0.3)

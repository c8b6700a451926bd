"""Table 1's target, and the two ways to a filter's average error: by recursion and by runs."""

import numpy as np
import pytest

from trackhelpers import exact
from trackhelpers.published import published
from trackhelpers.scenarios.augmented_bias import contenders as c
from trackhelpers.scenarios.augmented_bias import runs, target


def test_the_segments_are_those_of_table_1():
    printed = published("augmented_bias", 1)["interval"].tolist()[1:]
    assert [f"{s.first}-{s.last}s" for s in target.SEGMENTS] == printed
    assert sum(s.last - s.first + 1 for s in target.SEGMENTS) == target.STEPS


def test_the_target_moves_as_table_1_says():
    track, a = target.truth(2.0), target.accelerations(2.0)
    np.testing.assert_allclose(track[:, 200], [10 + 1000, 5, 20 + 1000, 5])
    np.testing.assert_allclose(track[[1, 3], 400], 405)
    np.testing.assert_allclose(track[[1, 3], 600], 5)
    np.testing.assert_allclose(np.diff(track[0, :201], n=2), 0, atol=1e-9)
    np.testing.assert_allclose(np.diff(track[0, 200:401], n=2), 2, atol=1e-8)
    np.testing.assert_allclose(a[1, 700:], 0)
    np.testing.assert_allclose(np.diff(track[1]), a[0], atol=1e-10)
    t = np.arange(1, 201)
    np.testing.assert_allclose(track[3, 1101:], 5 + 10 * np.sin(2 * np.pi * t / 100), atol=1e-10)


def test_a_track_obeys_the_constant_velocity_model_with_its_accelerations_as_input():
    acceleration, start = np.random.default_rng(4).normal(size=(2, 30)), (1.0, -2.0, 3.0, 4.0)
    track = target.track_of(acceleration, start)
    np.testing.assert_array_equal(track[:, 0], start)
    np.testing.assert_allclose(track[:, 1:], c.F @ track[:, :-1] + c.GAMMA @ acceleration, atol=1e-11)


def test_the_sinusoids_position_is_the_integral_of_its_speed():
    track = target.truth()
    fine = np.linspace(0, 200, 200_001)
    speed = 5 + 10 * np.sin(2 * np.pi * fine / 100)
    way = np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(fine))])
    np.testing.assert_allclose(track[2, 1100:] - track[2, 1100], way[::1000], atol=1e-5)


def test_the_frozen_path_is_one_of_the_process_it_claims_to_be():
    paths = np.array([target.correlated(path) for path in range(400)])
    assert np.array_equal(target.correlated(3), target.correlated(3)) and not np.array_equal(paths[0], paths[1])
    assert abs(paths.var() - 1) < 0.1
    assert abs(np.mean(paths[:, 20:] * paths[:, :-20]) - np.exp(-1)) < 0.1


def test_starts_and_measurements_have_the_moments_that_the_filters_are_told():
    rngs = [np.random.default_rng(child) for child in np.random.SeedSequence(0).spawn(400)]
    track = target.truth()[:, :101]
    x0, z = target.simulate(rngs, track)
    np.testing.assert_allclose(np.cov(x0), target.P0, atol=0.7)
    errors = (z - track[[0, 2], 1:, None]).reshape(2, -1)
    np.testing.assert_allclose(np.cov(errors), target.R, atol=0.15)


def test_several_tracks_are_measured_with_the_noise_of_each_alone():
    tracks = np.stack([target.truth(a)[:, :41] for a in (0.5, 5.0)] + [target.truth()[:, 200:241]], axis=-1)

    def rngs():
        return [np.random.default_rng(child) for child in np.random.SeedSequence(3).spawn(4)]

    starts, z = target.simulate(rngs(), tracks)
    assert starts.shape == (4, 3, 4) and z.shape == (2, 40, 3, 4)
    for k in range(3):
        one_start, one_z = target.simulate(rngs(), tracks[..., k])
        np.testing.assert_array_equal(starts[:, k], one_start)
        np.testing.assert_array_equal(z[:, :, k], one_z)


@pytest.mark.parametrize("index", [1e-3, 0.0577, 1.0, 5.0])
def test_the_closed_form_of_the_lag_is_the_recursions(index):
    linear = c.Linear("CV", c.F, c.H, index**2 * 3.0 * c.GAMMA @ c.GAMMA.T, np.eye(4), np.eye(4))
    t = np.arange(3001.0)
    track = np.stack([t**2 * 0.35, 0.7 * t, 0 * t, 0 * t])
    bias, _, _ = c.exact_errors(linear, track)
    np.testing.assert_allclose(bias[:2, -1], exact.steady_lag(index, a=0.7), rtol=1e-5)
    K, _ = c.gains(linear, 3000)
    np.testing.assert_allclose(K[:2, 0, -1], exact.alpha_beta(index), rtol=1e-6)


@pytest.fixture(scope="module")
def scores():
    return runs.score([c.plain(), c.augmented("0.01 ΓΓᵀ"), c.strong_tracking()], runs=120, seed=1)


@pytest.mark.parametrize("make", [c.plain, lambda: c.augmented("0.01 ΓΓᵀ")])
def test_runs_agree_with_the_recursion(scores, make):
    score = scores[make().name]
    bias, covariance, _ = c.exact_errors(make(), target.truth())
    deviation = np.sqrt(np.einsum("iik->ik", covariance) / score.runs)
    distance = np.abs(score.mean - bias) / deviation
    assert distance.max() < 5.5 and 0.5 < np.mean(distance < 1) < 0.85
    square = np.einsum("iik->ik", covariance) + bias**2
    np.testing.assert_allclose(score.square.mean(axis=1), square.mean(axis=1), rtol=0.02)


def test_bias_is_what_is_left_of_the_mean_when_its_own_scatter_is_taken_off(scores):
    calm, busy = target.SEGMENTS[0].settled, target.SEGMENTS[1].settled
    assert np.all(scores["SKF"].bias(calm) < 0.1)
    np.testing.assert_allclose(scores["SKF"].bias(busy)[[0, 1]], np.abs(exact.steady_lag(np.sqrt(0.01 / 3), 2.0)), rtol=0.01)
    assert np.all(scores["SKF"].rmse(busy) >= scores["SKF"].bias(busy))


def test_by_run_and_the_sums_are_the_same_errors(scores):
    for score in scores.values():
        for i, segment in enumerate(target.SEGMENTS):
            for part in runs.PARTS:
                np.testing.assert_allclose(score.part(i, part).mean(axis=1), score.square[:, getattr(segment, part)].mean(axis=1))


def test_nees_is_given_only_where_the_covariance_means_something(scores):
    assert np.isnan(scores["STKF β=4, one"].nees).all() and np.isfinite(scores["SKF"].nees[1:]).all()
    assert scores["SKF"].nees[380] > 1000  # and says so where it does not


def test_a_comparison_with_oneself_is_one(scores):
    assert runs.compared(scores["SKF"], scores["SKF"], 0, ["x", "y"]) == (1.0, 1.0, 1.0)
    ratio, low, high = runs.compared(scores["ABMA 0.01 ΓΓᵀ"], scores["SKF"], 0, ["x", "y"])
    assert 1.3 < low < ratio < high < 1.6


def test_names_must_differ():
    with pytest.raises(ValueError, match="contenders"):
        runs.score([c.plain(), c.plain()], runs=2)


def test_settling_is_counted_from_the_change_to_the_last_sample_outside():
    bias = np.array([9, 9, 5, 0.1, 3, 0.1, 0.1, 0.0])
    assert runs.settling_time(bias, 1.0, 2, 7) == 3
    assert runs.settling_time(bias, 10.0, 2, 7) == 0
    assert runs.settling_time(bias, 1.0, 2, 4) == 3


def test_scores_without_consistency_have_the_same_errors_and_no_nees():
    cast = [c.augmented(), c.strong_tracking(), c.interacting()]
    whole, quick = (runs.score(cast, 20, 3, consistency=consistency) for consistency in (True, False))
    for name, each in quick.items():
        np.testing.assert_allclose(each.by_run, whole[name].by_run, rtol=1e-12)
        assert np.isnan(each.nees).all() and np.isnan(each.nis).all()


def test_what_is_scored_up_to_a_sample_is_the_same_as_without_an_end():
    pair = [c.plain(), c.strong_tracking(4.0)]
    whole, short = runs.score(pair, 8, 3), runs.score(pair, 8, 3, last=target.SEGMENTS[4].last)
    for name in whole:
        for ours, theirs in zip(whole[name][:2], short[name][:2], strict=True):
            np.testing.assert_allclose(theirs[:, :901], ours[:, :901], rtol=1e-12, atol=1e-9)
            assert np.isnan(theirs[:, 901:]).all()
        np.testing.assert_allclose(short[name].by_run[:5], whole[name].by_run[:5], rtol=1e-9)
        np.testing.assert_allclose(short[name].nis[:901], whole[name].nis[:901], rtol=1e-9)

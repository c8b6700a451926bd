"""Paper 3's filter in other clothes: constant acceleration, two stages, gains without a bias; and the correlation of innovations."""

import numpy as np
import pytest

from trackhelpers.filters import AugmentedBiasKF
from trackhelpers.scenarios.augmented_bias import analysis, contenders, target
from trackhelpers.scenarios.augmented_bias.contenders import GAMMA, F, H, Q, exact_errors, gains
from trackhelpers.scenarios.augmented_bias.target import P0, R

TRACK = target.truth()[:, :301]


@pytest.fixture(scope="module")
def data():
    x0, z = target.simulate([np.random.default_rng(11)], TRACK)
    return x0[:, 0], z[..., 0]


def random_bias_step(rng):
    root = rng.normal(size=(2, 2, 2))
    Q_bias = np.zeros((4, 4))
    for axis, one in enumerate(root):
        Q_bias[2 * axis : 2 * axis + 2, 2 * axis : 2 * axis + 2] = 0.05 * (one @ one.T)
    return Q_bias


@pytest.mark.parametrize("seed", range(4))
def test_positions_of_the_augmented_filter_are_a_constant_acceleration_filters(data, seed):
    x0, z = data
    Q_bias = random_bias_step(np.random.default_rng(seed))
    disguise = analysis.constant_acceleration(Q_bias)
    one = analysis.estimates(contenders.augmented_kf(x0, Q_bias), z)
    other = analysis.estimates(disguise.single(x0), z, of=disguise.to_estimate)
    np.testing.assert_allclose(one[[0, 2]], other[[0, 2]], rtol=1e-10)
    assert np.max(np.abs(one[[1, 3]] - other[[1, 3]])) > 1e-3  # the velocity has a share of Λ_p


@pytest.mark.parametrize("direction", [(0.5, 1.0), (0.0, 1.0), (-0.3, 2.0)])
def test_a_step_of_rank_one_leaves_no_difference_at_all(data, direction):
    x0, z = data
    Q_bias = np.kron(np.eye(2), 0.02 * np.outer(direction, direction))
    disguise = analysis.constant_acceleration(Q_bias)
    one = analysis.estimates(contenders.augmented_kf(x0, Q_bias), z)
    np.testing.assert_allclose(one, analysis.estimates(disguise.single(x0), z, of=disguise.to_estimate), rtol=1e-9)


def test_gamma_gives_the_usual_constant_acceleration_filter():
    disguise, usual = analysis.constant_acceleration(0.01 * GAMMA @ GAMMA.T), contenders.accelerating()
    np.testing.assert_array_equal(disguise.to_estimate, usual.to_estimate)
    np.testing.assert_allclose(disguise.F, usual.F)
    increment = usual.Q  # of CA alone; the disguise has Q_cv on top
    Q_cv = usual.from_start @ Q @ usual.from_start.T
    np.testing.assert_allclose(disguise.Q, increment + Q_cv, atol=1e-15)


def test_axes_that_are_coupled_and_a_velocity_without_a_step_are_refused():
    coupled = 0.01 * np.eye(4)
    coupled[0, 2] = coupled[2, 0] = 0.001
    for wrong in (coupled, analysis.bias_step((0.01, 0.0))):
        with pytest.raises(ValueError, match="Q_bias: expected axes that are not coupled"):
            analysis.constant_acceleration(wrong)


@pytest.mark.parametrize("prior", [np.diag([1.0, 0.5, 1.0, 0.5]), np.diag([0.0, 0.3, 2.0, 0.0]), np.eye(4) + 0.5])
def test_friedlands_two_stages_are_the_constant_bias_of_r3(data, prior):
    x0, z = data
    whole = AugmentedBiasKF(F, H, Q, R, np.zeros((4, 4)), x0, P0, "R3", prior)
    two = analysis.TwoStageKF(F, H, Q, R, x0, P0, prior)
    one = analysis.estimates(whole, z)
    np.testing.assert_allclose(one, analysis.estimates(two, z), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(whole.bias, two.bias, atol=1e-9)
    np.testing.assert_allclose(whole.P[4:, 4:], two.bias_P, atol=1e-9)


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        (-np.eye(4), "P_bias0: expected a positive semidefinite matrix"),
        (np.triu(np.ones((4, 4))), "P_bias0: expected a symmetric matrix"),
        (np.diag([1.0, np.nan, 1.0, 1.0]), "P_bias0: expected finite numbers"),
        (np.eye(3), "P_bias0: expected shape"),
    ],
)
def test_a_prior_of_the_bias_that_is_no_covariance_is_refused(data, prior, message):
    with pytest.raises(ValueError, match=message):
        analysis.TwoStageKF(F, H, Q, R, data[0], P0, prior)


def test_two_stages_without_a_measurement_predict_both_as_r3_does(data):
    x0, z = data
    prior = np.diag([1.0, 0.5, 1.0, 0.5])
    whole = AugmentedBiasKF(F, H, Q, R, np.zeros((4, 4)), x0, P0, "R3", prior)
    two = analysis.TwoStageKF(F, H, Q, R, x0, P0, prior)
    for k, column in enumerate(z.T[:60]):
        for kf in (whole, two):
            kf.predict()
            kf.update(None if k % 3 == 1 else column)
        np.testing.assert_allclose(two.estimate, whole.estimate, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(two.bias_P, whole.P[4:, 4:], atol=1e-9)
    before = two.bias, two.bias_P, two.V
    with pytest.raises(ValueError, match="z: expected"):
        two.update([np.nan, 0.0])
    assert all(now is then for now, then in zip((two.bias, two.bias_P, two.V), before, strict=True))


def test_r1_is_r3_that_starts_with_one_step_of_bias(data):
    x0, z = data
    Q_bias = analysis.bias_step((0.03, 0.01), 0.005)
    one = analysis.estimates(contenders.augmented_kf(x0, Q_bias), z)
    other = AugmentedBiasKF(F, H, Q, R, Q_bias, x0, P0, "R3", Q_bias)
    np.testing.assert_allclose(one, analysis.estimates(other, z), rtol=1e-10)


def test_offset_of_the_velocity_and_growth_of_the_belief():
    for covariance in (-0.005, 0.0, 0.004):
        lin = contenders.augmented(analysis.bias_step((0.02, 0.01), covariance))
        kappa = covariance / 0.01
        assert exact_errors(lin, TRACK)[0][1, 300] == pytest.approx(2 * (0.5 - kappa), abs=1e-6)
        P = gains(lin, 600)[1][4, 4]
        assert (P[-1] - P[-101]) / 100 == pytest.approx(0.02 - covariance**2 / 0.01, abs=1e-9)


def test_mean_error_with_the_plain_gains_is_the_plain_bias():
    K, _ = gains(contenders.plain(), 300)
    np.testing.assert_allclose(analysis.mean_error(K, contenders.plain(), TRACK), exact_errors(contenders.plain(), TRACK)[0], atol=1e-9)


def test_gains_from_the_predicted_covariances_are_the_filters():
    K, P = gains(contenders.plain(), 50)
    predicted = [F @ P[..., k] @ F.T + Q for k in range(50)]
    np.testing.assert_allclose(analysis.gains_from(predicted), K, atol=1e-14)


@pytest.mark.parametrize("name", contenders.BIAS_NOISE)
def test_fading_of_the_estimate_gives_its_predicted_covariance_and_its_gain(name):
    lin = contenders.augmented(name)
    K, P = gains(lin, 60)
    L = lin.to_estimate
    predicted = []
    for k in range(60):
        factor = analysis.fading_of_estimate(P[..., k], lin, F, Q)
        predicted.append(factor @ F @ L @ P[..., k] @ L.T @ F.T + Q)
        np.testing.assert_allclose(predicted[-1], L @ (lin.F @ P[..., k] @ lin.F.T + lin.Q) @ L.T, atol=1e-9)
    np.testing.assert_allclose(analysis.gains_from(predicted), np.einsum("ij,jmk->imk", L, K), atol=1e-9)


@pytest.mark.parametrize("contender", [contenders.augmented(), contenders.strong_tracking(4.0)], ids=["linear", "adaptive"])
def test_innovations_are_the_single_filters(contender):
    x0, z = target.simulate([np.random.default_rng(s) for s in (1, 2)], TRACK)
    found = analysis.innovations(contender, x0, z)
    for run in (0, 1):
        kf = contender.single(x0[:, run])
        for k in range(40):
            kf.predict()
            kf.update(z[:, k, run])
            np.testing.assert_allclose(found[:, k, run], kf.y, atol=1e-7)


def test_correlation_of_what_leans_one_way_of_what_alternates_and_of_noise():
    ones = np.ones((20, 5))
    assert analysis.correlation(ones).value == pytest.approx(1)
    assert analysis.correlation(ones * (-1.0) ** np.arange(20)[:, None]).value == pytest.approx(-1)
    noise = analysis.correlation(np.random.default_rng(0).standard_normal((200, 400)), lag=3)
    assert noise.interval[0] < 0 < noise.interval[1]
    assert noise.interval[1] - noise.interval[0] == pytest.approx(2 * 1.96 / np.sqrt(197 * 400), rel=0.15)


def test_influence_is_the_derivative_by_a_runs_weight():
    y = np.random.default_rng(1).standard_normal((30, 50)).cumsum(axis=0)
    whole = analysis.correlation(y)
    assert np.mean(whole.influence) == pytest.approx(0, abs=1e-12)
    for run in (0, 7):
        heavier = np.concatenate([np.repeat(y, 1000, axis=1), y[:, [run]]], axis=1)  # 50 000 runs and one more
        slope = (analysis.correlation(heavier).value - whole.value) * (50_000 + 1)
        assert slope == pytest.approx(whole.influence[run], rel=1e-2, abs=1e-4)


def test_a_filter_is_as_far_from_white_as_itself_and_the_sign_does_not_count():
    y = np.random.default_rng(2).standard_normal((40, 60)).cumsum(axis=0)
    one = analysis.correlation(y)
    assert analysis.farther_from_white(one, one) == (0.0, 0.0, 0.0)
    mirrored = analysis.correlation(y * (-1.0) ** np.arange(40)[:, None])
    assert analysis.farther_from_white(one, mirrored) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    white = analysis.correlation(np.random.default_rng(3).standard_normal((40, 60)))
    difference, low, high = analysis.farther_from_white(one, white)
    assert low < difference < high and low > 0

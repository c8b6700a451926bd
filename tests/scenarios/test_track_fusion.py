import numpy as np
import pytest

from trackhelpers.arrays import congruence
from trackhelpers.consistency import chi2_band, nees
from trackhelpers.ensemble import exact_error
from trackhelpers.filters import MotionKF
from trackhelpers.fusion import bar_shalom_campo, convex_combination, covariance_intersection
from trackhelpers.motion import CV
from trackhelpers.scenarios import track_fusion as tf

STARTS = ("two points", "prior")


def generators(runs, seed=7):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]


@pytest.mark.parametrize("name", tf.TRACKS)
def test_every_track_obeys_the_laws_of_motion_with_its_acceleration(name):
    truth = tf.TRACKS[name]()
    F, G = tf.MODEL.F(np.zeros(4), tf.T), tf.MODEL.G(np.zeros(4), tf.T)
    acceleration = np.diff(truth[1::2], axis=1) / tf.T
    np.testing.assert_allclose(truth[:, 1:], F @ truth[:, :-1] + G @ acceleration, rtol=1e-12)
    assert tuple(truth[::2, 0]) == tf.START


def test_the_tracks_are_those_of_the_source():
    straight, turn, accelerated = (track() for track in tf.TRACKS.values())
    assert [track.shape[1] for track in (straight, turn, accelerated)] == [201, 401, 201]
    np.testing.assert_allclose(straight[:, -1], [1000 + 15 * 400, 15, 12000 - 5 * 400, -5])
    np.testing.assert_array_equal(turn[1::2, :202], np.repeat([[1.0], [-15.0]], 202, axis=1))  # 402 s is sample 201
    assert turn[1, 202] > 1
    np.testing.assert_allclose(turn[1::2, 301:], np.repeat([[16.0], [0.0]], 100, axis=1), atol=1e-12)  # 602 s is sample 301
    np.testing.assert_allclose(accelerated[:, -1], [1000 + 6000 + 8000, 55, 12000 - 2000 - 4000, -25])


def test_a_parabola_is_no_circle():
    """Constant acceleration: the second difference is constant, the speed is not."""
    turn = tf.turn()[:, 201:302]
    second = np.diff(turn[::2], 2, axis=1)
    np.testing.assert_allclose(second, 0.075 * tf.T**2, rtol=1e-9)
    speed = np.hypot(*turn[1::2])
    assert speed.min() < 0.8 * speed[0]


def test_a_run_s_noise_does_not_depend_on_the_others_nor_on_the_sensors():
    truth = tf.straight(5)
    _, all_z = tf.simulate(generators(4), truth, tf.PAIRS["A"])
    _, one_z = tf.simulate(generators(4)[2:3], truth, tf.PAIRS["A"])
    np.testing.assert_array_equal(all_z[..., 2:3], one_z)
    _, wide = tf.simulate(generators(4), truth, tf.position_pair(200.0, 300.0))
    seen = np.stack([truth[::2]] * 2)[..., None]
    np.testing.assert_allclose(wide - seen, 2 * (all_z - seen), atol=1e-9)


def test_measurement_noise_has_the_covariance_of_the_sensor_and_sensors_are_independent():
    truth, z = tf.simulate(generators(4000), tf.straight(2), tf.CROSSED)
    noise = (z - truth[::2])[:, :, 1].reshape(4, -1)
    R = np.block([[tf.CROSSED[0].R, np.zeros((2, 2))], [np.zeros((2, 2)), tf.CROSSED[1].R]])
    scale = np.sqrt(np.outer(np.diag(R), np.diag(R)))
    assert np.abs((noise @ noise.T / 4000 - R) / scale).max() < 0.1


def test_random_acceleration_gives_the_model_s_process_noise():
    truth, _ = tf.simulate(generators(4000), tf.straight(3), tf.PAIRS["A"], sigma_a=0.5)
    step = truth[:, 2] - tf.MODEL.F(np.zeros(4), tf.T) @ truth[:, 1]
    Q = CV(0.5).Q(np.zeros(4), tf.T)
    np.testing.assert_allclose(step @ step.T / 4000, Q, atol=0.1 * Q.max())


@pytest.mark.parametrize("sigma_a", [0.0, 0.2])
def test_two_point_start_has_its_covariance_and_only_the_process_noise_in_common(sigma_a):
    plan = tf.design(tf.CROSSED, 2)
    _, covariance = tf.exact_errors(plan, tf.straight(2), sigma_a)
    process = np.diag([0, 1.0, 0, 1]) * sigma_a**2 * tf.T**2 / 4
    for i in range(2):
        mine = slice(4 * i, 4 * i + 4)
        R = tf.CROSSED[i].R
        written = np.kron(R, [[1, 1 / tf.T], [1 / tf.T, 2 / tf.T**2]]) + process
        np.testing.assert_allclose(covariance[mine, mine, 1], written, rtol=1e-12)
    np.testing.assert_allclose(covariance[:4, 4:8, 1], process, atol=1e-9)
    believed = np.diag([0, 1.0, 0, 1]) * tf.SIGMA_A**2 * tf.T**2 / 4
    np.testing.assert_allclose(plan.P12[..., 1], believed, atol=1e-15)


@pytest.mark.parametrize("start", STARTS)
def test_matched_model_makes_every_belief_true_except_that_of_convex_and_intersection(start):
    plan = tf.design(tf.CROSSED, 40, start)
    bias, covariance = tf.exact_errors(plan, tf.straight(40), tf.SIGMA_A)
    np.testing.assert_allclose(bias[:, plan.first :], 0, atol=1e-9)
    np.testing.assert_allclose(covariance[:4, 4:8, plan.first :], plan.P12[..., plan.first :], atol=1e-7)
    assert np.abs(plan.P12 - plan.P12.swapaxes(0, 1))[..., 3:].max() > 1e-3 * np.abs(plan.P12[..., 3:]).max()
    average = {}
    for name, rule in tf.fuse(plan).items():
        average[name] = tf.expected_nees(*rule.error(bias, covariance), rule.P)[-1]
    for name in ("sensor 1", "sensor 2", "BSC", "centralised"):
        assert average[name] == pytest.approx(4, abs=1e-8)
    assert average["CI"] < 4 < 5.5 < average["convex"]


def test_matched_model_orders_centralised_fused_and_single_filters():
    plan = tf.design(tf.CROSSED, 60)
    rules = tf.fuse(plan)
    for better, worse in (("centralised", "BSC"), ("BSC", "sensor 1"), ("BSC", "sensor 2")):
        difference = rules[worse].P[..., 2:] - rules[better].P[..., 2:]
        assert np.linalg.eigvalsh(np.moveaxis(difference, -1, 0)).min() > -1e-7


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("name, sigma_a", [("turn", 0.0), ("accelerated", 0.0), ("straight", 0.2)])
def test_sampling_agrees_with_the_recursion_in_every_rule(name, sigma_a, start):
    """3000 runs at the last step and in the turn; a standard deviation of 3000 values is known to 1.3 %."""
    truth, pair = tf.TRACKS[name](), tf.CROSSED
    truth = truth[:, 190:330] if name == "turn" else truth[:, :60]
    plan = tf.design(pair, truth.shape[1], start)
    bias, covariance = tf.exact_errors(plan, truth, sigma_a)
    x_true, z = tf.simulate(generators(3000), truth, pair, sigma_a)
    x, _ = tf.run(z, plan, truth[:, 0] if start == "prior" else None)
    for rule in tf.fuse(plan).values():
        error = rule.estimate(x) - x_true
        mean, spread = rule.error(bias, covariance)
        for k in (plan.first + 3, 50, truth.shape[1] - 1):
            sigma = np.sqrt(np.diag(spread[..., k]))
            assert np.all(np.abs(error[:, k].mean(axis=1) - mean[:, k]) < 4.5 * sigma / np.sqrt(3000))
            sample = np.cov(error[:, k])
            assert np.abs((sample - spread[..., k]) / np.outer(sigma, sigma)).max() < 4.5 * np.sqrt(2 / 3000)


def test_sampled_nees_is_the_expected_one():
    truth = tf.turn()[:, 190:260]
    plan = tf.design(tf.PAIRS["A"], 70)
    x_true, z = tf.simulate(generators(2000), truth, plan.pair)
    x, _ = tf.run(z, plan)
    rule = tf.fuse(plan)["convex"]
    sampled = nees(x_true[:, -1], rule.estimate(x)[:, -1], rule.P[..., -1])
    expected = tf.expected_nees(*rule.error(*tf.exact_errors(plan, truth)), rule.P)[-1]
    assert abs(sampled.mean() - expected) < 4.5 * sampled.std() / np.sqrt(2000)
    assert expected > 5


def test_nis_of_matched_filters_keeps_to_its_band():
    plan = tf.design(tf.PAIRS["C"], 30)
    _, z = tf.simulate(generators(2000), tf.straight(30), plan.pair, tf.SIGMA_A)
    _, nis = tf.run(z, plan)
    low, high = chi2_band(2, 2000, level=0.9999)
    average = nis[:, 2:].mean(axis=-1)
    assert np.all((low < average) & (average < high))
    assert np.all(np.isnan(nis[:, :2]))


def test_local_filters_are_filterpy_s_and_the_recursion_is_that_of_one_filter():
    truth, plan = tf.accelerated(20), tf.design(tf.PAIRS["A"], 20, "prior", P0=np.eye(4))
    _, z = tf.simulate(generators(1), truth, plan.pair)
    x, _ = tf.run(z, plan, truth[:, 0])
    kf = MotionKF(tf.MODEL, truth[:, 0], np.eye(4))
    for k in range(1, 20):
        kf.predict(tf.T)
        kf.update(z[1, :, k, 0], plan.pair[1])
    np.testing.assert_allclose(x[1, :, -1, 0], kf.x, rtol=1e-9)
    np.testing.assert_allclose(plan.P[1, ..., -1], kf.P, rtol=1e-9)
    bias, covariance = tf.exact_errors(plan, truth)
    alone = exact_error(tf.MODEL, plan.pair[1], truth, tf.T, truth[:, 0], np.eye(4))
    np.testing.assert_allclose(bias[4:8], alone[0], atol=1e-8)
    np.testing.assert_allclose(covariance[4:8, 4:8], alone[1], atol=1e-8)


def test_weights_are_unbiased_and_give_what_the_fusion_rules_give():
    plan = tf.design(tf.CROSSED, 15)
    _, z = tf.simulate(generators(3), tf.straight(15), plan.pair)
    x, _ = tf.run(z, plan)
    k, rules = 9, tf.fuse(plan)
    (x1, x2, _), (P1, P2, _) = x[:, :, k], plan.P[..., k]
    wanted = {
        "convex": convex_combination([x1, x2], [P1, P2]),
        "BSC": bar_shalom_campo(x1, P1, x2, P2, plan.P12[..., k]),
        "CI": covariance_intersection(x1, P1, x2, P2),
    }
    for name, (estimate, P) in wanted.items():
        np.testing.assert_allclose(rules[name].estimate(x)[:, k], estimate, rtol=1e-9)
        np.testing.assert_allclose(rules[name].P[..., k], P, rtol=1e-9)
    for rule in rules.values():
        np.testing.assert_allclose(rule.W[..., k] @ np.tile(np.eye(4), (3, 1)), np.eye(4), atol=1e-9)


def test_a_prior_known_for_certain_leaves_the_covariance_singular_for_two_steps():
    plan = tf.design(tf.PAIRS["A"], 6, "prior")
    assert [np.linalg.matrix_rank(plan.P[0, ..., k], tol=1e-9) for k in range(3)] == [0, 2, 4]
    convex = tf.fuse(plan)["convex"]
    assert np.all(np.isnan(convex.P[..., :2])) and np.all(np.isfinite(convex.P[..., 2:]))


def test_without_process_noise_and_from_two_points_all_fusion_is_the_centralised_filter():
    plan = tf.design(tf.CROSSED, 30, model=CV(0.0))
    rules = tf.fuse(plan)
    np.testing.assert_allclose(plan.P12[..., 1:], 0, atol=1e-12)
    for name in ("convex", "BSC"):
        np.testing.assert_allclose(rules[name].P[..., 1:], rules["centralised"].P[..., 1:], rtol=1e-6, atol=1e-6)


def test_exact_rms_is_bias_and_spread_together():
    bias, covariance = np.array([[3.0]]), np.array([[[16.0]]])
    np.testing.assert_allclose(tf.rms(bias, covariance), 5)
    np.testing.assert_allclose(tf.expected_nees(bias, covariance, np.array([[[5.0]]])), 5)


def test_constant_acceleration_leaves_the_start_half_a_step_behind():
    plan, truth = tf.design(tf.PAIRS["A"], 3), tf.accelerated(3)
    bias, _ = tf.exact_errors(plan, truth)
    np.testing.assert_allclose(bias[:4, 1], [0, -0.1 * tf.T / 2, 0, 0.05 * tf.T / 2], atol=1e-9)


def test_two_points_covariance_is_a_congruence_of_what_was_measured():
    P, common = tf.two_points(tf.CROSSED[1].R, tf.MODEL.Q(np.zeros(4), tf.T))
    now, before = np.kron(np.eye(2), [[1], [1 / tf.T]]), np.kron(np.eye(2), [[0], [-1 / tf.T]])
    R = tf.CROSSED[1].R
    np.testing.assert_allclose(P, congruence(now, R) + congruence(before, R) + common, rtol=1e-12)


@pytest.mark.parametrize(
    "call, name",
    [
        (lambda: tf.design(tf.PAIRS["A"], 1), "steps"),
        (lambda: tf.design(tf.PAIRS["A"], 9, "one point"), "start"),
        (lambda: tf.design(tf.PAIRS["A"], 9, P0=np.eye(4)), "P0"),
        (lambda: tf.design(tf.PAIRS["A"], 9, "prior", P0=-np.eye(4)), "P0"),
        (lambda: tf.design(tf.PAIRS["A"][:1], 9), "pair"),
        (lambda: tf.design(tf.PAIRS["A"], 9, model=CV(0.1, axes=1)), "model"),
        (lambda: tf.exact_errors(tf.design(tf.PAIRS["A"], 9), tf.straight(8)), "truth"),
        (lambda: tf.exact_errors(tf.design(tf.PAIRS["A"], 9), tf.straight(9), -1.0), "sigma_a"),
        (lambda: tf.simulate(generators(1), np.zeros(4), tf.PAIRS["A"]), "truth"),
        (lambda: tf.run(np.zeros((2, 2, 8, 1)), tf.design(tf.PAIRS["A"], 9)), "z"),
        (lambda: tf.run(np.zeros((2, 2, 9, 1)), tf.design(tf.PAIRS["A"], 9), np.zeros(4)), "x0"),
        (lambda: tf.run(np.zeros((2, 2, 9, 1)), tf.design(tf.PAIRS["A"], 9, "prior")), "x0"),
        (lambda: tf.straight(0), "steps"),
        (lambda: tf.times(2.5), "steps"),
        (lambda: tf.FullPosition([[1.0, 2.0], [2.0, 1.0]]), "R"),
        (lambda: tf.two_points(np.eye(3), np.eye(4)), "R"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=f"^{name}"):
        call()

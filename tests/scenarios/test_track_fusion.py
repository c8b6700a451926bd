import numpy as np
import pytest

from trackhelpers.motion import CV
from trackhelpers.scenarios import track_fusion as tf


def generators(runs, seed=7):
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(runs)]


@pytest.mark.parametrize("name", tf.TRACKS)
def test_every_track_obeys_the_laws_of_motion_with_its_acceleration(name):
    truth, G = tf.TRACKS[name](), tf.MODEL.G(np.zeros(4), tf.T)
    acceleration = np.diff(truth[1::2], axis=1) / tf.T
    np.testing.assert_allclose(truth[:, 1:], tf.F @ truth[:, :-1] + G @ acceleration, rtol=1e-12)
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


def test_the_crossed_sensors_do_not_commute():
    R1, R2 = (sensor.R for sensor in tf.CROSSED)
    assert np.abs(R1 @ R2 - R2 @ R1).max() > 1e-3 * np.abs(R1 @ R2).max()


def test_random_acceleration_gives_the_model_s_process_noise():
    truth, _ = tf.simulate(generators(4000), tf.straight(3), tf.PAIRS["A"], sigma_a=0.5)
    step = truth[:, 2] - tf.F @ truth[:, 1]
    Q = CV(0.5).Q(np.zeros(4), tf.T)
    np.testing.assert_allclose(step @ step.T / 4000, Q, atol=0.1 * Q.max())


@pytest.mark.parametrize("sigma_a", [0.0, 0.2, 3.0])
def test_two_point_start_has_its_covariance_and_only_the_process_noise_in_common(sigma_a):
    R, Q = tf.CROSSED[1].R, CV(sigma_a).Q(np.zeros(4), tf.T)
    P, common = tf.two_points(R, Q)
    process = np.diag([0, 1.0, 0, 1]) * sigma_a**2 * tf.T**2 / 4
    np.testing.assert_allclose(common, process, atol=1e-15)
    np.testing.assert_allclose(P, np.kron(R, [[1, 1 / tf.T], [1 / tf.T, 2 / tf.T**2]]) + process, rtol=1e-12)


def test_two_points_are_the_estimate_that_has_this_covariance():
    truth, z = tf.simulate(generators(20000), tf.straight(2), tf.position_pair(0.1, 0.2), tf.SIGMA_A)
    errors = [tf.LAST @ seen[:, 1] + tf.FIRST @ seen[:, 0] - truth[:, 1] for seen in z]
    (P1, common), (P2, _) = (tf.two_points(sensor.R) for sensor in tf.position_pair(0.1, 0.2))
    for one, other, wanted in ((0, 0, P1), (1, 1, P2), (0, 1, common)):
        np.testing.assert_allclose(errors[one] @ errors[other].T / 20000, wanted, atol=0.04 * np.abs(P2).max())


def test_constant_acceleration_leaves_the_start_half_a_step_behind():
    truth = tf.accelerated(2)
    error = tf.LAST @ truth[::2, 1] + tf.FIRST @ truth[::2, 0] - truth[:, 1]
    np.testing.assert_allclose(error, [0, -0.1 * tf.T / 2, 0, 0.05 * tf.T / 2], atol=1e-9)
    np.testing.assert_allclose(error, tf.UNFORESEEN @ (truth[:, 1] - tf.F @ truth[:, 0]), atol=1e-9)


def test_no_two_methods_look_alike():
    looks = tf.LOOK.values()
    assert len({look["color"] for look in looks}) == len({look["linestyle"] for look in looks}) == len(tf.LOOK)


@pytest.mark.parametrize(
    "call, name",
    [
        (lambda: tf.simulate(generators(1), np.zeros(4), tf.PAIRS["A"]), "truth"),
        (lambda: tf.simulate(generators(1), tf.straight(4), tf.PAIRS["A"], -1.0), "sigma_a"),
        (lambda: tf.straight(0), "steps"),
        (lambda: tf.times(2.5), "steps"),
        (lambda: tf.two_points(np.eye(3)), "R"),
        (lambda: tf.two_points(np.eye(2), np.eye(3)), "Q"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=f"^{name}"):
        call()

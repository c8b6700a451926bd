"""The augmented bias model's exact properties, E1 to E5 of the reconstruction."""

import numpy as np
import pytest
from filterpy.common import Q_discrete_white_noise

from trackhelpers.filters import READINGS, AugmentedBiasKF, MatrixKF, augmented_matrices
from trackhelpers.motion import CA, CV

T = 1.0
MODEL = CV(0.1)
F, Q, GAMMA = (getattr(MODEL, name)(np.zeros(4), T) for name in ("F", "Q", "G"))
H, R, X0, P0 = np.eye(4)[[0, 2]], 3.0 * np.eye(2), np.array([10.0, 5.0, 20.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0])
Q_BIAS = 0.01 * np.eye(4)


def data(steps=200, seed=0):
    return np.random.default_rng(seed).normal(size=(steps, 2)).cumsum(axis=0)


def estimates(kf, zs, L=None):
    found = []
    for z in zs:
        kf.predict()
        kf.update(z)
        found.append(kf.estimate if L is None else L @ kf.x)
    return np.array(found)


def abma(Q_bias=Q_BIAS, reading="R1", **more):
    return AugmentedBiasKF(F, H, Q, R, Q_bias, X0, P0, reading, **more)


def accelerating(Q6):
    """CA with the start of X0, acceleration 0 ± 0."""
    put = np.kron(np.eye(2), [[1.0, 0], [0, 1], [0, 0]])
    return MatrixKF(CA().F(np.zeros(6), T), np.eye(6)[[0, 3]], Q6, R, put @ X0, put @ P0 @ put.T), put.T


@pytest.mark.parametrize("reading", READINGS)
def test_without_a_bias_to_begin_with_and_without_its_noise_every_reading_is_the_plain_filter(reading):
    """E1"""
    plain = estimates(MatrixKF(F, H, Q, R, X0, P0), data(), np.eye(4))
    np.testing.assert_allclose(estimates(abma(np.zeros((4, 4)), reading), data()), plain, atol=1e-10)


def test_reading_4_is_the_plain_filter_with_more_noise():
    """E3"""
    plain = estimates(MatrixKF(F, H, Q + Q_BIAS, R, X0, P0), data(), np.eye(4))
    np.testing.assert_allclose(estimates(abma(reading="R4"), data()), plain, atol=1e-10)


@pytest.mark.parametrize("Q_bias", [Q_BIAS, np.kron(np.eye(2), [[0.03, 0.005], [0.005, 0.01]])])
def test_reading_1_is_friedlands_bias_that_starts_with_the_uncertainty_of_a_step(Q_bias):
    zs = data()
    np.testing.assert_allclose(estimates(abma(Q_bias), zs), estimates(abma(Q_bias, "R3", P_bias0=Q_bias), zs), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(("reading", "rank"), [("R1", 6), ("R2", 6), ("R2 uncorrected", 6), ("R3", 6), ("R4", 4)])
def test_what_a_reading_can_observe(reading, rank):
    A = augmented_matrices(F, H, Q, Q_BIAS, reading)
    assert np.linalg.matrix_rank(np.vstack([A.H @ np.linalg.matrix_power(A.F, k) for k in range(8)])) == rank


def test_a_bias_of_velocity_alone_makes_readings_1_and_2_one_and_a_constant_acceleration_filter():
    """E4"""
    q = 0.02
    Q_bias = np.diag([0, q, 0, q])
    first, second = (estimates(kf := abma(Q_bias, reading), data()) for reading in ("R1", "R2"))
    np.testing.assert_allclose(first, second, atol=1e-10)
    kf = abma(Q_bias)
    w, n = np.array([T**2 / 2, T, 0]), np.array([0, 0.5, 1 / T])
    ca, _ = accelerating(np.kron(np.eye(2), 0.01 * np.outer(w, w) + q * np.outer(n, n)))
    for z in data():
        for each in (kf, ca):
            each.predict()
            each.update(z)
        v, bias = kf.estimate[[1, 3]], kf.bias[[1, 3]]
        np.testing.assert_allclose(ca.x[[1, 4]], v - bias / 2, atol=1e-10)
        np.testing.assert_allclose(ca.x[[2, 5]], bias / T, atol=1e-10)
        np.testing.assert_allclose(ca.x[[0, 3]], kf.estimate[[0, 2]], atol=1e-10)


def test_bias_noise_along_the_input_makes_reading_1_a_constant_acceleration_filter():
    """E5"""
    q = 0.01
    ca, L = accelerating(np.kron(np.eye(2), Q_discrete_white_noise(3, T, q)) + embedded(Q))
    np.testing.assert_allclose(estimates(abma(q * GAMMA @ GAMMA.T), data()), estimates(ca, data(), L), atol=1e-10)


def embedded(Q4):
    put = np.kron(np.eye(2), [[1.0, 0], [0, 1], [0, 0]])
    return put @ Q4 @ put.T


def test_gain_and_covariance_do_not_see_the_data_and_one_axis_not_the_other():
    one, two = abma(), abma()
    other = data(seed=1)
    other[:, 1] = data()[:, 1]  # only x differs
    for a, b in zip(data(), other, strict=True):
        for kf, z in ((one, a), (two, b)):
            kf.predict()
            kf.update(z)
        assert np.array_equal(one.K, two.K) and np.array_equal(one.P, two.P)
        assert np.array_equal(one.estimate[2:], two.estimate[2:])
    assert not np.array_equal(one.estimate[:2], two.estimate[:2])


def test_exchanging_the_axes_exchanges_the_estimates():
    start = X0[[2, 3, 0, 1]]
    swapped = AugmentedBiasKF(F, H, Q, R, Q_BIAS, start, P0)
    np.testing.assert_allclose(estimates(abma(), data()), estimates(swapped, data()[:, ::-1])[:, [2, 3, 0, 1]], atol=1e-10)


def accelerated(begin, steps):
    """Positions (steps, 2) without noise: x accelerates by 2 m/s² from step `begin` on; and the last true velocity in x."""
    t = np.arange(1.0, steps + 1)
    since = np.maximum(t - begin, 0)
    return np.stack([10 + 5 * t + since**2, 20 + 5 * t], axis=1), 5 + 2 * since[-1]


@pytest.mark.parametrize(("begin", "offset"), [(50, 1.0), (200, 1.0), (0, 0.4925)])
def test_an_acceleration_leaves_half_a_step_of_it_in_the_velocity_unless_it_was_there_from_the_start(begin, offset):
    zs, speed = accelerated(begin, begin + 300)
    last = estimates(abma(), zs)[-1]
    np.testing.assert_allclose(last[[0, 2, 3]], [zs[-1, 0], zs[-1, 1], 5], atol=1e-4)
    assert last[1] - speed == pytest.approx(offset, abs=1e-4)


def test_a_bias_of_position_alone_is_a_catastrophe():
    zs, speed = accelerated(50, 350)
    assert abs(estimates(abma(np.diag([0.1, 0, 0.1, 0])), zs)[-1, 1] - speed) > 20


def test_the_start_of_the_bias_can_be_told():
    kf = abma(P_bias0=np.diag([1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_array_equal(np.diag(kf.P)[4:], [1, 2, 3, 4])
    np.testing.assert_array_equal(np.diag(kf.estimate_P), np.diag(P0) + np.arange(1, 5))
    np.testing.assert_array_equal(kf.estimate, X0)


BAD = [
    ({"Q_bias": np.diag([-0.1, 1, 1, 1])}, "Q_bias"),
    ({"Q_bias": np.triu(np.ones((4, 4)))}, "Q_bias"),
    ({"Q_bias": np.eye(3)}, "Q_bias"),
    ({"reading": "R5"}, "reading"),
    ({"P_bias0": -np.eye(4)}, "P_bias0"),
    ({"F": np.eye(3)}, "F"),
    ({"H": np.eye(3)}, "H"),
    ({"x0": np.zeros(3)}, "F"),
    ({"Q": np.eye(2)}, "Q"),
    ({"P0": np.eye(8)}, "P0"),
]


@pytest.mark.parametrize(("change", "name"), BAD)
def test_bad_arguments_are_named(change, name):
    arguments = {"F": F, "H": H, "Q": Q, "R": R, "Q_bias": Q_BIAS, "x0": X0, "P0": P0} | change
    with pytest.raises(ValueError, match=name):
        AugmentedBiasKF(**arguments)


def test_matrices_of_an_unknown_reading_are_refused():
    with pytest.raises(ValueError, match="reading"):
        augmented_matrices(F, H, Q, Q_BIAS, "R0")

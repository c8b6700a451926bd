"""Singer's model between its limits, and a model that is given by its matrices."""

import mpmath
import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise, van_loan_discretization

from trackhelpers.ensemble import EnsembleEKF, EnsembleKF
from trackhelpers.filters import MotionKF
from trackhelpers.motion import CA, CV, LinearModel, Singer
from trackhelpers.sensors import LinearSensor, Position


def exact_noise(sigma, tau, dt):
    """2σ²/τ ∫ r rᵀ with 50 digits, r the response of position, velocity and acceleration."""
    with mpmath.workdps(50):
        a = 1 / mpmath.mpf(tau)

        def r(t):
            decay = mpmath.exp(-a * t)
            return (decay - 1 + a * t) / a**2, (1 - decay) / a, decay

        def entry(i, j):
            return float(2 * a * sigma**2 * mpmath.quad(lambda t: r(t)[i] * r(t)[j], mpmath.linspace(0, dt, 9)))

        lower = np.array([[entry(i, j) if j <= i else 0.0 for j in range(3)] for i in range(3)])
        return lower + np.tril(lower, -1).T


@pytest.mark.parametrize(("tau", "dt"), [(20, 1), (20, 0.01), (1e6, 0.5), (0.5, 1), (0.01, 1), (3, 100)])
def test_singers_noise_is_exact_from_short_to_long_correlation(tau, dt):
    Q = Singer(1.3, tau, axes=1).Q(np.zeros(3), dt)
    np.testing.assert_allclose(Q, exact_noise(1.3, tau, dt), rtol=1e-12)


@pytest.mark.parametrize("tau", [0.3, 20.0])
def test_singer_is_the_discretised_differential_equation(tau):
    model, dt = Singer(2.0, tau, axes=1), 0.7
    dynamics = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -1 / tau]])
    F, Q = van_loan_discretization(dynamics, np.array([[0], [0], [2.0 * np.sqrt(2 / tau)]]), dt)
    np.testing.assert_allclose(model.F(np.zeros(3), dt), F, atol=1e-13)
    np.testing.assert_allclose(model.Q(np.zeros(3), dt), Q, rtol=1e-9)


def test_a_slow_singer_is_constant_acceleration_and_a_fast_one_constant_velocity():
    dt, q = 0.7, 0.3
    slow, fast = Singer(np.sqrt(q * 1e9 / 2), 1e9, axes=1), Singer(np.sqrt(q / (2e-6)), 1e-6, axes=1)
    np.testing.assert_allclose(slow.F(np.zeros(3), dt), CA(axes=1).F(np.zeros(3), dt), atol=1e-8)
    np.testing.assert_allclose(slow.Q(np.zeros(3), dt), Q_continuous_white_noise(3, dt, q), rtol=1e-6)
    np.testing.assert_allclose(fast.F(np.zeros(3), dt)[:2, :2], CV(axes=1).F(np.zeros(2), dt))
    np.testing.assert_allclose(fast.F(np.zeros(3), dt)[:, 2], 0, atol=1e-5)
    np.testing.assert_allclose(fast.Q(np.zeros(3), dt)[:2, :2], Q_continuous_white_noise(2, dt, q), rtol=1e-5)


def test_two_steps_of_singer_are_one_of_twice_the_length():
    model, x = Singer((1.0, 2.0), 5.0), np.arange(6.0)
    F, Q = model.F(x, 0.4), model.Q(x, 0.4)
    np.testing.assert_allclose(model.F(x, 0.8), F @ F, atol=1e-13)
    np.testing.assert_allclose(model.Q(x, 0.8), F @ Q @ F.T + Q, atol=1e-13)
    np.testing.assert_array_equal(model.Q(x, 0.0), np.zeros((6, 6)))
    np.testing.assert_allclose(model.f(x, 0.4), F @ x)


@pytest.mark.parametrize("Ensemble", [EnsembleKF, EnsembleEKF])
def test_singer_serves_one_target_and_an_ensemble(Ensemble):
    model = Singer(1.0, 8.0)
    sensor, rng = Position(0.5, model.state), np.random.default_rng(0)
    kf, ens = MotionKF(model, np.zeros(6), np.eye(6)), Ensemble(model, np.zeros((6, 2)), np.eye(6))
    for _ in range(50):
        z = rng.normal(size=2)
        kf.predict(0.3)
        kf.update(z, sensor)
        ens.predict(0.3)
        ens.update(np.stack([z, z], axis=1), sensor)
    np.testing.assert_allclose(ens.x[:, 1], kf.x, atol=1e-11)
    np.testing.assert_allclose(ens.P[..., 1], kf.P, atol=1e-11)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: Singer(1.0, 0.0), "tau"),
        (lambda: Singer(1.0, -1.0), "tau"),
        (lambda: Singer(-1.0, 1.0), "sigma_m"),
        (lambda: Singer((1.0, 2.0, 3.0), 1.0), "sigma_m"),
        (lambda: Singer().F(np.zeros(6), -1.0), "dt"),
        (lambda: LinearModel(np.eye(3), np.eye(2), 1.0, "ab"), "F"),
        (lambda: LinearModel(np.full((2, 2), np.nan), np.eye(2), 1.0, "ab"), "F"),
        (lambda: LinearModel(np.eye(2), -np.eye(2), 1.0, "ab"), "Q"),
        (lambda: LinearModel(np.eye(2), np.eye(2), 1.0, "ab").f(np.zeros(2), 0.5), "dt"),
        (lambda: LinearModel(np.eye(2), np.eye(2), 0.0, "ab"), "dt"),
        (lambda: LinearSensor(np.eye(2), np.eye(3), "ab"), "R"),
        (lambda: LinearSensor(np.eye(3), np.eye(3), "ab"), "H"),
    ],
)
def test_bad_arguments_are_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_singer_has_no_held_input():
    with pytest.raises(NotImplementedError, match="no G"):
        Singer().G(np.zeros(6), 1.0)


def test_a_model_and_a_sensor_of_matrices_are_those_they_were_made_of():
    cv, dt = CV(0.4), 0.5
    model = LinearModel(cv.F(np.zeros(4), dt), cv.Q(np.zeros(4), dt), dt, cv.state)
    x = np.random.default_rng(1).normal(size=(4, 3))
    for method in ("f", "F", "Q"):
        np.testing.assert_allclose(getattr(model, method)(x, dt), getattr(cv, method)(x, dt), atol=1e-15)
    R = np.array([[2.0, 0.5], [0.5, 1.0]])
    sensor, position = LinearSensor(Position(1.0, cv.state).H(np.zeros(4)), R, cv.state), Position(1.0, cv.state)
    np.testing.assert_array_equal(sensor.h(x), position.h(x))
    np.testing.assert_array_equal(sensor.H(x), position.H(x))
    np.testing.assert_array_equal(sensor.R, R)
    assert sensor.names == ("z1", "z2") and sensor.linear

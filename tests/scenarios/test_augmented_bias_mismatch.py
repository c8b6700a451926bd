import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from trackhelpers import exact
from trackhelpers.exact import alpha_beta, steady_lag
from trackhelpers.scenarios.augmented_bias import mismatch as lab
from trackhelpers.scenarios.augmented_bias.contenders import F, Q, exact_errors, plain
from trackhelpers.scenarios.augmented_bias.target import R, correlated, track_of, truth

INDEX = float(np.sqrt(0.01 / 3.0))
CASES = [(INDEX, np.sqrt(3.0), 1.0), (0.5, 2.0, 0.3), (3.0, 0.1, 2.0), (20.0, 1.0, 1.0)]


def one_axis(index, sigma, dt):
    """Transition, input and process noise of one axis with this tracking index."""
    F1, G = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt**2 / 2, dt])
    return F1, G, (index * sigma / dt**2) ** 2 * np.outer(G, G)


def test_outcomes_have_the_moments_of_their_system():
    system = lab.random_system(np.random.default_rng(0))
    X, Z, W = lab.outcomes(system)
    v = Z - system.H @ X[1:]
    noise = np.vstack([X[0] - system.mean[:, None], *W, *v])
    moments = noise @ noise.T / noise.shape[1]
    expected = np.zeros_like(moments)
    place = 0
    for block in (system.P0, *system.Q, *system.R):
        expected[place : place + len(block), place : place + len(block)] = block
        place += len(block)
    assert X.shape[2] == 2**11
    np.testing.assert_allclose(noise.mean(axis=1), 0, atol=1e-13)
    np.testing.assert_allclose(moments, expected, atol=1e-12)


def test_regression_leaves_nothing_that_the_data_explain():
    rng = np.random.default_rng(1)
    target, data = rng.normal(size=(2, 64)), rng.normal(size=(3, 64))
    guess, covariance = lab.regression(target, data)
    miss = target - guess
    np.testing.assert_allclose(miss @ np.vstack([np.ones(64), data]).T, 0, atol=1e-12)
    np.testing.assert_allclose(covariance, miss @ miss.T / 64, atol=1e-14)


def test_regression_over_all_outcomes_is_the_kalman_filter():
    system = lab.random_system(np.random.default_rng(2), steps=2, n=2, m=2)
    X, Z, _ = lab.outcomes(system)
    known, x = exact.gains(*(list(matrix) for matrix in system[:4]), system.P0, len(Z)), system.mean[:, None]
    for k, (prior, P_prior, K, posterior, P_post) in enumerate(lab.by_regression(X, Z)):
        x = system.F[k] @ x
        np.testing.assert_allclose(prior, np.broadcast_to(x, prior.shape), atol=1e-10)
        np.testing.assert_allclose(P_prior, known.prior[..., k], atol=1e-10)
        np.testing.assert_allclose(K, known.K[..., k], atol=1e-10)
        x = x + K @ (Z[k] - system.H[k] @ x)
        np.testing.assert_allclose(posterior, x, atol=1e-10)
        np.testing.assert_allclose(P_post, known.P[..., k + 1], atol=1e-10)


@pytest.mark.parametrize("case", CASES)
def test_settled_gain_and_covariance_solve_the_riccati_equation(case):
    settled = lab.Settled(*case)
    F1, _, Q1 = one_axis(*case)
    M = solve_discrete_are(F1.T, np.eye(2, 1), Q1, [[settled.sigma**2]])
    K = M[:, 0] / (M[0, 0] + settled.sigma**2)
    np.testing.assert_allclose(settled.gain, K, rtol=1e-8)
    np.testing.assert_allclose(settled.believed, M - np.outer(K, M[0]), rtol=1e-7)
    assert M[0, 0] + settled.sigma**2 == pytest.approx(settled.sigma**2 / settled.root**2, rel=1e-8)
    np.testing.assert_allclose(settled.gain * [1, settled.dt], alpha_beta(settled.index), rtol=1e-9)


@pytest.mark.parametrize("case", CASES)
def test_settled_error_is_the_fixed_point_of_its_recursions(case):
    settled = lab.Settled(*case)
    F1, G, _ = one_axis(*case)
    A, K = settled.kept @ F1, settled.gain
    np.testing.assert_allclose(settled.loop, A, atol=1e-15)
    for a in (0.5, -2.0):
        lag = settled.lag(a)
        np.testing.assert_allclose(A @ lag - settled.kept @ G * a, lag, rtol=1e-9)
        np.testing.assert_allclose(lag, steady_lag(settled.index, a, settled.dt), rtol=1e-9)
        np.testing.assert_allclose(settled.rmse(a) ** 2, lag**2 + np.diag(settled.noise))
    np.testing.assert_allclose(settled.noise, solve_discrete_lyapunov(A, settled.sigma**2 * np.outer(K, K)), rtol=1e-8)


@pytest.mark.parametrize("case", CASES)
def test_lag_and_innovation_in_units_of_what_the_filter_believes(case):
    settled = lab.Settled(*case)
    sigma_a = settled.index * settled.sigma / settled.dt**2
    assert settled.lag(1.0)[0] == pytest.approx(-settled.root * settled.sigma / sigma_a)
    mean_innovation = settled.dt / settled.gain[1]
    assert mean_innovation / (settled.sigma / settled.root) == pytest.approx(1 / sigma_a)
    nees = settled.lag(1.0) @ np.linalg.solve(settled.believed, settled.lag(1.0))
    assert nees == pytest.approx(settled.delay / settled.dt / sigma_a**2)


def test_autocovariance_of_the_innovations_is_that_of_a_long_filtered_noise():
    settled = lab.Settled(0.5, 1.0, 1.0)
    impulse, e, y = [], np.zeros(2), np.array([1.0])
    for k in range(200):  # innovations that one unit of measurement noise brings about
        y = (1.0 if k == 0 else 0.0) - (e[0] + e[1])
        impulse.append(y)
        e = np.array([[1, 1], [0, 1]]) @ e + settled.gain * y
    impulse = np.array(impulse)
    for lag in range(6):
        assert settled.innovation_noise(lag) == pytest.approx(impulse[lag:] @ impulse[: len(impulse) - lag], abs=1e-12)


@pytest.mark.parametrize("omega", [0.05, 0.7, 3.0])
def test_frequency_response_is_what_the_exact_recursion_settles_to(omega):
    k = np.arange(401)
    track = np.array([np.sin(omega * k), omega * np.cos(omega * k)] * 2)
    bias, _, _ = exact_errors(plain(), track)
    formula = np.imag(lab.Settled(INDEX).response(omega)[:, None] * np.exp(1j * omega * k[300:]))
    np.testing.assert_allclose(bias[:2, 300:], formula, atol=1e-11)


def test_correlated_acceleration_lies_between_none_and_a_constant_one():
    settled = lab.Settled(INDEX)
    errors = np.array([settled.correlated(tau) for tau in (1e-3, 1.0, 20.0, 1e7)])
    assert np.all(np.diff(errors, axis=0) > 0)
    np.testing.assert_allclose(errors[-1], np.abs(settled.lag(1.0)), rtol=1e-5)
    white = solve_discrete_lyapunov(settled.loop, np.outer(settled.kick, settled.kick))
    np.testing.assert_allclose(errors[0] ** 2, np.diag(white), rtol=1e-9)


def test_worst_acceleration_is_worse_than_any_other_and_is_reached():
    settled, steps = lab.Settled(INDEX), 400
    errors = [settled.kick]
    for _ in range(steps - 1):
        errors.append(settled.loop @ errors[-1])
    worst = np.sign(np.array(errors)[::-1, 0])  # the newest acceleration acts through the first response
    e = np.zeros(2)
    for a in worst:
        e = settled.loop @ e + settled.kick * a
    assert e[0] == pytest.approx(settled.worst(steps))
    assert settled.worst() > abs(settled.lag(1.0)[0])


@pytest.mark.parametrize(("a", "path"), [(2.0, 0), (0.5, 3), (5.0, 1)])
def test_model_error_is_the_integrated_acceleration(a, path):
    track = truth(a, path)
    np.testing.assert_allclose(track[:, 1:] - F @ track[:, :-1], lab.integrated(a, path), atol=1e-9)


def test_change_and_autocorrelation_of_known_series():
    k = np.arange(50.0)
    np.testing.assert_allclose(lab.change(np.array([k, 2 * k]), 3), [3.0, 6.0])
    assert lab.autocorrelation((-1.0) ** k) == pytest.approx(-49 / 50)
    assert lab.autocorrelation(np.ones(50), lag=2) == pytest.approx(48 / 50)


def test_runs_agree_with_the_exact_recursion():
    acceleration = np.zeros((2, 80))
    acceleration[:, 40:] = 1.0
    track = track_of(acceleration)
    runs = lab.sampled(track, runs=400, seed=5)
    bias, covariance, believed = exact_errors(plain(), track)
    expected = [bias[:, 1:], lab.mean_innovation(track)]
    for found, mean in zip((runs.error, runs.innovation), expected, strict=True):
        scatter = found.std(axis=-1) / np.sqrt(400)
        assert np.max(np.abs(found.mean(axis=-1) - mean) / scatter) < 5
    P, C, e = believed[..., -1], covariance[..., -1], bias[:, -1]
    mean_nees = np.trace(np.linalg.solve(P, C)) + e @ np.linalg.solve(P, e)
    assert abs(runs.nees[-1].mean() - mean_nees) < 5 * runs.nees[-1].std() / 20
    S = F @ believed[..., -2] @ F.T + Q
    y = runs.innovation[:, -1]
    np.testing.assert_allclose(runs.nis[-1], np.sum(y**2, axis=0) / (S[0, 0] + R[0, 0]))


def test_power_is_the_share_of_runs_beyond_the_limit():
    settled, rng = lab.Settled(INDEX), np.random.default_rng(6)
    means = np.array([[0.0, 3.0, 8.0], [0.0, 3.0, 0.0]])
    v, S = settled.innovation_noise(), settled.sigma**2 / settled.root**2
    drawn = means[..., None] + np.sqrt(v) * rng.normal(size=(2, 3, 40000))
    share = np.mean(np.sum(drawn**2, axis=0) / S > -2 * np.log(0.01), axis=-1)
    np.testing.assert_allclose(lab.power(settled, means), share, atol=0.01)


def test_steps_of_a_correlated_acceleration_and_of_a_sinusoid():
    """What notebook 1 holds (12) against: mean square and lag-one autocorrelation of the steps, in closed form."""
    rho = np.exp(-1 / 20.0)
    steps = np.array([np.diff(correlated(path)) for path in range(400)])
    square = np.mean(steps**2, axis=1)
    assert abs(square.mean() - 2 * (1 - rho)) < 4 * square.std() / 20
    whiteness = lab.autocorrelation(steps)
    assert abs(whiteness.mean() + (1 - rho) / 2) < 4 * whiteness.std() / 20
    omega, k = 2 * np.pi / 100, np.arange(201)
    swing = np.diff(np.sin(omega * k))  # Λ's velocity part, amplitude 2 sin(ω/2), over two periods
    assert np.mean(swing**2) == pytest.approx(2 * np.sin(omega / 2) ** 2)
    assert lab.change(swing, 1) / np.sqrt(np.mean(swing**2)) == pytest.approx(2 * np.sin(omega / 2), rel=0.01)
    assert lab.autocorrelation(np.diff(swing)) == pytest.approx(np.cos(omega), abs=0.01)

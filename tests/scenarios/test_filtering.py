"""The ensemble of runs with shared gains against filterpy, the Riccati equation and closed forms."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.linalg import solve_discrete_are

from trackhelpers.scenarios.thesis.equations import random_systems
from trackhelpers.scenarios.thesis.filtering import covariances, estimate, paired_noises, simulate

STEPS, RUNS = 12, 5


def ensemble(seed):
    """A stable random system with inputs, its truth and its measurements."""
    rng = np.random.default_rng(seed)
    s = random_systems(rng, count=1)[0]
    A = 0.9 * s.A / np.abs(np.linalg.eigvals(s.A)).max()
    n, m = len(A), len(s.H)
    Bu = rng.normal(size=(STEPS, n))
    start = rng.normal(size=(n, RUNS))
    x, z = simulate(A, s.H, start, rng.normal(size=(STEPS, n, RUNS)), rng.normal(size=(STEPS, m, RUNS)), Bu)
    return s._replace(A=A), Bu, start, x, z


@pytest.mark.parametrize("seed", range(5))
def test_gains_and_estimates_are_those_of_filterpy(seed):
    s, Bu, _, _, z = ensemble(seed)
    known = covariances(s.A, s.H, s.Q, s.R, s.P, STEPS)
    runs = estimate(z, known.K, s.A, s.H, s.x, Bu)
    for run in range(RUNS):
        kf = KalmanFilter(dim_x=len(s.A), dim_z=len(s.H))
        kf.x, kf.P, kf.F, kf.H, kf.Q, kf.R = s.x.copy(), s.P.copy(), s.A, s.H, s.Q, s.R
        for k in range(STEPS):
            kf.predict(u=Bu[k], B=np.eye(len(s.A)))
            np.testing.assert_allclose(runs.prior[k, :, run], kf.x, atol=1e-10)
            np.testing.assert_allclose(known.prior[k], kf.P, atol=1e-10)
            kf.update(z[k, :, run])
            np.testing.assert_allclose(known.K[k], kf.K, atol=1e-10)
            np.testing.assert_allclose(known.S[k], kf.S, atol=1e-10)
            np.testing.assert_allclose(known.posterior[k], kf.P, atol=1e-10)
            np.testing.assert_allclose(runs.innovation[k, :, run], kf.y, atol=1e-10)
            np.testing.assert_allclose(runs.posterior[k, :, run], kf.x, atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_prior_covariance_settles_at_the_riccati_solution(seed):
    s, *_ = ensemble(seed)
    settled = covariances(s.A, s.H, s.Q, s.R, s.P, 300).prior[-1]
    np.testing.assert_allclose(settled, solve_discrete_are(s.A.T, s.H.T, s.Q, s.R), rtol=1e-9)


def test_joseph_form_and_short_form_agree_at_the_optimal_gain():
    s, *_ = ensemble(0)
    joseph, short = (covariances(s.A, s.H, s.Q, s.R, s.P, STEPS, joseph=form) for form in (True, False))
    np.testing.assert_allclose(joseph.posterior, short.posterior, atol=1e-12)


def test_short_form_loses_the_variance_where_joseph_keeps_it():
    A, H, R, P0 = np.eye(2), np.array([[1.0, 0.0]]), [[1e-5]], 1e12 * np.eye(2)
    joseph, short = (covariances(A, H, 0 * A, R, P0, 1, joseph=form).posterior[0, 0, 0] for form in (True, False))
    assert joseph == pytest.approx(1e-5, rel=1e-3)
    assert short != pytest.approx(1e-5, rel=0.5)


def test_gain_one_makes_the_estimate_the_measurement():
    A = H = np.eye(1)
    z = np.random.default_rng(0).normal(size=(STEPS, 1, RUNS))
    np.testing.assert_array_equal(estimate(z, [[0.0]], A, H, [2.0]).posterior, 2.0)
    np.testing.assert_allclose(estimate(z, [[1.0]], A, H, [2.0]).posterior, z, atol=1e-15)


def test_prediction_as_printed_never_sees_a_measurement():
    s, Bu, start, _, z = ensemble(1)
    K = covariances(s.A, s.H, s.Q, s.R, s.P, STEPS).K
    one, other = (estimate(data, K, s.A, s.H, start, Bu, as_printed=True) for data in (z, z + 1.0))
    np.testing.assert_array_equal(one.prior, other.prior)
    assert np.abs(estimate(z, K, s.A, s.H, start, Bu).prior - one.prior)[1:].max() > 0.1
    quiet, _ = simulate(s.A, s.H, start, np.zeros((STEPS, *start.shape)), np.zeros_like(z), Bu)
    np.testing.assert_allclose(one.prior, quiet, atol=1e-12)


def test_simulation_obeys_the_state_and_the_measurement_equation():
    rng = np.random.default_rng(3)
    s = random_systems(rng, count=1, n=3, m=2)[0]
    w, v = rng.normal(size=(2, 3, RUNS)), rng.normal(size=(2, 2, RUNS))
    start, Bu = rng.normal(size=(3, RUNS)), rng.normal(size=(2, 3))
    x, z = simulate(s.A, s.H, start, w, v, Bu)
    second = s.A @ (s.A @ start + Bu[0][:, None] + w[0]) + Bu[1][:, None] + w[1]
    np.testing.assert_allclose(x[1], second, atol=1e-13)
    np.testing.assert_allclose(z[1], s.H @ second + v[1], atol=1e-13)


def test_noises_have_mean_0_variance_1_and_rise_together():
    noises = paired_noises(np.random.default_rng(4), (3, 20000))
    assert list(noises) == ["Gaussian", "uniform", "Laplace"]
    order = np.argsort(noises["Gaussian"].ravel())
    kurtosis = {"Gaussian": 3.0, "uniform": 1.8, "Laplace": 6.0}
    for name, sample in noises.items():
        assert sample.shape == (3, 20000)
        assert sample.mean() == pytest.approx(0, abs=0.02)
        assert sample.var() == pytest.approx(1, abs=0.03)
        assert np.mean(sample**4) == pytest.approx(kurtosis[name], rel=0.1)
        assert np.all(np.diff(sample.ravel()[order]) >= 0)


ONE = np.eye(1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: covariances(np.ones((1, 2)), ONE, ONE, ONE, ONE, 3), r"A: .*\(1, 2\)"),
        (lambda: covariances(ONE, np.ones((1, 2)), ONE, ONE, ONE, 3), r"H: .*\(m, 1\).*\(1, 2\)"),
        (lambda: covariances(ONE, ONE, -ONE, ONE, ONE, 3), "Q: .*semidefinite"),
        (lambda: covariances(ONE, ONE, ONE, ONE, np.eye(2), 3), r"P0: .*\(2, 2\)"),
        (lambda: covariances(ONE, ONE, ONE, ONE, ONE, 0), "steps: .*≥ 1"),
        (lambda: covariances(ONE, ONE, 0 * ONE, 0 * ONE, 0 * ONE, 1), "R: .*positive definite"),
        (lambda: simulate(ONE, ONE, np.ones((1, 2)), np.ones((3, 2, 2)), np.ones((3, 1, 2))), r"w: .*\(3, 2, 2\)"),
        (lambda: simulate(ONE, ONE, np.ones((1, 2)), np.ones((3, 1, 2)), np.ones((3, 1, 4))), r"v: .*\(3, 1, 4\)"),
        (lambda: simulate(ONE, ONE, np.ones((1, 4)), np.ones((3, 1, 2)), np.ones((3, 1, 2))), r"x0: .*\(1, 4\)"),
        (lambda: simulate(ONE, ONE, np.ones((1, 2)), np.ones((3, 1, 2)), np.ones((3, 1, 2)), np.ones((2, 1))), r"Bu: .*\(2, 1\)"),
        (lambda: estimate(np.ones((3, 2, 4)), ONE, ONE, ONE, [0.0]), r"z: .*\(3, 2, 4\)"),
        (lambda: estimate(np.ones((3, 1, 4)), np.ones((2, 1, 1)), ONE, ONE, [0.0]), r"K: .*\(2, 1, 1\)"),
        (lambda: estimate(np.ones((3, 1, 4)), ONE, ONE, ONE, [0.0, 1.0]), r"x0: .*\(2, 4\)"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

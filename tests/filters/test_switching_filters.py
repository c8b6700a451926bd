"""Variance inflation, input estimation, variable dimension and interacting models: quiet at rest, quick in a manoeuvre, and never hurt by a missing measurement."""

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from scipy.stats import multivariate_normal

from trackhelpers.filters import InputEstimationKF, ManoeuvreIMM, MatrixKF, VariableDimensionKF, VarianceInflationKF
from trackhelpers.filters.imm import embedding
from trackhelpers.motion import CA, CTRV, CV, Singer

T = 1.0
REST, TURN = CV(0.1), CA(0.1)
F, Q, G = (getattr(REST, name)(np.zeros(4), T) for name in "FQG")
H, R, X0, P0 = np.eye(4)[[0, 2]], 3.0 * np.eye(2), np.array([0.0, 5.0, 0.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0])
BEGIN, END, STEPS = 60, 120, 200

MAKE = {
    "inflation": lambda **more: VarianceInflationKF(F, H, Q, R, X0, P0, **more),
    "input": lambda **more: InputEstimationKF(F, G, H, Q, R, X0, P0, **more),
    "variable dimension": lambda **more: VariableDimensionKF(REST, TURN, R, T, X0, P0, **more),
    "interacting": lambda **more: ManoeuvreIMM(REST, TURN, R, T, X0, P0, **more),
}


def track(a):
    """Truth (4, STEPS): x accelerates by `a` for BEGIN < k ≤ END."""
    k = np.arange(1.0, STEPS + 1)
    during, after = np.clip(k - BEGIN, 0, END - BEGIN), np.maximum(k - END, 0)
    vx = 5 + a * during
    return np.stack([5 * k + a / 2 * during**2 + a * (END - BEGIN) * after, vx, 5 * k, 5 + 0 * k])


def follow(kf, a, seed=0, missed=()):
    """Errors (4, STEPS) and the filter's state of mind at each step; the scans `missed` are None."""
    truth, rng = track(a), np.random.default_rng(seed)
    errors, minds = [], []
    for k in range(STEPS):
        kf.predict()
        z = truth[[0, 2], k] + np.sqrt(3) * rng.standard_normal(2)
        kf.update(None if k in missed else z)
        errors.append(kf.estimate - truth[:, k])
        minds.append(kf.manoeuvring if hasattr(kf, "manoeuvring") else getattr(kf, "mu", getattr(kf, "u", None)).copy())
    return np.array(errors).T, minds


@pytest.mark.parametrize("name", ["inflation", "input", "variable dimension"])
def test_without_a_manoeuvre_a_filter_that_never_alarms_is_the_plain_filter(name):
    limit = {"inflation": "probability", "input": "probability", "variable dimension": "enter"}[name]
    errors, _ = follow(MAKE[name](**{limit: 1 - 1e-15}), 0.0)
    kf, truth, rng = MatrixKF(F, H, Q, R, X0, P0), track(0.0), np.random.default_rng(0)
    for k in range(STEPS):
        kf.predict()
        kf.update(truth[[0, 2], k] + np.sqrt(3) * rng.standard_normal(2))
        assert np.array_equal(errors[:, k], kf.x - truth[:, k])


@pytest.mark.parametrize("name", MAKE)
def test_in_a_manoeuvre_each_stays_near_where_the_plain_filter_is_lost(name):
    errors, _ = follow(MAKE[name](), 2.0)
    assert np.abs(errors[0, BEGIN + 20 : END]).mean() < 4  # the plain filter lags by 29 m
    assert np.abs(errors[0, END + 20 :]).mean() < 4
    assert np.abs(errors[2]).max() < 6  # y never moved


def test_variable_dimension_changes_its_state_and_comes_back():
    kf = VariableDimensionKF(REST, TURN, R, T, X0, P0)
    _, minds = follow(kf, 2.0)
    assert not any(minds[:BEGIN]) and minds[BEGIN + 10] and all(minds[BEGIN + 10 : END]) and not minds[-1]
    assert kf.x.shape == (4,) and kf.estimate_P.shape == (4, 4)


def test_without_noise_variable_dimension_finds_the_acceleration_at_once():
    kf = VariableDimensionKF(REST, CA(1e-6), R, T, X0, P0)
    truth = track(2.0)
    for k in range(END):
        kf.predict()
        kf.update(truth[[0, 2], k])
    assert kf.manoeuvring
    np.testing.assert_allclose(kf.x[[2, 5]], [2, 0], atol=0.02)


def test_input_estimation_finds_the_acceleration_and_its_end():
    kf = InputEstimationKF(F, G, H, Q, R, X0, P0)
    _, inputs = follow(kf, 2.0)
    np.testing.assert_allclose(inputs[END - 1], [2, 0], atol=0.5)
    np.testing.assert_allclose(inputs[-1], [0, 0], atol=0.5)
    assert kf.changes >= 2


def test_inflation_goes_on_and_off():
    _, minds = follow(MAKE["inflation"](), 2.0)
    assert not any(minds[:BEGIN]) and all(minds[BEGIN + 10 : END]) and not minds[-1]


def test_interacting_models_are_filterpys_on_filterpys_own_filters():
    """Ours beside an IMMEstimator put together by hand, with the columns of the acceleration zeroed in the quiet model."""
    E = embedding(REST, TURN)
    filters = []
    for F6, Q6 in ((E @ F @ E.T, E @ Q @ E.T), (TURN.F(np.zeros(6), T), TURN.Q(np.zeros(6), T))):
        kf = KalmanFilter(6, 2)
        kf.x, kf.P, kf.F, kf.Q, kf.H, kf.R = E @ X0, E @ P0 @ E.T, F6, Q6, np.eye(6)[[0, 3]], R
        filters.append(kf)
    theirs, ours = IMMEstimator(filters, [0.9, 0.1], np.array([[0.98, 0.02], [0.02, 0.98]])), MAKE["interacting"]()
    rng = np.random.default_rng(0)
    for k in range(STEPS):
        z = track(2.0)[[0, 2], k] + rng.standard_normal(2)
        for imm in (theirs, ours):
            imm.predict()
            imm.update(z)
        np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)
        np.testing.assert_allclose(ours.mu, theirs.mu, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "every", "runs"), [("variable dimension", 6, 40), ("variable dimension", 2, 10), ("input", 6, 10), ("input", 2, 5)]
)
def test_a_manoeuvre_is_found_through_missed_scans(name, every, runs):
    """With every `every`-th scan missed, in each of the runs."""
    missed = range(every - 1, STEPS, every)
    late = []
    for seed in range(runs):
        errors, minds = follow(MAKE[name](), 2.0, seed, missed)
        found = minds[BEGIN + 20] if name == "variable dimension" else abs(minds[BEGIN + 25][0] - 2) < 1
        assert found
        late.append(np.abs(errors[0, END - 20 : END]).mean())
    assert np.mean(late) < 4  # 1 to 2 m without misses; the plain filter lags by 29 m


@pytest.mark.parametrize("name", ["variable dimension", "input", "inflation"])
def test_a_gap_wipes_no_memory(name):
    """A gap of thirty scans in the quiet: the alarm afterwards comes within as many measurements as without a gap."""
    minds = [follow(MAKE[name](), 2.0, 1, gap)[1] for gap in ((), range(BEGIN - 30, BEGIN))]
    first = [next(k for k in range(BEGIN, STEPS) if (np.linalg.norm(mind[k]) > 0 if name == "input" else mind[k])) for mind in minds]
    assert abs(first[1] - first[0]) <= 5


@pytest.mark.parametrize("missed", [(), (1,), (2, 3), (1, 2, 5, 6, 7)])
def test_the_retrospective_start_runs_through_the_gaps(missed):
    """An acceleration from the start on, without noise: at the alarm, the fourth measurement, the state is the truth whatever was missed before it."""
    kf, k = VariableDimensionKF(REST, TURN, 1e-4 * np.eye(2), T, X0, 1e-4 * np.eye(4), window=3), 0
    while not kf.manoeuvring:
        k += 1
        kf.predict()
        kf.update(None if k in missed else [5 * k + k**2, 5 * k])
    assert k == 4 + len(missed)
    np.testing.assert_allclose(kf.x, [5 * k + k**2, 5 + 2 * k, 2, 5 * k, 5, 0], atol=1e-8)


def test_the_chain_moves_with_every_prediction():
    imm, chain = MAKE["interacting"](), np.array([[0.98, 0.02], [0.02, 0.98]])
    for k in range(1, 21):
        imm.predict()
        np.testing.assert_allclose(imm.mu, np.array([0.9, 0.1]) @ np.linalg.matrix_power(chain, k), atol=1e-14)
        for _ in range(k % 3):
            imm.update(None)
    np.testing.assert_allclose(imm.mu, [0.677, 0.323], atol=1e-3)


def test_bare_predictions_mix_the_models_as_a_mixture_over_all_histories_but_for_the_merging():
    """The mean and covariance of x after a step are those of the four histories (model before, model after), written out."""
    imm = MAKE["interacting"]()
    for k in range(BEGIN + 4):
        imm.predict()
        imm.update(track(2.0)[[0, 2], k])
    for _ in range(5):
        before = [(kf.x, kf.P) for kf in imm.filters], imm.mu
        imm.predict()
        histories = [
            (before[1][i] * imm.M[i, j], imm.filters[j].F @ x, imm.filters[j].F @ P @ imm.filters[j].F.T + imm.filters[j].Q)
            for i, (x, P) in enumerate(before[0])
            for j in range(2)
        ]
        mean = sum(w * x for w, x, _ in histories)
        spread = sum(w * (P + np.outer(x - mean, x - mean)) for w, x, P in histories)
        np.testing.assert_allclose(imm.x, mean, atol=1e-9)
        np.testing.assert_allclose(imm.P, spread, rtol=1e-9, atol=1e-9)


def test_two_measurements_at_one_instant_are_their_mean_with_half_the_noise():
    """For every model alike, so that the probabilities of the models agree too."""
    two, one, rng = MAKE["interacting"](), MAKE["interacting"](), np.random.default_rng(0)
    for k in range(BEGIN + 5):
        a, b = track(2.0)[[0, 2], k] + np.sqrt(3) * rng.standard_normal((2, 2))
        for imm in (two, one):
            imm.predict()
        two.update(a)
        two.update(b)
        one.update((a + b) / 2, R=R / 2)
        np.testing.assert_allclose(two.mu, one.mu, atol=1e-9)
        np.testing.assert_allclose(two.x, one.x, atol=1e-8)
        np.testing.assert_allclose(two.P, one.P, atol=1e-8)


def test_the_mixtures_log_likelihood_is_that_of_both_models():
    imm = MAKE["interacting"]()
    for k in range(40):
        imm.predict()
        mu = imm.mu
        imm.update(track(2.0)[[0, 2], k])
        densities = [multivariate_normal(kf.H @ kf.x_prior, kf.S).pdf(imm.z) for kf in imm.filters]
        assert imm.log_likelihood == pytest.approx(np.log(mu @ densities), abs=1e-9)


def test_far_from_both_models_the_likelier_one_still_wins():
    """filterpy rounds both likelihoods up to the least positive number, and so believes the chain alone."""
    imm = MAKE["interacting"]()
    for k in range(20):
        imm.predict()
        imm.update(track(0.0)[[0, 2], k])
    imm.predict()
    imm.update(track(0.0)[[0, 2], 20] + [150.0, 0.0])
    assert imm.mu[1] > 0.999


def test_the_predicted_mixture_is_weighed_by_the_probabilities_after_the_step():
    imm = MAKE["interacting"]()
    for k in range(BEGIN + 3):
        imm.predict()
        mixed = sum(m * kf.x for m, kf in zip(imm.cbar, imm.filters, strict=True))
        np.testing.assert_allclose(imm.x, mixed, atol=1e-12)
        imm.update(None if k == 30 else track(2.0)[[0, 2], k])
        np.testing.assert_allclose(imm.x, sum(m * kf.x for m, kf in zip(imm.mu, imm.filters, strict=True)), atol=1e-12)


def test_interacting_models_know_which_one_is_in_force():
    _, probabilities = follow(MAKE["interacting"](), 2.0)
    assert probabilities[BEGIN - 1][0] > 0.7 and probabilities[END - 1][1] > 0.8 and probabilities[-1][0] > 0.7


def test_without_a_measurement_the_models_probabilities_follow_the_chain_alone():
    """filterpy weighs them again by the likelihood of the last measurement."""
    imm = MAKE["interacting"]()
    for k in range(30):
        imm.predict()
        imm.update(track(0.0)[[0, 2], k])
    before = imm.mu.copy()
    for _ in range(3):
        imm.predict()
        x, P = imm.x.copy(), imm.P.copy()
        imm.update(None)
        np.testing.assert_allclose(imm.x, x, atol=1e-12)
        np.testing.assert_allclose(imm.P, P, atol=1e-12)
    np.testing.assert_allclose(imm.mu, before @ np.linalg.matrix_power(np.array([[0.98, 0.02], [0.02, 0.98]]), 3))


@pytest.mark.parametrize("name", MAKE)
def test_a_missing_measurement_predicts_only(name):
    kf = MAKE[name]()
    for k in range(5):
        kf.predict()
        kf.update(track(0.0)[[0, 2], k])
    kf.predict()
    x, P = kf.x.copy(), kf.P.copy()
    kf.update(None)
    np.testing.assert_allclose(kf.x, x, atol=1e-12)
    np.testing.assert_allclose(kf.P, P, atol=1e-12)


@pytest.mark.parametrize("name", ["input", "variable dimension"])
def test_a_second_measurement_in_a_step_is_refused_by_filters_that_count_steps(name):
    kf = MAKE[name]()
    kf.predict()
    kf.update([5.0, 5.0])
    x, P = kf.x.copy(), kf.P.copy()
    with pytest.raises(RuntimeError, match="one measurement after each predict"):
        kf.update([5.0, 5.0])
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P)


def test_inflation_is_added_once_a_prediction():
    kf = MAKE["inflation"](probability=0.9, window=1)
    kf.predict()
    kf.update([60.0, 5.0])  # alarm
    kf.statistic = 1e9
    before = kf.P.copy()
    kf.update([60.0, 5.0])
    assert kf.manoeuvring and np.all(np.diag(kf.P) <= np.diag(before))


@pytest.mark.parametrize("misses", [0, 1, 4])
def test_variance_inflation_is_its_definition_written_out(misses):
    """One filter with Q and one with Q or its multiple beside each other; the noise of the scans missed is inflated with that of the next measurement."""
    kf, rng, total, flags = MAKE["inflation"](inflation=50.0, window=4, probability=0.95), np.random.default_rng(3), 0.0, []
    x, P, quiet, extra = X0, P0, P0, np.zeros((4, 4))
    for k in range(STEPS):
        z = track(2.0)[[0, 2], k] + np.sqrt(3) * rng.standard_normal(2)
        z = z if k % (misses + 1) == 0 else None
        kf.predict()
        kf.update(z)
        x, P, quiet, extra = F @ x, F @ P @ F.T + Q, F @ quiet @ F.T + Q, F @ extra @ F.T + Q
        if z is not None:
            y, S = z - H @ x, H @ quiet @ H.T + R
            total = 0.75 * total + y @ np.linalg.solve(S, y)
            flags.append(total > kf.limit)
            P, extra = P + 49 * extra * flags[-1], np.zeros((4, 4))
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ y, (np.eye(4) - K @ H) @ P
            quiet = quiet - quiet @ H.T @ np.linalg.inv(S) @ H @ quiet
            assert kf.manoeuvring == flags[-1]
        np.testing.assert_allclose(kf.x, x, atol=1e-7)
        np.testing.assert_allclose(kf.P, P, rtol=1e-6, atol=1e-7)
    assert any(flags) and not all(flags)


@pytest.mark.parametrize("name", MAKE)
@pytest.mark.parametrize("z", [[1.0], [1.0, np.inf], [[1.0, 2.0]]])
def test_a_bad_measurement_leaves_the_filter_as_it_was(name, z):
    kf = MAKE[name]()
    kf.predict()
    x, P = kf.x.copy(), kf.P.copy()
    with pytest.raises(ValueError, match="z"):
        kf.update(z)
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: MAKE["inflation"](inflation=0.5), "inflation"),
        (lambda: MAKE["inflation"](window=0), "window"),
        (lambda: MAKE["inflation"](probability=1.5), "probability"),
        (lambda: MAKE["input"](window=0), "window"),
        (lambda: MAKE["input"](probability=0), "probability"),
        (lambda: InputEstimationKF(F, np.eye(3), H, Q, R, X0, P0), "G"),
        (lambda: InputEstimationKF(F, np.eye(4), H, Q, R, X0, P0, window=1), "window"),
        (lambda: InputEstimationKF(F, np.ones(4), H, Q, R, X0, P0), "G"),
        (lambda: MAKE["variable dimension"](enter=1.0), "probability"),
        (lambda: MAKE["variable dimension"](leave=0.0), "leave"),
        (lambda: MAKE["variable dimension"](window=1.5), "window"),
        (lambda: VariableDimensionKF(REST, TURN, R, 0.0, X0, P0), "dt"),
        (lambda: VariableDimensionKF(REST, CV(0.1), R, T, X0, P0), "manoeuvring"),
        (lambda: VariableDimensionKF(CV(0.1, axes=1), TURN, R, T, X0, P0), "quiet"),
        (lambda: VariableDimensionKF(REST, CTRV(), R, T, X0, P0), "manoeuvring"),
        (lambda: VariableDimensionKF(REST, TURN, R, T, np.zeros(6), P0), "x0"),
        (lambda: ManoeuvreIMM(REST, CA(0.1, axes=3), R, T, X0, P0), "manoeuvring"),
        (lambda: MAKE["interacting"](stay=(1.0, 0.9)), "stay"),
        (lambda: MAKE["interacting"](stay=(0.9,)), "stay"),
        (lambda: MAKE["interacting"](mu=(0.5, 0.4)), "mu"),
        (lambda: ManoeuvreIMM(REST, TURN, np.eye(3), T, X0, P0), "R"),
    ],
)
def test_bad_arguments_are_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_singer_may_be_the_manoeuvring_model():
    for make in (VariableDimensionKF, ManoeuvreIMM):
        errors, _ = follow(make(REST, Singer(2.0, 20.0), R, T, X0, P0), 2.0)
        assert np.abs(errors[0, BEGIN + 20 : END]).mean() < 4

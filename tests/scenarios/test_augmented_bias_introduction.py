"""Paper 3's introduction: the runs, the probes of its claims, and the count of operations."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from trackhelpers.consistency import nis
from trackhelpers.motion import CV, Singer
from trackhelpers.scenarios.augmented_bias import analysis, operations, target
from trackhelpers.scenarios.augmented_bias import contenders as rivals
from trackhelpers.scenarios.augmented_bias import introduction as intro
from trackhelpers.scenarios.augmented_bias import introduction_probes as probes
from trackhelpers.scenarios.augmented_bias.target import R, T, track_of

TRACK = track_of(intro.accelerations(2.0))
RUNS = intro.draw(TRACK, runs=60, seed=3)
ALL = {
    "SKF": rivals.plain(),
    "CA": rivals.accelerating(),
    "IMM": rivals.interacting(),
    "VDF": rivals.variable_dimension(),
    "inflation": rivals.variance_inflation(),
    "STKF": rivals.strong_tracking(4.0),
    "IE": rivals.input_estimation(),
}


def errors_of(values):
    return intro.Errors(np.asarray(values, dtype=float), np.zeros(np.shape(values)[1]))


# the runs


def test_the_track_is_a_parabola_while_accelerated_and_straight_otherwise():
    t = np.arange(181.0)
    x = 10 + 5 * t + np.where(t > 60, (np.minimum(t, 120) - 60) ** 2, 0) + np.where(t > 120, 120 * (t - 120), 0)
    assert_allclose(TRACK[0], x, rtol=0, atol=1e-9)
    assert_allclose(TRACK[2:], [20 + 5 * t, np.full(181, 5.0)], rtol=0, atol=1e-9)


def test_a_run_has_its_noise_whatever_the_track_and_the_number_of_runs():
    other = intro.draw(track_of(intro.accelerations(0.5)), runs=7, seed=3)
    noise = [data.z - data.track[[0, 2], 1:] for data in (RUNS, other)]
    assert_allclose(noise[0][..., :7], noise[1], rtol=0, atol=1e-9)


def test_random_tracks_have_singer_s_variance_and_correlation():
    tau, sigma = 5.0, 2.0
    data = intro.draw_random(Singer(sigma, tau), steps=200, runs=400, seed=1)
    gained = np.diff(data.track[1], axis=0)  # integrals of the acceleration over a step
    keep = np.exp(-T / tau)
    expected = {0: 2 * sigma**2 * tau * (T - tau * (1 - keep)), 5: (sigma * tau * (1 - keep)) ** 2 * keep**4}
    for lag, value in expected.items():
        by_run = np.mean(gained[lag:] * gained[: len(gained) - lag], axis=0)
        assert abs(by_run.mean() - value) < 4 * by_run.std() / np.sqrt(400)
    assert_allclose(np.std(data.z - data.track[[0, 2], 1:]), np.sqrt(3), rtol=0.01)
    assert_allclose(np.cov(data.start - data.track[:, 0]), target.P0, atol=0.8)


@pytest.mark.parametrize("name", list(ALL))
def test_the_single_filter_makes_the_errors_of_its_ensemble(name):
    ensemble = intro.errors(ALL[name], RUNS)
    for run in (0, 41):
        assert_allclose(intro.single_errors(ALL[name], RUNS, run), ensemble.values[..., run], rtol=0, atol=1e-7)


def test_runs_agree_with_the_recursion():
    for contender in (ALL["SKF"], ALL["CA"]):
        e = intro.errors(contender, RUNS)
        assert np.max(np.abs(intro.deviations(contender, e, TRACK))) < 4
        assert_allclose(e.rmse("manoeuvre"), intro.exact_rmse(contender, TRACK, "manoeuvre"), rtol=0.05)


def test_a_constant_error_is_all_bias_and_has_its_own_size():
    e = errors_of(np.full((4, 181, 30), -3.0))
    assert e.rmse("rest") == 3.0 and intro.by_part({"a": e}).loc["a"].eq(3.0).all()
    assert_allclose(intro.share_of_bias(e, "rest"), 1.0)


def test_the_share_of_the_bias_is_unbiased_when_there_is_none():
    shares = []
    for seed in range(40):
        e = errors_of(np.random.default_rng(seed).standard_normal((4, 181, 20)))
        shares.append(intro.share_of_bias(e, "rest").value)
    assert abs(np.mean(shares)) < 4 * np.std(shares) / np.sqrt(40)


def test_the_ratio_of_a_filter_with_twice_the_errors_is_two_without_spread():
    e = intro.errors(ALL["SKF"], RUNS)
    assert_allclose(intro.ratio(errors_of(2 * e.values), e, "end", "vx"), 2.0)


# the probes


def test_a_gate_refuses_what_a_loop_refuses_and_the_filter_coasts():
    refused, linear = probes.gated(ALL["SKF"], RUNS), ALL["SKF"]
    kf, limit = linear.single(RUNS.start[:, 5]), stats.chi2.ppf(0.9999, 2)
    for k, z in enumerate(RUNS.z[..., 5].T, 1):
        kf.predict()
        outside = nis(z - kf.H @ kf.x, kf.H @ kf.P @ kf.H.T + R) > limit
        assert outside == refused[k, 5]
        kf.update(None if outside else z)
    assert refused[-20:, 5].all()


@pytest.mark.parametrize("count", [0, 1, 37, 60])
def test_the_interval_of_a_share_is_clopper_and_pearson_s(count):
    exact = stats.binomtest(count, 60).proportion_ci(method="exact")
    assert_allclose(probes.share(np.arange(60) < count), (count / 60, exact.low, exact.high), atol=1e-12)


def test_delays_are_counted_from_the_change():
    modes = np.zeros((181, 4), dtype=bool)
    modes[63:131, 0] = True  # 3 s, 11 s
    modes[60:121, 1] = True  # alarmed already; 1 s
    modes[119:, 2] = True  # 59 s; never back
    assert_array_equal(probes.delays(modes, 60, 120), [3, np.nan, 59, 60])
    assert_array_equal(probes.delays(modes, 120, 180), [11, 1, 60, np.nan])


def test_switching_and_the_dropped_acceleration_are_the_single_filter_s():
    vdf, run = rivals.variable_dimension(), 11
    modes, held, last = probes.switching(vdf, RUNS)[:, run], probes.dropped(vdf, RUNS)[run], None
    for k, kf in enumerate(intro.walk(vdf.single(RUNS.start[:, run]), RUNS.z[..., run]), 1):
        assert kf.manoeuvring == modes[k]
        if k > 120 and not kf.manoeuvring:
            break
        last = kf.F @ kf.x
    else:
        pytest.fail("never left CA")
    H = np.eye(6)[[0, 3]]  # one more step of CA, whose acceleration was dropped afterwards
    ca = rivals.accelerating()
    P = ca.F @ previous_covariance(vdf, run, k) @ ca.F.T + ca.Q
    gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    assert_allclose(held, (last + gain @ (RUNS.z[:, k - 1, run] - H @ last))[2], atol=1e-9)


def previous_covariance(vdf, run, k):
    *_, kf = intro.walk(vdf.single(RUNS.start[:, run]), RUNS.z[:, : k - 1, run])
    return kf.P


def test_the_imm_s_decision_is_a_probability_above_one_half():
    modes = probes.switching(ALL["IMM"], RUNS)[1:, 2]
    mu = [kf.mu[1] for kf in intro.walk(ALL["IMM"].single(RUNS.start[:, 2]), RUNS.z[..., 2])]
    assert_array_equal(modes, np.array(mu) > 0.5)


def test_a_switch_after_the_last_sample_is_no_switch():
    assert_allclose(probes.left_at(180, RUNS)[0].values, intro.errors(ALL["CA"], RUNS).values, rtol=0, atol=1e-9)


def test_a_switch_in_between_is_two_filters_one_after_the_other():
    e, dropped = probes.left_at(123, RUNS)
    *_, ca = intro.walk(ALL["CA"].single(RUNS.start[:, 0]), RUNS.z[:, :123, 0])
    L = ALL["CA"].to_estimate
    skf = ALL["SKF"].single(L @ ca.x)
    skf.P = L @ ca.P @ L.T
    path = np.array([kf.x.copy() for kf in intro.walk(skf, RUNS.z[:, 123:, 0])]).T
    assert_allclose(e.values[:, 124:, 0], path - TRACK[:, 124:], rtol=0, atol=1e-7)
    assert_allclose(dropped[0], ca.x[2], rtol=1e-9)


@pytest.mark.parametrize("name", ["SKF", "STKF", "inflation"])
def test_innovations_are_the_filter_s_own(name):
    y = probes.innovations(ALL[name], RUNS)[:, 1:, 4]
    own = np.array([kf.y.copy() for kf in intro.walk(ALL[name].single(RUNS.start[:, 4]), RUNS.z[..., 4])]).T
    assert_allclose(y, own, rtol=0, atol=1e-7)


def test_the_gain_is_the_filter_s_own():
    gains = probes.gain_by_step(ALL["STKF"], RUNS)[1:, 4]
    own = [kf.K[0, 0] for kf in intro.walk(ALL["STKF"].single(RUNS.start[:, 4]), RUNS.z[..., 4])]
    assert_allclose(gains, own, rtol=1e-9)


def test_the_autocorrelation_of_a_constant_is_one_and_of_an_alternation_minus_one():
    y = np.ones((2, 181, 5))
    y[1] *= (-1.0) ** np.arange(181)[:, None]
    assert probes.autocorrelation(y, 3, "rest").value == 1
    assert probes.autocorrelation(y, 3, "rest", component=1).value == -1


def test_white_innovations_have_no_autocorrelation():
    y = np.random.default_rng(0).standard_normal((2, 181, 500))
    found = probes.autocorrelation(y, 1, "manoeuvre")
    assert abs(found.value) < 4 / np.sqrt(500 * 39) and found.low < found.value < found.high


def test_a_difference_is_as_wide_as_both_intervals_together():
    one, other = probes.share(np.arange(60) < 50), probes.share(np.arange(60) < 10)
    found = probes.difference(one, other)
    assert_allclose(found.high - found.low, one.high - one.low + other.high - other.low)


def test_fixing_costs_nothing_where_one_setting_is_the_best_in_all_parts():
    good, bad = errors_of(np.ones((4, 181, 9))), errors_of(np.full((4, 181, 9), 3.0))
    costs, best = probes.cost_of_fixing({1: good, 2: bad}, {1: good, 2: bad}, ("rest", "manoeuvre"))
    assert costs[1].value == 1 and costs[2].value == pytest.approx(3) and best == {"rest": 1, "manoeuvre": 1}


def test_singer_is_its_differential_equation_and_has_both_limits():
    assert max(probes.singer_residuals(points=20, seed=5).values()) < 1e-9


def test_a_component_is_the_single_filter_s():
    abma = rivals.augmented()
    found = probes.component(abma, RUNS, 5)[1:, 9]
    own = [kf.x[5] for kf in intro.walk(rivals.augmented_kf(RUNS.start[:, 9]), RUNS.z[..., 9])]
    assert_allclose(found, own, rtol=0, atol=1e-9)


def test_the_augmented_filter_s_bias_over_t_is_an_acceleration():
    twin = analysis.constant_acceleration(rivals.BIAS_NOISE["0.01, 0.01"])
    assert_allclose(probes.component(rivals.augmented(), RUNS, 5) / T, probes.component(twin, RUNS, 2), rtol=0, atol=1e-9)


def test_a_run_that_left_early_has_no_delay_of_the_end_and_is_counted():
    begin, end = np.array([1.0, 2.0, 3.0, np.nan]), np.array([4.0, np.nan, 9.0, 5.0])
    found = probes.Delays(begin, end, 0.5)
    assert found.left_out == 0.25 and found.later.value == 4.5


def test_the_mean_leaves_nan_out():
    assert probes.finite_mean(np.array([1.0, np.nan, 3.0])).value == 2.0


# the count of operations


class Counting(float):
    """A number that counts what is done with it."""

    done = 0


def _operation(symbol):
    def method(self, other):
        if isinstance(other, np.ndarray):
            return NotImplemented  # NumPy goes through the entries
        Counting.done += 1
        return Counting(getattr(float, symbol)(self, float(other)))

    return method


for symbol in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv"):
    setattr(Counting, f"__{symbol}__", _operation(f"__{symbol}__"))


def counting(A):
    return np.vectorize(Counting, otypes=[object])(np.asarray(A, dtype=float))


def operations_of(function):
    Counting.done = 0
    function()
    return Counting.done


@pytest.mark.parametrize("n, m", [(4, 2), (6, 2), (8, 2), (6, 3)])
def test_a_step_of_filterpy_takes_the_operations_that_are_counted(n, m):
    kf, rng = KalmanFilter(dim_x=n, dim_z=m), np.random.default_rng(n)
    kf.x, kf.P, kf.Q = counting(rng.normal(size=n)), counting(np.eye(n)), counting(np.eye(n))
    kf.F, kf.H, kf.R = counting(rng.normal(size=(n, n))), counting(rng.normal(size=(m, n))), counting(np.eye(m))
    kf.inv = lambda S: counting(np.linalg.inv(S.astype(float)))
    assert operations_of(kf.predict) == operations.predict(n) + n * n  # filterpy multiplies by alpha²
    assert operations_of(lambda: kf.update(rng.normal(size=m))) == operations.correct(n, m) - operations.inverse(m)


def test_nis_and_mixture_take_the_operations_that_are_counted():
    rng = np.random.default_rng(1)
    y, S = counting(rng.normal(size=2)), counting(np.eye(2))
    assert operations_of(lambda: np.dot(np.dot(y, S), y)) == operations.nis(2)
    weights, xs, Ps = counting([0.4, 0.6]), counting(rng.normal(size=(2, 6))), counting(rng.normal(size=(2, 6, 6)))

    def mixture():
        mean = sum((w * x for w, x in zip(weights, xs, strict=True)), start=counting(np.zeros(6)))
        spread = counting(np.zeros((6, 6)))
        for w, x, P in zip(weights, xs, Ps, strict=True):
            d = x - mean
            spread = spread + w * (P + np.outer(d, d))

    assert operations_of(mixture) == operations.mixture(6)


def test_an_imm_of_one_model_is_a_kalman_filter_and_its_overhead():
    per_model = [operations.interacting(models=r) - r * operations.kalman(6) for r in (2, 3, 4)]
    assert np.all(np.diff(per_model, n=2) > 0)  # the mixing grows with the square of the number of models


def test_the_table_names_every_rival_and_its_cheapest_is_the_plain_filter():
    table = operations.table()
    assert min(table, key=lambda name: table[name][0]) == "SKF"
    assert table["SKF"] == (operations.kalman(4),) * 2 and table["ABMA"][0] > operations.kalman(8)
    assert operations.variable_dimension()[2] > 5 * operations.kalman(6)


def test_the_plain_filter_is_on_the_printed_model():
    assert_allclose(ALL["SKF"].Q, CV(0.1).Q(np.zeros(4), T))

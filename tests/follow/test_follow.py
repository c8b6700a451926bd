"""The loop is the loop, and the smoother is the least-squares solution over all measurements."""

import numpy as np
import pytest

from trackhelpers.consistency import nees
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF
from trackhelpers.filters import MatrixKF, MotionEKF, MotionIMM, MotionKF, MotionSquareRootUKF, MotionUKF
from trackhelpers.follow import follow, smooth
from trackhelpers.motion import CA, CTRV, CV, Singer
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar

MODEL = CV(0.5)
SENSOR = Position(0.3, MODEL.state)
STEPS = [0.1, 0.7, 0.0, 0.3, 2.0, 0.2, 0.5, 0.4]
ZS = [*np.random.default_rng(0).normal(size=(4, 2)), None, *np.random.default_rng(1).normal(size=(3, 2))]
SINGLES = [MotionKF, MotionEKF, MotionUKF, MotionSquareRootUKF]


@pytest.mark.parametrize("Filter", SINGLES)
def test_follow_is_predict_and_update_in_turn(Filter):
    by_hand, kf = (Filter(MODEL, np.zeros(4), np.eye(4)) for _ in range(2))
    history = follow(kf, ZS, SENSOR, STEPS, t0=5.0)
    for k, (z, dt) in enumerate(zip(ZS, STEPS, strict=True)):
        by_hand.predict(dt)
        by_hand.update(z, SENSOR)
        np.testing.assert_array_equal(history.x[:, k], by_hand.x)
        np.testing.assert_array_equal(history.P[..., k], by_hand.P)
    np.testing.assert_allclose(history.t, 5 + np.cumsum(STEPS))
    assert history.filter is kf and history.y.shape == (2, 8) and history.S.shape == (2, 2, 8)
    assert np.isnan(history.y[:, 4]).all() and np.isnan(history.S[..., 4]).all() and np.isfinite(history.y[:, 3]).all()
    assert "8 steps" in repr(history)


@pytest.mark.parametrize(
    "model", [CV(0.5, noise="continuous"), CA(0.5, noise="continuous"), Singer(0.5, 3.0)], ids=lambda m: type(m).__name__
)
def test_missed_scans_inside_a_step_change_nothing_where_the_noise_is_continuous(model):
    """And with an acceleration that is constant within a step they do."""

    def last(model, zs, steps):
        kf = follow(MotionKF(model, np.zeros(model.n), np.eye(model.n)), zs, Position(0.3, model.state), steps).filter
        return np.concatenate([kf.x, kf.P.ravel()])

    whole, split = (ZS[:2], [0.6, 2.0]), ([None, ZS[0], None, None, ZS[1]], [0.2, 0.4, 0.5, 1.0, 0.5])
    np.testing.assert_allclose(last(model, *whole), last(model, *split), rtol=1e-9, atol=1e-9)
    assert np.abs(last(MODEL, *whole) - last(MODEL, *split)).max() > 1e-3


def test_sensors_take_turns_at_their_time_with_their_R_and_shorter_measurements_are_padded():
    class Moving(Radar):
        def at(self, t):
            times.append(t)
            return Radar(position=(-10 - t, 0))

    times, model = [], CTRV(2.0, 0.3)
    kf = MotionEKF(model, [0.6, 0.6, 5, 0.7, 0], np.eye(5))
    history = follow(
        kf,
        [[0.7, 0.7], [11.0, 0.08, 4.0], None],
        [Lidar(), Moving(), None],
        0.1,
        Rs=[None, np.diag([1, 0.01, 1.0]), None],
        keep=("x", "y", "K"),
    )
    np.testing.assert_allclose(times, [0.2])
    np.testing.assert_allclose(kf.R, np.diag([1, 0.01, 1.0]))
    assert history.y.shape == (3, 3) and np.isnan(history.y[2, 0]) and np.isfinite(history.y[:, 1]).all()
    assert history.K.shape == (5, 3, 3) and not hasattr(history, "P")


def test_filters_on_matrices_need_neither_sensor_nor_step():
    F, Q = MODEL.F(np.zeros(4), 0.1), MODEL.Q(np.zeros(4), 0.1)
    history = follow(MatrixKF(F, SENSOR.H(np.zeros(4)), Q, SENSOR.R, np.zeros(4), np.eye(4)), ZS)
    other = follow(MotionKF(MODEL, np.zeros(4), np.eye(4)), ZS, SENSOR, 0.1)
    np.testing.assert_allclose(history.x, other.x, atol=1e-14)


@pytest.mark.parametrize("Ensemble", [EnsembleKF, EnsembleEKF])
def test_an_ensemble_keeps_its_states_alone_unless_asked(Ensemble):
    x0 = np.random.default_rng(2).normal(size=(4, 3))
    masks = [None, np.array([True, False, True]), *[None] * 6]
    zs = [None if z is None else z[:, None] for z in ZS]
    history = follow(Ensemble(MODEL, x0, np.eye(4)), zs, SENSOR, STEPS, masks=masks)
    assert history.x.shape == (4, 8, 3) and not hasattr(history, "P")
    full = follow(Ensemble(MODEL, x0, np.eye(4)), zs, SENSOR, STEPS, masks=masks, keep=("x", "P", "y", "S"))
    assert full.P.shape == (4, 4, 8, 3) and full.y.shape == (2, 8, 3) and full.S.shape == (2, 2, 8, 3)
    for run in range(3):
        own = [None if run == 1 and k == 1 else z for k, z in enumerate(ZS)]
        single = follow(MotionKF(MODEL, x0[:, run], np.eye(4)), own, SENSOR, STEPS)
        np.testing.assert_allclose(history.x[..., run], single.x, atol=1e-12)
        np.testing.assert_allclose(full.P[..., run], single.P, atol=1e-12)
        np.testing.assert_allclose(full.y[..., run], single.y, atol=1e-12)


@pytest.mark.parametrize(
    "arguments",
    [{"dt": [0.1]}, {"sensors": [SENSOR]}, {"Rs": [np.eye(2)]}, {"masks": []}, {"dt": -0.1}, {"dt": [np.timedelta64(1, "s")] * 8}],
)
def test_sequences_that_do_not_fit_are_refused_before_anything_moves(arguments):
    kf = MotionKF(MODEL, np.zeros(4), np.eye(4))
    with pytest.raises(ValueError, match=next(iter(arguments))):
        follow(kf, ZS, **({"sensors": SENSOR, "dt": 0.1} | arguments))
    assert np.array_equal(kf.P, np.eye(4))


def test_a_bad_measurement_is_named_by_its_index():
    with pytest.raises(ValueError, match=r"zs\[1\]: z"):
        follow(MotionKF(MODEL, np.zeros(4), np.eye(4)), [[0, 0], [np.nan, 0]], SENSOR, 0.1)


def least_squares(x0, P0, zs, steps, model, sensor):
    """All states at once: x0, every step and every measurement as one linear Gaussian system; means (n, N) and covariances of the states after each step."""
    n, N = len(x0), len(zs)
    rows, wanted, weights = [np.eye(n, n * (N + 1))], [x0], [np.linalg.inv(P0)]
    H = sensor.H(x0)
    for k, (z, dt) in enumerate(zip(zs, steps, strict=True)):
        move = np.zeros((n, n * (N + 1)))
        move[:, n * k : n * k + n], move[:, n * k + n : n * k + 2 * n] = -model.F(x0, dt), np.eye(n)
        rows, wanted, weights = [*rows, move], [*wanted, np.zeros(n)], [*weights, np.linalg.inv(model.Q(x0, dt) + 1e-9 * np.eye(n))]
        if z is not None:
            see = np.zeros((len(H), n * (N + 1)))
            see[:, n * k + n : n * k + 2 * n] = H
            rows, wanted, weights = [*rows, see], [*wanted, z], [*weights, np.linalg.inv(sensor.R)]
    information = sum(A.T @ W @ A for A, W in zip(rows, weights, strict=True))
    covariance = np.linalg.inv(information)
    mean = covariance @ sum(A.T @ W @ b for A, W, b in zip(rows, weights, wanted, strict=True))
    blocks = [slice(n * k, n * k + n) for k in range(1, N + 1)]
    return np.stack([mean[b] for b in blocks], axis=-1), np.stack([covariance[b, b] for b in blocks], axis=-1)


@pytest.mark.parametrize("Filter", SINGLES)
def test_the_smoother_is_the_least_squares_solution_over_irregular_steps_and_gaps(Filter):
    model = CV(0.5, noise="continuous")
    smoothed = smooth(follow(Filter(model, np.ones(4), np.eye(4)), ZS, SENSOR, STEPS))
    x, P = least_squares(np.ones(4), np.eye(4), ZS, STEPS, model, SENSOR)
    np.testing.assert_allclose(smoothed.x, x, atol=1e-5)  # the system has 1e-9 in the place of a Q that is 0 where dt is
    np.testing.assert_allclose(smoothed.P, P, atol=1e-5)


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
def test_on_a_turning_target_with_two_sensors_the_smoother_is_better_than_the_filter_and_honest(Filter):
    """Irregular steps, radar and lidar at one instant, the heading goes round several times."""
    rng, model, truth = np.random.default_rng(3), CTRV(0.5, 0.1), [np.array([20.0, 0.0, 5.0, 1.0, 0.5])]
    zs, steps, sensors, kept = [], [], [], []
    for k in range(300):
        dt = rng.choice([0.05, 0.1, 0.4]) if k % 2 else 0.0
        x = truth[-1]
        truth.append(model.f(x, dt) + model.G(x, dt) @ ([0.5, 0.1] * rng.standard_normal(2)))
        sensor = Lidar(0.5) if k % 2 else Radar((0.5, 0.05, 0.5), position=(-30, 5))
        zs.append(None if 100 < k < 120 else sensor.h(truth[-1]) + np.sqrt(np.diag(sensor.R)) * rng.standard_normal(sensor.m))
        steps.append(dt)
        sensors.append(sensor)
    truth = np.stack(truth[1:], axis=-1)
    kf = Filter(model, truth[:, 0] + [0.5, -0.5, 0.5, 0.1, 0.05], np.diag([0.25, 0.25, 0.25, 0.01, 0.01]))
    history = follow(kf, zs, sensors, steps)
    smoothed = smooth(history)
    filtered, better = (np.sqrt(np.mean((x[:2] - truth[:2]) ** 2)) for x in (history.x, smoothed.x))
    assert better < 0.7 * filtered
    from trackhelpers.angles import residual

    error = residual(truth, smoothed.x, (3,))
    kept = [e @ np.linalg.solve(P, e) for e, P in zip(error.T[5:], np.moveaxis(smoothed.P, -1, 0)[5:], strict=True)]
    assert 2 < np.mean(kept) < 9  # 5 for independent errors; these are not


def test_a_heading_is_smoothed_across_the_cut():
    compass, kf = LinearSensor([[0, 0, 0, 1, 0]], [[0.01]], CTRV.state), MotionEKF(CTRV(0.1, 0.1), [0, 0, 1, 3.0, 0.5], np.eye(5))
    headings = 3.0 + 0.05 * np.arange(1, 30)
    smoothed = smooth(follow(kf, [[(z + np.pi) % (2 * np.pi) - np.pi] for z in headings], compass, 0.1))
    away = (smoothed.x[3] - headings + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(away).max() < 0.05


def test_a_start_that_is_known_exactly_is_smoothed_too():
    smoothed = smooth(follow(MotionKF(MODEL, np.zeros(4), np.zeros((4, 4))), ZS, SENSOR, 0.1))
    assert np.isfinite(smoothed.x).all() and np.isfinite(smoothed.P).all()


def test_what_cannot_be_smoothed_is_said():
    ens = EnsembleKF(MODEL, np.zeros((4, 2)), np.eye(4))
    with pytest.raises(ValueError, match=r"history: expected that of one target.*EnsembleKF"):
        smooth(follow(ens, [None], SENSOR, 0.1))
    with pytest.raises(ValueError, match="history"):
        smooth("a track")


@pytest.mark.parametrize("Filter", SINGLES)
def test_what_the_gate_keeps_out_is_a_missed_scan(Filter):
    wild = [*ZS[:3], np.array([1e3, 0.0]), *ZS[4:]]
    gated, missed = (Filter(MODEL, np.zeros(4), np.eye(4)) for _ in range(2))
    history = follow(gated, wild, SENSOR, STEPS, gate=0.9999)
    other = follow(missed, [*ZS[:3], None, *ZS[4:]], SENSOR, STEPS)
    assert history.outliers == (3,) and other.outliers == ()
    np.testing.assert_array_equal(history.x, other.x)
    np.testing.assert_array_equal(history.P, other.P)
    np.testing.assert_array_equal(smooth(history).x, smooth(other).x)


def test_a_gate_passes_as_many_as_it_says():
    rng, model, N = np.random.default_rng(3), CV(0.001), 4000
    x, zs = np.zeros(4), []
    for _ in range(N):
        x = model.f(x, 1.0) + model.G(x, 1.0) @ rng.normal(0, 0.001, 2)
        zs.append(x[[0, 2]] + rng.normal(0, 0.3, 2))
    kf = MotionKF(model, np.zeros(4), np.eye(4))
    outside = len(follow(kf, zs, SENSOR, 1.0, gate=0.95).outliers) / N
    assert 0.04 < outside < 0.06  # where the measurement's noise rules; where the motion's does, a gate so narrow loses the target


def test_the_gate_of_a_bank_is_its_best_model_s():
    still, fast = (MotionKF(CV(sigma), np.zeros(4), np.eye(4)) for sigma in (0.01, 100.0))
    bank = MotionIMM([still, fast], [0.5, 0.5], [[0.9, 0.1], [0.1, 0.9]])
    history = follow(bank, [np.zeros(2), np.array([30.0, 0]), np.array([1e6, 0])], SENSOR, 1.0, keep=("x",), gate=0.999)
    assert history.outliers == (2,)


@pytest.mark.parametrize("gate", [0, 1, -0.5, float("nan")])
def test_a_gate_is_a_probability(gate):
    with pytest.raises(ValueError, match="gate"):
        follow(MotionKF(MODEL, np.zeros(4), np.eye(4)), ZS, SENSOR, STEPS, gate=gate)


def test_an_ensemble_has_no_gate():
    with pytest.raises(ValueError, match="gate"):
        follow(EnsembleKF(MODEL, np.zeros((4, 3)), np.eye(4)), [None], SENSOR, 1.0, gate=0.9)


@pytest.mark.parametrize("Filter", SINGLES)
def test_the_truth_gives_nees(Filter):
    truth = np.random.default_rng(2).normal(size=(4, 8))
    history = follow(Filter(MODEL, np.zeros(4), np.eye(4)), ZS, SENSOR, STEPS, truth=truth)
    again = follow(Filter(MODEL, np.zeros(4), np.eye(4)), ZS, SENSOR, STEPS)
    np.testing.assert_allclose(history.nees, [nees(truth[:, k], again.x[:, k], again.P[..., k]) for k in range(8)])
    assert "nees (8,)" in repr(history) and not hasattr(again, "nees")


@pytest.mark.parametrize("Ensemble", [EnsembleKF, EnsembleEKF])
def test_an_ensemble_is_judged_by_one_truth_or_by_one_each(Ensemble):
    truth = np.random.default_rng(2).normal(size=(4, 8, 3))
    zs = [None if z is None else z[:, None] + np.arange(3) for z in ZS]

    def judged(truth):
        return follow(Ensemble(MODEL, np.zeros((4, 3)), np.eye(4)), zs, SENSOR, STEPS, keep=("x", "P"), truth=truth)

    each, one = judged(truth), judged(truth[..., 0])
    assert each.nees.shape == one.nees.shape == (8, 3)
    np.testing.assert_allclose(each.nees, nees(truth.reshape(4, -1), each.x.reshape(4, -1), each.P.reshape(4, 4, -1)).reshape(8, 3))
    np.testing.assert_allclose(each.nees[:, 0], one.nees[:, 0])


@pytest.mark.parametrize("truth", [np.zeros((4, 7)), np.zeros((5, 8)), np.zeros((4, 8, 3)), np.full((4, 8), np.nan)])
def test_a_truth_that_does_not_fit_moves_nothing(truth):
    kf = MotionKF(MODEL, np.zeros(4), np.eye(4))
    with pytest.raises(ValueError, match="truth: expected"):
        follow(kf, ZS, SENSOR, STEPS, truth=truth)
    np.testing.assert_array_equal(kf.P, np.eye(4))

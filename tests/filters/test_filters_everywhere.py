"""The filters on models, wherever a user takes them: compasses, mounted sensors, wide headings, missed scans, wrong calls."""

import copy
import datetime
import pickle
import warnings

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, EnsembleUKF
from trackhelpers.filters import MotionEKF, MotionKF, MotionSquareRootUKF, MotionUKF
from trackhelpers.model import Model
from trackhelpers.motion import CTRV, CV, LinearModel
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar, RangeBearing

X0, P0 = np.array([4.0, 3.0, 5.0, 0.7, 0.3]), 0.1 * np.eye(5)
PAIRS = [(MotionKF, EnsembleKF), (MotionEKF, EnsembleEKF), (MotionUKF, EnsembleUKF)]
SINGLES, ENSEMBLES = zip(*PAIRS, strict=True)
SINGLES += (MotionSquareRootUKF,)
TURN = LinearModel([[1, 0.1], [0, 1]], np.diag([1e-4, 1e-4]), 0.1, ("θ", "ω"), angles=(0,))


def both(Single, Ensemble, model, x0, P0):
    return Single(model, x0, P0), Ensemble(model, np.repeat(np.asarray(x0, dtype=float)[:, None], 3, axis=1), P0)


def equal(kf, ens, atol=1e-10):
    np.testing.assert_allclose(ens.x[:, 1], kf.x, atol=atol)
    np.testing.assert_allclose(ens.P[..., 1], kf.P, atol=atol)


@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS[1:])
def test_a_compass_measures_the_short_way_round(Single, Ensemble):
    compass = LinearSensor([[0, 0, 0, 1, 0]], [[0.01]], CTRV.state)
    kf, ens = both(Single, Ensemble, CTRV(), [0, 0, 1, 3.10, 0], P0)
    kf.update(-3.10, compass)
    ens.update([[-3.10]], compass)
    assert kf.y[0] == pytest.approx(2 * np.pi - 6.2) and -np.pi <= kf.x[3] < -3.1
    equal(kf, ens)


@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS)
def test_a_linear_model_with_an_angle_wraps_it_in_every_filter(Single, Ensemble):
    kf, ens = both(Single, Ensemble, TURN, [3.0, 1.0], np.eye(2))
    compass, start = LinearSensor([[1, 0]], [[0.01]], TURN.state), 3.0
    for k in range(1, 80):
        z = (start + 0.1 * k + np.pi) % (2 * np.pi) - np.pi
        kf.predict(0.1)
        kf.update(z, compass)
        ens.predict(0.1)
        ens.update([[z]], compass)
        assert abs(kf.y[0]) < 0.2 and -np.pi <= kf.x[0] < np.pi
    equal(kf, ens)
    assert kf.x[1] == pytest.approx(1.0, abs=0.01)


def test_a_sensor_that_does_not_know_the_models_angle_is_refused():
    model = LinearModel(np.eye(2), np.eye(2), 1.0, ("course", "rate"), angles=(0,))
    sensor = LinearSensor([[1, 0]], [[0.01]], model.state)
    for kf, z in ((MotionKF(model, np.zeros(2), np.eye(2)), [0.0]), (EnsembleKF(model, np.zeros((2, 3)), np.eye(2)), [[0.0]])):
        with pytest.raises(ValueError, match=r"angles=\(0,\)"):
            kf.update(z, sensor)
        kf.update(z, LinearSensor([[1, 0]], [[0.01]], model.state, angles=(0,)))


@pytest.mark.parametrize("make", [lambda **k: Lidar(0.1, **k), lambda **k: Radar(**k), lambda **k: RangeBearing((0.3, 0.03), **k)])
def test_a_mounted_sensor_sees_what_one_at_the_origin_sees_of_the_moved_and_turned_scene(make):
    place, turn = np.array([3.0, -2.0]), 0.8
    c, s = np.cos(turn), np.sin(turn)
    here = np.array([[c, s], [-s, c]]) @ (X0[:2] - place)
    x = np.array([*here, X0[2], X0[3] - turn, X0[4]])
    mounted, plain = make(position=place, heading=turn), make()
    np.testing.assert_allclose(mounted.residual(mounted.h(X0), plain.h(x)), 0, atol=1e-12)
    h = 1e-6
    numeric = np.stack([mounted.residual(mounted.h(X0 + h * e), mounted.h(X0 - h * e)) / (2 * h) for e in np.eye(5)], axis=1)
    np.testing.assert_allclose(mounted.H(X0), numeric, atol=1e-7)


@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS)
def test_a_position_sensor_that_stands_elsewhere_gives_the_same_track(Single, Ensemble):
    model, place, rng = CV(0.5), np.array([100.0, -50.0]), np.random.default_rng(0)
    R = np.array([[0.09, 0.02], [0.02, 0.04]])
    c, s = np.cos(0.5), np.sin(0.5)
    turn = np.array([[c, s], [-s, c]])
    away, home = Position(R=turn @ R @ turn.T, state=model.state, position=place, heading=0.5), Position(R=R, state=model.state)
    (kf, ens), plain = both(Single, Ensemble, model, np.zeros(4), np.eye(4)), MotionKF(model, np.zeros(4), np.eye(4))
    for z in rng.normal(size=(20, 2)):
        seen = turn @ (z - place)
        for each, measured, sensor in ((kf, seen, away), (ens, seen[:, None], away), (plain, z, home)):
            each.predict(0.3)
            each.update(measured, sensor)
    np.testing.assert_allclose(kf.x, plain.x, atol=1e-10)
    equal(kf, ens)


def test_rows_take_a_part_of_the_measurement():
    R = np.array([[0.09, 0.002, 0], [0.002, 9e-4, 0], [0, 0, 0.09]])
    whole, bearing, two = Radar(R=R), Radar(rows=("ψ",)), Radar(R=R, rows=("ρ̇", "ψ"))
    assert bearing.names == ("ψ",) and bearing.angles == (0,) and bearing.R == pytest.approx(9e-4) and two.angles == (1,)
    np.testing.assert_array_equal(two.R, R[np.ix_([2, 1], [2, 1])])
    np.testing.assert_allclose(two.h(X0), whole.h(X0)[[2, 1]])
    np.testing.assert_allclose(two.H(X0), whole.H(X0)[[2, 1]])
    np.testing.assert_allclose(two.linearised(X0[:, None])[0][:, 0], whole.h(X0)[[2, 1]])
    kf, ens = both(MotionEKF, EnsembleEKF, CTRV(1, 0.1), X0, P0)
    kf.update(0.7, bearing)
    ens.update([[0.7]], bearing)
    equal(kf, ens)


@pytest.mark.parametrize("mask", [None, np.array([True, False, True])])
@pytest.mark.parametrize("per_run", [False, True])
@pytest.mark.parametrize("runs", [3, 150])
@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS)
def test_an_R_of_this_call_serves_one_target_all_runs_or_each(Single, Ensemble, per_run, mask, runs):
    model, rng = CV(0.5), np.random.default_rng(1)
    sensor = Position(1.0, model.state)
    root = rng.normal(size=(2, 2, runs))
    R = np.einsum("ikm,jkm->ijm", root, root) + 0.1 * np.eye(2)[..., None]
    R = R if per_run else R[..., 0]
    mask = None if mask is None else np.resize(mask, runs)
    x0, z = rng.normal(size=(4, runs)), rng.normal(size=(2, runs))
    ens = Ensemble(model, x0, np.eye(4))
    ens.predict(0.5)
    ens.update(z, sensor, mask=mask, R=R)
    for i in range(0, runs, max(1, runs // 5)):
        kf = Single(model, x0[:, i], np.eye(4))
        kf.predict(0.5)
        kf.update(None if mask is not None and not mask[i] else z[:, i], sensor, R=R[..., i] if per_run else R)
        np.testing.assert_allclose(ens.x[:, i], kf.x, atol=1e-10)
        np.testing.assert_allclose(ens.P[..., i], kf.P, atol=1e-10)
    assert np.array_equal(sensor.R, np.eye(2))


@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS[1:])
def test_correlated_noise_is_taken_as_it_is(Single, Ensemble):
    R = np.array([[0.09, 0.008, 0.02], [0.008, 9e-4, 0], [0.02, 0, 0.09]])
    kf, ens = both(Single, Ensemble, CTRV(1, 0.1), X0, P0)
    sensor = Radar(R=R)
    z = np.add(sensor.h(X0), [0.1, 0.01, -0.1])
    kf.update(z, sensor)
    ens.update(z[:, None], sensor)
    equal(kf, ens)
    plain = MotionEKF(CTRV(1, 0.1), X0, P0)
    plain.update(z, Radar(R=np.diag(np.diag(R))))
    assert np.abs(plain.x - kf.x).max() > 1e-3


def test_an_unscented_filter_keeps_a_wide_heading_wide():
    for correlation in (0.0, 0.9):
        for sd in (2.0, 3.0):
            P = np.diag([1, 1, 1, sd**2, 1.0])
            P[3, 4] = P[4, 3] = correlation * sd
            kf, ens = both(MotionUKF, EnsembleUKF, CTRV(0, 0), np.zeros(5), P)
            kf.predict(0)
            ens.predict(0)
            np.testing.assert_allclose(kf.P, P, atol=1e-12)
            equal(kf, ens)


def test_a_heading_that_nobody_knows_is_refused_at_the_start_and_warned_of_later():
    wide = np.diag([1, 1, 1, 10.0, 1])
    for make in (lambda P: MotionUKF(CTRV(2, 0.3), [1, 1, 0, 0, 0], P), lambda P: EnsembleUKF(CTRV(2, 0.3), np.ones((5, 2)), P)):
        for P in (wide, 500 * np.eye(5)):
            with pytest.raises(ValueError, match="P0: expected standard deviations up to π of angles, got θ"):
                make(P)
        kf = make(np.diag([1, 1, 1, 1, 1.0]))
        with pytest.warns(RuntimeWarning, match="θ exceeds π"):
            kf.predict(10.0)
    MotionEKF(CTRV(2, 0.3), [1, 1, 0, 0, 0], wide)


def test_sigma_points_across_a_long_gap_stay_a_covariance():
    kf, rng = MotionUKF(CTRV(2, 0.3), [1, 1, 0, 0, 0], np.eye(5)), np.random.default_rng(2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        for k in range(200):
            gap = 3.0 if k == 100 else 0.05
            kf.predict(gap)
            truth = np.array([1 + 0.3 * k, 1, 6, 0, 0])
            sensor = Lidar() if k % 2 else Radar()
            kf.update(sensor.h(truth) + np.sqrt(np.diag(sensor.R)) * rng.standard_normal(sensor.m), sensor)
            assert np.linalg.eigvalsh(kf.P)[0] > 0


@pytest.mark.parametrize("Single", SINGLES)
def test_a_missed_scan_needs_no_sensor_and_leaves_nothing_of_an_older_one(Single):
    model = CV(0.5)
    kf = Single(model, np.zeros(4), np.eye(4))
    kf.predict(0.1)
    kf.update([1, 1], Position(0.3, model.state))
    assert kf.log_likelihood < 0 and kf.mahalanobis > 0
    kf.predict(0.1)
    kf.update(None)
    assert (kf.z, kf.y.size, kf.log_likelihood, kf.likelihood, kf.mahalanobis) == (None, 0, 0.0, 1.0, 0.0)
    assert "log-likelihood" in repr(kf)


@pytest.mark.parametrize("Ensemble", ENSEMBLES)
def test_an_ensemble_that_misses_a_scan_needs_no_sensor(Ensemble):
    ens = Ensemble(CV(0.5), np.zeros((4, 3)), np.eye(4))
    ens.predict(0.1)
    before = ens.x
    ens.update(None)
    assert np.array_equal(ens.x, before) and ens.y.shape == (0, 3)


@pytest.mark.parametrize("Single", SINGLES)
def test_the_log_likelihood_is_scipys(Single):
    from scipy.stats import multivariate_normal

    kf = Single(CV(0.5), np.zeros(4), np.eye(4))
    kf.update([1.0, -0.5], Position((0.3, 0.4), CV().state))
    assert kf.log_likelihood == pytest.approx(multivariate_normal(np.zeros(2), kf.S).logpdf(kf.y), rel=1e-12)


@pytest.mark.parametrize("Single", SINGLES)
@pytest.mark.parametrize("name", ["rts_smoother", "batch_filter"])
def test_inherited_methods_that_would_take_a_placeholder_refuse_by_name(Single, name):
    kf = Single(CV(0.5), np.zeros(4), np.eye(4))
    with pytest.raises(NotImplementedError, match=rf"{name}.*trackhelpers.follow"):
        getattr(kf, name)(None, None)


NEAR = Position(1.0, CV().state)
WRONG = {
    "a masked measurement": lambda kf: kf.update(np.ma.array([1.0, -999.0], mask=[False, True]), NEAR),
    "no number": lambda kf: kf.update(["1", "2"], NEAR),
    "complex": lambda kf: kf.update([1j, 2], NEAR),
    "an infinite one": lambda kf: kf.update([np.inf, 2], NEAR),
    "R of another size": lambda kf: kf.update([1, 2], NEAR, R=np.eye(3)),
    "R that is none": lambda kf: kf.update([1, 2], NEAR, R=[[1, 2], [2, 1]]),
    "seconds as a time": lambda kf: kf.predict(np.timedelta64(5, "ns")),
    "a timedelta": lambda kf: kf.predict(datetime.timedelta(seconds=1)),
    "no sensor": lambda kf: kf.update([1, 2]),
    "nothing to weigh": lambda kf: (setattr(kf, "P", np.zeros((4, 4))), kf.update([1, 2], NEAR, R=np.zeros((2, 2)))),
}


@pytest.mark.parametrize("Single", SINGLES)
@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_a_refused_call_changes_no_attribute(Single, call):
    kf = Single(CV(0.5), np.zeros(4), np.eye(4))
    kf.predict(0.1)
    kf.update([1.0, 1.0], NEAR)
    if call is WRONG["nothing to weigh"]:
        kf.P = np.zeros((4, 4))
    before = {name: copy.deepcopy(value) for name, value in kf.__dict__.items() if not callable(value)}
    with pytest.raises(ValueError):
        call(kf)
    assert set(before) == {name for name, value in kf.__dict__.items() if not callable(value)}
    for name, value in before.items():
        if isinstance(value, np.ndarray) or np.isscalar(value):
            np.testing.assert_array_equal(kf.__dict__[name], value, err_msg=name)


@pytest.mark.parametrize("Single", SINGLES)
def test_a_target_at_the_radar_or_nothing_to_weigh_is_said_in_words(Single):
    kf = Single(CV(0.5), np.zeros(4), np.zeros((4, 4)))
    with pytest.raises(ValueError, match="S: expected a positive definite innovation covariance"):
        kf.update([0, 0], NEAR, R=np.zeros((2, 2)))
    if Single is MotionEKF:
        before = kf.R
        with pytest.raises(ValueError, match="range 0"):
            kf.update([1, 0, 0], Radar(state=CV().state))
        assert kf.R is before


@pytest.mark.parametrize("make", [Lidar, Radar, lambda **k: RangeBearing((1, 0.1), **k)], ids=["Lidar", "Radar", "RangeBearing"])
def test_sensors_in_the_plane_refuse_a_height_that_they_would_ignore(make):
    with pytest.raises(ValueError, match="z"):
        make(state=CV(axes=3).state)


@pytest.mark.parametrize("Single", SINGLES)
def test_a_filter_may_be_pickled_and_copied_and_goes_on_alike(Single):
    model = CV(0.5)
    kf = Single(model, np.zeros(4), np.eye(4))
    kf.predict(0.1)
    kf.update([1, 1], NEAR)
    for other in (pickle.loads(pickle.dumps(kf)), copy.deepcopy(kf)):
        one = copy.copy(kf)
        for each in (one, other):
            each.predict(0.2)
            each.update([1.5, 1.0], Position(1.0, model.state))
        np.testing.assert_array_equal(other.x, one.x)
        np.testing.assert_array_equal(other.P, one.P)


def test_a_state_that_was_set_by_hand_redraws_the_sigma_points():
    kf, other = (MotionUKF(CV(0.5), np.zeros(4), np.eye(4)) for _ in range(2))
    for each in (kf, other):
        each.predict(0.5)
        each.P[0, 0] = 9.0  # in place
    other.sigmas_f = other.sigmas_f * np.nan
    for each in (kf, other):
        each.update([1, 1], NEAR)
    np.testing.assert_array_equal(kf.x, other.x)


@pytest.mark.parametrize(("Single", "Ensemble"), PAIRS[1:])
def test_nees_knows_the_models_angles(Single, Ensemble):
    kf, ens = both(Single, Ensemble, CTRV(), [0, 0, 1, 3.13, 0], P0)
    truth = [0, 0, 1, -3.13, 0]
    assert kf.nees(truth) == pytest.approx((2 * np.pi - 6.26) ** 2 / 0.1)
    np.testing.assert_allclose(ens.nees(truth), kf.nees(truth))
    assert kf.estimate is kf.x and kf.estimate_P is kf.P


def test_the_ensemble_is_not_evensens():
    assert "Evensen" in EnsembleKF.__doc__ and issubclass(CV, Model)


MASKED = np.ma.array([[1.0, 2.0, -999.0], [1.0, 2.0, 3.0]], mask=[[False, False, True], [False] * 3])


@pytest.mark.parametrize("Ensemble", ENSEMBLES)
@pytest.mark.parametrize(
    "call",
    [
        lambda ens: ens.update(MASKED, NEAR),
        lambda ens: ens.update(MASKED.astype(complex), NEAR),
        lambda ens: ens.update([["1"] * 3] * 2, NEAR),
        lambda ens: ens.predict(np.timedelta64(1, "s")),
        lambda ens: type(ens)(ens.model, np.ma.array(np.ones((4, 3)), mask=np.eye(4, 3)), np.eye(4)),
        lambda ens: ens.nees(np.ma.array(np.ones(4), mask=[True, False, False, False])),
    ],
)
def test_what_stands_behind_a_mask_is_no_number_of_an_ensemble_either(Ensemble, call):
    ens = Ensemble(CV(0.5), np.zeros((4, 3)), np.eye(4))
    ens.predict(0.1)
    before = ens.x, ens.P.copy()
    with pytest.raises(ValueError):
        call(ens)
    assert ens.x is before[0] and np.array_equal(ens.P, before[1])


@pytest.mark.parametrize("make", [lambda bad: LinearSensor(bad, np.eye(2), ("a", "b")), lambda bad: Position(R=bad, state=CV().state)])
def test_nor_of_a_sensor(make):
    with pytest.raises(ValueError, match=r"masked|H|R"):
        make(np.ma.array(np.eye(2), mask=[[True, False], [False, False]]))

"""Defaults, edges and bookkeeping of the filters: what a user reads off a filter, sets on it, or is refused."""

import inspect

import numpy as np
import pytest
from filterpy.kalman import JulierSigmaPoints, MerweScaledSigmaPoints, SimplexSigmaPoints
from scipy.stats import chi2, multivariate_normal

from trackhelpers import filters
from trackhelpers.consistency import nees
from trackhelpers.filters import (
    AugmentedBiasKF,
    InputEstimationKF,
    ManoeuvreIMM,
    MatrixKF,
    MotionEKF,
    MotionIMM,
    MotionKF,
    MotionSquareRootUKF,
    MotionUKF,
    SquareRootUKF,
    StrongTrackingKF,
    VariableDimensionKF,
    VarianceInflationKF,
    cholupdate,
)
from trackhelpers.filters.base import inverse_of_S
from trackhelpers.filters.factors import lower_root, triangular
from trackhelpers.filters.imm import embedding, mixture, weighed
from trackhelpers.filters.motion_ukf import check_sigma_points, upper_root
from trackhelpers.filters.square_root_ukf import _regular
from trackhelpers.filters.strong_tracking import axes_seen, faded, fading_factor, innovation_spread
from trackhelpers.filters.variance_inflation import inflated
from trackhelpers.manoeuvre import fading_limit
from trackhelpers.motion import CA, CTRV, CV
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar

REST, TURN, CURVE = CV(0.3), CA(0.3), CTRV(1.0, 0.2)
F, Q, G = (getattr(REST, name)(np.zeros(4), 1.0) for name in "FQG")
H, R = np.eye(4)[[0, 2]], np.array([[3.0, 1.0], [1.0, 2.0]])
X0, P0 = np.array([0.0, 5.0, 0.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0]) + 0.2
CHAIN = np.array([[0.9, 0.1], [0.3, 0.7]])
NEAR = Position(R=R, state=REST.state)


def everything(kf):
    """All attributes, of the filters of a bank too."""
    return [each.__dict__.copy() for each in (kf, *getattr(kf, "filters", ()))]


def unchanged(kf, before):
    return all(
        each.__dict__.keys() == then.keys() and all(each.__dict__[name] is then[name] for name in then)
        for each, then in zip((kf, *getattr(kf, "filters", ())), before, strict=True)
    )


def make(name, **more):
    matrices, pair = (F, H, Q, R, X0, P0), (REST, TURN, R, 1.0, X0, P0)
    return {
        "plain": lambda: MatrixKF(*matrices),
        "bias": lambda: AugmentedBiasKF(F, H, Q, R, Q, X0, P0),
        "strong": lambda: StrongTrackingKF(*matrices, **more),
        "inflation": lambda: VarianceInflationKF(*matrices, **more),
        "input": lambda: InputEstimationKF(F, G, H, Q, R, X0, P0, **more),
        "dimension": lambda: VariableDimensionKF(*pair, **more),
        "interacting": lambda: ManoeuvreIMM(*pair, **more),
        "KF": lambda: MotionKF(REST, X0, P0),
        "EKF": lambda: MotionEKF(REST, X0, P0, **more),
        "UKF": lambda: MotionUKF(REST, X0, P0, **more),
        "root": lambda: MotionSquareRootUKF(REST, X0, P0, **more),
        "bank": lambda: MotionIMM([MotionKF(CV(s), X0, P0) for s in (0.1, 2.0)], [0.8, 0.2], CHAIN),
    }[name]()


# --- what is not named


def test_what_is_not_named_is_what_is_documented():
    strong, inflation, given, dimension, imm = (make(name) for name in ("strong", "inflation", "input", "dimension", "interacting"))
    assert (strong.beta, strong.rho, strong.factors, strong.V, strong.fading) == (4.0, 0.95, "one", None, 1.0)
    assert (inflation.inflation, inflation.window, inflation.statistic, inflation.manoeuvring) == (100.0, 5, 0.0, False)
    assert inflation.limit == fading_limit(2, 5, 0.999)
    assert (given.window, given.changes, given.u.tolist()) == (10, 0, [0.0, 0.0])
    assert given.limit == pytest.approx(chi2.ppf(0.9999, 2))
    assert (dimension.window, dimension.manoeuvring, dimension.statistic) == (5, False, 0.0)
    assert dimension.enter_limit == fading_limit(2, 5, 0.999) and dimension.leave_limit == pytest.approx(chi2.ppf(0.95, 10))
    assert imm.mu.tolist() == [0.9, 0.1] and imm.M.tolist() == [[0.98, pytest.approx(0.02)], [pytest.approx(0.02), 0.98]]
    assert make("EKF").iterations == 1 and make("root").form == "qr"
    for name in ("UKF", "root"):
        kf = make(name)
        np.testing.assert_allclose(kf.Wm, [0.0, *[1 / 8] * 8], atol=1e-15)
        np.testing.assert_allclose(kf.Wc, [2.0, *[1 / 8] * 8], atol=1e-15)
    kf = make("UKF", alpha=0.5, beta=1.0, kappa=2.0)  # spread 0.25 · 6
    np.testing.assert_allclose(kf.Wm, [1 - 4 / 1.5, *[1 / 3] * 8])
    assert kf.Wc[0] == pytest.approx(1 - 4 / 1.5 + 1 - 0.25 + 1)


def test_only_filters_with_the_covariances_of_one_model_are_smoothed():
    assert all(make(name).smoothable for name in ("plain", "bias", "KF", "EKF", "UKF", "root"))
    assert not any(make(name).smoothable for name in ("strong", "inflation", "input", "dimension", "interacting", "bank"))


@pytest.mark.parametrize("name", ["plain", "strong", "inflation", "input", "dimension", "interacting", "KF", "EKF", "UKF", "root", "bank"])
def test_a_start_is_ones_own_copy_and_without_evidence(name):
    kf = make(name)
    assert np.array_equal(kf.estimate, X0) and np.allclose(kf.estimate_P, P0)
    assert np.array_equal(kf.x_prior, kf.x) and np.array_equal(kf.P_post, kf.P) and kf.x_prior is not kf.x
    if name != "bank":
        assert kf.z is None and kf.y.shape == (0,) and kf.S.shape == kf.SI.shape == (0, 0) and kf.K.shape == (len(kf.x), 0)
    assert kf.log_likelihood == 0


@pytest.mark.parametrize("name", ["plain", "strong", "inflation", "input", "dimension", "KF", "EKF", "UKF", "root"])
def test_after_an_update_the_moments_before_and_after_can_be_read(name):
    kf, update = make(name), (lambda kf, z: kf.update(z, NEAR)) if name in ("KF", "EKF", "UKF", "root") else (lambda kf, z: kf.update(z))
    kf.predict(*([1.0] if name in ("KF", "EKF", "UKF", "root") else []))
    x, P = kf.x.copy(), kf.P.copy()
    np.testing.assert_allclose(x, F @ X0)
    np.testing.assert_allclose(P, F @ P0 @ F.T + Q, atol=1e-12)
    update(kf, [5.5, 4.0])
    np.testing.assert_allclose(kf.x_prior, x, atol=1e-12)
    np.testing.assert_allclose(kf.P_prior, P, atol=1e-12)
    assert np.array_equal(kf.x_post, kf.x) and np.array_equal(kf.P_post, kf.P) and kf.z.tolist() == [5.5, 4.0]
    np.testing.assert_allclose(kf.y, [0.5, -1.0], atol=1e-12)
    np.testing.assert_allclose(kf.S, H @ P @ H.T + R, atol=1e-11)
    np.testing.assert_allclose(kf.SI @ kf.S, np.eye(2), atol=1e-11)
    np.testing.assert_allclose(kf.K, P @ H.T @ np.linalg.inv(kf.S), atol=1e-11)
    assert kf.log_likelihood == pytest.approx(multivariate_normal(np.zeros(2), kf.S).logpdf(kf.y))
    assert kf.likelihood == pytest.approx(np.exp(kf.log_likelihood))
    assert kf.mahalanobis == pytest.approx(np.sqrt(kf.y @ np.linalg.solve(kf.S, kf.y)))


# --- refusals change nothing


@pytest.mark.parametrize("name", ["KF", "EKF", "UKF", "root", "bank"])
def test_a_prediction_or_a_measurement_that_is_refused_half_way_changes_no_attribute(name):
    kf, other = make(name), LinearSensor(H, R, REST.state)
    kf.predict(0.5)
    kf.update([1.0, 2.0], NEAR)
    before = everything(kf)
    for z, R_, sensor in (([1.0, np.nan], None, other), ([1.0], None, other), ([1.0, 2.0], -np.eye(2), other), ([1.0, 2.0], None, Lidar())):
        with pytest.raises(ValueError):
            kf.update(z, sensor, R=R_)
        assert unchanged(kf, before)
    with pytest.raises(ValueError, match="dt"):
        kf.predict(-1.0)
    assert unchanged(kf, before)


@pytest.mark.parametrize("name", ["plain", "KF", "UKF", "bank", "interacting"])
def test_a_covariance_of_another_size_that_was_set_by_hand_fails_and_changes_nothing(name):
    kf = make(name)
    for each in getattr(kf, "filters", [kf])[-1:]:
        each.P = np.eye(9)
    before = everything(kf)
    with pytest.raises(Exception, match=r"\d"):
        kf.predict(*([] if name in ("plain", "interacting") else [0.5]))
    assert unchanged(kf, before)


def test_an_indefinite_covariance_that_was_set_by_hand_is_named():
    kf = make("UKF")
    kf.P = -np.eye(4)
    before = everything(kf)
    with pytest.raises(ValueError, match="P: expected a positive semidefinite covariance, got smallest eigenvalue -1"):
        kf.predict(0.5)
    assert unchanged(kf, before)


def test_a_sensor_is_looked_at_again_for_another_model():
    for name in ("KF", "EKF", "UKF"):
        kf = make(name)
        kf.update([1.0, 1.0], NEAR)
        kf.model = CA(0.3)
        with pytest.raises(ValueError, match="sensor: expected one made with"):
            kf.update([1.0, 1.0], NEAR)
    kf = make("KF")
    kf.update([1.0, 1.0], NEAR)
    with pytest.raises(ValueError, match="sensor: expected a linear sensor"):
        kf.update([1.0, 1.0, 1.0], Radar(state=REST.state))
    with pytest.raises(ValueError, match="model: expected a linear model"):
        MotionKF(CURVE, np.zeros(5), np.eye(5))


def test_a_linear_filter_follows_another_step_model_and_sensor():
    kf, mounted = make("KF"), Position(1.0, REST.state, position=(3.0, 4.0))
    for dt, model in ((0.5, REST), (0.25, REST), (0.25, CV(9.0)), (0.0, REST)):
        kf.model = model
        x, P = kf.x, kf.P
        kf.predict(dt)
        np.testing.assert_allclose(kf.x, model.F(x, dt) @ x)
        np.testing.assert_allclose(kf.P, model.F(x, dt) @ P @ model.F(x, dt).T + model.Q(x, dt))
    kf.update([1.0, 2.0], NEAR)
    x = kf.x
    kf.update([1.0, 2.0], mounted)
    np.testing.assert_allclose(kf.y, np.array([4.0, 6.0]) - x[[0, 2]])
    assert kf.z.tolist() == [1.0, 2.0] and np.array_equal(kf.R, np.eye(2))


def test_the_nees_folds_where_it_is_asked_to():
    for kind in (MotionEKF, MotionUKF):
        kf = kind(CURVE, [0, 0, 5.0, 0.2, 0.1], np.diag([1, 1, 0.5, 0.1, 0.1]))
        truth = np.array([0.5, 0, 5.5, 0.3, 0.1])
        backwards = np.array([0.5, 0, -5.5, 0.3 - np.pi, 0.1])
        assert kf.nees(backwards, fold=True) == pytest.approx(kf.nees(truth)) == pytest.approx(nees(truth, kf.x, kf.P, (3,)))
        assert kf.nees(backwards) > 100


def test_constant_matrices_of_one_row_and_none():
    given = {"F": F.copy(), "H": H[0].copy(), "x0": X0.copy()}
    kf = MatrixKF(**given, Q=Q, R=[[1.0]], P0=P0)
    for array in given.values():
        array[:] = 7.0
    assert np.array_equal(kf.F, F) and np.array_equal(kf.H, H[:1]) and np.array_equal(kf.x, X0)
    for x0, rows, got in (([], np.zeros((1, 0)), "0 and 1"), (X0, np.zeros((0, 4)), "4 and 0")):
        with pytest.raises(ValueError, match=f"x0, H: expected a state and a measurement of one component or more, got {got}"):
            MatrixKF(np.eye(len(x0)), rows, np.eye(len(x0)), np.eye(len(rows)), x0, np.eye(len(x0)))


def test_an_innovation_covariance_is_singular_up_to_rounding():
    S = np.array([[4.0, 1.0], [1.0, 1e-8]]) + np.diag([0, 1.0])
    np.testing.assert_allclose(inverse_of_S(S), np.linalg.inv(S))
    for c in (1 - 1e-12, 1 - 1e-16):
        S = np.array([[1.0, c], [c, 1.0]])
        if c < 1 - 1e-13:
            np.testing.assert_allclose(inverse_of_S(S), np.linalg.inv(S))
        else:
            with pytest.raises(ValueError, match="S: expected a positive definite innovation covariance"):
                inverse_of_S(S)


# --- the filters for manoeuvring targets


def test_a_spread_of_innovations_begins_with_the_first_in_every_run():
    V, y = np.full((2, 2, 2), np.nan), np.array([[1.0, 2.0], [3.0, -1.0]])
    V[..., 1] = [[1.0, 0.5], [0.5, 2.0]]
    found = innovation_spread(V, y, 0.5)
    np.testing.assert_allclose(found[..., 0], [[1, 3], [3, 9]])
    np.testing.assert_allclose(found[..., 1], (0.5 * V[..., 1] + [[4, -2], [-2, 1]]) / 1.5)
    np.testing.assert_allclose(innovation_spread(None, y[:, 0], 0.5), [[1, 3], [3, 9]])
    assert fading_factor(3.0, 2.0) == 1.5 and fading_factor(1.0, 2.0) == 1.0 and fading_factor(1.0, -2.0) == 1.0
    assert fading_factor([3.0, 3.0], [2.0, 0.0]).tolist() == [1.5, 1.0]


def test_a_covariance_fades_by_its_definition_with_a_noise_of_its_own():
    moved, V = F @ P0 @ F.T, np.array([[90.0, 3.0], [3.0, 70.0]])
    N, M = np.diag(V - H @ Q @ H.T - 2 * R), np.diag(H @ moved @ H.T)
    fading, P = faded(moved, V, H, Q, R, 2.0)
    assert fading == pytest.approx(N.sum() / M.sum())
    np.testing.assert_allclose(P, fading * moved + Q)
    fading, P = faded(moved, V, H, Q, R, 2.0, axes_seen(F, H))
    D = np.diag(np.sqrt((N / M)[[0, 0, 1, 1]]))
    np.testing.assert_allclose(fading, N / M)
    np.testing.assert_allclose(P, D @ moved @ D + Q)
    assert axes_seen(F, H, "one") is None
    runs = faded(moved[..., None] * [1.0, 2.0], V[..., None] * [1.0, 3.0], H, Q, R[..., None] * [1.0, 0.5], 2.0)
    assert runs[0].shape == (2,) and runs[1].shape == (4, 4, 2)
    for r, (a, b, c) in enumerate(((1.0, 1.0, 1.0), (2.0, 3.0, 0.5))):
        alone = faded(a * moved, b * V, H, Q, c * R, 2.0)
        np.testing.assert_allclose(runs[0][r], alone[0])
        np.testing.assert_allclose(runs[1][..., r], alone[1])


def test_a_second_measurement_finds_the_covariance_already_fading():
    kf = make("strong", beta=0.5)
    for z in ([40.0, 3.0], [60.0, 4.0]):
        kf.predict()
        kf.update(z)
    fading, prior, P, V = kf.fading, kf.P_prior, kf.P, kf.V
    assert fading > 1
    kf.update([70.0, 4.0])
    assert kf.fading == fading and not np.array_equal(kf.V, V)
    S = H @ P @ H.T + R
    np.testing.assert_allclose(kf.P, P - P @ H.T @ np.linalg.inv(S) @ H @ P, atol=1e-12)
    assert np.array_equal(kf.P_prior, prior)


def test_noise_is_inflated_where_a_target_manoeuvres():
    P, noise = np.eye(2), np.array([[2.0, 1.0], [1.0, 3.0]])
    np.testing.assert_array_equal(inflated(P, noise, True, 5.0), P + 4 * noise)
    np.testing.assert_array_equal(inflated(P, noise, False, 5.0), P)
    np.testing.assert_array_equal(inflated(P[..., None], noise[..., None], np.array([True, False]), 5.0)[..., 1], P)


def test_a_manoeuvre_at_once_inflates_the_noise_of_the_first_step():
    kf = make("inflation", inflation=11.0)
    kf.predict()
    kf.update([500.0, 5.0])
    P = F @ P0 @ F.T + 11 * Q
    assert kf.manoeuvring
    np.testing.assert_allclose(kf.P_prior, P)
    np.testing.assert_allclose(kf.S, H @ P @ H.T + R)


def test_a_method_that_undoes_what_fails_keeps_its_name_and_its_words():
    for cls in (MotionKF, MotionUKF, MatrixKF, ManoeuvreIMM, MotionIMM, SquareRootUKF):
        assert cls.update.__name__ == "update" and cls.update.__doc__.startswith("Correct ")
    assert list(inspect.signature(MotionKF.update).parameters) == ["self", "z", "sensor", "R"]


def alarmed(**more):
    """A filter of variable dimension right after its alarm, and the measurements up to there."""
    kf, zs = make("dimension", window=3, **more), []
    while not kf.manoeuvring:
        k = len(zs) + 1
        zs.append([5.0 * k + 4.0 * k**2, 5.0 * k])
        kf.predict()
        x, P = kf.x, kf.P
        kf.update(zs[-1])
    return kf, zs, x, P


def test_at_the_alarm_the_innovation_is_that_of_the_model_that_predicted_it():
    kf, zs, x, P = alarmed()
    assert len(zs) == 4  # of window + 1 measurements the first begins the manoeuvre
    np.testing.assert_allclose(kf.y, zs[-1] - H @ x)
    np.testing.assert_allclose(kf.S, H @ P @ H.T + R)
    np.testing.assert_allclose(kf.SI, np.linalg.inv(kf.S))
    assert kf.statistic == 0.0 and kf.x.shape == kf.x_post.shape == (6,) and kf.dim_x == 6 and kf.F.shape == (6, 6)
    assert np.array_equal(kf.x_post, kf.x) and np.array_equal(kf.estimate, kf.x[[0, 1, 3, 4]])
    assert np.array_equal(kf.estimate_P, kf.P[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])])


def test_a_manoeuvre_ends_after_a_window_in_which_no_acceleration_was_significant():
    kf, zs, _, _ = alarmed(leave=1 - 1e-12)  # everything is insignificant, as soon as there are three of them
    k = len(zs)
    for more in range(1, 4):
        assert kf.manoeuvring
        kf.predict()
        before = kf.x_prior.copy(), kf.P_prior.copy()
        kf.x[[2, 5]] = 0.0
        kf.update([5.0 * (k + more) + 4.0 * (k + more) ** 2, 5.0 * (k + more)])
    assert not kf.manoeuvring and kf.x.shape == (4,) and kf.statistic == 0.0 and kf.dim_x == 4 and kf.H.shape == (2, 4)
    np.testing.assert_array_equal(kf.x_prior[2:], before[0][3:5])
    np.testing.assert_array_equal(kf.P_prior, before[1][np.ix_([0, 1, 3, 4], [0, 1, 3, 4])])
    assert np.array_equal(kf.x_post, kf.x) and np.array_equal(kf.P_post, kf.P)
    for _ in range(4):  # there is no alarm before window + 1 measurements
        assert not kf.manoeuvring
        kf.predict()
        kf.update(kf.x[[0, 2]] + 1000.0)
    assert kf.manoeuvring


def test_a_change_of_the_input_is_found_once_and_the_window_begins_anew():
    kf, changes = make("input", window=4, probability=0.99), []
    for k in range(1, 13):
        kf.predict()
        kf.update([5.0 * k + 10.0 * k**2, 5.0 * k])
        changes.append(kf.changes)
        assert np.array_equal(kf.x_post, kf.x) and np.array_equal(kf.P_post, kf.P)
    assert changes[:4] == [0, 0, 0, 1] and changes[6] == 1  # the next one is found four measurements later at the earliest
    np.testing.assert_allclose(kf.u, [20.0, 0.0], atol=2.0)


def test_mixtures_of_one_target_and_of_runs():
    xs, Ps = (np.array([1.0, 2.0]), np.array([3.0, -1.0])), (np.eye(2), np.diag([2.0, 5.0]))
    x, P = mixture((0.25, 0.75), xs, Ps)
    apart = [a - x for a in xs]
    np.testing.assert_allclose(x, [2.5, -0.25])
    np.testing.assert_allclose(P, sum(w * (C + np.outer(d, d)) for w, C, d in zip((0.25, 0.75), Ps, apart, strict=True)))
    ahead, logs = np.array([[0.5, 0.9, 1.0], [0.5, 0.1, 0.0]]), np.array([[-1.0, -2000.0, 3.0], [-2.0, -1000.0, 9.0]])
    mu, total = weighed(ahead, logs)
    np.testing.assert_allclose(mu, [[1 / (1 + np.exp(-1)), 0, 1], [1 / (1 + np.e), 1, 0]], atol=1e-12)
    np.testing.assert_allclose(total, [np.log(0.5 * np.exp(-1) + 0.5 * np.exp(-2)), -1000 + np.log(0.1), 3.0])
    for r in range(3):
        alone = weighed(ahead[:, r], logs[:, r])
        np.testing.assert_allclose(alone[0], mu[:, r])
        assert alone[1] == pytest.approx(total[r])
    E = embedding(CV(1.0, axes=1), CA(1.0, axes=1))
    assert E.tolist() == [[1, 0], [0, 1], [0, 0]]


def test_interacting_models_report_each_likelihood_and_the_mixtures_innovation():
    imm = make("interacting", stay=(0.9, 0.8), mu=(0.6, 0.4))
    assert imm.M.tolist() == [[0.9, pytest.approx(0.1)], [pytest.approx(0.2), 0.8]] and imm.likelihood.tolist() == [1.0, 1.0]
    imm.predict()
    np.testing.assert_allclose(imm.mu, [0.6 * 0.9 + 0.4 * 0.2, 0.6 * 0.1 + 0.4 * 0.8])
    np.testing.assert_allclose(imm.omega.sum(axis=0), [1, 1])
    x, P = imm.x, imm.P
    own = np.array([[5.0, -1.0], [-1.0, 4.0]])
    imm.update([9.0, 4.0], R=own)
    rows = np.eye(6)[[0, 3]]
    np.testing.assert_allclose(imm.y, [9.0, 4.0] - rows @ x)
    np.testing.assert_allclose(imm.S, rows @ P @ rows.T + own)
    np.testing.assert_allclose(imm.SI, np.linalg.inv(imm.S))
    assert imm.likelihood.max() == 1.0 and imm.z.tolist() == [9.0, 4.0]
    assert np.log(imm.likelihood[0] / imm.likelihood[1]) == pytest.approx(imm.filters[0].log_likelihood - imm.filters[1].log_likelihood)
    assert imm.mahalanobis == pytest.approx(np.sqrt(imm.y @ imm.SI @ imm.y))
    assert np.array_equal(imm.x_post, imm.x) and np.array_equal(imm.P_post, imm.P)
    imm.update(None)
    assert imm.likelihood.tolist() == [1.0, 1.0] and imm.log_likelihood == 0


# --- interacting models of any kind


def curves(headings=(0.1, 0.5, -0.3)):
    return [
        MotionEKF(CTRV(s, 0.1 * s), [0, 0, 5.0, heading, 0.1], np.diag([1, 2, 0.5, 0.1, 0.05]) + 0.01)
        for s, heading in zip((0.5, 1.0, 3.0), headings, strict=True)
    ]


THREE = np.array([[0.8, 0.15, 0.05], [0.1, 0.8, 0.1], [0.0, 0.3, 0.7]])


def test_three_models_are_mixed_by_hand():
    imm, mu = MotionIMM(curves(), [0.5, 0.3, 0.2], THREE), np.array([0.5, 0.3, 0.2])
    xs, Ps = [kf.x for kf in imm.filters], [kf.P for kf in imm.filters]
    after = mu @ THREE
    assert imm.N == 3 and imm.state == CURVE.state
    imm.predict(0.2)
    np.testing.assert_allclose(imm.mu, after)
    np.testing.assert_allclose(imm.omega, THREE * mu[:, None] / after)
    for j, kf in enumerate(imm.filters):
        w = THREE[:, j] * mu / after[j]
        x = sum(a * b for a, b in zip(w, xs, strict=True))
        P = sum(a * (C + np.outer(b - x, b - x)) for a, b, C in zip(w, xs, Ps, strict=True))
        np.testing.assert_allclose(kf.x, kf.model.f(x, 0.2), atol=1e-12)
        np.testing.assert_allclose(kf.P, kf.model.F(x, 0.2) @ P @ kf.model.F(x, 0.2).T + kf.model.Q(x, 0.2), atol=1e-12)
    assert np.array_equal(imm.x_prior, imm.x) and imm.x_prior is not imm.x
    own = np.array([[0.5, 0.1], [0.1, 0.4]])
    imm.update([1.2, 0.3], Lidar(), R=own)
    assert all(np.array_equal(kf.R, own) for kf in imm.filters) and imm.z.tolist() == [1.2, 0.3]
    densities = np.exp([kf.log_likelihood for kf in imm.filters])
    np.testing.assert_allclose(imm.mu, after * densities / (after @ densities))
    np.testing.assert_allclose(imm.likelihood, densities / densities.max())
    assert imm.log_likelihood == pytest.approx(np.log(after @ densities)) and imm.likelihood.max() == 1
    np.testing.assert_allclose(imm.x, sum(m * kf.x for m, kf in zip(imm.mu, imm.filters, strict=True)), atol=1e-12)
    assert np.array_equal(imm.x_post, imm.x) and np.array_equal(imm.P_post, imm.P)
    imm.update(None)
    assert imm.z is None


def test_common_components_are_those_that_all_have_and_what_is_left_keeps_its_regression():
    straight = MotionKF(CV(0.3), X0, P0)
    quick = MotionKF(CA(0.3), [1.0, 4.0, 0.5, 1.0, 6.0, -0.5], np.diag([3.0, 2, 1, 3, 2, 1]) + 0.3)
    imm = MotionIMM([straight, quick], [0.6, 0.4], CHAIN)
    assert imm.state == ("x", "vx", "y", "vy")
    kept = [0, 1, 3, 4]
    after = np.array([0.6, 0.4]) @ CHAIN
    w = CHAIN[:, 1] * [0.6, 0.4] / after[1]
    means, Cs = [straight.x, quick.x[kept]], [straight.P, quick.P[np.ix_(kept, kept)]]
    c = w[0] * means[0] + w[1] * means[1]
    C = sum(a * (S + np.outer(m - c, m - c)) for a, m, S in zip(w, means, Cs, strict=True))
    A = quick.P[:, kept] @ np.linalg.inv(Cs[1])
    x, P = quick.x + A @ (c - means[1]), quick.P + A @ (C - Cs[1]) @ A.T + quick.model.Q(quick.x, 0.0)
    imm.predict(0.0)
    np.testing.assert_allclose(quick.x, x, atol=1e-10)
    np.testing.assert_allclose(quick.P, P, atol=1e-10)
    np.testing.assert_allclose(quick.x[kept], c, atol=1e-12)
    only = MotionIMM([MotionKF(CV(0.3), X0, P0), MotionKF(CA(0.3), quick.x, quick.P)], [0.6, 0.4], CHAIN, common=("y", "x"))
    assert only.state == ("y", "x") and only.x.shape == (2,)
    np.testing.assert_allclose(only.x, 0.6 * X0[[2, 0]] + 0.4 * quick.x[[3, 0]])


def test_a_map_of_ones_own_components_is_no_map():
    def two(maps):
        return MotionIMM([MotionKF(CV(s), X0 + s, P0 + s) for s in (0.1, 2.0)], [0.7, 0.3], CHAIN, common=REST.state, maps=maps)

    plain, mapped = two(None), two([None, (lambda x: x, lambda c, x: c)])
    for z in (None, [3.0, 4.0], [8.0, 11.0]):
        for name in ("x", "P", "mu"):
            np.testing.assert_allclose(getattr(mapped, name), getattr(plain, name), rtol=1e-6, atol=1e-6)
        for imm in (plain, mapped):
            imm.predict(0.5)
            imm.update(z, NEAR)
    np.testing.assert_allclose(mapped.filters[1].P, plain.filters[1].P, rtol=1e-5, atol=1e-6)
    half = MotionIMM(
        [MotionKF(CV(s), X0, P0) for s in (0.1, 2.0)],
        [0.7, 0.3],
        CHAIN,
        common=("p", "q"),
        maps=[(lambda x: np.stack([2 * x[0], x[3]]), lambda c, x: np.array([c[0] / 2, x[1], x[2], c[1]]))] * 2,
    )
    J = np.array([[2.0, 0, 0, 0], [0, 0, 0, 1.0]])
    np.testing.assert_allclose(half.x, J @ X0)
    np.testing.assert_allclose(half.P, J @ P0 @ J.T, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"filters": [make("KF")]}, "filters: expected a sequence of two filters on models or more"),
        ({"filters": [make("KF"), make("plain")]}, "filters: expected a sequence of two filters"),
        ({"filters": make("KF")}, "filters: expected a sequence of two filters"),
        ({"maps": [None] * 3}, "maps: expected 2, one a filter, got 3"),
        ({"maps": [None]}, "maps: expected 2, one a filter, got 1"),
        ({"common": ()}, "common: expected a sequence of names"),
        ({"common": ("x", "q")}, "common: expected components of"),
        ({"mu0": [1.2, -0.2]}, "mu0: expected probabilities"),
        (
            {"filters": [*curves()[:2], MotionKF(CV(0.1), X0, P0)], "mu0": [0.5, 0.3, 0.2], "transition": THREE, "common": ("x", "θ")},
            "common: expected components of",
        ),
    ],
)
def test_what_does_not_interact_is_refused(change, words):
    arguments = {"filters": [make("KF"), make("KF")], "mu0": [0.5, 0.5], "transition": CHAIN} | change
    with pytest.raises(ValueError, match=f"^{words}"):
        MotionIMM(**arguments)


def test_a_sensor_a_model_or_one_for_all():
    imm = make("bank")
    for wrong in ([NEAR], [NEAR] * 3, ()):
        with pytest.raises(ValueError, match=f"^sensor: expected one or 2, one a model, got {len(wrong)}"):
            imm.update([1.0, 2.0], wrong)
    one, two = make("bank"), make("bank")
    one.update([1.0, 2.0], NEAR)
    two.update([1.0, 2.0], (NEAR, NEAR))
    assert np.array_equal(one.x, two.x)


# --- factors and square roots


@pytest.mark.parametrize("zeros", [(), (0,), (1, 3)])
def test_a_factor_is_updated_and_downdated_whatever_is_nought(zeros):
    rng = np.random.default_rng(3)
    A, x = rng.standard_normal((4, 4)), rng.standard_normal(4)
    x[list(zeros)] = 0.0
    L, given = np.linalg.cholesky(A @ A.T + 3 * np.outer(x, x)), x.copy()
    np.testing.assert_allclose(cholupdate(L, x) @ cholupdate(L, x).T, L @ L.T + np.outer(x, x), atol=1e-12)
    np.testing.assert_allclose(cholupdate(L, x, -1) @ cholupdate(L, x, -1).T, L @ L.T - np.outer(x, x), atol=1e-12)
    assert np.array_equal(x, given) and cholupdate(L, np.zeros(4)) is not L
    for sign in (2, 0.5, 0):
        with pytest.raises(ValueError, match="sign: expected 1 or -1"):
            cholupdate(L, x, sign)
    np.testing.assert_allclose(cholupdate([[-2.0]], [1.0], -1) ** 2, [[3.0]])
    with pytest.raises(ValueError, match="component 0"):
        cholupdate([[-1.0]], [1.0], -1)


def test_triangular_factors_have_no_negative_diagonal():
    rows = np.random.default_rng(4).standard_normal((7, 3))
    L = triangular(rows.copy())
    np.testing.assert_allclose(L @ L.T, rows.T @ rows, atol=1e-12)
    assert (L.diagonal() > 0).all() and np.array_equal(L, np.tril(L))
    assert np.array_equal(np.abs(triangular(np.zeros((3, 2)))), np.zeros((2, 2)))


@pytest.mark.parametrize("units", [[1, 1, 1], [1e6, 1, 1e-6]])
def test_lower_roots_of_definite_and_semidefinite_covariances(units):
    a, b = np.array([1.0, 2.0, -1.0]) * units, np.array([0.5, 0.0, 1.0]) * units
    for P in (np.outer(a, a) + np.diag(np.square(units)), np.outer(a, a) + np.outer(b, b), np.outer(a, a), np.zeros((3, 3))):
        L = lower_root(P, "P", 3)
        np.testing.assert_allclose(L @ L.T / np.outer(units, units), P / np.outer(units, units), atol=1e-12)
        assert np.array_equal(L, np.tril(L)) and (L.diagonal() >= 0).all()
    with pytest.raises(ValueError, match="Q: expected a positive semidefinite"):
        lower_root(np.diag([1.0, -1.0, 1.0]), "Q", 3)
    with pytest.raises(ValueError, match="sqrt_fn: expected U with UᵀU = Q"):
        lower_root(np.diag([1.0, 2.0, 1.0]), "Q", 3, lambda P: P)


def test_what_rounding_left_of_a_pivot_is_nothing():
    """Cholesky's root would go on with it: 1e-9 where there is nothing."""
    P = np.array([[1.0, 0.1], [0.1, np.nextafter(0.1 * 0.1, 1)]])
    assert 0 < np.linalg.cholesky(P)[1, 1] < 1e-8
    np.testing.assert_allclose(lower_root(P, "P", 2), [[1.0, 0.0], [0.1, 0.0]], atol=1e-13)
    kept = np.diag([1.0, 1e-13]) + [[0, 0], [0, 0.01]] + 0.1 * np.array([[0, 1], [1, 0]])
    np.testing.assert_allclose(lower_root(kept, "P", 2), np.linalg.cholesky(kept), atol=1e-15)


def test_sigma_points_of_what_is_only_semidefinite():
    half = np.outer([1.0, 2.0, -1.0], [1.0, 2.0, -1.0])
    for P in (half + np.eye(3), half, np.zeros((3, 3)), half - 1e-12 * np.eye(3)):
        U = upper_root(P)
        np.testing.assert_allclose(U.T @ U, P, atol=1e-10)
    for P in (half - 1e-3 * np.eye(3), -np.eye(3)):
        with pytest.raises(ValueError, match="P: expected a positive semidefinite covariance"):
            upper_root(P)
    for bad in ((0.0, 2.0, 0.0), (1.0, 2.0, -3.0), (1.0, 2.0, -4.0), (2.0, 2.0, 1e308), (1e200, 2.0, 0.0)):
        with pytest.raises(ValueError, match=r"alpha, beta, kappa: expected finite numbers with alpha²\(n \+ kappa\) > 0"):
            check_sigma_points(3, *bad)
    for name in ("alpha", "beta", "kappa"):
        with pytest.raises(ValueError, match=f"^{name}: expected a finite number"):
            check_sigma_points(3, **{"alpha": 1.0, "beta": 2.0, "kappa": 0.0} | {name: np.nan})


def test_an_angle_may_be_known_up_to_half_a_turn():
    P = np.diag([1.0, 1, 1, np.pi**2, 1])
    MotionUKF(CURVE, np.zeros(5), P)
    with pytest.raises(ValueError, match="P0: expected standard deviations up to π of angles, got θ wider"):
        MotionUKF(CURVE, np.zeros(5), P * 1.001)
    with pytest.warns(RuntimeWarning, match="the standard deviation of θ exceeds π") as caught:
        MotionUKF(CURVE, np.zeros(5), P).predict(5.0)
    assert caught[0].filename == __file__  # it points at who called


def test_a_factor_of_S_is_judged_row_by_row():
    """A row's diagonal is what is left of its component's standard deviation: units of other components do not matter."""
    steep = np.array([[1.0, 0.0], [1e15, 1e14]])
    assert _regular(steep) is steep
    with pytest.raises(ValueError, match="S: expected"):
        _regular(np.array([[1.0, 0.0], [1e15, 1.0]]))
    with pytest.raises(ValueError, match="S: expected"):
        _regular(np.zeros((1, 1)))


def along(x, dt, push=0.0):
    return np.array([x[0] + dt * x[1], x[1] + dt * push])


def place(x, bias=0.0):
    return x[:1] + bias


def square_root(points=None, **more):
    arguments = {
        "dim_x": 2,
        "dim_z": 1,
        "dt": 0.5,
        "hx": place,
        "fx": along,
        "points": MerweScaledSigmaPoints(2, 1.0, 2.0, 0.5) if points is None else points,
    }
    kf = SquareRootUKF(**arguments | more)
    kf.x, kf.P, kf.Q, kf.R = np.array([1.0, 2.0]), np.diag([2.0, 1.0]), np.diag([0.1, 0.2]), np.array([[0.5]])
    return kf


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"dim_x": 0}, "dim_x: expected a whole number"),
        ({"dim_z": 0}, "dim_z: expected a whole number"),
        ({"dt": -0.1}, "dt: expected"),
        ({"hx": 3}, "hx: expected a function"),
        ({"fx": "f"}, "fx: expected a function"),
        ({"form": "QR"}, "form: expected one of"),
        ({"points": object()}, "points: expected filterpy's"),
        ({"points": SimplexSigmaPoints(2)}, "points: expected 5 sigma points in symmetric pairs"),
        ({"points": MerweScaledSigmaPoints(3, 1.0, 2.0, 0.5)}, "points: expected 5 sigma points"),
        ({"points": MerweScaledSigmaPoints(1, 1.0, 2.0, 0.5)}, "points: expected 5 sigma points"),
        ({"points": MerweScaledSigmaPoints(2, 1.0, 2.0, -3.0)}, "points: expected 5 sigma points"),
    ],
)
def test_a_square_root_filter_says_what_it_was_not_made_of(change, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        square_root(**change)


def test_further_arguments_steps_and_functions_reach_f_and_h():
    kf, F2 = square_root(), np.array([[1.0, 0.5], [0.0, 1.0]])
    kf.predict()
    np.testing.assert_allclose(kf.x, [2.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(kf.P, F2 @ np.diag([2.0, 1.0]) @ F2.T + np.diag([0.1, 0.2]), atol=1e-12)
    kf.predict(0.0, push=1.0)
    np.testing.assert_allclose(kf.x, [2.0, 2.0], atol=1e-12)
    kf.predict(1.0, fx=lambda x, dt, push: along(x, dt, 2 * push), push=1.0)
    np.testing.assert_allclose(kf.x, [4.0, 4.0], atol=1e-12)
    P = kf.P.copy()
    kf.update([5.0], bias=0.5)
    np.testing.assert_allclose(kf.y, [0.5], atol=1e-12)
    np.testing.assert_allclose(kf.S, P[:1, :1] + 0.5, atol=1e-12)
    x, P = kf.x, kf.P.copy()
    kf.update(7.0, R=2.0, hx=lambda x: 2 * x[0])
    np.testing.assert_allclose(kf.S, 4 * P[:1, :1] + 2.0, atol=1e-12)
    np.testing.assert_allclose(kf.y, [7.0 - 2 * x[0]], atol=1e-12)
    np.testing.assert_allclose(kf.K, 2 * P[:, :1] / kf.S, atol=1e-12)
    with pytest.raises(ValueError, match="R: expected a finite number"):
        kf.update(7.0, R=-1.0)
    with pytest.raises(ValueError, match="R: expected shape"):
        kf.update(7.0, R=np.eye(2))


@pytest.mark.parametrize("hx", [lambda x: None, lambda x: "far", lambda x: np.zeros(2), lambda x: np.array([np.nan])])
def test_values_of_h_and_f_that_are_none_are_named_and_change_nothing(hx):
    kf = square_root()
    kf.predict()
    before = everything(kf)
    with pytest.raises(ValueError, match="hx: expected 1 finite numbers for each sigma point"):
        kf.update(1.0, hx=hx)
    assert unchanged(kf, before)
    with pytest.raises(ValueError, match="fx: expected 2 finite numbers for each sigma point"):
        kf.predict(fx=lambda x, dt: np.zeros(3))
    assert unchanged(kf, before)


@pytest.mark.parametrize("x", [np.zeros(3), np.array([1.0, np.inf]), 0.0])
def test_a_state_of_another_shape_that_was_set_by_hand_is_named(x):
    kf = square_root()
    kf.x = x
    for call in (kf.predict, lambda: kf.update(1.0)):
        with pytest.raises(ValueError, match=r"^x: expected"):
            call()


@pytest.mark.parametrize("points", [MerweScaledSigmaPoints(2, 0.7, 2.0, 1.0), JulierSigmaPoints(2, 1.0)])
def test_sigma_points_lie_where_their_subtraction_puts_them(points):
    """The second component is an angle, of which filterpy's points are told by `subtract`."""
    calls = []

    def subtract(x, y):
        calls.append(y)
        return np.array([x[0] - y[0], (x[1] - y[1] + np.pi) % (2 * np.pi) - np.pi])

    points.subtract = subtract
    kf = square_root(points)
    kf.x = np.array([1.0, 3.0])
    found = kf._points()
    expected = points.sigma_points(kf.x, kf.P)
    assert calls and np.abs(found[:, 1]).max() <= np.pi
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_signatures_of_the_square_root_filters_are_filterpys():
    for cls in (filters.MotionUKF, filters.MotionSquareRootUKF):
        defaults = {name: p.default for name, p in inspect.signature(cls).parameters.items() if p.default is not p.empty}
        assert {name: defaults[name] for name in ("alpha", "beta", "kappa")} == {"alpha": 1.0, "beta": 2.0, "kappa": 0.0}


@pytest.mark.parametrize("kind", [MotionKF, MotionEKF, MotionUKF])
def test_a_covariance_that_does_not_fit_is_no_half_prediction(kind):
    kf = kind(CV(1.0), np.zeros(4), np.eye(4))
    kf.predict(1.0)
    kf.P = np.eye(3)
    before = kf.__dict__.copy()
    with pytest.raises(ValueError):
        kf.predict(2.0)
    assert kf.__dict__.keys() == before.keys() and all(kf.__dict__[name] is value for name, value in before.items())

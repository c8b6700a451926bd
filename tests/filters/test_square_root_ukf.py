"""The square-root filter is the plain one where rounding is no matter, and goes on where it is."""

import copy
import pickle
from fractions import Fraction

import numpy as np
import pytest
from filterpy.kalman import JulierSigmaPoints, KalmanFilter, MerweScaledSigmaPoints, SimplexSigmaPoints, UnscentedKalmanFilter
from pykalman import AdditiveUnscentedKalmanFilter
from scipy.linalg import sqrtm
from scipy.stats import multivariate_normal

from trackhelpers.angles import mean as angle_mean
from trackhelpers.angles import wrap
from trackhelpers.filters import MotionSquareRootUKF, MotionUKF, SquareRootUKF, cholupdate
from trackhelpers.follow import follow, smooth
from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar

FORMS = ("qr", "cholupdate")
both_forms = pytest.mark.parametrize("form", FORMS)


def covariance(n, seed, spread=1.0):
    A = np.random.default_rng(seed).normal(size=(n, n)) * np.logspace(0, spread, n)[:, None]
    return A @ A.T / n


def track(x, dt, turn=0.3):
    """A nonlinear motion of (px, py, v, θ), for the filters on functions."""
    return np.array([x[0] + x[2] * np.cos(x[3]) * dt, x[1] + x[2] * np.sin(x[3]) * dt, x[2], x[3] + turn * dt])


def seen(x):
    return np.array([np.hypot(x[0], x[1]), np.arctan2(x[1], x[0])])


X0, SIGMA = np.array([40.0, 30.0, 5.0, 0.7]), np.array([0.5, 0.5, 1.0, 0.03])
P0 = np.outer(SIGMA, SIGMA) * (covariance(4, 1, 0.2) + 0.1 * np.eye(4))
Q, R = np.diag([1e-3, 1e-3, 0.02, 1e-3]), np.array([[0.09, 0.002], [0.002, 1e-3]])
POINTS = {
    "Merwe": MerweScaledSigmaPoints(4, 1.0, 2.0, 0.0),
    "Merwe, Wc₀ < 0": MerweScaledSigmaPoints(4, 0.5, 1.0, 0.0),
    "Julier": JulierSigmaPoints(4, 1.0),
    "Julier, Wc₀ < 0": JulierSigmaPoints(4, -1.0),
}


def make(cls, points=POINTS["Merwe"], **more):
    kf = cls(4, 2, 0.1, seen, track, points, **more)
    kf.x, kf.P, kf.Q, kf.R = X0.copy(), P0.copy(), Q.copy(), R.copy()
    return kf


def measurements(steps=60):
    rng, x = np.random.default_rng(5), X0.copy()
    for _ in range(steps):
        x = track(x, 0.1)
        yield seen(x) + np.linalg.cholesky(R) @ rng.standard_normal(2)


@pytest.mark.parametrize("n", [1, 4])
def test_update_and_downdate_by_the_same_vector_give_the_factor_back(n):
    L, x = np.linalg.cholesky(covariance(n, 3) + np.eye(n)), np.random.default_rng(4).normal(size=n) * 3
    more = cholupdate(L, x)
    np.testing.assert_allclose(more, np.linalg.cholesky(L @ L.T + np.outer(x, x)), atol=1e-12)
    np.testing.assert_allclose(cholupdate(more, x, -1), L, atol=1e-12)
    assert np.array_equal(np.triu(more, 1), np.zeros((n, n)))


def test_a_semidefinite_factor_is_updated_too():
    a, x = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, -1.0])
    L = np.zeros((3, 3))
    for each in (a, x):
        L = cholupdate(L, each)
    np.testing.assert_allclose(L @ L.T, np.outer(a, a) + np.outer(x, x), atol=1e-14)


@pytest.mark.parametrize(
    ("L", "x", "sign", "name"),
    [
        (np.eye(2), [1.0, 0.0], -1, "L Lᵀ − x xᵀ"),
        (np.eye(2), [0.8, 0.8], -1, "component 1"),
        (np.eye(2), [1.0], 1, "L"),
        (np.eye(2), [np.nan, 1], 1, "x"),
        (np.diag([np.inf, 1.0]), [1.0, 1], 1, "L"),
        (np.eye(2), [1.0, 0.0], 0, "sign"),
    ],
)
def test_what_cannot_be_updated_is_named_and_changes_nothing(L, x, sign, name):
    before = L.copy()
    with pytest.raises(ValueError, match=name):
        cholupdate(L, x, sign)
    assert np.array_equal(L, before)


@both_forms
@pytest.mark.parametrize("points", POINTS.values(), ids=POINTS)
def test_both_forms_with_merwes_and_juliers_points_are_filterpys_plain_filter(points, form):
    plain, root = make(UnscentedKalmanFilter, points), make(SquareRootUKF, points, form=form)
    for z in measurements():
        for kf in (plain, root):
            kf.predict()
            kf.sigmas_f = points.sigma_points(kf.x, kf.P)  # filterpy's does so after its prediction, to rounding
            kf.update(z)
        for name in ("x", "P", "x_prior", "P_prior", "K", "y", "S", "SI", "log_likelihood", "mahalanobis"):
            np.testing.assert_allclose(getattr(root, name), getattr(plain, name), rtol=1e-9, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(root.factor, np.linalg.cholesky(plain.P), atol=1e-9)


@both_forms
def test_with_alpha_1_beta_0_kappa_3_minus_n_it_is_pykalmans_plain_additive_filter(form):
    zs = np.array(list(measurements()))
    oracle = AdditiveUnscentedKalmanFilter(lambda x: track(x, 0.1), seen, Q, R, X0, P0)
    x, P = oracle.filter(zs)  # its first measurement is one of the start
    kf = make(SquareRootUKF, MerweScaledSigmaPoints(4, 1.0, 0.0, 3.0 - 4), form=form)
    for k, z in enumerate(zs):
        if k:
            kf.predict()
        kf.update(z)
        np.testing.assert_allclose(kf.x, x[k], atol=1e-9)
        np.testing.assert_allclose(kf.P, P[k], atol=1e-9)


def linear(cls, F, H, P0, R, Q=None, **more):
    n, m = len(F), len(H)
    points = MerweScaledSigmaPoints(n, 1.0, 2.0, 0.0)
    kf = cls(dim_x=n, dim_z=m) if cls is KalmanFilter else cls(n, m, 1.0, lambda x: H @ x, lambda x, dt: F @ x, points, **more)
    if cls is KalmanFilter:
        kf.F, kf.H, kf.x = F, H, np.zeros(n)
    kf.P, kf.Q, kf.R = np.array(P0), np.zeros((n, n)) if Q is None else Q, R
    return kf


@both_forms
def test_on_a_linear_problem_it_is_the_kalman_filter(form):
    """pykalman's square-root filter is not, by 0.1 and more: hence its plain one above."""
    F, H, P0 = np.array([[1, 1.0, 0.5], [0, 1, 1], [0, 0, 0.9]]), np.array([[1.0, 0, 0], [0.3, -1, 2]]), covariance(3, 2)
    R, Q = np.array([[4.0, -1.0], [-1.0, 2.0]]), covariance(3, 7)
    one, other = linear(KalmanFilter, F, H, P0, R, Q), linear(SquareRootUKF, F, H, P0, R, Q, form=form)
    for z in np.random.default_rng(0).normal(size=(50, 2)):
        for kf in (one, other):
            kf.predict()
            kf.update(z)
        np.testing.assert_allclose(other.x, one.x, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(other.P, one.P, rtol=1e-9, atol=1e-10)


ILL, F_ILL = np.array([[1, 0], [1, 1e-3]]), np.array([[1.0, 1.0], [0.0, 1.0]])


def ill_conditioned(cls, variances, steps, **more):
    """A filter of constant velocity, q = 0, that measures position and position + velocity/1000 with 0.1 mm, after `steps` steps."""
    kf = linear(cls, F_ILL, ILL, np.diag(variances), 1e-8 * np.eye(2), **more)
    rng, x = np.random.default_rng(0), np.zeros(2)
    for _ in range(steps):
        kf.predict()
        kf.update(ILL @ x + 1e-4 * rng.standard_normal(2))
    return kf


def exact(variances, steps):
    """P of the same filter in rational numbers: the inverse covariances add up."""
    v, w, h = Fraction(variances[0]), Fraction(variances[1]), Fraction(1, 1000)
    a, b, c = 1 / v, Fraction(0), 1 / w  # information [[a, b], [b, c]] at the present time
    for _ in range(steps):
        a, b, c = a, b - a, c - 2 * b + a  # F⁻ᵀ Y F⁻¹
        a, b, c = a + 2 * 10**8, b + h * 10**8, c + h * h * 10**8
    det = a * c - b * b
    return np.array([[c / det, -b / det], [-b / det, a / det]], dtype=float)


def test_where_the_plain_filter_loses_positive_definiteness_at_step_2_both_square_roots_go_on():
    ill_conditioned(UnscentedKalmanFilter, (1e6, 1.0), 1)
    with pytest.raises(np.linalg.LinAlgError):
        ill_conditioned(UnscentedKalmanFilter, (1e6, 1.0), 2)
    for steps in (1, 2, 200):
        errors = {}
        for form in FORMS:
            kf = ill_conditioned(SquareRootUKF, (1e6, 1.0), steps, form=form)
            errors[form] = np.abs(kf.P / exact((1e6, 1.0), steps) - 1).max()
        assert errors["qr"] < 1e-12 and 1e-5 < errors["cholupdate"] < 0.1  # the downdates cancel: not lost, but the worse by ten digits


def test_where_the_prior_is_1e18_times_the_noise_the_qr_form_alone_goes_on():
    with pytest.raises(np.linalg.LinAlgError):
        ill_conditioned(UnscentedKalmanFilter, (1e10, 1e-2), 3)
    with pytest.raises(ValueError, match=r"form=.qr."):
        ill_conditioned(SquareRootUKF, (1e10, 1e-2), 1, form="cholupdate")
    for steps in (1, 2, 200):
        kf = ill_conditioned(SquareRootUKF, (1e10, 1e-2), steps)
        assert np.abs(kf.P / exact((1e10, 1e-2), steps) - 1).max() < 1e-12 and np.isfinite(kf.log_likelihood)


def by_two_decompositions(kf):
    """The posterior P with K from P_xz and the factor of [√Wc (δx − K δy), K √R]."""
    dy, dx = kf.sigmas_h - kf.Wm @ kf.sigmas_h, kf.sigmas_f - kf.x_prior
    root = np.sqrt(kf.Wc)[:, None]
    noise = np.linalg.cholesky(kf.R)
    S_y = np.linalg.qr(np.vstack([root * dy, noise.T]), mode="r").T
    K = np.linalg.solve(S_y.T, np.linalg.solve(S_y, (kf.Wc[:, None] * dy).T @ dx)).T
    L = np.linalg.qr(np.vstack([root * (dx - dy @ K.T), (K @ noise).T]), mode="r").T
    return L @ L.T


def test_the_joint_decomposition_is_that_of_the_deviations_less_the_gain_where_S_is_regular_and_right_where_it_is_not():
    kf = make(SquareRootUKF)
    for z in measurements(10):
        kf.predict()
        kf.update(z)
        np.testing.assert_allclose(by_two_decompositions(kf), kf.P, rtol=1e-9, atol=1e-12)
    kf = ill_conditioned(SquareRootUKF, (1e10, 1e-2), 1)
    P = by_two_decompositions(kf)
    assert np.linalg.eigvalsh(P)[0] > 0 and P[0, 0] > 10 * kf.P[0, 0]  # positive definite, and wrong


@pytest.mark.parametrize(("variances", "plain"), [((1e6, 1.0), "P"), ((1e10, 1e-2), "S")])
def test_on_a_model_the_square_root_goes_on_where_the_plain_filter_refuses(variances, plain):
    model = CV(0.0, axes=1)
    sensor = LinearSensor(ILL, 1e-8 * np.eye(2), model.state)
    zs = 1e-4 * np.random.default_rng(0).standard_normal((200, 2))
    with pytest.raises(ValueError, match=rf"zs\[[01]\]: {plain}: expected"):
        follow(MotionUKF(model, np.zeros(2), np.diag(variances)), zs, sensor, 1.0)
    kf = follow(MotionSquareRootUKF(model, np.zeros(2), np.diag(variances)), zs, sensor, 1.0).filter
    assert np.abs(kf.P / exact(variances, 200) - 1).max() < 1e-12


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_noise_of_one_dimension_alone_is_a_singular_S_whatever_the_unit(scale):
    kf, a = MotionSquareRootUKF(CV(), np.zeros(4), np.zeros((4, 4))), scale * np.array([0.1, 0.3])
    with pytest.raises(ValueError, match="S: expected"):
        kf.update([1.0, 1.0], Position(1.0, CV().state), R=np.outer(a, a))


def test_the_downdate_that_fails_leaves_the_filter_as_it_was():
    kf = linear(SquareRootUKF, F_ILL, ILL, np.diag([1e10, 1e-2]), 1e-8 * np.eye(2), form="cholupdate")
    kf.predict()
    before = dict(kf.__dict__)
    with pytest.raises(ValueError, match="P: expected"):
        kf.update([0.0, 0.0])
    assert all(kf.__dict__[name] is value for name, value in before.items()) and kf.__dict__.keys() == before.keys()


def test_setting_P_as_a_whole_or_in_part_factors_it():
    kf = make(SquareRootUKF)
    np.testing.assert_allclose(kf.factor, np.linalg.cholesky(P0), atol=1e-14)
    kf.P *= 4
    np.testing.assert_allclose(kf.factor, 2 * np.linalg.cholesky(P0), atol=1e-14)
    kf.P = np.diag([4.0, 1, 1, 1])
    kf.P[0, 0] = 9.0
    np.testing.assert_allclose(kf.factor, np.diag([3.0, 1, 1, 1]))
    with pytest.raises(ValueError, match="P"):
        kf.P = -np.eye(4)
    np.testing.assert_allclose(kf.P, np.diag([9.0, 1, 1, 1]))
    a = np.array([1.0, 2.0, -1.0, 0.5])
    kf.P = np.outer(a, a)
    np.testing.assert_allclose(kf.P, np.outer(a, a), atol=1e-14)
    assert np.array_equal(np.triu(kf.factor, 1), np.zeros((4, 4)))


@pytest.mark.parametrize("sqrt_fn", [sqrtm, lambda P: np.linalg.cholesky(P).T])
def test_another_root_gives_the_same_factor(sqrt_fn):
    kf, plain = make(SquareRootUKF, sqrt_fn=sqrt_fn), make(SquareRootUKF)
    for z in measurements(5):
        for each in (kf, plain):
            each.predict()
            each.update(z)
    np.testing.assert_allclose(kf.factor, plain.factor, atol=1e-12)
    with pytest.raises(ValueError, match="sqrt_fn"):
        make(SquareRootUKF, sqrt_fn=lambda P: np.linalg.cholesky(P))  # lower: not filterpy's convention


def test_a_start_without_variance_or_noise_is_no_trouble_to_the_qr_form():
    kf = make(SquareRootUKF)
    kf.P, kf.Q = np.diag([0.0, 1.0, 0.0, 0.0]), np.zeros((4, 4))
    for z in measurements(10):
        kf.predict()
        kf.update(z)
    assert np.isfinite(kf.x).all() and kf.P[2, 2] == pytest.approx(0, abs=1e-20)


def test_two_measurements_after_one_prediction_are_one_of_both():
    F, P0, H = np.eye(2), covariance(2, 9), np.array([[1.0, 0.5], [0.2, 2.0]])
    R = np.diag([0.3, 0.7])
    one, two = (linear(SquareRootUKF, F, H, P0, R, Q=0.1 * np.eye(2)) for _ in range(2))
    one.predict()
    one.update([1.0, 2.0])
    two.predict()
    two.update([1.0, 0.0], R=np.diag([0.3, 1e14]))
    two.update([0.0, 2.0], R=np.diag([1e14, 0.7]))
    np.testing.assert_allclose(two.x, one.x, atol=1e-9)
    np.testing.assert_allclose(two.P, one.P, atol=1e-9)


@both_forms
def test_means_and_residuals_of_ones_own_serve_as_in_filterpy(form):
    """A bearing across the cut."""
    wrapped = {
        "z_mean_fn": lambda points, W: angle_mean(points.T, W, (1,)),
        "residual_z": lambda a, b: np.array([a[0] - b[0], wrap(a[1] - b[1])]),
        "x_mean_fn": lambda points, W: angle_mean(points.T, W, (3,)),
        "residual_x": lambda a, b: np.append(np.subtract(a, b)[:3], wrap(a[3] - b[3])),
        "state_add": lambda x, dx: np.append((x + dx)[:3], wrap(x[3] + dx[3])),
    }
    plain, root = make(UnscentedKalmanFilter, **wrapped), make(SquareRootUKF, form=form, **wrapped)
    x = np.array([-40.0, 1.0, 5.0, 3.0])
    plain.x, root.x = x.copy(), x.copy()
    for k in range(40):
        x = track(x, 0.1)
        z = seen(x) + 0.01 * np.sin([k, 3 * k])
        for kf in (plain, root):
            kf.predict()
            kf.update([z[0], wrap(z[1])])
        np.testing.assert_allclose(root.x, plain.x, atol=1e-9)
        np.testing.assert_allclose(root.P, plain.P, atol=1e-9)
    assert wrap(x[3]) < 0 < x[3]


def test_what_is_inherited_and_right_stays_and_a_transform_refuses():
    zs = list(measurements(20))
    plain, root = make(UnscentedKalmanFilter), make(SquareRootUKF)
    means, covariances = plain.batch_filter(zs)
    np.testing.assert_allclose(root.batch_filter(zs)[0], means, atol=1e-9)
    for ours, theirs in zip(root.rts_smoother(means, covariances), plain.rts_smoother(means, covariances), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
    for call in (lambda: root.predict(UT=print), lambda: root.update(zs[0], UT=print)):
        with pytest.raises(NotImplementedError, match="UT"):
            call()


def test_a_missed_measurement_leaves_the_prediction_and_no_older_evidence():
    kf = make(SquareRootUKF)
    kf.predict()
    kf.update(next(measurements()))
    assert kf.log_likelihood == pytest.approx(multivariate_normal(np.zeros(2), kf.S).logpdf(kf.y)) and "x = " in str(kf)
    kf.predict()
    x, P, L = kf.x.copy(), kf.P.copy(), kf.factor.copy()
    kf.update(None)
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P) and np.array_equal(kf.factor, L) and np.array_equal(kf.x_post, x)
    assert (kf.z, kf.y.size, kf.log_likelihood, kf.likelihood, kf.mahalanobis) == (None, 0, 0.0, 1.0, 0.0)
    assert "x = " in str(kf)


WRONG = {
    "z": lambda kf: kf.update([1.0, np.nan]),
    "z: expected": lambda kf: kf.update([1.0]),
    "R": lambda kf: kf.update([50.0, 0.6], R=[[1, 2], [2, 1]]),
    "R: ": lambda kf: kf.update([50.0, 0.6], R=-1.0),
    "hx": lambda kf: kf.update([50.0, 0.6], hx=lambda x: [np.nan, 1.0]),
    "hx: ": lambda kf: kf.update([50.0, 0.6], hx=lambda x: [1.0]),
    "fx": lambda kf: kf.predict(fx=lambda x, dt: x * np.inf),
    "dt": lambda kf: kf.predict(-1.0),
    "Q": lambda kf: (setattr(kf, "Q", -Q), kf.predict()),
    "S": lambda kf: kf.update([50.0, 0.6], hx=lambda x: [50.0, 0.6], R=0.0),
}


@pytest.mark.filterwarnings("ignore:invalid value")
@both_forms
@pytest.mark.parametrize("name", WRONG)
def test_a_refused_call_names_its_argument_and_changes_nothing(name, form):
    kf = make(SquareRootUKF, form=form)
    kf.predict()
    kf.update(next(measurements()))
    before = {key: copy.deepcopy(value) for key, value in kf.__dict__.items() if key != "Q"}
    with pytest.raises(ValueError, match=name):
        WRONG[name](kf)
    for key, value in before.items():
        np.testing.assert_array_equal(kf.__dict__[key], value, err_msg=key) if isinstance(value, np.ndarray) else None
    assert kf._log_likelihood == before["_log_likelihood"]


def test_wrong_forms_and_points_are_named():
    with pytest.raises(ValueError, match="form"):
        make(SquareRootUKF, form="lu")
    with pytest.raises(ValueError, match="form"):
        MotionSquareRootUKF(CV(), np.zeros(4), np.eye(4), form="lu")
    for points in (SimplexSigmaPoints(4), MerweScaledSigmaPoints(3, 1, 2, 0)):
        with pytest.raises(ValueError, match="points"):
            make(SquareRootUKF, points)


@both_forms
def test_it_is_pickled_and_copied_and_goes_on_alike(form):
    kf, z = make(SquareRootUKF, form=form), list(measurements(2))
    kf.predict()
    kf.update(z[0])
    for other in (pickle.loads(pickle.dumps(kf)), copy.deepcopy(kf)):
        one = copy.copy(kf)
        for each in (one, other):
            each.predict()
            each.update(z[1])
        np.testing.assert_array_equal(other.factor, one.factor)
        np.testing.assert_array_equal(other.x, one.x)


CTRV_START, CTRV_P0 = [4.0, 3.0, 5.0, 2.8, 0.6], 0.05 * (covariance(5, 3, 0.0) + np.eye(5))


def turning(steps=200):
    """Lidar and radar in turn, irregular steps, missed scans; the heading and the bearing go across the cut."""
    rng, model, x = np.random.default_rng(1), CTRV(2.0, 0.3), np.array(CTRV_START)
    zs, sensors, steps = [], [], rng.choice([0.0, 0.05, 0.1], size=steps)
    for k, dt in enumerate(steps):
        x = model.f(x, dt)
        sensor = Radar(position=(6.0, 8.0)) if k % 2 else Lidar()
        zs.append(None if k % 17 == 5 else sensor.h(x) + np.sqrt(np.diag(sensor.R)) * rng.standard_normal(sensor.m))
        sensors.append(sensor)
    return zs, sensors, list(steps)


def linear_track():
    model = CV(0.5, noise="continuous")
    zs = [None if k == 7 else z for k, z in enumerate(np.random.default_rng(2).normal(size=(60, 2)))]
    return zs, Position((0.3, 0.1), model.state), 0.7


@both_forms
@pytest.mark.parametrize("parameters", [(1, 2, 0), (1, 0, -1), (0.5, 1, 0)])
@pytest.mark.parametrize(
    ("model", "x0", "P0", "scene"),
    [
        (CTRV(2.0, 0.3), CTRV_START, CTRV_P0, turning()),
        (CV(0.5, noise="continuous"), np.ones(4), covariance(4, 5), linear_track()),
    ],
    ids=["CTRV, lidar and radar", "CV, positions"],
)
def test_on_a_model_it_is_MotionUKF_and_so_is_its_smoother(model, x0, P0, scene, parameters, form):
    keep = ("x", "P", "y", "S", "K", "log_likelihood", "mahalanobis")
    one = follow(MotionUKF(model, x0, P0, *parameters), *scene, keep=keep)
    other = follow(MotionSquareRootUKF(model, x0, P0, *parameters, form=form), *scene, keep=keep)
    for name in keep:
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=1e-9, err_msg=name)
    for ours, theirs in zip(smooth(other), smooth(one), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-7, atol=1e-8)
    assert other.filter.form == form and isinstance(other.filter, (MotionUKF, SquareRootUKF))


def test_an_R_of_this_call_and_a_missed_scan_are_MotionUKFs():
    one, other = MotionUKF(CTRV(2, 0.3), CTRV_START, CTRV_P0), MotionSquareRootUKF(CTRV(2, 0.3), CTRV_START, CTRV_P0)
    for kf in (one, other):
        kf.predict(0.1)
        kf.update([3.5, 3.2], Lidar(), R=[[0.1, 0.05], [0.05, 0.2]])
    np.testing.assert_allclose(other.x, one.x, atol=1e-12)
    np.testing.assert_allclose(other.P, one.P, atol=1e-12)


def test_a_far_origin_costs_the_square_root_nothing():
    """States of 6 million metres, as from the Earth's centre: the deviations come from the factor, not from differences of sigma points."""
    model, far = CV(1e-3, noise="continuous"), np.array([-4e6, 0.0, 3.5e6, 0.0])
    sensor = Position(30.0, model.state)
    near, away = (MotionSquareRootUKF(model, x0, np.diag([900.0, 100.0, 900.0, 100.0])) for x0 in (np.zeros(4), far))
    for z in 30 * np.random.default_rng(3).normal(size=(300, 2)):
        for kf, origin in ((near, np.zeros(4)), (away, far)):
            kf.predict(1.0)
            kf.update(z + origin[[0, 2]], sensor)
    np.testing.assert_allclose(away.x - far, near.x, atol=1e-7)
    np.testing.assert_allclose(away.P, near.P, rtol=1e-7, atol=1e-9)

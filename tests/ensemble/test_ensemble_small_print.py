"""What no long track shows of the ensembles: what they refuse, what they take for missing, and the paths that run where nothing is compiled."""

import inspect
import warnings

import numpy as np
import pytest

from trackhelpers import filters, fused
from trackhelpers.charts import Plane
from trackhelpers.consistency import nees
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, EnsembleUKF, adaptive, shared, switching, unscented_compiled
from trackhelpers.ensemble.filters import _root
from trackhelpers.filters import MotionEKF, MotionKF, MotionUKF
from trackhelpers.follow import follow
from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import TDOA, Lidar, LinearSensor, Position, Radar

TURN, STRAIGHT, M = CTRV(2.0, 0.3), CV(0.5), 4
RNG = np.random.default_rng(0)
X0 = np.array([20.0, 10.0, 5.0, 0.7, 0.1])[:, None] + 0.1 * RNG.standard_normal((5, M))
ROOTS = np.eye(5)[..., None] + 0.2 * RNG.standard_normal((5, 5, M))
P0 = 0.1 * np.einsum("ikm,jkm->ijm", ROOTS, ROOTS)
RADAR = Radar(R=np.array([[0.09, 0.002, 0.01], [0.002, 0.001, 0.001], [0.01, 0.001, 0.09]]))
LIDAR = Lidar(R=np.array([[0.02, 0.01], [0.01, 0.03]]))
RS = np.einsum("ikm,jkm->ijm", *2 * [np.eye(3)[..., None] + 0.3 * RNG.standard_normal((3, 3, M))])
MASK = np.array([True, False, True, True])


@pytest.fixture
def plain(monkeypatch):
    """Nothing is compiled."""
    monkeypatch.setattr(fused, "binding", None)
    monkeypatch.setattr(unscented_compiled, "binding", None)


PAIRS = [
    (EnsembleEKF, MotionEKF, {}),
    (EnsembleEKF, MotionEKF, {"iterations": 3}),
    (EnsembleUKF, MotionUKF, {}),
    (EnsembleUKF, MotionUKF, {"alpha": 0.6, "beta": 1.5, "kappa": 1.0}),
]


def assert_each_run_is_the_single_filter(many, one, settings, noise=None):
    ens, singles = many(TURN, X0, P0, **settings), [one(TURN, X0[:, m], P0[..., m], **settings) for m in range(M)]
    rng = np.random.default_rng(1)
    for k, (sensor, mask) in enumerate([(RADAR, None), (LIDAR, MASK), (RADAR, ~MASK), (LIDAR, None)]):
        z = sensor.h(TURN.f(X0, 0.2 * (k + 1))) + 0.1 * rng.standard_normal((sensor.m, M))
        R = None if noise is None else noise[: sensor.m, : sensor.m]
        ens.predict(0.2)
        ens.update(z, sensor, mask=mask, R=R)
        for m, kf in enumerate(singles):
            kf.predict(0.2)
            measured = mask is None or mask[m]
            kf.update(z[:, m] if measured else None, sensor, R=None if R is None else R[..., m] if R.ndim == 3 else R)
            for name in ("x", "P", *(("y", "S", "K") if measured else ())):
                np.testing.assert_allclose(getattr(ens, name)[..., m], getattr(kf, name), atol=1e-9, err_msg=name)
            assert measured or all(np.isnan(getattr(ens, name)[..., m]).all() for name in ("y", "S", "K"))


@pytest.mark.parametrize(("many", "one", "settings"), PAIRS)
@pytest.mark.parametrize("noise", [None, RS[..., 0], RS], ids=["the sensor's", "one", "one a run"])
def test_without_a_compiler_each_run_is_the_single_filter(plain, many, one, settings, noise):
    assert_each_run_is_the_single_filter(many, one, settings, noise)


@pytest.mark.parametrize(("many", "one", "settings"), PAIRS)
@pytest.mark.parametrize("noise", [None, RS], ids=["the sensor's", "one a run"])
def test_with_a_noise_of_its_own_each_run_is_the_single_filter(many, one, settings, noise):
    assert_each_run_is_the_single_filter(many, one, settings, noise)


def test_what_is_not_named_is_what_is_documented():
    assert EnsembleEKF(TURN, X0, P0).iterations == 1
    ens = EnsembleUKF(TURN, X0, P0)
    np.testing.assert_allclose(ens.Wm, [0.0, *[0.1] * 10], atol=1e-15)
    np.testing.assert_allclose(ens.Wc, [2.0, *[0.1] * 10], atol=1e-15)
    other = EnsembleUKF(TURN, X0, P0, alpha=0.5, beta=1.0, kappa=3.0)
    np.testing.assert_allclose(other.Wm, [1 - 5 / 2, *[0.25] * 10])
    assert other.Wc[0] == pytest.approx(-1.5 + 1 - 0.25 + 1)


@pytest.mark.parametrize("name", ["StrongTrackingKF", "VarianceInflationKF", "InputEstimationKF", "VariableDimensionKF", "ManoeuvreIMM"])
def test_an_ensemble_is_set_as_the_filter_of_its_name(name):
    ours = getattr(adaptive, f"Ensemble{name}", None) or getattr(switching, f"Ensemble{name.removeprefix('Manoeuvre')}")
    one, many = (inspect.signature(cls).parameters.values() for cls in (getattr(filters, name), ours))
    assert [(p.name, p.default) for p in one] == [(p.name, p.default) for p in many]


@pytest.mark.parametrize("x0", [np.zeros(5), np.zeros((4, 2)), np.zeros((5, 0)), np.zeros((5, 2, 2))])
def test_a_start_has_its_components_first_and_its_runs_last(x0):
    with pytest.raises(ValueError, match=r"^x0: expected shape \(5, M\), runs on the last axis, got"):
        EnsembleEKF(TURN, x0, np.eye(5))
    with pytest.raises(ValueError, match=r"^x0: expected finite numbers, got 1 that are not"):
        EnsembleEKF(TURN, np.where(np.arange(10).reshape(5, 2) == 3, np.inf, 0.0), np.eye(5))


def test_headings_of_a_start_lie_within_half_a_turn():
    x0 = X0.copy()
    x0[3] = 4.0
    np.testing.assert_allclose(EnsembleEKF(TURN, x0, P0).x[3], 4.0 - 2 * np.pi)


def test_a_run_has_failed_where_something_is_not_finite_or_a_variance_is_negative():
    ens = EnsembleEKF(TURN, X0, np.eye(5))
    ens.P[1, 1] = 0.0
    assert not ens.failed.any() and ens.failed.shape == (M,)
    ens.x[4, 0], ens.P[0, 3, 1], ens.P[2, 2, 3] = np.inf, np.nan, -1e-12
    assert ens.failed.tolist() == [True, True, False, True]
    matrices = adaptive.EnsembleMatrixKF(np.eye(2), np.eye(1, 2), np.eye(2), [[1.0]], np.zeros((2, 3)), np.eye(2))
    assert not matrices.failed.any()
    matrices.x[0, 0], matrices.P[0, 1, 2] = np.nan, np.inf
    assert matrices.failed.tolist() == [True, False, True]


def test_the_nees_takes_one_truth_or_one_a_run_and_folds():
    ens = EnsembleEKF(TURN, X0, P0)
    truth = X0 + 0.1
    expected = [nees(truth[:, m], X0[:, m], P0[..., m], (3,)) for m in range(M)]
    np.testing.assert_allclose(ens.nees(truth), expected)
    common = [nees(truth[:, 0], X0[:, m], P0[..., m], (3,)) for m in range(M)]
    for one in (truth[:, 0], truth[:, :1]):
        np.testing.assert_allclose(ens.nees(one), common)
    backwards = truth.copy()
    backwards[2], backwards[3] = -truth[2], truth[3] + np.pi
    np.testing.assert_allclose(ens.nees(backwards, fold=True), expected)
    assert (ens.nees(backwards) > 100 * ens.nees(truth)).all()
    assert np.array_equal(ens.estimate, ens.x) and np.array_equal(ens.estimate_P, ens.P)


@pytest.mark.parametrize("make", [EnsembleKF, EnsembleEKF, EnsembleUKF])
def test_where_nobody_is_measured_nothing_is_left(make):
    ens, sensor = make(STRAIGHT, X0[:4], np.eye(4)), Position(1.0, STRAIGHT.state)
    for missing in ((None, sensor, None), (np.zeros((2, M)), sensor, np.zeros(M, bool)), (None, None, MASK)):
        ens.update(np.zeros((2, M)), sensor)
        assert ens.y.shape == (2, M) and ens.S.shape == (2, 2, M) and ens.K.shape == (4, 2, M)
        x, P = ens.x, ens.P
        ens.update(*missing)
        assert ens.y.shape == (0, M) and ens.S.shape == (0, 0, M) and ens.K.shape == (4, 0, M)
        assert np.array_equal(ens.x, x) and np.array_equal(ens.P, P)


@pytest.mark.parametrize("make", [EnsembleKF, EnsembleEKF, EnsembleUKF])
def test_a_mask_of_all_is_none_and_a_measurement_may_be_everyones(make):
    sensor, z = Position((1.0, 2.0), STRAIGHT.state), np.array([[3.0], [4.0]])
    runs = [make(STRAIGHT, X0[:4], P0[:4, :4]) for _ in range(3)]
    runs[0].update(z, sensor)
    runs[1].update(np.repeat(z, M, axis=1), sensor)
    runs[2].update(z, sensor, mask=np.ones(M, bool))
    for ens in runs[1:]:
        for name in ("x", "P", "y", "S", "K"):
            assert np.array_equal(getattr(ens, name), getattr(runs[0], name)), name
    for wrong in (z[:, 0], np.zeros((2, M - 1)), np.zeros((1, M)), np.zeros((2, M, 1))):
        with pytest.raises(ValueError, match=rf"^z: expected shape \(2, {M}\), runs on the last axis, or \(2, 1\) for all, got"):
            runs[0].update(wrong, sensor)
    with pytest.raises(ValueError, match="z: expected finite measurements; name the runs without one by mask"):
        runs[0].update(np.where(MASK, z, np.nan), sensor)
    with pytest.raises(ValueError, match="z: expected finite"):
        runs[0].update(np.where(MASK, np.nan, z), sensor, mask=MASK)


@pytest.mark.parametrize("make", [EnsembleEKF, EnsembleUKF])
def test_a_refused_call_leaves_every_attribute_and_another_sensor_is_looked_at(make):
    ens = make(TURN, X0, P0)
    ens.update(LIDAR.h(X0), LIDAR)
    before = ens.__dict__.copy()
    for arguments in (
        (np.full((3, M), np.nan), RADAR),
        (np.zeros((2, M)), Lidar(state=STRAIGHT.state)),
        (np.zeros((2, M)), LIDAR, None, -np.eye(2)),
    ):
        with pytest.raises(ValueError):
            ens.update(*arguments)
        assert ens.__dict__.keys() == before.keys() and all(ens.__dict__[name] is before[name] for name in before)
    ens.model = STRAIGHT
    with pytest.raises(ValueError, match="sensor: expected one made with"):
        ens.update(LIDAR.h(X0), LIDAR)


def test_a_linear_ensemble_refuses_what_is_not_linear():
    with pytest.raises(ValueError, match=r"^model: expected a linear model"):
        EnsembleKF(TURN, X0, P0)
    ens = EnsembleKF(STRAIGHT, X0[:4], np.eye(4))
    with pytest.raises(ValueError, match=r"^sensor: expected a linear sensor"):
        ens.update(np.ones((3, M)), Radar(state=STRAIGHT.state))


@pytest.mark.parametrize("runs", [M, 40])
@pytest.mark.parametrize("own", ["", "P", "R", "PR"])
def test_a_linear_ensemble_sees_angles_and_mountings_as_the_single_filter(runs, own):
    """P and R of everyone or of each run; z1 is an angle, and the position is seen from elsewhere and turned."""
    rng = np.random.default_rng(2)
    x0 = 3 * rng.standard_normal((4, runs))
    A, B = (np.eye(n)[..., None] + 0.2 * rng.standard_normal((n, n, runs)) for n in (4, 3))
    P, R = np.einsum("ikm,jkm->ijm", A, A), np.einsum("ikm,jkm->ijm", B, B)
    P, R = P if "P" in own else P[..., 0], R if "R" in own else R[..., 0]
    angular = LinearSensor(rng.standard_normal((3, 4)), np.eye(3), STRAIGHT.state, angles=(0,))
    mounted = Position(0.5, STRAIGHT.state, position=(10.0, -20.0), heading=0.6)
    ens, kf = EnsembleKF(STRAIGHT, x0, P), MotionKF(STRAIGHT, x0[:, 2], P[..., 2] if "P" in own else P)
    for sensor, noise in ((angular, R), (mounted, None), (angular, R), (angular, R)):
        z = sensor.h(x0) + 3.0
        ens.predict(0.3)
        kf.predict(0.3)
        ens.update(z, sensor, R=noise)
        kf.update(z[:, 2], sensor, R=None if noise is None else noise[..., 2] if noise.ndim == 3 else noise)
        for name in ("x", "P", "y", "S", "K"):
            np.testing.assert_allclose(getattr(ens, name)[..., 2], getattr(kf, name), atol=1e-10, err_msg=name)


@pytest.mark.parametrize("runs", [3, 40])  # in NumPy, and compiled where numba is there
def test_a_shared_step_is_the_textbooks_and_its_gain_nan_where_S_is_singular(runs):
    rng = np.random.default_rng(3)
    x, F, H, z = (rng.standard_normal(shape) for shape in ((5, runs), (5, 5), (3, 5), (3, runs)))
    A, B, C = (rng.standard_normal((n, n)) for n in (5, 5, 3))
    P, Q, R = A @ A.T, B @ B.T, C @ C.T
    moved, ahead = shared.predict(x, P, F, Q)
    np.testing.assert_allclose(moved, F @ x, atol=1e-12)
    np.testing.assert_allclose(ahead, F @ P @ F.T + Q, atol=1e-12)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    expected = x + K @ (z - H @ x), P - K @ S @ K.T, z - H @ x, S, K
    for got, wanted in zip(shared.correct(x, P, z, H, R), expected, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-10)
    assert np.isnan(shared.correct(x, 0 * P, z, H, 0 * R)[4]).all()
    K = shared.correct(x, P, z, H, -S)[4]  # P Hᵀ R⁻¹ of an S that is not positive: solved all the same
    np.testing.assert_allclose(K, P @ H.T @ np.linalg.inv(H @ P @ H.T - S), rtol=1e-4)


def test_compiled_steps_can_be_switched_off(monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.setenv("TRACKHELPERS_COMPILED", "1")
    assert shared._compiled.__wrapped__() is not None
    monkeypatch.setenv("TRACKHELPERS_COMPILED", "0")
    assert shared._compiled.__wrapped__() is None


def test_roots_of_covariances_are_of_what_is_semidefinite_and_nan_of_what_is_not():
    half = np.outer([1.0, 2.0, -1.0], [1.0, 2.0, -1.0])
    P = np.stack([np.eye(3) + half, half, 0 * half, half - 1e-3 * np.eye(3), np.full((3, 3), np.nan)], axis=-1)
    L = _root(P)
    for m in range(3):
        np.testing.assert_allclose(L[..., m] @ L[..., m].T, P[..., m], atol=1e-12)
    assert np.isnan(L[..., 3:]).any(axis=(0, 1)).all()
    slightly = half - 1e-11 * np.eye(3)  # rounding
    np.testing.assert_allclose(_root(slightly[..., None])[..., 0] @ _root(slightly[..., None])[..., 0].T, half, atol=1e-9)


@pytest.mark.parametrize("compiled", [True, False])
def test_an_unscented_ensemble_starts_from_certainty_as_the_single_filter(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr(unscented_compiled, "binding", None)
    P = np.repeat(0.1 * np.eye(5)[..., None], M, axis=2)
    P[..., 1], P[2, 2, 2] = 0.0, 0.0
    ens, singles = EnsembleUKF(TURN, X0, P), [MotionUKF(TURN, X0[:, m], P[..., m]) for m in range(M)]
    for kf in (ens, *singles):
        kf.predict(0.0)
    ens.update(LIDAR.h(X0) + 0.3, LIDAR)
    for m, kf in enumerate(singles):
        kf.update(LIDAR.h(X0[:, m]) + 0.3, LIDAR)
        np.testing.assert_allclose(ens.x[:, m], kf.x, atol=1e-9)
        np.testing.assert_allclose(ens.P[..., m], kf.P, atol=1e-9)


def test_an_angle_that_is_not_known_is_refused_at_the_start_and_warned_of_later():
    P = np.diag([1.0, 1.0, 1.0, np.pi**2, 1.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ens = EnsembleUKF(TURN, X0, P)
    with pytest.raises(ValueError, match="P0: expected standard deviations up to π of angles, got θ wider"):
        EnsembleUKF(TURN, X0, P * 1.01)
    with pytest.warns(RuntimeWarning, match="exceeds π"):
        ens.predict(1.0)


# --- many steps in one piece


def tracks(steps=6):
    rng, zs, sensors = np.random.default_rng(4), [], []
    for k in range(steps):
        sensor = (LIDAR, RADAR)[k % 2]
        zs.append(None if k == 3 else sensor.h(TURN.f(X0, 0.1 * (k + 1))) + 0.1 * rng.standard_normal((sensor.m, M)))
        sensors.append(None if k == 3 else sensor)
    return zs, sensors


def stepped(ens, zs, sensors, dt=0.1):
    xs = []
    for z, sensor in zip(zs, sensors, strict=True):
        ens.predict(dt)
        ens.update(z, sensor)
        xs.append(ens.x)
    return np.stack(xs, axis=1)


class Other(EnsembleEKF):
    """What a subclass does differently is not known."""


@pytest.mark.parametrize(
    ("make", "change", "whole"),
    [
        (lambda: EnsembleEKF(TURN, X0, P0), lambda z: z, True),
        (lambda: Other(TURN, X0, P0), lambda z: z, False),
        (lambda: EnsembleEKF(TURN, X0, P0, iterations=2), lambda z: z, False),
        (lambda: EnsembleEKF(TURN, X0, P0), lambda z: z.tolist(), False),
        (lambda: EnsembleEKF(TURN, X0, P0), lambda z: np.float32(z), False),
        (lambda: EnsembleEKF(TURN, X0, P0), lambda z: z[:, :1], False),
    ],
)
def test_steps_in_one_piece_are_the_steps_one_by_one(monkeypatch, make, change, whole):
    pytest.importorskip("llvmlite")
    zs, sensors = tracks()
    zs = [None if z is None else change(z) for z in zs]
    asked, run = [], fused.run
    monkeypatch.setattr(fused, "run", lambda *arguments: asked.append(run(*arguments)) or asked[-1])
    ens, one_by_one = make(), make()
    found, expected = follow(ens, zs, sensors, 0.1), stepped(one_by_one, zs, sensors)
    np.testing.assert_allclose(found.x, expected, atol=1e-9)
    for name in ("x", "P", "y", "S", "K"):
        np.testing.assert_allclose(getattr(ens, name), getattr(one_by_one, name), atol=1e-9, err_msg=name)
    assert bool(asked and asked[-1] is not None) is whole


@pytest.mark.parametrize(
    ("z", "sensor", "word"),
    [
        (np.full((2, M), np.nan), LIDAR, "z"),
        (np.zeros((3, M)), LIDAR, "z"),
        (np.zeros((2, M)), None, "sensor"),
        (np.zeros((2, M)), Lidar(state=STRAIGHT.state), "sensor"),
    ],
)
def test_a_step_that_is_to_be_refused_is_named_with_its_number(z, sensor, word):
    zs, sensors = tracks()
    zs[4], sensors[4] = z, sensor
    ens = EnsembleEKF(TURN, X0, P0)
    with pytest.raises(ValueError, match=rf"^zs\[4\]: {word}"):
        follow(ens, zs, sensors, 0.1)
    one_by_one = EnsembleEKF(TURN, X0, P0)
    stepped(one_by_one, zs[:4], sensors[:4])
    one_by_one.predict(0.1)
    np.testing.assert_allclose(ens.x, one_by_one.x, atol=1e-9)


def test_steps_of_more_sensors_than_are_compiled_together_are_taken_one_by_one():
    zs, sensors = tracks()
    sensors = [None if sensor is None else type(sensor)(R=sensor.R) for sensor in sensors]  # five of them
    ens, one_by_one = EnsembleEKF(TURN, X0, P0), EnsembleEKF(TURN, X0, P0)
    found, expected = follow(ens, zs, sensors, 0.1), stepped(one_by_one, zs, sensors)
    np.testing.assert_allclose(found.x, expected, atol=1e-9)
    np.testing.assert_allclose(ens.P, one_by_one.P, atol=1e-9)


def test_another_model_is_followed_over_the_same_step():
    ens, kf = EnsembleKF(STRAIGHT, X0[:4], np.eye(4)), MotionKF(STRAIGHT, X0[:4, 0], np.eye(4))
    for model in (STRAIGHT, CV(9.0), STRAIGHT):
        ens.model = kf.model = model
        ens.predict(0.5)
        kf.predict(0.5)
        np.testing.assert_allclose(ens.P[..., 0], kf.P, atol=1e-12)


def test_a_run_that_is_certain_of_a_component_is_updated_beside_its_neighbours():
    satellites = 1e6 * np.array([[-3.0, -3.1, -3.0], [5.0, 5.0, 5.1], [4.5, 4.4, 4.4]])
    rng, model = np.random.default_rng(4), CV(0.1)
    sensor = TDOA(24.0, lambda t: satellites + t, Plane(), model.state).at(1.0)
    x0 = np.array([1e5, 3.0, -2e5, 4.0])[:, None] + rng.normal(0.0, 100.0, (4, 7))
    P0 = np.repeat(np.diag([1e6, 1.0, 1e6, 1.0])[..., None], 7, axis=2)
    P0[1, 1, [2, 5]] = 0.0  # the speed along x is known
    z = sensor.h(x0) + rng.normal(0.0, 24.0, (2, 7))
    ens = EnsembleUKF(model, x0, P0)
    ens.update(z, sensor)
    for r in range(7):
        kf = MotionUKF(model, x0[:, r], P0[..., r])
        kf.update(z[:, r], sensor)
        np.testing.assert_allclose(ens.x[:, r], kf.x, rtol=1e-9)
        np.testing.assert_allclose(ens.P[..., r], kf.P, rtol=1e-6, atol=1e-6)


def test_inflation_of_one_state_is_the_single_filters():
    F, H, Q, R = np.eye(1), np.eye(1), np.array([[0.1]]), np.array([[1.0]])
    x0, zs = np.array([[0.0, 1.0]]), np.array([[0.5, 9.0], [1.0, 12.0], [0.2, 20.0]])
    ens = adaptive.EnsembleVarianceInflationKF(F, H, Q, R, x0, np.eye(1))
    for z in zs:
        ens.predict()
        ens.update(z[None])
    for r in range(2):
        kf = filters.VarianceInflationKF(F, H, Q, R, x0[:, r], np.eye(1))
        for z in zs:
            kf.predict()
            kf.update(z[[r]])
        np.testing.assert_allclose(ens.x[:, r], kf.x, atol=1e-12)

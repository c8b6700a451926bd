"""A model or a sensor is written once, and what a subclass changes reaches every filter."""

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.filters import MotionEKF, MotionUKF
from trackhelpers.hooks import central_differences
from trackhelpers.model import Model
from trackhelpers.motion import CA, CCA, CSAA, CSAV, CTRA, CTRV, CV, PolarCA, PolarCV, Singer
from trackhelpers.sensors import Lidar, Radar
from trackhelpers.sensors.base import Sensor

MODELS = [
    CV(1.0),
    CA(1.0, axes=1),
    CTRV(2.0, 0.3),
    CTRA(1, 0.3),
    CSAV(2.7, 1, 0.1),
    CCA(1, 0.1),
    CSAA(2.7, 1, 0.1),
    PolarCV(1, 0.1),
    PolarCA(1, 0.1),
    Singer(1.0),
]


class Noisier(CTRV):
    def _Q(self, x, dt, parts):
        return super()._Q(x, dt, parts) | {(2, 2): 9.0 * dt, (4, 4): 2.0 * dt + 0 * x[2]}


class Skewed(Radar):
    def _h(self, x, parts):
        rows = super()._h(x, parts)
        return [1.1 * rows[0], *rows[1:]]

    def _H(self, x, parts):
        return {place: 1.1 * value if place[0] == 0 else value for place, value in super()._H(x, parts).items()}


class Slipping(CTRV):
    """Overrides f alone: F follows by central differences of the new f, where it asks for them."""

    def _f(self, x, dt, parts):
        px, py, v, heading, w = super()._f(x, dt, parts)
        return px, py, 0.9 * v, heading, w

    _F = Model._F


@pytest.mark.parametrize(("Single", "Ensemble"), [(MotionEKF, EnsembleEKF), (MotionUKF, EnsembleUKF)])
@pytest.mark.parametrize("model", [Noisier(2.0, 0.3), Slipping(2.0, 0.3)], ids=lambda m: type(m).__name__)
def test_an_overridden_hook_reaches_the_single_filter_and_the_ensemble_alike(model, Single, Ensemble):
    x0, P0 = np.array([4.0, 3.0, 5.0, 0.7, 0.3]), 0.1 * np.eye(5)
    kf, plain, ens = Single(model, x0, P0), Single(CTRV(2.0, 0.3), x0, P0), Ensemble(model, x0[:, None], P0)
    for sensor in (Skewed(), Lidar(), Skewed()):
        z = sensor.h(CTRV().f(x0, 0.1)) + 0.05
        for each in (kf, plain):
            each.predict(0.1)
            each.update(z, sensor)
        ens.predict(0.1)
        ens.update(z[:, None], sensor)
    np.testing.assert_allclose(ens.x[:, 0], kf.x, atol=1e-9)
    np.testing.assert_allclose(ens.P[..., 0], kf.P, atol=1e-9)
    assert np.abs(kf.P - plain.P).max() > 1e-3


@pytest.mark.parametrize("name", ["f", "F", "G", "Q", "step", "linearised"])
def test_a_public_method_of_a_model_is_not_overridden(name):
    with pytest.raises(TypeError, match=rf"Own\.{name}: write the hook _"):
        type("Own", (CTRV,), {name: lambda self, x, dt: None})


def test_nor_by_a_class_that_is_mixed_in():
    class Mixin:
        def Q(self, x, dt):
            return np.eye(5)

    with pytest.raises(TypeError, match="_Q"):
        type("Own", (Mixin, CTRV), {})


@pytest.mark.parametrize("name", ["h", "H", "step", "linearised"])
def test_a_public_method_of_a_sensor_is_not_overridden(name):
    with pytest.raises(TypeError, match=rf"Own\.{name}: write the hook _"):
        type("Own", (Radar,), {name: lambda self, x: None})


@pytest.mark.parametrize("model", MODELS, ids=lambda m: type(m).__name__)
def test_central_differences_are_the_written_jacobian(model):
    x = np.random.default_rng(0).normal(size=(model.n, 3))
    for one in (x, x[:, 0]):
        written, numeric = model.F(one, 0.3), np.zeros((model.n, model.n, *one.shape[1:]))
        for place, value in Model._F(model, one, 0.3, None).items():
            numeric[place] = value
        np.testing.assert_allclose(numeric, written, atol=3e-9)


def test_central_differences_of_a_bearing_do_not_jump_at_the_cut():
    x = np.array([-3.0, 0.0, 5.0, 0.7, 0.3])
    radar = Radar()
    numeric = np.zeros((3, 5))
    for place, value in Sensor._H(radar, x, None).items():
        numeric[place] = value
    np.testing.assert_allclose(numeric, radar.H(x), atol=1e-8)


def test_central_differences_of_a_linear_function_are_its_matrix():
    A = np.random.default_rng(1).normal(size=(2, 3))
    found = central_differences(lambda x: np.einsum("ij,j...->i...", A, x), np.array([1e6, 0.0, -1e-6]))
    np.testing.assert_allclose([[found[i, j] for j in range(3)] for i in range(2)], A, rtol=1e-4)  # 1e6 has its last places at 1e-10


class SEIR(Model):
    """An epidemic: nothing moves, nothing turns; f alone is written."""

    state, bounds = ("S", "E", "I", "β"), {"S": (0, 1), "E": (0, 1), "I": (0, 1), "β": (0, np.inf)}

    def __init__(self):
        super().__init__([("sigma_beta", 0.05)])

    def _f(self, x, dt, parts):
        S, E, I, beta = x
        infected, ill, well = beta * S * I * dt, 0.3 * E * dt, 0.2 * I * dt
        return [S - infected, E + infected - ill, I + ill - well, beta]

    def _G(self, x, dt, parts):
        return {(3, 0): np.sqrt(dt)}


@pytest.mark.parametrize("Filter", [MotionEKF, MotionUKF])
def test_a_model_without_motion_runs_in_the_motion_filters_within_its_bounds(Filter):
    model = SEIR()
    kf = Filter(model, [0.99, 0.005, 0.005, 0.6], np.diag([1e-4, 1e-5, 1e-5, 0.04]))
    many = {MotionEKF: EnsembleEKF, MotionUKF: EnsembleUKF}[Filter](model, np.repeat(kf.x[:, None], 3, axis=1), kf.P)
    seen = type("Cases", (Sensor,), {"names": ("cases",), "_h": lambda self, x, parts: [x[2]]})(0.001, model.state)
    for k in range(60):
        z = 0.02 * np.exp(-((k - 30) ** 2) / 200) - 0.002
        kf.predict(1.0)
        kf.update(z, seen)
        many.predict(1.0)
        many.update([[z]], seen)
        assert np.all(kf.x[:3] >= 0) and np.all(kf.x[:3] <= 1) and kf.x[3] >= 0
        np.testing.assert_allclose(many.x[:, 1], kf.x, atol=1e-8)


def test_what_a_model_lacks_is_named():
    class Bare(Model):
        state = ("a",)

    with pytest.raises(NotImplementedError, match="lacks the hook _f"):
        Bare(Q=[[1.0]]).f([0.0], 0.1)
    with pytest.raises(NotImplementedError, match="_G or _Q, or a constant Q"):
        Bare().Q([0.0], 0.1)


def test_a_hook_in_array_notation_serves_one_state_as_it_serves_many():
    class Decay(Model):
        state = ("a", "b", "c")

        def _f(self, x, dt, parts):
            return [*(np.exp(-dt * x[:1]) + x[1:2]), *(x[1:] + x[:2])]

    x = np.random.default_rng(0).normal(size=(3, 4))
    model = Decay(Q=np.eye(3))
    np.testing.assert_allclose(model.f(x, 0.5)[:, 2], model.f(x[:, 2], 0.5), rtol=1e-14)
    np.testing.assert_allclose(model.f(x, 0.5)[1:], x[1:] + x[:2])


def test_a_wrong_number_of_rows_is_named():
    Short = type("Short", (CTRV,), {"_f": lambda self, x, dt, parts: list(x)[:4]})
    with pytest.raises(ValueError, match="_f: expected 5 rows, got 4"):
        Short().f(np.ones(5), 0.1)


def test_where_pythons_numbers_raise_a_single_state_gets_numpys_inf():
    with np.errstate(all="ignore"):
        assert np.isinf(CTRA(1.0).f([0, 0, 1e308, 0, 0, 1e308], 1e10)[2])
        assert not np.isfinite(CSAV(2.7).f([0, 0, 1e308, 0, 1.5], 1e10)).all()


CONTINUOUS = [CV, CA, CTRV, CTRA, PolarCV, PolarCA, CCA]


@pytest.mark.parametrize("Model", CONTINUOUS, ids=lambda m: m.__name__)
def test_the_split_of_a_step_does_not_change_continuous_noise(Model):
    model = Model(0.7, noise="continuous") if Model in (CV, CA) else Model(0.7, 0.3, noise="continuous")
    rng = np.random.default_rng(2)
    for _ in range(5):
        x, a, b = rng.normal(size=model.n), 0.3, 1.1
        middle = model.f(x, a)
        F = model.F(middle, b)
        np.testing.assert_allclose(F @ model.Q(x, a) @ F.T + model.Q(middle, b), model.Q(x, a + b), rtol=1e-10, atol=1e-12)


def test_continuous_noise_is_the_textbooks():
    from filterpy.common import Q_continuous_white_noise

    np.testing.assert_allclose(
        CV(0.7, noise="continuous").Q(np.zeros(4), 0.3), Q_continuous_white_noise(2, 0.3, 0.49, block_size=2), atol=1e-15
    )
    np.testing.assert_allclose(
        CA(0.7, noise="continuous").Q(np.zeros(6), 0.3), Q_continuous_white_noise(3, 0.3, 0.49, block_size=2), atol=1e-15
    )


def test_continuous_noise_of_a_turn_is_what_samples_of_a_fine_walk_show():
    model, x, dt, steps, runs = CTRV(0.5, 0.2), np.array([0.0, 0.0, 5.0, 0.4, 0.6]), 1.0, 200, 4000
    fine, rng = np.repeat(x[:, None], runs, axis=1), np.random.default_rng(3)
    for _ in range(steps):
        fine = CTRV().f(fine, dt / steps)
        fine[[2, 4]] += np.array([[0.5], [0.2]]) * np.sqrt(dt / steps) * rng.standard_normal((2, runs))
    Q = CTRV(0.5, 0.2, noise="continuous").Q(x, dt)
    scale = np.sqrt(np.diag(Q))
    np.testing.assert_allclose(np.cov(fine) / np.outer(scale, scale), Q / np.outer(scale, scale), atol=0.08)
    assert model.noise == "straight"


@pytest.mark.parametrize("noise", ["straight", "exact", "continuous"])
def test_every_noise_serves_many_states_as_it_serves_one(noise):
    x = np.random.default_rng(4).normal(size=(5, 3))
    model = CTRV(0.5, 0.2, noise=noise)
    np.testing.assert_allclose(model.Q(x, 0.7)[..., 1], model.Q(x[:, 1], 0.7), atol=1e-14)


def test_an_input_that_is_white_in_time_has_no_gain():
    with pytest.raises(NotImplementedError, match="white in time"):
        CTRV(1.0, 1.0, noise="continuous").G(np.zeros(5), 0.1)


TURNING = [CTRV(), CTRA(), CSAV(2.7), CSAA(2.7), CCA(), PolarCV(), PolarCA()]


@pytest.mark.parametrize("model", TURNING, ids=lambda m: type(m).__name__)
def test_a_motion_and_the_same_driven_backwards_go_to_the_same_places(model):
    x = np.random.default_rng(5).normal(size=model.n)
    x[model.backwards[0]] = -3.0
    folded = model.fold(x)
    assert folded[model.backwards[0]] == 3.0
    np.testing.assert_allclose(model.f(folded, 0.7)[:2], model.f(x, 0.7)[:2], atol=1e-12)
    np.testing.assert_allclose(model.fold(model.f(folded, 0.7), near=model.f(x, 0.7)), model.normalise(model.f(x, 0.7)), atol=1e-12)


def test_nees_of_a_filter_that_drives_backwards_is_folded_on_request():
    model, truth = CTRV(), np.array([1.0, 2.0, 5.0, 0.7, 0.3])
    kf = MotionEKF(model, [1.1, 2.0, -5.1, 0.7 + np.pi, 0.3], 0.01 * np.eye(5))
    ens = EnsembleEKF(model, np.stack([kf.x, truth], axis=1), 0.01 * np.eye(5))
    assert kf.nees(truth) > 1e4
    assert kf.nees(truth, fold=True) == pytest.approx(2.0)
    np.testing.assert_allclose(ens.nees(truth, fold=True), [2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(CV().fold(np.arange(4.0)), np.arange(4.0))

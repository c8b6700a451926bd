import numpy as np
import pytest

from trackhelpers.motion import CA, CTRA, CTRV, CV, PolarCA
from trackhelpers.sensors import Lidar, Position, Radar, RangeBearing

STATES = [CTRV().state, CTRA().state, CV().state, CA().state, PolarCA().state]


@pytest.mark.parametrize("state", STATES, ids="-".join)
@pytest.mark.parametrize("make", [lambda s: Lidar(0.15, s), lambda s: RangeBearing((1.0, 0.1), s), lambda s: Radar(state=s)])
def test_H_is_the_derivative_of_h(make, state):
    sensor, h = make(state), 1e-6
    rng = np.random.default_rng(0)
    for _ in range(20):
        x = rng.normal(size=len(state)) + 2
        difference = np.stack([(sensor.h(x + h * e) - sensor.h(x - h * e)) / (2 * h) for e in np.eye(len(state))], axis=1)
        np.testing.assert_allclose(sensor.H(x), difference, atol=1e-7)


@pytest.mark.parametrize("state", STATES, ids="-".join)
def test_any_trailing_axes_equal_one_target_at_a_time(state):
    sensor = Radar(state=state)
    X = np.random.default_rng(1).normal(size=(len(state), 3, 2))
    for i in range(3):
        for j in range(2):
            np.testing.assert_allclose(sensor.h(X)[:, i, j], sensor.h(X[:, i, j]))
            np.testing.assert_allclose(sensor.H(X)[..., i, j], sensor.H(X[:, i, j]))


@pytest.mark.parametrize("state", STATES, ids="-".join)
@pytest.mark.parametrize("make", [Lidar, Radar, lambda **s: RangeBearing((1.0, 0.1), **s)], ids=["Lidar", "Radar", "RangeBearing"])
def test_linearised_is_h_and_H(make, state):
    sensor = make(state=state)
    for x in (np.random.default_rng(2).normal(size=(len(state), 7)), np.arange(1.0, len(state) + 1)):
        seen, entries = sensor.linearised(x)
        np.testing.assert_allclose(seen, sensor.h(x), rtol=1e-14)
        H = np.zeros((sensor.m, len(state), *x.shape[1:]))
        for place, value in entries.items():
            H[place] = value
        np.testing.assert_allclose(H, sensor.H(x), rtol=1e-14)


def test_linearised_computes_what_h_and_H_share_once_and_forgets_it():
    class Counting(Radar):
        count = 0

        def _parts(self, x):
            self.count += 1
            return super()._parts(x)

    radar, x = Counting(), np.ones((5, 3))
    radar.linearised(x)
    assert radar.count == 1
    x[0] = 2  # the same array, another state
    assert radar.h(x)[0, 0] == pytest.approx(np.sqrt(5))
    with pytest.raises(ValueError, match="range 0"):
        radar.linearised(np.zeros(5))
    assert radar.linearised(x)[0][0, 0] == pytest.approx(np.sqrt(5))


def test_linearised_takes_the_h_and_H_of_a_subclass():
    class Doubled(Radar):
        def _h(self, x, parts):
            return [2 * value for value in super()._h(x, parts)]

        def _H(self, x, parts):
            return {place: 2 * value for place, value in super()._H(x, parts).items()}

    x = np.ones((5, 3))
    (one, one_H), (two, two_H) = Radar().linearised(x), Doubled().linearised(x)
    np.testing.assert_array_equal(two, 2 * one)
    assert all(np.array_equal(two_H[place], 2 * one_H[place]) for place in one_H)


def test_range_rate_is_the_derivative_of_the_range_along_the_motion():
    model, radar, x, dt = CTRV(), Radar(), np.array([3.0, -2.0, 5.0, 0.7, 0.4]), 1e-6
    ahead, behind = radar.h(model.f(x, dt)), radar.h(2 * x - model.f(x, dt))
    assert radar.h(x)[2] == pytest.approx((ahead[0] - behind[0]) / (2 * dt), rel=1e-6)


def test_the_two_layouts_measure_the_same():
    v, th = 5.0, 0.7
    one = Radar(state=CTRV().state).h([3, -2, v, th, 0.4])
    two = Radar(state=CV().state).h([3, v * np.cos(th), -2, v * np.sin(th)])
    np.testing.assert_allclose(one, two)


def test_bearing_residual_crosses_the_cut():
    np.testing.assert_allclose(Radar().residual([1, 3.1, 0], [1, -3.1, 0]), [0, 6.2 - 2 * np.pi, 0])


def test_R_is_the_squared_sigmas_and_read_only():
    assert np.array_equal(Radar((0.3, 0.03, 0.3)).R, np.diag(np.square([0.3, 0.03, 0.3])))
    with pytest.raises(ValueError, match="read-only"):
        Radar().R[0, 0] = 1


def test_at_the_sensor_one_target_raises_and_an_ensemble_marks_the_run():
    with pytest.raises(ValueError, match="range 0"):
        Radar().h(np.zeros(5))
    X = np.ones((5, 3))
    X[:2, 1] = 0
    seen = Radar().h(X)
    assert np.isnan(seen[0, 1]) and np.isfinite(seen[:, [0, 2]]).all()


def test_position_measures_each_axis_of_the_state():
    assert np.array_equal(Position(0.5, CA(axes=1).state).H(np.zeros(3)), [[1, 0, 0]])
    assert np.array_equal(Position(0.5, CV(axes=3).state).h(np.arange(6.0)), [0, 2, 4])


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: Lidar(-1), "sigma"),
        (lambda: Radar((0.3, 0.03)), "sigma"),
        (lambda: Radar(("a", "b", "c")), "sigma"),
        (lambda: Lidar(0.15, state=CA(axes=1).state), "state"),
        (lambda: Radar(state=("x", "y")), "state"),
        (lambda: Position(1.0, state=("θ",)), "state"),
        (lambda: Lidar().h(np.zeros(4)), "x"),
        (lambda: Radar().H([1, 2, np.nan, 0, 0]), "x"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()

import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, Plane, ecef, next_sign
from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.filters import MotionEKF, MotionUKF
from trackhelpers.model import Model
from trackhelpers.motion import CV
from trackhelpers.sensors import TDOA, range_differences

STATE = ("x", "y", "vx", "vy")
SIGMA = 24.0


class PaperCV(Model):
    """Constant velocity in the paper's order of the state."""

    state = STATE

    def __init__(self):
        super().__init__(Q=np.diag([1e-3] * 4))

    def _f(self, x, dt, parts):
        return [x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3]]


def satellites(t):
    """Three satellites about 1000 km over (30°N, 137°E), which move north."""
    lat, lon = np.radians([30.0, 29.1, 29.5]) + 1e-3 * t, np.radians([137.0, 137.0, 137.9])
    return ecef(lat, lon, 1e6)


EMITTER = ecef(np.radians(30.5), np.radians(138.0))
CHARTS = {
    "ellipsoid": (Ellipsoid(), EMITTER[:2], satellites),
    "enu": (LocalENU(np.radians(30.0), np.radians(137.0)), np.array([9e4, 5e4]), satellites),
    "plane": (Plane(), np.array([3e5, 2e5]), np.array([[0.0, 5e6, 0.0], [0.0, 0.0, 4e6]])),
}


@pytest.mark.parametrize("chart, q, sats", CHARTS.values(), ids=CHARTS)
def test_h_is_the_difference_of_the_distances(chart, q, sats):
    sensor = TDOA(SIGMA, sats, chart, STATE).at(3.0)
    p, s = chart.position(q), sats(3.0) if callable(sats) else np.vstack([sats, np.zeros(3)])
    r = np.linalg.norm(p[:, None] - s, axis=0)
    seen = sensor.h([*q, 1.0, 2.0])
    np.testing.assert_allclose(seen, r[1:] - r[0], atol=1e-8)
    np.testing.assert_allclose(range_differences(p, s), seen, atol=1e-9)


@pytest.mark.parametrize("state", [STATE, ("x", "vx", "y", "vy"), ("vy", "y", "b1", "vx", "x")], ids="-".join)
@pytest.mark.parametrize("chart, q, sats", CHARTS.values(), ids=CHARTS)
def test_H_is_the_derivative_of_h(chart, q, sats, state):
    sensor = TDOA(SIGMA, sats, chart, state).at(3.0)
    x = np.zeros(len(state))
    x[state.index("x")], x[state.index("y")] = q
    step = 10.0
    difference = np.stack([(sensor.h(x + step * e) - sensor.h(x - step * e)) / (2 * step) for e in np.eye(len(x))], axis=1)
    np.testing.assert_allclose(sensor.H(x), difference, atol=1e-8)
    assert np.count_nonzero(sensor.H(x)) == 4


def test_range_differences_without_cancellation_agree_with_a_hundred_digits():
    mpmath = pytest.importorskip("mpmath")
    s = satellites(0.0)
    with mpmath.workdps(100):
        r = [mpmath.sqrt(sum((mpmath.mpf(a) - mpmath.mpf(b)) ** 2 for a, b in zip(EMITTER, s[:, i], strict=True))) for i in range(3)]
        exact = [float(r[i] - r[0]) for i in (1, 2)]
    np.testing.assert_allclose(range_differences(EMITTER, s), exact, rtol=0, atol=2e-10)


def test_range_differences_broadcast_over_times_and_runs():
    times, offsets = np.arange(4.0), np.linspace(-1e4, 1e4, 5)
    s = np.stack([satellites(t) for t in times], axis=-1)[..., None]
    p = EMITTER[:, None, None] + np.stack([offsets, offsets, 0 * offsets])[:, None]
    d = range_differences(p, s)
    assert d.shape == (2, 4, 5)
    for k in range(4):
        for m in range(5):
            np.testing.assert_allclose(d[:, k, m], range_differences(p[:, 0, m], s[..., k, 0]), atol=1e-9)


def test_rows_by_number_and_by_name_are_the_rows_of_the_pair():
    R = SIGMA**2 * np.array([[2.0, 1.0], [1.0, 3.0]])
    x = np.array([*EMITTER[:2], 0.0, 0.0])
    pair = TDOA(R, satellites, Ellipsoid(), STATE).at(1.0)
    assert pair.names == ("d1", "d2")
    np.testing.assert_array_equal(pair.R, R)
    for rows, taken in [((1,), [0]), ((2,), [1]), (2, [1]), ("d1", [0]), (("d2", "d1"), [1, 0])]:
        for same in (TDOA(R, satellites, Ellipsoid(), STATE, rows=rows), TDOA(R=R, satellites=satellites, chart=Ellipsoid(), rows=rows)):
            same = same.at(1.0)
            np.testing.assert_array_equal(same.h(x), pair.h(x)[taken])
            np.testing.assert_array_equal(same.H(x), pair.H(x)[taken])
            np.testing.assert_array_equal(same.R, R[np.ix_(taken, taken)])


def test_two_satellites_give_one_difference_and_four_give_three():
    four = np.column_stack([satellites(0.0), ecef(np.radians(30.9), np.radians(136.0), 1e6)])
    x = np.array([*EMITTER[:2], 0.0, 0.0])
    all_rows = TDOA(SIGMA, four, Ellipsoid(), STATE, rows=(1, 2, 3)).h(x)
    assert TDOA(SIGMA, four[:, :2], Ellipsoid(), STATE, rows=(1,)).h(x) == all_rows[0]
    assert TDOA(SIGMA, lambda t: four[:, :2], Ellipsoid(), STATE, rows=(1,)).at(0).h(x) == all_rows[0]
    assert TDOA(SIGMA, lambda t: four, Ellipsoid(), STATE, rows=(3,)).at(0).h(x) == all_rows[2]


def test_at_gives_the_satellites_of_that_instant_and_keeps_the_last():
    sensor, x = TDOA(SIGMA, satellites, Ellipsoid(), STATE), np.array([*EMITTER[:2], 0.0, 0.0])
    early, late = sensor.at(1.0), sensor.at(2.0)
    np.testing.assert_allclose(early.h(x), TDOA(SIGMA, satellites(1.0), Ellipsoid(), STATE).h(x))
    assert not np.allclose(early.h(x), late.h(x))
    assert sensor.at(2.0) is late
    np.testing.assert_allclose(late.at(1.0).h(x), early.h(x))
    with pytest.raises(ValueError, match="at"):
        sensor.h(x)


@pytest.mark.parametrize("state", [STATE, ("x", "vx", "y", "vy")], ids="-".join)
@pytest.mark.parametrize("one, many", [(MotionEKF, EnsembleEKF), (MotionUKF, EnsembleUKF)])
def test_an_ensemble_is_its_runs_one_by_one_with_masks_and_a_sign_of_each(one, many, state):
    model = CV(1e-3, noise="continuous") if state[1] == "vx" else PaperCV()
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    rng = np.random.default_rng(1)
    x0 = np.zeros((4, 4))
    place = [state.index("x"), state.index("y")]
    x0[place] = EMITTER[:2, None] + 1e3 * rng.normal(size=(2, 4))
    P0 = np.diag([1e6 if i in place else 100.0 for i in range(4)])
    masks = [None, np.array([True, False, True, True]), np.array([False, True, False, True])]
    zs = [range_differences(np.stack([*EMITTER[:2, None].repeat(4, 1), signs * EMITTER[2]]), satellites(t))[:, :4] for t in range(3)]
    sensors = [TDOA(SIGMA, satellites, Ellipsoid(signs), state, rows=rows) for rows in ((1, 2), (1,), (2,))]
    ens = many(model, x0, P0)
    singles = [one(model, x0[:, m], P0) for m in range(4)]
    for t, (mask, sensor) in enumerate(zip(masks, sensors, strict=True)):
        z = zs[t][list(sensor._taken)]
        ens.predict(1.0)
        ens.update(z, sensor.at(t), mask=mask)
        for m, kf in enumerate(singles):
            kf.predict(1.0)
            measured = mask is None or mask[m]
            kf.update(z[:, m] if measured else None, sensor.with_chart(Ellipsoid(signs[m])).at(t) if measured else None)
            np.testing.assert_allclose(ens.x[:, m], kf.x, atol=1e-6)
            np.testing.assert_allclose(ens.P[..., m], kf.P, rtol=1e-7, atol=1e-6)
    assert np.abs(ens.x[place] - EMITTER[:2, None])[:, ::2].max() < 200  # those on the satellites' side of the Earth


def test_outside_the_ellipsoid_is_an_error_for_one_target_and_nan_for_that_run():
    sensor = TDOA(SIGMA, satellites, Ellipsoid(), STATE).at(0.0)
    inside, outside = [*EMITTER[:2], 0, 0], [7e6, 0, 0, 0]
    for method in (sensor.h, sensor.H, sensor.step):
        with pytest.raises(ValueError, match="ellipsoid"):
            method(outside)
    both = np.array([inside, outside], dtype=float).T
    np.testing.assert_array_equal(np.isnan(sensor.h(both)), [[False, True], [False, True]])
    assert np.isnan(sensor.H(both)[:, :2, 1]).all() and np.isfinite(sensor.H(both)[..., 0]).all()
    ens = EnsembleUKF(PaperCV(), both, np.diag([1e4, 1e4, 1.0, 1.0]))
    ens.update(sensor.h(both)[:, :1], sensor)
    np.testing.assert_array_equal(ens.failed, [False, True])


def test_a_filter_of_one_target_whose_sigma_points_leave_the_ellipsoid_says_so_and_stays():
    kf = MotionUKF(PaperCV(), [6.378e6, 0.0, 0.0, 0.0], np.diag([1e8, 1e8, 1.0, 1.0]))
    before = kf.x.copy(), kf.P.copy()
    with pytest.raises(ValueError, match="sigma point"):
        kf.update([0.0, 0.0], TDOA(SIGMA, satellites, Ellipsoid(), STATE).at(0.0))
    np.testing.assert_array_equal(kf.x, before[0])
    np.testing.assert_array_equal(kf.P, before[1])


@pytest.mark.parametrize(
    "change, words",
    [
        ({"sigma": None}, "sigma, R"),
        ({"R": np.eye(2)}, "sigma, R"),
        ({"rows": (1, 1)}, "rows"),
        ({"rows": (0,)}, "rows"),
        ({"rows": (3,), "satellites": satellites(0.0)}, "rows"),
        ({"rows": ()}, "rows"),
        ({"sigma": np.ones((2, 3))}, "R"),
        ({"satellites": np.ones((3, 1))}, "satellites"),
        ({"satellites": np.ones(3)}, "satellites"),
        ({"satellites": np.full((3, 3), np.nan)}, "satellites"),
        ({"state": ("e", "n")}, "state"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        TDOA(**{"sigma": SIGMA, "satellites": satellites, "chart": Ellipsoid(), "state": STATE, **change})


def test_a_function_that_gives_too_few_satellites_is_refused_when_asked():
    with pytest.raises(ValueError, match="satellites"):
        TDOA(SIGMA, lambda t: satellites(t)[:, :2], Ellipsoid(), STATE).at(0.0)


def test_the_sign_rule_is_right_along_a_crossing_of_the_equator():
    chart = Ellipsoid()  # a ship sails south along a meridian at 8 m/s, sampled once a second, from 1 km north
    lat = (1000.5 - 8.0 * np.arange(300)) / chart.a
    track = ecef(lat, np.radians(150.0))
    sign = 1.0
    for k in range(299):
        chart = chart.with_sign(sign)
        p = chart.position(track[:2, k])
        rate = track[:, k + 1] - track[:, k]
        sign = next_sign(p[2], rate[2], 1.0)
        assert sign == np.sign(track[2, k + 1])
    signs = next_sign(np.array([1.0, -1.0, 5.0, np.nan]), np.array([-3.0, 3.0, -3.0, 1.0]), 1.0)
    np.testing.assert_array_equal(signs, [-1, 1, 1, 1])

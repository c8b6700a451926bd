import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU
from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.filters import MotionEKF, MotionUKF
from trackhelpers.motion import CV
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors import FDOA, range_differences

STATE = ("x", "y", "vx", "vy")
P, V = (part[..., 0] for part in paper.track("ship", np.array([240.0])))
CHARTS = {"ellipsoid": Ellipsoid(), "enu": LocalENU(np.radians(20.0), np.radians(135.0))}


def _sensor(chart, state=STATE, rows=(1, 2), sigma=0.1):
    return FDOA(sigma, paper.satellites, paper.satellite_velocities, chart, state, rows)


def _state(chart, state=STATE, velocity=V):
    q = chart.to_chart(P)
    rate = np.linalg.lstsq(chart.jacobian(q), velocity, rcond=None)[0]
    values = dict(zip((*STATE, "b"), [*q, *rate, 0.0], strict=True))
    return np.array([values[name] for name in state])


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_h_is_the_rate_of_the_range_difference_of_a_ship_under_way(chart):
    ahead, behind = (range_differences(P + V * dt, paper.satellites(240.0 + dt)) for dt in (0.05, -0.05))
    np.testing.assert_allclose(_sensor(chart).at(240.0).h(_state(chart)), (ahead - behind) / 0.1, atol=1e-4)


@pytest.mark.parametrize("state", [STATE, ("x", "vx", "y", "vy"), ("vy", "b", "y", "vx", "x")], ids="-".join)
@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_H_is_the_derivative_of_h_with_the_turning_of_the_chart(chart, state):
    sensor = _sensor(chart, state).at(240.0)
    x = _state(chart, state, 300 * V)
    steps = np.array([30.0 if name in "xy" else 1.0 for name in state])
    difference = np.stack(
        [(sensor.h(x + s * e) - sensor.h(x - s * e)) / (2 * s) for s, e in zip(steps, np.eye(len(x)), strict=True)], axis=1
    )
    np.testing.assert_allclose(sensor.H(x), difference, rtol=1e-6, atol=1e-11)


def test_rows_are_those_of_the_pair_and_two_satellites_give_one():
    chart = Ellipsoid()
    x, pair = _state(chart), _sensor(chart).at(240.0)
    for rows, k in (((1,), 0), (2, 1), ("ḋ2", 1)):
        single = _sensor(chart, rows=rows).at(240.0)
        np.testing.assert_array_equal(single.h(x), pair.h(x)[[k]])
        np.testing.assert_array_equal(single.H(x), pair.H(x)[[k]])
    s, v = paper.satellites(240.0)[:, :2], paper.satellite_velocities(240.0)[:, :2]
    np.testing.assert_array_equal(FDOA(0.1, s, v, chart, rows=(1,)).h(x), pair.h(x)[:1])


@pytest.mark.parametrize("one, many", [(MotionEKF, EnsembleEKF), (MotionUKF, EnsembleUKF)])
def test_an_ensemble_is_its_runs_one_by_one(one, many):
    chart, model = Ellipsoid(np.array([1.0, 1.0, 1.0])), CV(1e-3, noise="continuous")
    sensor = _sensor(chart, model.state)
    x0 = _state(Ellipsoid(), model.state)[:, None] + np.random.default_rng(0).normal(size=(4, 3)) * np.array([1e3, 5, 1e3, 5])[:, None]
    P0 = np.diag([1e6, 25.0, 1e6, 25.0])
    ens, singles = many(model, x0, P0), [one(model, x0[:, m], P0) for m in range(3)]
    mask = np.array([True, False, True])
    z = (
        np.array([0.3, -0.2])[:, None]
        + _sensor(Ellipsoid(), model.state).at(241.0).h(_state(Ellipsoid(), model.state))[:, None]
        + np.zeros((2, 3))
    )
    ens.predict(1.0)
    ens.update(z, sensor.at(241.0), mask=mask)
    for m, kf in enumerate(singles):
        kf.predict(1.0)
        kf.update(z[:, m] if mask[m] else None, sensor.with_chart(Ellipsoid()).at(241.0))
        np.testing.assert_allclose(ens.x[:, m], kf.x, atol=1e-6)
        np.testing.assert_allclose(ens.P[..., m], kf.P, rtol=1e-7, atol=1e-6)


def test_what_does_not_fit_is_refused():
    s = paper.satellites(0.0)
    for change, words in [
        ({"velocities": s[:, :2]}, "velocities"),
        ({"velocities": paper.satellite_velocities}, "velocities"),
        ({"state": ("x", "y")}, "vx"),
    ]:
        with pytest.raises(ValueError, match=words):
            FDOA(**{"sigma": 0.1, "satellites": s, "velocities": s, "chart": Ellipsoid(), **change})
    with pytest.raises(ValueError, match="ellipsoid"):
        _sensor(Ellipsoid()).at(0.0).h([7e6, 0.0, 0.0, 0.0])

"""Valid calls of sensors and of the fixes from range differences."""

import numpy as np
from bad_inputs import Angles, Count, Covariance, Each, Fixed, Mask, Names, Number, Numbers, Scale, Thing
from calls import Call, on

from trackhelpers import batch, fixes, sensors
from trackhelpers.charts import Ellipsoid, Plane
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors.base import CTRV_STATE, Sensor

TIMES = np.array([200.0, 260.0, 320.0, 380.0])
S = paper.satellites(240.0)
SEEN = paper.track("T1", 240.0)[0]
D = sensors.range_differences(SEEN, S)
MANY = paper.satellites(TIMES)
Z = sensors.range_differences(SEEN[:, None], MANY)
R2, FLAT = 9.0 * np.eye(2), np.array([[0.0, 1e4, 0.0], [0.0, 0.0, 1e4], [5e3, 5e3, 5e3]])
X4, X5 = np.array([3e3, 4e3, 5.0, 6.0]), np.array([30.0, 40.0, 5.0, 0.3, 0.1])


class Depth(Sensor):
    """A sensor that is written by hand."""

    names = ("d", "e")

    def __init__(self, sigma=1.0, R=None, rows=None, angles=None):
        super().__init__(sigma, CTRV_STATE, R, rows, angles)

    def _h(self, x, parts):
        return [x[0] * x[1], x[1]]


def tdoa():
    return sensors.TDOA(3.0, FLAT, Plane(), ("x", "y", "vx", "vy"))


def moving():
    return sensors.TDOA(3.0, lambda t: FLAT + t, Plane(), ("x", "y", "vx", "vy"))


def _mounted(kind, m, **more):
    shared = {"state": Names(CTRV_STATE), "rows": Names(None, optional=True), "position": Numbers([1.0, 2.0], optional="position" in more)}
    return [
        Call(kind, sigma=Scale(0.5, array=True), heading=Number(0.3), **shared),
        Call(kind, sigma=Each(*[Scale(0.5)] * m, number=True)),
        Call(kind, R=Covariance(np.eye(m), optional=True)),
    ]


STATE = Names(("x", "y", "vx", "vy"))
X = Numbers(X5, beyond=(np.ones((4, 3)),))
_RADAR = sensors.Radar

CALLS = {
    "sensors.base.Sensor": [
        Call(
            Depth, sigma=Each(Scale(1.0), Scale(2.0), number=True), rows=Names(None, optional=True), angles=Angles((1,), 2, optional=True)
        ),
        Call(Depth, sigma=Scale(1.0, array=True)),
        Call(Depth, R=Covariance(R2, optional=True)),
    ],
    **{f"sensors.base.Sensor.{name}": [Call(on(_RADAR, name), x=X)] for name in ("h", "H", "step", "linearised")},
    "sensors.base.Sensor.residual": [
        Call(on(_RADAR, "residual"), z=Numbers([1.0, 2.0, 3.0], gaps=True), z_hat=Numbers([1.0, 2.0, 3.0], gaps=True))
    ],
    "sensors.base.Sensor.at": [Call(on(_RADAR, "at"), t=Number(3.0))],
    "sensors.linear.Position": _mounted(sensors.Position, 2, position=None),
    "sensors.linear.Lidar": _mounted(sensors.Lidar, 2, position=None),
    "sensors.polar.RangeBearing": _mounted(sensors.RangeBearing, 2),
    "sensors.polar.Radar": _mounted(sensors.Radar, 3),
    "sensors.linear.LinearSensor": [
        Call(
            sensors.LinearSensor,
            H=Numbers(np.eye(2, 4)),
            R=Covariance(R2),
            state=Names(STATE.value, beyond=((1, 2),)),
            names=Names(("a", "b"), optional=True, beyond=((1, 2),)),
            angles=Angles((1,), 2, optional=True),
        )
    ],
    "sensors.tdoa.range_differences": [
        Call(
            sensors.range_differences,
            position=Numbers([1e3, 2e3, 3e3], gaps=False),
            satellites=Numbers(FLAT, free=True, beyond=(FLAT[:, :1], FLAT[:1])),
        )
    ],
    "sensors.tdoa.difference_gradients": [
        Call(
            sensors.difference_gradients,
            position=Numbers([1e3, 2e3, 3e3]),
            satellites=Numbers(FLAT, free=True, beyond=(FLAT[:, :1], FLAT[:1])),
        )
    ],
    "sensors.tdoa.StationDifferences": [
        Call(
            sensors.TDOA,
            sigma=Scale(3.0, array=True),
            satellites=Numbers(FLAT, free=True, beyond=(FLAT[:, :1],)),
            chart=Thing(Plane()),
            state=STATE,
            rows=Fixed((1, 2)),
        )
    ],
    "sensors.tdoa.TDOA": [
        Call(lambda **k: sensors.TDOA(satellites=FLAT, chart=Plane(), **k), sigma=Each(Scale(3.0), Scale(3.0), number=True)),
        Call(lambda **k: sensors.TDOA(satellites=FLAT, chart=Plane(), **k), R=Covariance(R2)),
        Call(
            lambda **k: sensors.TDOA(3.0, FLAT, Plane(), **k), rows=Names((1, 2), beyond=((1, 9), (0,), (-1,), ("nonsense",), (1, 1), ()))
        ),
    ],
    "sensors.tdoa.StationDifferences.at": [Call(on(moving, "at"), t=Number(5.0))],
    "sensors.tdoa.StationDifferences.with_chart": [Call(on(tdoa, "with_chart"), chart=Thing(Plane()))],
    "sensors.tdoa.StationDifferences.of_runs": [
        Call(
            on(lambda: sensors.TDOA(3.0, FLAT, Ellipsoid([1, -1])), "of_runs"),
            mask=Mask([True, False]),
        )
    ],
    "sensors.fdoa.FDOA": [
        Call(
            sensors.FDOA,
            sigma=Scale(3.0, array=True),
            satellites=Numbers(FLAT, free=True, beyond=(FLAT[:, :1],)),
            velocities=Numbers(FLAT / 10, free=True, beyond=(FLAT[:, :1],)),
            chart=Thing(Plane()),
            state=STATE,
            rows=Names((1, 2), beyond=((1, 9), (0,), (-1,), ("nonsense",), (1, 1), ())),
        )
    ],
    "fixes.fix": [Call(fixes.fix, d=Numbers(D, beyond=(1e9 * D,)), satellites=Numbers(S), near=Numbers(SEEN, optional=True))],
    "fixes.candidates": [Call(fixes.candidates, d=Numbers(D), satellites=Numbers(S))],
    "fixes.fix_covariance": [
        Call(fixes.fix_covariance, position=Numbers(SEEN), satellites=Numbers(S), R=Covariance(R2, definite=True), chart=Thing(Ellipsoid()))
    ],
    "batch.batch_fix": [
        Call(
            batch.batch_fix,
            z=Numbers(Z, gaps=True),
            t=Numbers(TIMES),
            satellites=Numbers(MANY),
            R=Covariance(R2, definite=True),
            chart=Thing(Ellipsoid()),
            x0=Numbers(SEEN[:2] + 1e3, free=True, beyond=(np.ones(3), np.ones((2, 2)))),
            t0=Number(0.0),
            iterations=Count(50),
        )
    ],
}

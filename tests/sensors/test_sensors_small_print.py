"""What a sensor declares, takes for granted, keeps and refuses."""

import copy

import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, Plane, ecef
from trackhelpers.motion import CA, CTRV, CV
from trackhelpers.sensors import (
    FDOA,
    TDOA,
    Lidar,
    LinearSensor,
    Position,
    Radar,
    RangeBearing,
    Sensor,
    difference_gradients,
    range_differences,
)
from trackhelpers.sensors.base import check_mounting, check_time
from trackhelpers.sensors.tdoa import check_stations

CARTESIAN, TURN = CV(1.0).state, CTRV(1.0, 0.1).state
X = np.random.default_rng(0).normal(size=(5, 6)) + np.array([30, 20, 3, 0, 0])[:, None]


class Compass(Sensor):
    """A heading and a speed, without a written Jacobian."""

    names = ("ψ", "speed")

    def _h(self, x, parts):
        return [np.arctan2(x[3], x[1]), (x[1] ** 2 + x[3] ** 2) ** 0.5]


# --- what all share


@pytest.mark.parametrize("name", ["h", "H", "step", "linearised"])
def test_a_subclass_writes_hooks(name):
    with pytest.raises(TypeError, match=rf"\.{name}: write the hook _"):
        type("Wrong", (Sensor,), {name: lambda self, x: x})


def test_a_sensor_without_h_says_so():
    with pytest.raises(NotImplementedError, match="Bare lacks the hook _h"):
        type("Bare", (Sensor,), {"names": ("a",)})(1.0, CARTESIAN).h(np.zeros(4))


def test_a_sensor_without_a_jacobian_has_central_differences_across_the_cut():
    sensor = Compass((0.1, 0.5), CARTESIAN)
    x = np.array([1.0, -3.0, 2.0, 0.0])  # to the west
    expected = np.array([[0, 0, 0, -1 / 3], [0, -1.0, 0, 0]])
    np.testing.assert_allclose(sensor.H(x), expected, atol=1e-8)
    np.testing.assert_allclose(sensor.H(np.stack([x, x], axis=1))[..., 1], expected, atol=1e-8)
    part = Compass(0.1, CARTESIAN, rows=("speed",))
    np.testing.assert_allclose(part.H(x), expected[1:], atol=1e-8)
    np.testing.assert_allclose(part.linearised(x)[1][0, 1], -1.0, atol=1e-8)
    assert sensor.angles == (0,) and part.angles == () and Compass(0.1, CARTESIAN, angles=(1,)).angles == (1,)
    assert Compass(0.1, CARTESIAN, angles=()).angles == () and Compass(0.1, CARTESIAN, rows=("speed", "ψ"), angles=(0,)).angles == (1,)
    assert not sensor.linear and sensor.m == 2 and sensor.names == sensor.components == ("ψ", "speed")


def test_a_sensor_introduces_itself():
    assert repr(Radar((0.5, 0.25, 2.0), CARTESIAN, rows=("ρ", "ψ"))) == "Radar(sigma=(0.5, 0.25), state=(x, vx, y, vy), names=(ρ, ψ))"


@pytest.mark.parametrize(
    ("sigma", "rows", "expected"),
    [
        (2.0, None, [2, 2, 2]),
        (2.0, ("ψ",), [2]),
        ((1.0, 2.0, 3.0), None, [1, 2, 3]),
        ((1.0, 2.0, 3.0), ("ρ̇", "ρ"), [3, 1]),
        ((1.0, 2.0), ("ρ̇", "ρ"), [1, 2]),
        (np.array([1.0, 2.0, 3.0]), "ψ", [2]),
        (np.array([4.0]), "ψ", [4]),
        (np.array(4.0), None, [4, 4, 4]),
    ],
)
def test_deviations_are_of_all_components_or_of_those_taken(sigma, rows, expected):
    sensor = Radar(sigma, rows=rows)
    assert sensor.sigma == pytest.approx(tuple(expected)) and np.array_equal(sensor.R, np.diag(np.square(np.array(expected, dtype=float))))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"sigma": (1.0, 2.0)}, r"sigma: expected one number or 3, for \(ρ, ψ, ρ̇\), got 2"),
        ({"sigma": (1.0, 2.0), "rows": "ψ"}, r"sigma: expected one number or 1, for \(ψ\), got 2"),
        ({"sigma": -1.0}, "sigma: expected a finite number"),
        ({"rows": ("ρ", "ρ")}, "rows: expected"),
        ({"rows": ("ρ", "z")}, r"rows: expected some of \('ρ', 'ψ', 'ρ̇'\), each once"),
        ({"rows": ()}, "rows: expected"),
        ({"R": np.eye(4)}, "R: expected shape"),
        ({"R": -np.eye(3)}, "R: expected a positive"),
        ({"state": ("x", "x", "v", "θ")}, "state: expected a sequence of names"),
        ({"state": ("x", "v", "θ")}, "state: expected a component named 'y', which Radar needs"),
        ({"state": ("x", "y", "v")}, "state: expected a component named 'vx', which Radar needs"),
        ({"state": ("x", "y", "θ", "vx")}, "state: expected a component named 'vy', which Radar needs"),
        ({"state": ("x", "y", "z", "v", "θ")}, "state: expected none named z, which Radar, in the plane, would ignore"),
        ({"position": (1.0, 2.0, 3.0)}, "position: expected shape"),
        ({"heading": np.inf}, "heading: expected an angle in rad"),
    ],
)
def test_what_does_not_fit_a_radar_is_named(arguments, words):
    with pytest.raises(ValueError, match=rf"^{words}"):
        Radar(**arguments)


def test_indices_of_angles_are_among_all_components():
    with pytest.raises(ValueError, match=r"^angles: expected indices from 0 to 1"):
        Compass(0.1, CARTESIAN, angles=(2,))


@pytest.mark.parametrize("make", [Lidar, lambda: Position(1.0, TURN, position=(1.0, 2.0), heading=0.3), Radar])
def test_a_step_is_h_and_H_for_one_target_and_for_runs(make):
    sensor = make()
    for x in (X[:, 0], X[:, 1], X, X.reshape(5, 3, 2)):
        h, H = sensor.step(x)
        np.testing.assert_allclose(h, sensor.h(x), rtol=1e-14)
        np.testing.assert_allclose(H, sensor.H(x), rtol=1e-14)
        assert h.shape == (sensor.m, *x.shape[1:]) and H.shape == (sensor.m, 5, *x.shape[1:])
    for wrong in (np.zeros(4), np.zeros((4, 2)), np.array([1, 1, 1, np.nan, 1])):
        for method in (sensor.h, sensor.H, sensor.step, sensor.linearised):
            with pytest.raises(ValueError, match=r"^x: expected"):
                method(wrong)


def test_the_matrix_of_a_linear_sensor_cannot_be_spoilt():
    sensor = Lidar()
    H = sensor.step(X[:, 0])[1]
    assert sensor.step(X[:, 1])[1] is H and sensor.linear
    with pytest.raises(ValueError, match="read-only"):
        H[0, 0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        sensor.H(X)[0, 0] = 2.0


@pytest.mark.parametrize(
    ("z", "z_hat"), [(np.zeros(2), np.zeros(3)), (np.zeros(3), np.zeros(2)), (np.zeros((3, 4)), np.zeros((3, 2))), (1.0, np.zeros(3))]
)
def test_residuals_have_the_sensors_rows(z, z_hat):
    with pytest.raises(ValueError, match=r"^z, z_hat: expected shapes \(3, \.\.\.\) that broadcast"):
        Radar().residual(z, z_hat)


def test_residuals_broadcast_and_wrap_only_angles():
    z, z_hat = np.array([[10.0], [3.0], [7.0]]), np.array([[1.0, 2.0], [-3.0, 3.0], [0.0, 1.0]])
    np.testing.assert_allclose(Radar().residual(z, z_hat), [[9, 8], [6 - 2 * np.pi, 0], [7, 6]])


@pytest.mark.parametrize("t", [0, 1.5, np.float64(2), -3, np.int64(4)])
def test_times_are_seconds_of_either_sign(t):
    sensor = Lidar()
    assert sensor.at(t) is sensor and sensor.of_runs(np.array([True])) is sensor and check_time(t) is None


@pytest.mark.parametrize("t", [np.inf, -np.inf, np.nan, "0", None, True, np.timedelta64(1, "s")])
def test_other_times_are_refused(t):
    for sensor in (Lidar(), TDOA(1.0, ecef(0.5 + 0.01 * np.arange(3.0), 2.3, 1e6), Ellipsoid())):
        with pytest.raises(ValueError, match=r"^t: expected a finite time, seconds as a number"):
            sensor.at(t)


def test_a_mounting_is_numbers():
    place, heading = check_mounting([1, 2], 3, 2)
    assert place == (1.0, 2.0) and type(place[0]) is float and heading == 3.0


# --- positions


def test_positions_of_three_axes_are_moved_and_turned_about_the_third():
    state, x = CA(axes=3).state, np.arange(9.0) ** 2
    sensor = Position((1.0, 2.0, 3.0), state, position=(1.0, 0.0, -2.0), heading=np.pi / 2)
    assert sensor.names == ("x", "y", "z") and sensor.position == (1.0, 0.0, -2.0)
    np.testing.assert_allclose(sensor.h(x), [x[3], 1.0 - x[0], x[6] + 2.0], atol=1e-12)
    expected = np.zeros((3, 9))
    expected[0, 3], expected[1, 0], expected[2, 6] = 1, -1, 1
    np.testing.assert_allclose(sensor.H(x), expected, atol=1e-12)
    part = Position(1.0, state, rows=("z", "x"), position=(1.0, 0.0, -2.0), heading=np.pi / 2)
    np.testing.assert_allclose(part.h(x), sensor.h(x)[[2, 0]])
    np.testing.assert_allclose(part.H(x), sensor.H(x)[[2, 0]])
    only = Position(1.0, CV(axes=1).state, position=[5.0])
    assert only.names == ("x",) and only.position == (5.0,) and only.h([7.0, 1.0]).tolist() == [2.0]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Position(1.0, ("a", "b")), "state: expected a component named x, y or z, which Position needs"),
        (lambda: Position(1.0, ("x", "vx"), heading=0.1), "heading: expected 0 without components named x and y, got 0.1"),
        (lambda: Position(1.0, ("x", "z"), heading=0.1), "heading: expected 0 without"),
        (lambda: Position(1.0, CARTESIAN, position=(1.0,)), "position: expected shape"),
        (lambda: Lidar(state=CV(axes=3).state), "state: expected components named x and y and no z, which Lidar needs"),
        (lambda: Lidar(state=("x", "z")), "state: expected components named x and y and no z"),
        (lambda: LinearSensor(np.eye(2, 4), np.eye(2), CARTESIAN, names=("a",)), "R: expected shape"),
        (lambda: LinearSensor(np.eye(2, 3), np.eye(2), CARTESIAN), "H: expected shape"),
        (lambda: LinearSensor([[1, np.nan, 0, 0]], [[1.0]], CARTESIAN), "H: expected finite"),
        (lambda: LinearSensor(np.eye(2, 4), np.eye(2), CARTESIAN, angles=(2,)), "angles: expected indices from 0 to 1"),
    ],
)
def test_what_does_not_fit_a_position_or_a_matrix_is_named(call, words):
    with pytest.raises(ValueError, match=rf"^{words}"):
        call()


def test_a_matrix_is_copied_named_and_knows_its_angles():
    H, state = np.array([[0.0, -1.0, 0.0], [0.5, 0.0, 2.0], [0.0, 1.0, 1.0]]), ("x", "θ", "v")
    sensor = LinearSensor(H, np.eye(3), state)
    assert sensor.names == ("z1", "z2", "z3") and sensor.angles == (0,)
    assert LinearSensor(H, np.eye(3), state, names=("a", "b", "ψ")).angles == (0, 2) and LinearSensor(
        H, np.eye(3), state, angles=(1,)
    ).angles == (1,)
    x = np.arange(1.0, 4.0)
    expected = H @ x
    given = H.copy()
    H[:] = 9.0
    np.testing.assert_allclose(sensor.h(x), expected)
    np.testing.assert_allclose(sensor.h(np.stack([x, 2 * x], axis=1)), np.stack([expected, 2 * expected], axis=1))
    np.testing.assert_array_equal(sensor.H(x), given)
    assert LinearSensor([1, 0, 0], [[2.0]], state).h(x).tolist() == [1.0]
    nothing = LinearSensor(np.zeros((1, 3)), [[1.0]], state)
    assert nothing.h(x).tolist() == [0.0] and nothing.h(np.ones((3, 2))).tolist() == [[0, 0]] and not nothing.picks(0, [0, 1, 2])


# --- polar coordinates


@pytest.mark.parametrize("make", [RangeBearing, Radar])
@pytest.mark.parametrize("position", [(0.0, 0.0), (0.0, 5.0), (3.0, 0.0)])
def test_at_the_sensor_there_is_no_bearing(make, position):
    sensor = make(position=position)
    x = np.array([*position, 1.0, 0.5, 0.1])
    for method in (sensor.h, sensor.H, sensor.step, sensor.linearised):
        with pytest.raises(ValueError, match=r"^x: the target stands at the sensor \(range 0\)"):
            method(x)
    runs = np.stack([x + np.array([3, 4, 0, 0, 0]), x], axis=1)
    h, H = sensor.h(runs), sensor.H(runs)
    assert h[0, 0] == 5.0 and np.isnan(h[0, 1]) and np.isfinite(H[..., 0]).all() and np.isnan(H[0, 0, 1])


def test_range_and_bearing_by_hand():
    sensor = RangeBearing(position=(1.0, 2.0), heading=0.25)
    x = np.array([4.0, 6.0, 0, 0, 0])
    np.testing.assert_allclose(sensor.h(x), [5.0, np.arctan2(4, 3) - 0.25])
    np.testing.assert_allclose(sensor.h(X), [np.hypot(X[0] - 1, X[1] - 2), np.arctan2(X[1] - 2, X[0] - 1) - 0.25])
    np.testing.assert_allclose(sensor.H(x), [[0.6, 0.8, 0, 0, 0], [-4 / 25, 3 / 25, 0, 0, 0]])
    radar = Radar(state=CARTESIAN)
    y = np.array([3.0, 2.0, 4.0, -1.0])
    np.testing.assert_allclose(radar.h(y), [5.0, np.arctan2(4, 3), 0.4])
    along = np.array([3 / 5, 4 / 5])
    across = np.array([2.0, -1.0]) / 5 - 0.4 * along / 5
    np.testing.assert_allclose(radar.H(y)[2], [across[0], along[0], across[1], along[1]])


# --- stations


STATE = ("x", "y", "vx", "vy")
LAT, LON = np.radians([30.0, 29.1, 29.5, 30.7]), np.radians([137.0, 137.0, 137.9, 138.3])
S = ecef(LAT, LON, 1e6)
V = np.random.default_rng(1).normal(size=(3, 4)) * 5e3
EMITTER = ecef(np.radians(30.5), np.radians(138.0))
Q = np.array([*EMITTER[:2], 3.0, -2.0])


def moving(t):
    return S[:, :3] + t * V[:, :3]


def test_gradients_of_range_differences_are_those_of_the_distances():
    gradients = difference_gradients(EMITTER, S)
    units = (EMITTER[:, None] - S) / np.linalg.norm(EMITTER[:, None] - S, axis=0)
    assert gradients.shape == (3, 3)
    np.testing.assert_allclose(gradients, (units[:, 1:] - units[:, :1]).T, atol=1e-12)
    many = difference_gradients(np.stack([EMITTER, EMITTER + 1e4], axis=1), S)
    assert many.shape == (3, 3, 2)
    np.testing.assert_allclose(many[..., 1], difference_gradients(EMITTER + 1e4, S), atol=1e-15)
    for call in (range_differences, difference_gradients):
        with pytest.raises(ValueError, match=r"^position: expected"):
            call(EMITTER[:2], S)
        with pytest.raises(ValueError, match=r"^satellites: expected finite positions of shape"):
            call(EMITTER, S[:, :1])


def test_stations_in_the_plane_stand_at_nought():
    flat = check_stations(S[:2], "stations")
    assert flat.shape == (3, 4) and not flat[2].any() and np.array_equal(flat[:2], S[:2])
    assert check_stations(S, "stations") is S
    for wrong in (S[:1], S[:, :1], S[:, 0], np.full((3, 2), np.inf), np.zeros((4, 3))):
        with pytest.raises(ValueError, match=r"^stations: expected finite positions of shape \(3, S\), S ≥ 2, got shape"):
            check_stations(wrong, "stations")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"sigma": None}, "sigma, R: expected one of the two"),
        ({"R": np.eye(2)}, "sigma, R: expected one of the two"),
        ({"chart": None}, "chart: expected a chart"),
        ({"rows": ()}, "rows: expected numbers of satellites, from 1, or names"),
        ({"rows": (1.0,)}, "rows: expected numbers of satellites"),
        ({"rows": (True,)}, "rows: expected numbers of satellites"),
        ({"rows": (4,)}, "rows: expected some of"),
        ({"rows": (0,)}, "rows: expected some of"),
        ({"rows": ("d1", 1)}, "rows: expected a sequence of names, each once"),
        ({"state": ("x", "vx")}, "state: expected a component named 'y', which TDOA needs"),
    ],
)
def test_what_does_not_fit_the_stations_is_named(change, words):
    with pytest.raises(ValueError, match=rf"^{words}"):
        TDOA(**{"sigma": 10.0, "satellites": S, "chart": Ellipsoid(), "state": STATE} | change)


def test_rows_noise_and_names_of_station_differences():
    assert TDOA(10.0, S, Ellipsoid()).components == ("d1", "d2", "d3") and TDOA(10.0, S, Ellipsoid()).names == ("d1", "d2")
    assert TDOA(10.0, moving, Ellipsoid()).components == ("d1", "d2") and TDOA(10.0, lambda t: S, Ellipsoid(), rows=(1, 3)).components == (
        "d1",
        "d2",
        "d3",
    )
    assert TDOA(10.0, moving, Ellipsoid()).state == STATE and FDOA(0.1, S, V, Ellipsoid()).names == ("ḋ1", "ḋ2")
    full = np.diag([1.0, 4.0, 9.0]) + 0.5
    for sensor in (
        TDOA(full, S, Ellipsoid(), rows=(3, 1)),
        TDOA(None, S, Ellipsoid(), rows=(3, 1), R=full),
        TDOA(full[np.ix_([2, 0], [2, 0])], S, Ellipsoid(), rows=(3, 1)),
    ):
        assert np.array_equal(sensor.R, full[np.ix_([2, 0], [2, 0])])
        np.testing.assert_allclose(sensor.h(Q), range_differences(EMITTER, S)[[2, 0]], atol=1e-6)
    np.testing.assert_allclose(TDOA([1.0, 2.0], S, Ellipsoid(), rows=(3, 1)).R, np.diag([1.0, 4.0]))
    np.testing.assert_allclose(TDOA(np.array([1.0, 2.0, 3.0]), S, Ellipsoid(), rows=(3, 1)).R, np.diag([9.0, 1.0]))
    assert TDOA(1.0, S, Ellipsoid(), rows=np.int64(2)).names == ("d2",) and TDOA(1.0, S, Ellipsoid(), rows="d3").names == ("d3",)


def test_instants_charts_and_runs_of_moving_stations():
    sensor = TDOA(10.0, moving, Ellipsoid(), STATE)
    with pytest.raises(ValueError, match=r"^TDOA: the satellites move: ask for the sensor of an instant, \.at\(t\)"):
        sensor.h(Q)
    first = sensor.at(1.0)
    assert sensor.at(1.0) is first and sensor.at(2.0) is not first and first.at(1.0) is not sensor
    np.testing.assert_allclose(first.h(Q), range_differences(EMITTER, moving(1.0)), atol=1e-6)
    still = TDOA(10.0, S, Ellipsoid(), STATE)
    assert still.at(5.0) is still and still.of_runs(np.array([True, False])) is still
    chart = LocalENU(np.radians(30.0), np.radians(137.0))
    other = first.with_chart(chart)
    assert other.chart is chart and isinstance(first.chart, Ellipsoid)
    np.testing.assert_allclose(other.h([*chart.to_chart(EMITTER), 0, 0]), first.h(Q), atol=1e-5)
    signed = first.with_chart(Ellipsoid([1.0, -1.0, 1.0]))
    part = signed.of_runs(np.array([False, True, True]))
    assert part.chart.sign.tolist() == [-1.0, 1.0] and signed.chart.sign.tolist() == [1.0, -1.0, 1.0]
    with pytest.raises(ValueError, match=r"^mask: expected booleans"):
        signed.of_runs(np.array([True, True]))
    runs = np.repeat(Q[:, None], 3, axis=1)
    np.testing.assert_allclose(part.h(runs[:, 1:]), signed.h(runs)[:, 1:])
    assert not np.allclose(signed.h(runs)[:, 0], signed.h(runs)[:, 1])
    with pytest.raises(ValueError, match=r"^chart: expected a chart"):
        first.with_chart("enu")


@pytest.mark.parametrize("kind", ["TDOA", "FDOA"])
def test_too_few_stations_are_named(kind):
    def make(satellites, velocities, rows=(1, 2)):
        return (
            TDOA(1.0, satellites, Ellipsoid(), rows=rows) if kind == "TDOA" else FDOA(1.0, satellites, velocities, Ellipsoid(), rows=rows)
        )

    with pytest.raises(ValueError, match=r"^satellites: expected shape \(3, S\) with S > 2, got \(3, 2\)"):
        make(lambda t: S[:, :2], V).at(0.0)
    with pytest.raises(ValueError, match=r"^satellites: expected shape \(3, S\) with S > 2, got \(3, 4, 1\)"):
        make(lambda t: S[..., None], V).at(0.0)
    if kind == "FDOA":
        for wrong, shape in ((V[:, :2], r"\(3, 2\)"), (V[..., None], r"\(3, 4, 1\)")):
            with pytest.raises(ValueError, match=rf"^velocities: expected shape \(3, S\) with S > 2, got {shape}"):
                make(S, wrong)
        with pytest.raises(ValueError, match=r"^velocities: expected an array"):
            make(S, lambda t: V)
        assert make(lambda t: S, lambda t: V).at(0.0).h(Q).shape == (2,)


def test_what_a_caller_holds_of_the_stations_is_his_own():
    s, v = S.copy(), V.copy()
    one, two = TDOA(1.0, s, Ellipsoid()), FDOA(1.0, s, v, Ellipsoid())
    before = one.h(Q), two.h(Q)
    s[:], v[:] = 1.0, 2.0
    assert np.array_equal(one.h(Q), before[0]) and np.array_equal(two.h(Q), before[1])
    assert np.array_equal(copy.copy(one).satellites, S) and np.array_equal(two.velocities, V)


def test_differences_of_range_rates_by_hand():
    plane, s = Plane(), np.array([[0.0, 5e3, -3e3], [0.0, 1e3, 4e3], [2e3, 3e3, 1e3]])
    v, x = np.array([[10.0, 0.0, 5.0], [0.0, -20.0, 3.0], [1.0, 2.0, -4.0]]), np.array([1e3, -2e3, 7.0, -5.0])
    sensor = FDOA(0.1, s, v, plane, STATE)

    def rates(x):
        apart, speed = np.array([x[0], x[1], 0.0])[:, None] - s, np.array([x[2], x[3], 0.0])[:, None] - v
        along = (apart * speed).sum(axis=0) / np.linalg.norm(apart, axis=0)
        return along[1:] - along[0]

    np.testing.assert_allclose(sensor.h(x), rates(x), rtol=1e-12)
    numeric = np.stack([(rates(x + 1e-3 * e) - rates(x - 1e-3 * e)) / 2e-3 for e in np.eye(4)], axis=1)
    np.testing.assert_allclose(sensor.H(x), numeric, atol=1e-8)
    runs = np.stack([x, 1.1 * x], axis=1)
    np.testing.assert_allclose(sensor.h(runs)[:, 1], rates(1.1 * x), rtol=1e-12)
    np.testing.assert_allclose(sensor.H(runs)[..., 0], numeric, atol=1e-8)

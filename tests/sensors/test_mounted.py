"""Sensors that stand elsewhere, are taken in part, or are a matrix: what the filters' tests show on tracks, here of h and H alone."""

import numpy as np
import pytest

from trackhelpers.motion import CTRV, CV
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar, RangeBearing

CARTESIAN, TURN = CV(1.0).state, CTRV(1.0, 0.1).state
X = np.random.default_rng(0).normal(size=(5, 6)) + np.array([30, 20, 3, 0, 0])[:, None]


@pytest.mark.parametrize("make", [Radar, RangeBearing, Lidar])
@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_a_mounted_sensor_sees_the_scene_moved_and_turned(make, heading):
    position = np.array([4.0, -7.0])
    mounted, plain = make(position=position, heading=heading), make()
    c, s = np.cos(heading), np.sin(heading)
    moved = X.copy()
    moved[:2] = np.array([[c, s], [-s, c]]) @ (X[:2] - position[:, None])
    moved[3] -= heading
    np.testing.assert_allclose(mounted.residual(mounted.h(X), plain.h(moved)), 0, atol=1e-12)
    for x in X.T:
        difference = [mounted.residual(mounted.h(x + d), mounted.h(x - d)) / 2e-6 for d in 1e-6 * np.eye(5)]
        np.testing.assert_allclose(mounted.H(x), np.transpose(difference), atol=1e-7)
        h, H = mounted.step(x)
        np.testing.assert_allclose(h, mounted.h(x), rtol=1e-14)
        np.testing.assert_allclose(H, mounted.H(x), rtol=1e-14)


def test_rows_are_rows_of_everything():
    R = np.array([[1.0, 0.2, 0.1], [0.2, 2.0, 0.3], [0.1, 0.3, 3.0]])
    whole = Radar(R=R)
    for rows, angles in (((1,), (0,)), ((0, 2), ()), ((2, 1), (1,)), ((0, 1, 2), (1,))):
        part = Radar(R=R, rows=[whole.names[i] for i in rows])
        assert part.names == tuple(whole.names[i] for i in rows) and part.angles == angles and part.m == len(rows)
        np.testing.assert_allclose(part.h(X), whole.h(X)[list(rows)])
        np.testing.assert_allclose(part.H(X), whole.H(X)[list(rows)])
        assert np.array_equal(part.R, R[np.ix_(rows, rows)])
        np.testing.assert_allclose(part.sigma, np.sqrt(R.diagonal()[list(rows)]))
        assert np.array_equal(part.at(3.0).R, part.R) and part.of_runs(np.ones(6, bool)) is part


def test_a_matrix_measures_its_product_and_its_angles_wrap():
    H = np.array([[1.0, 0, 0, 0, 0], [0, 0, 0, 1, 0.5]])
    sensor = LinearSensor(H, np.diag([1.0, 0.01]), TURN, angles=(1,))
    np.testing.assert_allclose(sensor.h(X), H @ X, rtol=1e-14)
    np.testing.assert_allclose(sensor.step(X[:, 0])[0], H @ X[:, 0], rtol=1e-14)
    assert np.array_equal(sensor.H(X[:, 0]), H) and sensor.linear and not Radar().linear
    np.testing.assert_allclose(sensor.residual([7.0, 3.1], [1.0, -3.1]), [6, 6.2 - 2 * np.pi])
    np.testing.assert_allclose(LinearSensor(H, np.diag([1.0, 0.01]), TURN, angles=()).residual([7.0, 3.1], [1.0, -3.1]), [6, 6.2])


def test_the_noise_is_what_is_documented_where_none_is_named():
    assert np.allclose(Radar().sigma, (0.3, 0.03, 0.3)) and np.allclose(RangeBearing().sigma, (1, 0.01))
    assert np.allclose(Lidar().sigma, 0.15) and np.allclose(Position(state=CARTESIAN).sigma, 1)
    assert Radar().state == Lidar().state == Position().state == RangeBearing().state == TURN


def test_R_is_of_all_rows_or_of_those_taken():
    full, rows = np.diag([1.0, 4.0, 9.0]), Radar().components[1:]
    for R in (full, full[1:, 1:]):
        np.testing.assert_array_equal(Radar(R=R, rows=rows).R, full[1:, 1:])
    with pytest.raises(ValueError, match="R: expected shape"):
        Radar(R=full[:1, :1], rows=rows)


@pytest.mark.parametrize("t", [np.inf, np.nan, "1"])
def test_a_time_is_a_finite_number(t):
    assert Lidar().at(2.0).m == 2
    with pytest.raises(ValueError, match="t: expected a finite time"):
        Lidar().at(t)


def test_a_row_picks_a_component_or_its_negative():
    sensor = LinearSensor([[0, -1, 0], [0, 2, 0], [1, 1, 0], [1, 0, 0]], np.eye(4), ("x", "θ", "v"))
    assert [sensor.picks(i, [1]) for i in range(4)] == [True, False, False, False]
    assert sensor.angles == (0,)

"""Charts: the sign from step to step, limits of their arguments, and what is a caller's own."""

import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, Plane, check_chart, ecef, geodetic, next_sign


def test_the_sign_after_a_step_is_that_of_where_it_leads():
    assert next_sign(1.0, -2.0, 0.4) == 1.0 and next_sign(1.0, -2.0, 0.6) == -1.0 and next_sign(-1.0, 2.0, 0.6) == 1.0
    assert next_sign(1.0, -2.0, 0.5) == 1.0 and next_sign(-1.0, 0.0, 5.0) == -1.0 and next_sign(-1.0, 9.0, 0.0) == -1.0
    assert isinstance(next_sign(1.0, -2.0, 1.0), float)
    found = next_sign([1.0, -1.0, np.nan, 3.0], [[-2.0], [4.0]], 1)
    assert found.tolist() == [[-1, -1, 1, 1], [1, 1, 1, 1]]
    for wrong, words in (
        ((1.0, 1.0, -1.0), "dt: expected"),
        (([1.0, 2.0], [1.0, 2.0, 3.0], 1.0), "z, z_rate: expected"),
        (("up", 1.0, 1.0), "z: expected"),
    ):
        with pytest.raises(ValueError, match=f"^{words}"):
            next_sign(*wrong)


def test_a_chart_is_one_of_these():
    assert check_chart(chart := Plane()) is chart
    with pytest.raises(ValueError, match=r"^surface: expected a chart of trackhelpers\.charts, got 'plane'"):
        check_chart("plane", "surface")
    with pytest.raises(ValueError, match=r"^chart: expected a chart"):
        check_chart(Plane)


def test_an_origin_is_told_in_radians():
    for lat, lon in ((np.pi / 2, 2 * np.pi), (-np.pi / 2, -2 * np.pi), (0.0, 0.0)):
        chart = LocalENU(lat, lon)
        assert (chart.lat, chart.lon, chart.h) == (lat, lon, 0.0)
    for lat, lon in ((1.571, 0.0), (-1.571, 0.0), (0.0, 6.284), (0.0, -6.284)):
        with pytest.raises(ValueError, match=r"^lat, lon: expected radians, \|lat\| ≤ π/2 and \|lon\| ≤ 2π, got"):
            LocalENU(lat, lon)
    for name in ("lat", "lon", "h"):
        with pytest.raises(ValueError, match=f"^{name}: expected a finite number"):
            LocalENU(**{"lat": 0.1, "lon": 0.1, "h": 0.0} | {name: np.inf})


@pytest.mark.parametrize("h", [0.0, 500.0])
def test_east_north_and_up_of_an_origin(h):
    lat, lon = 0.5, 2.4
    chart = LocalENU(lat, lon, h)
    east = [-np.sin(lon), np.cos(lon), 0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    np.testing.assert_allclose(chart.jacobian([0.0, 0.0]), np.stack([east, north], axis=1), atol=1e-9)
    np.testing.assert_allclose(chart.velocity([0.0, 0.0], [2.0, -3.0]), 2 * np.array(east) - 3 * np.array(north), atol=1e-8)
    np.testing.assert_allclose(chart.to_chart(ecef(lat, lon, h + 77.0)), [0, 0], atol=1e-8)
    far = chart.position([4e5, -3e5])
    assert geodetic(far)[2] == pytest.approx(h, abs=1e-8)
    np.testing.assert_allclose(chart.to_chart(far), [4e5, -3e5], atol=1e-8)


def test_the_plane_is_flat_and_its_arrays_are_ones_own():
    plane, q = Plane(), np.array([[1.0, 2.0], [3.0, 4.0]])
    p, J = plane.position(q), plane.jacobian(q)
    assert p.tolist() == [[1, 2], [3, 4], [0, 0]] and J.shape == (3, 2, 2) and J[..., 1].tolist() == [[1, 0], [0, 1], [0, 0]]
    J[0, 0, 0] = 9.0
    assert plane.jacobian(q)[0, 0, 0] == 1.0 and plane.jacobian([1.0, 2.0]).tolist() == [[1, 0], [0, 1], [0, 0]]
    back = plane.to_chart(p)
    back[:] = 0.0
    assert p[0].tolist() == [1, 2] and plane.velocity([1.0, 2.0], [3.0, 4.0]).tolist() == [3, 4, 0]
    with pytest.raises(ValueError, match=r"^q, rate: expected shapes \(2, \.\.\.\) that broadcast"):
        plane.velocity(q, np.zeros((2, 3)))


def test_signs_of_the_ellipsoid():
    one, many = Ellipsoid(-1), Ellipsoid([1, -1])
    assert one.sign.shape == () and one.sign == -1 and many.sign.tolist() == [1, -1] and Ellipsoid().sign == 1
    assert isinstance(one.with_sign(1), Ellipsoid) and one.with_sign([1.0]).sign.shape == (1,)
    q = np.array([[3e6, 3e6], [2e6, 2e6]])
    z = np.sqrt(1 - (9e12 + 4e12) / Ellipsoid.a**2) * Ellipsoid.b
    np.testing.assert_allclose(many.position(q)[2], [z, -z], rtol=1e-12)
    np.testing.assert_allclose(one.position(q)[2], [-z, -z], rtol=1e-12)
    np.testing.assert_allclose(one.jacobian(q[:, 0])[2], (Ellipsoid.b / Ellipsoid.a) ** 2 * q[:, 0] / z, rtol=1e-12)
    np.testing.assert_allclose(one.to_chart(one.position(q)), q)
    for sign in (0, 0.5, 2, -3, np.nan, [1, 0]):
        with pytest.raises(ValueError, match=r"^sign: expected"):
            Ellipsoid(sign)
    for call in (many.position, many.jacobian):
        with pytest.raises(ValueError, match=r"^q: expected 2 runs on the last axis, one a sign, got shape"):
            call(q[:, :1])


def test_positions_of_latitudes_broadcast():
    assert ecef(0.1, 0.2).shape == (3,) and ecef([[0.1], [0.2]], [0.3, 0.4, 0.5], 7.0).shape == (3, 2, 3)
    np.testing.assert_allclose(ecef(0.0, 0.0, 5.0), [Ellipsoid.a + 5.0, 0, 0])
    np.testing.assert_allclose(ecef(np.pi / 2, 0.0, 5.0), [0, 0, Ellipsoid.b + 5.0], atol=1e-8)
    with pytest.raises(ValueError, match=r"^lat, lon, h: expected"):
        ecef([0.1, 0.2], [0.1, 0.2, 0.3])

import numpy as np
import pymap3d
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, Plane, ecef, geodetic

RNG = np.random.default_rng(0)
A, B = Ellipsoid.a, Ellipsoid.b
NEAR = RNG.uniform(-5e5, 5e5, (2, 40))
DISC = 6e6 * np.sqrt(RNG.uniform(0, 1, 40)) * np.stack([np.cos(angles := RNG.uniform(-np.pi, np.pi, 40)), np.sin(angles)])
SIGNS = np.where(np.arange(40) % 2, 1, -1)
CASES = {
    "plane": (Plane(), NEAR),
    "north": (Ellipsoid(), DISC),
    "south": (Ellipsoid(-1), DISC),
    "both": (Ellipsoid(SIGNS), DISC),
    "sea": (LocalENU(0.5, 2.4), NEAR),
    "equator": (LocalENU(0.0, -3.0), NEAR),
    "pole": (LocalENU(np.pi / 2, 0.0), NEAR),
    "aloft": (LocalENU(-1.1, 2.4, 1e4), NEAR),
}
every_chart = pytest.mark.parametrize(("chart", "q"), CASES.values(), ids=CASES)
enu_charts = pytest.mark.parametrize("chart", [chart for chart, _ in CASES.values() if isinstance(chart, LocalENU)])


def normal(p):
    """Of the ellipsoid through its point p."""
    return p / np.reshape([A**2, A**2, B**2], (3, *[1] * (p.ndim - 1)))


@every_chart
def test_the_jacobian_is_the_derivative_of_the_position(chart, q):
    step = 50.0
    columns = [(chart.position(q + step * e[:, None]) - chart.position(q - step * e[:, None])) / (2 * step) for e in np.eye(2)]
    np.testing.assert_allclose(chart.jacobian(q), np.stack(columns, axis=1), atol=1e-8)


@every_chart
def test_the_velocity_is_the_derivative_along_a_path(chart, q):
    rate = RNG.normal(size=q.shape)
    moved = (chart.position(q + 50 * rate) - chart.position(q - 50 * rate)) / 100
    np.testing.assert_allclose(chart.velocity(q, rate), moved, atol=1e-7)


@every_chart
def test_to_chart_is_the_way_back(chart, q):
    p = chart.position(q)
    np.testing.assert_allclose(chart.to_chart(p), q, rtol=0, atol=1e-8)
    np.testing.assert_allclose(chart.position(chart.to_chart(p)), p, rtol=0, atol=1e-8)


@every_chart
def test_one_target_is_a_run_of_an_ensemble_and_of_a_history(chart, q):
    p, J = chart.position(q), chart.jacobian(q)
    assert p.shape == (3, 40) and J.shape == (3, 2, 40)
    times = q[:, None]
    np.testing.assert_array_equal(chart.position(times), p[:, None])
    np.testing.assert_array_equal(chart.jacobian(times), J[:, :, None])
    for m in range(3):
        one = chart.with_sign(SIGNS[m]) if chart is CASES["both"][0] else chart
        np.testing.assert_allclose(one.position(q[:, m]), p[:, m], rtol=0, atol=2e-9)
        np.testing.assert_allclose(one.jacobian(q[:, m]), J[..., m], rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.position(q[:, [m]])[:, 0], p[:, m], rtol=0, atol=2e-9)


@pytest.mark.parametrize("sign", [1, -1, SIGNS])
def test_the_ellipsoids_points_and_slopes_are_the_equations(sign):
    chart = Ellipsoid(sign)
    x, y, z = p = chart.position(DISC)
    np.testing.assert_allclose((x**2 + y**2) / A**2 + z**2 / B**2, 1, rtol=1e-14)
    assert np.array_equal(np.sign(z), np.broadcast_to(sign, 40))
    J = chart.jacobian(DISC)
    np.testing.assert_allclose(J[2], -((B / A) ** 2) * p[:2] / z, rtol=1e-12)
    np.testing.assert_array_equal(J[:2], np.repeat(np.eye(2)[..., None], 40, axis=2))


@pytest.mark.parametrize("name", ["north", "both", "sea", "equator", "pole"])
def test_a_ships_velocity_is_tangent_to_the_ellipsoid(name):
    chart, q = CASES[name]
    v, n = chart.velocity(q, RNG.normal(size=q.shape)), normal(chart.position(q))
    np.testing.assert_allclose(np.sum(v * n, axis=0) / np.linalg.norm(v, axis=0) / np.linalg.norm(n, axis=0), 0, atol=1e-14)


@enu_charts
def test_the_local_chart_is_pymap3ds(chart):
    p = chart.position(NEAR)
    e, n, u = pymap3d.ecef2enu(*p, chart.lat, chart.lon, chart.h, deg=False)
    np.testing.assert_allclose([e, n], NEAR, rtol=0, atol=1e-8)
    np.testing.assert_allclose(pymap3d.enu2ecef(*NEAR, u, chart.lat, chart.lon, chart.h, deg=False), p, rtol=0, atol=1e-8)
    np.testing.assert_allclose(pymap3d.ecef2geodetic(*p)[2], chart.h, rtol=0, atol=1e-8)  # all at the surface's height
    np.testing.assert_allclose(chart.position([0.0, 0.0]), ecef(chart.lat, chart.lon, chart.h), rtol=0, atol=2e-9)
    np.testing.assert_allclose(chart.jacobian([0.0, 0.0]).T @ chart.jacobian([0.0, 0.0]), np.eye(2), atol=1e-12)


def test_both_charts_of_the_sea_agree():
    local = LocalENU(0.6, 2.4)
    p = local.position(NEAR)
    np.testing.assert_allclose(Ellipsoid().position(p[:2]), p, rtol=0, atol=1e-8)
    J = Ellipsoid().jacobian(p[:2])
    np.testing.assert_allclose(np.einsum("ij...,jk...->ik...", J, local.jacobian(NEAR)[:2]), local.jacobian(NEAR), atol=1e-12)


def test_the_local_chart_crosses_the_equator_and_the_pole():
    assert np.all(np.isfinite(LocalENU(0.0, 1.0).jacobian([[0, 0, 0], [-1.0, 0, 1]])))
    across = LocalENU(0.0, 1.0).position([[0, 0], [-1000.0, 1000]])
    np.testing.assert_allclose(across[2], [-1000, 1000], rtol=1e-12)


def test_the_sign_is_a_value_of_the_chart():
    signs = SIGNS.copy()
    chart = Ellipsoid(signs)
    signs[:] = 1
    assert np.array_equal(chart.sign, SIGNS)
    with pytest.raises(ValueError, match="read-only"):
        chart.sign[0] = 1
    with pytest.raises(AttributeError):
        chart.sign = 1
    other = chart.with_sign(-SIGNS)
    assert np.array_equal(chart.sign, SIGNS) and np.array_equal(other.position(DISC)[2], -chart.position(DISC)[2])


def test_outside_the_disc_one_target_is_refused_and_a_run_is_nan():
    chart = Ellipsoid()
    for q in ([6.4e6, 0], [5e6, -5e6]):
        for call in (chart.position, chart.jacobian):
            with pytest.raises(ValueError, match="q: expected a point of the ellipsoid"):
                call(q)
    runs = np.array([[6.4e6, 1e6, np.nan], [0, 0, 0]])
    assert np.isnan(chart.position(runs)[2]).tolist() == [True, False, True]
    assert np.isnan(chart.jacobian(runs)[2]).all(axis=0).tolist() == [True, False, True]


def test_the_ellipsoids_chart_ends_at_the_equator():
    chart, rim = Ellipsoid(), np.array([A, 0.0])
    np.testing.assert_array_equal(chart.position(rim), [A, 0, 0])
    with pytest.raises(ValueError, match="equator"):
        chart.jacobian(rim)
    assert np.isnan(chart.jacobian(rim[:, None])[2]).all()


@pytest.mark.parametrize("h", [0.0, 10.0])
def test_beyond_the_horizon_one_target_is_refused_and_a_run_is_nan(h):
    chart = LocalENU(0.5, 2.0, h)
    with pytest.raises(ValueError, match="q: expected a point that the surface reaches"):
        chart.position([7e6, 0])
    runs = np.array([[7e6, 0, np.nan], [0, 0, 0.0]])
    for found in (chart.position(runs), chart.jacobian(runs)[:, 0]):
        assert np.isnan(found).all(axis=0).tolist() == [True, False, True]


def test_latitude_and_longitude_are_pymap3ds_in_radians():
    lat, lon, h = RNG.uniform(-1.5, 1.5, 9), RNG.uniform(-3, 3, 9), RNG.uniform(-100, 1e6, 9)
    p = ecef(lat, lon, h)
    np.testing.assert_array_equal(p, pymap3d.geodetic2ecef(lat, lon, h, deg=False))
    np.testing.assert_allclose(p, pymap3d.geodetic2ecef(np.degrees(lat), np.degrees(lon), h), rtol=0, atol=1e-8)
    np.testing.assert_allclose(geodetic(p)[:2], [lat, lon], atol=1e-12)
    np.testing.assert_allclose(geodetic(p)[2], h, rtol=0, atol=1e-8)
    assert geodetic(p[:, 0]).shape == (3,) and geodetic(p[:, None, :1]).shape == (3, 1, 1)
    assert ecef(0.1, lon).shape == (3, 9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Plane().position([1.0, 2, 3]), "q: expected shape"),
        (lambda: Plane().jacobian([1.0, np.nan]), "q: expected finite"),
        (lambda: Plane().to_chart([1.0, 2]), "position: expected shape"),
        (lambda: Plane().velocity([1.0, 2], [1.0]), "rate: expected shape"),
        (lambda: Ellipsoid(0), "sign: expected 1 or -1"),
        (lambda: Ellipsoid([1, np.nan]), "sign"),
        (lambda: Ellipsoid([[1, 1]]), "sign"),
        (lambda: Ellipsoid([1, -1]).position([0.0, 0.0]), "q: expected 2 runs"),
        (lambda: Ellipsoid([1, -1]).jacobian(np.zeros((2, 3))), "q: expected 2 runs"),
        (lambda: Ellipsoid().position(np.ma.array([1.0, 2], mask=[0, 1])), "q: .*masked"),
        (lambda: LocalENU(35.0, 137.0), "expected radians"),
        (lambda: LocalENU(0.6, 137.0), "expected radians"),
        (lambda: LocalENU(np.nan, 0), "lat"),
        (lambda: geodetic([1.0, 2]), "position"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sgp4.api import WGS72, Satrec

from trackhelpers.charts import Ellipsoid, geodetic
from trackhelpers.datasets import coastline
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors import range_differences

S = paper.satellites(paper.TIMES)


def _generators(M, seed=0):
    return [np.random.default_rng([seed, run]) for run in range(M)]


def test_the_formation_is_the_papers():
    s = paper.satellites(300.0)
    assert np.degrees(np.arctan2(s[1, 0], s[0, 0])) == pytest.approx(137.0, abs=1e-6)
    latitude = np.arcsin(s[2, 0] / np.linalg.norm(s[:, 0]))
    assert latitude == pytest.approx(np.arcsin(np.sin(paper.INCLINATION) * np.sin(np.radians(28.2))), abs=np.radians(0.1))
    baselines = [np.linalg.norm(S[:, i] - S[:, j], axis=0) for i, j in itertools.combinations(range(3), 2)]
    assert 96.6e3 < np.min(baselines) and np.max(baselines) < 100.2e3
    heights = geodetic(S[:, 0])[2]
    assert np.all(np.abs(heights - 1e6) < 6e3)


def test_orbits_are_two_body_motion_but_for_the_earths_oblateness():
    def along(t):
        """Where S0 is in a frame that does not turn with the Earth, and how fast: ECEF turned back."""
        turn = 7.292115e-5 * t
        c, s = np.cos(turn), np.sin(turn)
        R, dR = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), 7.292115e-5 * np.array([[-s, -c, 0], [c, -s, 0], [0, 0, 0]])
        p, v = paper.satellites(t)[:, 0], paper.satellite_velocities(t)[:, 0]
        return R @ p, R @ v + dR @ p

    mu, J2, a = 3.986004418e14, 1.08263e-3, 6_378_137.0

    def fall(oblate):
        def rate(t, y):
            r = np.linalg.norm(y[:3])
            z2 = 5 * (y[2] / r) ** 2
            J = 1.5 * J2 * (a / r) ** 2 * oblate
            return np.r_[y[3:], -mu / r**3 * y[:3] * (1 + J * (np.array([1, 1, 3]) - z2))]

        return solve_ivp(rate, (0, 600), np.concatenate(along(0.0)), rtol=1e-11, atol=1e-6).y[:3, -1]

    end = along(600.0)[0]
    two_body, with_J2 = (np.linalg.norm(fall(oblate) - end) for oblate in (0, 1))
    assert 500 < two_body < 5000  # ½ t² of J2's 0.01 m/s²
    assert with_J2 < 0.02 * two_body


def test_the_spline_is_the_orbit_and_its_rate_the_velocity():
    paper_formation, t = paper.formation(), np.random.default_rng(0).uniform(-60, 660, 50)
    for k in range(3):
        np.testing.assert_allclose(paper_formation.satellites(t)[:, k], paper._positions(paper_formation.elements[:, k], t), atol=2e-6)
    inside = t[(t > -59) & (t < 659)]
    difference = (paper.satellites(inside + 0.5) - paper.satellites(inside - 0.5)) / 1.0
    np.testing.assert_allclose(paper.satellite_velocities(inside), difference, atol=1e-3)
    np.testing.assert_array_equal(paper.satellites(7.0), paper.satellites(np.array([7.0]))[..., 0])


def test_a_time_outside_and_unknown_names_are_refused():
    for t in (-61.0, [0.0, 661.0], np.nan):
        with pytest.raises(ValueError, match="t:"):
            paper.satellites(t)
    with pytest.raises(ValueError, match="layout"):
        paper.formation(layout="square")
    with pytest.raises(ValueError, match="target"):
        paper.track("T3", 0.0)
    with pytest.raises(ValueError, match="scenario"):
        paper.availability("4", _generators(1))
    with pytest.raises(ValueError, match="satellites"):
        paper.measurements(np.zeros((3, 5)), S, 1.0, _generators(1))


def test_a_formation_has_its_size():
    for size in (25e3, 200e3):
        s = paper.formation(size).satellites(300.0)
        assert np.linalg.norm(s[:, 1] - s[:, 0]) == pytest.approx(size, rel=2e-3)
    for layout in paper.LAYOUTS:
        assert paper.formation(layout=layout).satellites(0.0).shape == (3, 3)


@pytest.mark.parametrize("target", paper.TARGETS)
def test_targets_are_on_the_sea_and_the_ship_sails_at_fifteen_knots_to_the_north_east(target):
    p, v = paper.track(target, paper.TIMES)
    lat, lon, h = geodetic(p)
    np.testing.assert_allclose(h, 0, atol=1e-6)
    np.testing.assert_allclose(Ellipsoid().position(p[:2]), p, atol=1e-6)
    speed = np.linalg.norm(v, axis=0)
    np.testing.assert_allclose(speed, 7.71666666 if target == "ship" else 0, atol=1e-5)
    if target == "ship":
        np.testing.assert_allclose(p[:, 239], paper.track("T1", 0.0)[0], atol=1e-6)
        north = v[2] / np.cos(lat)
        east = v[1] * np.cos(lon) - v[0] * np.sin(lon)
        assert np.degrees(np.arctan2(east, north))[239] == pytest.approx(60.0, abs=1e-3)
        np.testing.assert_allclose(paper.track("ship", 100.0)[0], p[:, 99], atol=1e-9)
    else:
        s0 = paper.satellites({"T1": 240.0, "T2": 360.0}[target])[:, 0]
        np.testing.assert_allclose(np.cross(p[:, 0], s0) / np.linalg.norm(s0), 0, atol=1e-6)


def test_range_differences_are_shorter_than_their_baselines():
    for target in paper.TARGETS:
        d = range_differences(paper.track(target, paper.TIMES)[0], S)
        assert np.all(np.abs(d) < np.linalg.norm(S[:, 1:] - S[:, :1], axis=0))


@pytest.mark.parametrize("R", [paper.SIGMA, paper.R_TIME_OF_ARRIVAL], ids=["time difference", "time of arrival"])
def test_measurements_have_the_covariance_asked_for_and_do_not_depend_on_other_runs(R):
    p = paper.track("T1", paper.TIMES)[0]
    z = paper.measurements(p, S, R, _generators(50))
    noise = z - range_differences(p, S)[..., None]
    wanted = R if np.ndim(R) else R**2 * np.eye(2)
    np.testing.assert_allclose(np.cov(noise.reshape(2, -1)), wanted, atol=0.03 * wanted[0, 0])
    np.testing.assert_array_equal(paper.measurements(p, S, R, _generators(50)[3:5]), z[..., 3:5])
    np.testing.assert_array_equal(paper.measurements(np.repeat(p[..., None], 2, 2), S, R, _generators(50)[3:5]), z[..., 3:5])


@pytest.mark.parametrize("scenario", paper.SCENARIOS)
def test_availability_has_exact_counts_in_every_run(scenario):
    there = paper.availability(scenario, _generators(20))
    assert there.shape == (2, 600, 20) and there.dtype == bool
    counts = [np.sum(kind, axis=0) for kind in (there[0] & there[1], there[0] & ~there[1], ~there[0] & there[1])]
    for count, share in zip(counts, paper.SCENARIOS[scenario], strict=True):
        np.testing.assert_array_equal(count, round(600 * share))
    assert there.any(axis=0).all()
    if scenario != "complete":
        assert not np.array_equal(there[..., 0], there[..., 1])
    np.testing.assert_array_equal(paper.availability(scenario, _generators(20)[4:5])[..., 0], there[..., 4])


def test_bursts_keep_one_baseline_for_twenty_seconds():
    there = paper.availability("bursts", _generators(5))
    single = there[0] ^ there[1]
    for k in range(0, 600, 20):
        kinds = there[:, k : k + 20][:, single[k : k + 20]]
        assert kinds.all(axis=1).any() and not kinds.all()


def test_the_coastline_lies_within_its_window_and_has_japan():
    lines = coastline()
    lon, lat = np.concatenate(lines, axis=1)
    assert lon.min() >= 105 and lon.max() <= 165 and lat.min() >= 0 and lat.max() <= 50
    assert all(line.shape[0] == 2 and line.shape[1] >= 2 for line in lines)
    assert np.hypot(lon - 139.83, lat - 34.91).min() < 0.1  # the cape south of Tokyo Bay


def test_the_elements_are_those_of_a_circle_at_a_thousand_kilometres():
    orbit = Satrec()
    orbit.sgp4init(WGS72, "i", 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, paper.INCLINATION, 0.5, 60 * np.sqrt(398600.8e9 / paper.AXIS**3), 0.0)
    assert abs(orbit.a * 6378135.0 - paper.AXIS) < 2e3  # the mean axis without J2's own share

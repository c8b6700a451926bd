import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, geodetic
from trackhelpers.fixes import candidates, fix, fix_covariance
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors import TDOA, range_differences

S = paper.satellites(paper.TIMES)
LAYOUTS = ["triangle", "mirrored", "wide", "right angle"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("target", paper.TARGETS)
def test_exact_differences_have_one_visible_point_at_every_epoch_and_it_is_the_emitter(target, layout):
    s, p = paper.formation(layout=layout).satellites(paper.TIMES), paper.track(target, paper.TIMES)[0]
    d = range_differences(p, s)
    assert np.all(np.abs(d) < np.linalg.norm(s[:, 1:] - s[:, :1], axis=0))
    np.testing.assert_array_equal(np.isfinite(candidates(d, s)[0]).sum(axis=0), 1)
    assert np.linalg.norm(fix(d, s) - p, axis=0).max() <= 1e-7


def test_without_the_horizon_two_points_remain_at_every_epoch_and_both_have_the_differences():
    d = range_differences(paper.track("T1", paper.TIMES)[0], S)
    found = candidates(d, S, seen=False)
    np.testing.assert_array_equal(np.isfinite(found[0]).sum(axis=0), 2)
    for k in (0, 299, 599):
        for p in found[:, np.isfinite(found[0, :, k]), k].T:
            np.testing.assert_allclose(range_differences(p, S[..., k]), d[:, k], atol=1e-6)
            assert abs(geodetic(p)[2]) < 1e-6


def test_times_and_runs_are_fixed_one_by_one():
    z = paper.measurements(paper.track("T1", paper.TIMES[::60])[0], S[..., ::60], paper.SIGMA, [np.random.default_rng(r) for r in range(3)])
    many = fix(z, S[..., ::60, None])
    assert many.shape == (3, 10, 3)
    for k in range(10):
        for m in range(3):
            np.testing.assert_allclose(fix(z[:, k, m], S[..., 60 * k]), many[:, k, m], atol=1e-6)


def test_the_error_of_a_fix_has_the_covariance_of_first_order():
    p, R, chart = paper.track("T1", 240.0)[0], paper.R_TIME_OF_ARRIVAL, Ellipsoid()
    s = paper.satellites(240.0)
    L = np.linalg.cholesky(R)
    z = range_differences(p, s)[:, None] + L @ np.random.default_rng(0).standard_normal((2, 20_000))
    error = fix(z, s)[:2] - p[:2, None]
    P = fix_covariance(p, s, R, chart)
    assert np.mean(np.einsum("im,ij,jm->m", error, np.linalg.inv(P), error)) == pytest.approx(2, abs=0.06)
    H = TDOA(R, s, chart).H([*p[:2], 0.0, 0.0])[:, :2]
    np.testing.assert_allclose(P, np.linalg.inv(H) @ R @ np.linalg.inv(H).T, rtol=1e-9)


def test_a_covariance_is_the_same_in_space_whatever_the_chart():
    p, s = paper.track("T2", paper.TIMES[:3])[0], S[..., :3]
    lat, lon, _ = geodetic(p[:, 0])
    there = []
    for chart in (Ellipsoid(), LocalENU(lat, lon)):
        J = chart.jacobian(chart.to_chart(p))
        there.append(np.einsum("ikn,kln,jln->ijn", J, fix_covariance(p, s, paper.R_TIME_DIFFERENCE, chart), J))
    np.testing.assert_allclose(*there, rtol=1e-6, atol=1e-3)


def test_where_two_points_are_seen_the_nearest_to_the_one_told_is_taken():
    s, p = paper.formation(layout="side by side").satellites(300.0), paper.track("T1", 0.0)[0]
    d = range_differences(p, s)
    assert np.isfinite(candidates(d, s)[0]).sum() == 2
    with pytest.raises(ValueError, match="near="):
        fix(d, s)
    assert np.isnan(fix(d[:, None], s)).all()
    np.testing.assert_allclose(fix(d, s, near=p + 1e4), p, atol=1e-5)
    np.testing.assert_allclose(fix(np.stack([d, d], axis=1), s, near=p + 1e4), np.stack([p, p], axis=1), atol=1e-5)
    np.testing.assert_allclose(fix(np.stack([d, d], axis=1), s, near=np.stack([p, p], axis=1)), np.stack([p, p], axis=1), atol=1e-5)


def test_what_has_no_fix_is_refused_for_one_epoch_and_nan_in_its_run():
    s, p = paper.satellites(300.0), paper.track("T1", 0.0)[0]
    good = range_differences(p, s)
    cases = {
        "shorter than their baselines": np.array([150e3, 0.0]),
        "no point": np.array([98e3, 98e3]),
    }
    for words, d in cases.items():
        with pytest.raises(ValueError, match=words):
            fix(d, s)
        q = fix(np.stack([good, d, good], axis=1), s)
        np.testing.assert_array_equal(np.isfinite(q), np.array([[True, False, True]] * 3))
    q = fix(np.array([good, [np.nan, 0.0]]).T, s)
    np.testing.assert_array_equal(np.isfinite(q[0]), [True, False])


def test_an_emitter_below_the_horizon_has_no_covariance():
    s, p = paper.satellites(300.0), paper.track("T1", 0.0)[0]
    with pytest.raises(ValueError, match="below the horizon"):
        fix_covariance(-p, s, paper.R_TIME_DIFFERENCE, Ellipsoid(-1))
    both = fix_covariance(np.stack([p, -p], axis=1), s, paper.R_TIME_DIFFERENCE, Ellipsoid([1, -1]))
    np.testing.assert_array_equal(np.isfinite(both), [[[True, False]] * 2] * 2)


def test_points_exist_for_all_differences_or_none_and_have_them():
    grid = np.linspace(-99e3, 99e3, 60)
    d = np.stack(np.meshgrid(grid, grid)).reshape(2, -1)
    found = candidates(d, paper.satellites(299.0))
    points = np.isfinite(found[0])
    assert set(points.sum(axis=0)) == {0, 1}
    where = points.argmax(axis=0)
    p = np.take_along_axis(found, where[None, None], axis=1)[:, 0, points.any(axis=0)]
    np.testing.assert_allclose(range_differences(p, paper.satellites(299.0)), d[:, points.any(axis=0)], atol=1e-6)
    np.testing.assert_allclose(geodetic(p)[2], 0, atol=1e-6)


def test_a_formation_in_a_plane_with_the_earths_centre_is_refused():
    s = paper.satellites(300.0)
    line = np.stack([s[:, 0], s[:, 1], 2 * s[:, 1] - s[:, 0]], axis=1)
    for flat in (line, paper.formation(layout="string").satellites(300.0)):
        for d in (np.array([1e3, 2e3]), np.array([[1e3], [2e3]])):
            with pytest.raises(ValueError, match="plane"):
                fix(d, flat)
    assert np.isnan(fix(np.array([[1e3], [2e3]]), line[..., None])).all()
    with pytest.raises(ValueError, match="three"):
        fix([1e3, 2e3], s[:, :2])
    with pytest.raises(ValueError, match="singular"):
        fix_covariance(paper.track("T1", 0.0)[0], np.stack([s[:, 0], s[:, 1], s[:, 1]], axis=1), np.eye(2), Ellipsoid())

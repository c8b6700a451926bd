"""The points of the sea that a pair of range differences leaves open."""

import numpy as np
import pytest

from trackhelpers import sea_points
from trackhelpers.scenarios import space_tdoa as st
from trackhelpers.sensors import range_differences

S = st.satellites(1.0)
PLACES = np.stack([st.track(name, 0.0)[0] for name in ("T1", "T2")], axis=1)
D = range_differences(PLACES, S[..., None])
MANY = np.repeat(S[..., None], 2, axis=2)


@pytest.mark.parametrize("seen", [True, False])
def test_points_compiled_are_points_in_numpy(monkeypatch, seen):
    compiled = sea_points.sea_points(D, MANY, seen)
    monkeypatch.setattr(sea_points, "binding", None)
    np.testing.assert_allclose(sea_points.sea_points(D, MANY, seen), compiled, rtol=0, atol=1e-6)


def test_one_point_is_in_sight_and_two_pass_the_signs():
    found = [np.isfinite(sea_points.sea_points(D, MANY, seen)[0]).sum(axis=0).tolist() for seen in (True, False)]
    assert found == [[1, 1], [2, 2]]
    np.testing.assert_allclose(np.nansum(sea_points.sea_points(D, MANY, True), axis=1), PLACES, rtol=0, atol=1e-6)


def test_a_difference_longer_than_its_baseline_has_no_point():
    assert np.isnan(sea_points.sea_points(D + 1e6, MANY, False)).all()


def test_the_points_have_the_differences_and_lie_on_the_ellipsoid():
    p = sea_points.sea_points(D, MANY, False)
    there = np.isfinite(p[0])
    for k in range(2):
        points = p[:, there[:, k], k]
        np.testing.assert_allclose(
            range_differences(points, S[..., None]), np.repeat(D[:, [k]], points.shape[1], axis=1), rtol=0, atol=1e-6
        )
        np.testing.assert_allclose(
            points[0] ** 2 / sea_points.SQUARES[0] + points[1] ** 2 / sea_points.SQUARES[1] + points[2] ** 2 / sea_points.SQUARES[2],
            1,
            rtol=1e-12,
        )

"""Stations that move: the sensor of an instant is traced once for all of them, and what is compiled is NumPy's step."""

from unittest.mock import patch

import numpy as np
import pytest

from trackhelpers import chart_rows, fused
from trackhelpers.charts import Ellipsoid, LocalENU, Plane, geodetic
from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.motion import CV
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors import TDOA

pytestmark = pytest.mark.skipif(fused.binding is None, reason="llvmlite is not installed")

M, T1 = 21, paper.track("T1", 0.0)[0]
MODEL = CV(1e-3, axes=2, noise="continuous")
SIGNS = np.where(np.arange(M) % 3, 1.0, -1.0)
CHARTS = {"sea": Ellipsoid(), "signs": Ellipsoid(SIGNS), "ENU": LocalENU(*geodetic(T1)[:2]), "plane": Plane()}


def followed(kind, chart, R=None, flat=False):
    """The ensemble after some seconds with pairs and singles, and the sensors that it was given."""
    rng = np.random.default_rng(4)
    x0 = np.kron(chart.to_chart(T1), [1.0, 0.0])[:, None] + rng.normal(size=(4, M)) * np.array([[800.0], [5.0], [800.0], [5.0]])
    P0 = np.repeat(np.diag([1e6, 100.0, 1e6, 100.0])[..., None], M, axis=2)
    if flat:
        P0[2, :, 5] = P0[:, 2, 5] = 0.0
    ens = kind(MODEL, x0, P0)
    sensors = [TDOA(paper.SIGMA, paper.satellites, chart, MODEL.state, rows=rows) for rows in ((1, 2), (1,), (2,))]
    for t in (1.0, 2.0, 3.0, 4.0):
        ens.predict(1.0 if t > 1 or not flat else 0.0)
        for sensor in sensors:
            now = sensor.at(t)
            z = now.h(x0) + 24.0 * rng.normal(size=(now.m, M))
            ens.update(z, now, mask=rng.random(M) < 0.6, R=None if R is None else np.repeat(R * now.R[..., None], M, axis=2))
    return ens, sensors


def iterated(*start):
    return EnsembleEKF(*start, iterations=4)


@pytest.mark.parametrize("kind", [EnsembleEKF, iterated, EnsembleUKF])
@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
@pytest.mark.parametrize("R", [None, 2.0])
def test_what_is_compiled_is_numpys_step(kind, chart, R):
    compiled, sensors = followed(kind, chart, R)
    for sensor in sensors:
        assert [kernel is not None for kernel in fused._kept[sensor._kind].values()] == [True]  # one for all instants
    with patch.object(fused, "binding", None):
        expected, _ = followed(kind, chart, R)
    np.testing.assert_allclose(compiled.x, expected.x, rtol=1e-11, atol=1e-6)
    for name in ("P", "S", "K", "y"):
        np.testing.assert_allclose(getattr(compiled, name), getattr(expected, name), rtol=1e-7, atol=1e-6, err_msg=name)


def test_a_run_without_a_variance_takes_the_longer_way_alone():
    ens, _ = followed(EnsembleUKF, CHARTS["ENU"], flat=True)
    clean, _ = followed(EnsembleUKF, CHARTS["ENU"])
    assert np.isfinite(ens.x).all() and not ens.failed.any()
    assert clean.x.shape == ens.x.shape


@pytest.mark.parametrize("chart", [LocalENU(*geodetic(T1)[:2], 100.0), type("Other", (Ellipsoid,), {})()], ids=["height", "subclass"])
def test_other_charts_are_left_to_numpy(chart):
    compiled, sensors = followed(EnsembleUKF, chart)
    assert not any(kernel for sensor in sensors for kernel in fused._kept.get(sensor._kind, {}).values())
    with patch.object(fused, "binding", None):
        expected, _ = followed(EnsembleUKF, chart)
    np.testing.assert_array_equal(compiled.x, expected.x)


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_rows_and_slopes_are_position_and_jacobian(chart):
    q = chart.to_chart(T1)[:, None] + np.random.default_rng(1).normal(size=(2, M)) * 3e4
    rows, slopes = chart_rows.rows(chart, q), chart_rows.slopes(chart, q)
    for row, expected in zip(rows, chart.position(q), strict=True):
        np.testing.assert_allclose(np.broadcast_to(row, M), expected, rtol=1e-12, atol=1e-6)
    for k, row in enumerate(chart.jacobian(q)):
        for value, expected in zip(slopes[k], row, strict=True):
            np.testing.assert_allclose(np.broadcast_to(value, M), expected, rtol=1e-10, atol=1e-12)

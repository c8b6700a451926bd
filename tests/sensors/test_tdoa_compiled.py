"""What an ensemble's range differences are computed with, compiled, is what one target's are, in plain numbers."""

import numpy as np
import pytest

from trackhelpers.charts import Ellipsoid, LocalENU, Plane
from trackhelpers.kernels import Kernel, binding
from trackhelpers.sensors import TDOA
from trackhelpers.symbols import Symbol, tracing

S = np.array([[-3.0e6, -3.1e6, -3.0e6], [5.0e6, 5.0e6, 5.1e6], [4.5e6, 4.4e6, 4.4e6]])
STATE = ("x", "y", "vx", "vy")


@pytest.mark.parametrize("rows", [(1, 2), (2,)])
@pytest.mark.parametrize(
    "chart",
    [Ellipsoid(), Ellipsoid(-1), LocalENU(0.6, 2.1), LocalENU(0.6, 2.1, h=5000.0), Plane()],
    ids=["north", "south", "sea", "aloft", "plane"],
)
def test_an_ensembles_differences_are_those_of_its_runs(chart, rows):
    sensor = TDOA(24.0, S, chart, STATE, rows)
    x = np.random.default_rng(1).normal(0.0, 1e5, (4, 3, 17))
    h, H = sensor.h(x), sensor.H(x)
    for k in np.ndindex(3, 17):
        np.testing.assert_allclose(h[:, *k], sensor.h(x[:, *k]), rtol=0, atol=1e-8)
        np.testing.assert_allclose(H[:, :, *k], sensor.H(x[:, *k]), rtol=0, atol=1e-13)


def test_a_run_outside_the_chart_is_nan_and_leaves_its_neighbours_alone():
    sensor = TDOA(24.0, S, Ellipsoid(), STATE)
    x = np.array([[1e6, 7e6, 2e6], [1e6, 0.0, 2e6], [0.0] * 3, [0.0] * 3])
    h = sensor.h(x)
    assert np.isnan(h[:, 1]).all()
    assert np.isfinite(h[:, [0, 2]]).all()


class Raised(Plane):
    """A plane a kilometre up, by its position alone."""

    def position(self, q):
        return super().position(q) + np.array([0.0, 0.0, 1e3]).reshape(3, *[1] * (np.ndim(q) - 1))


def test_a_chart_with_a_position_of_its_own_is_asked_for_it():
    x = np.array([[1e5, 2e5], [0.0, 1e4], [0.0, 0.0], [0.0, 0.0]])
    sensor = TDOA(24.0, S, Raised(), STATE)
    np.testing.assert_allclose(sensor.h(x), np.stack([sensor.h(x[:, k]) for k in (0, 1)], axis=1), rtol=0, atol=1e-8)


@pytest.mark.skipif(binding is None, reason="needs llvmlite")
def test_a_kernel_of_no_runs_gives_empty_arrays_and_writes_nowhere():
    with tracing():
        kernel = Kernel([((2,), [Symbol("load", 0, 0) + 1.0, Symbol("load", 0, 1)])])
    assert kernel(0, np.zeros((2, 0)))[0].shape == (2, 0)

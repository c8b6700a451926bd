"""What is recorded of a computation with symbols gives the numbers that NumPy gives."""

import numpy as np
import pytest

from trackhelpers import kernels, symbols
from trackhelpers.symbols import NotTraceable, Pair, Symbol, tracing

pytestmark = pytest.mark.skipif(kernels.binding is None, reason="llvmlite is not installed")


def evaluated(function, *rows):
    """The function on symbols, compiled and applied to the rows."""
    with tracing():
        value = function(*(Symbol("load", 0, i) for i in range(len(rows))))
        kernel = kernels.Kernel([((), [value])])
    data = np.ascontiguousarray(np.stack([np.asarray(row, dtype=float) for row in rows]))
    return kernel(data.shape[1], data)[0]


WIDE = np.concatenate([np.linspace(-7, 7, 4001), np.linspace(-1e4, 1e4, 3001), [0.0, -0.0, np.pi, -np.pi, 1e-300, 1e-9]])


@pytest.mark.parametrize("function", [np.sin, np.cos])
def test_sine_and_cosine(function):
    np.testing.assert_allclose(evaluated(function, WIDE), function(WIDE), rtol=0, atol=3e-16)
    small = np.linspace(-0.7, 0.7, 999)
    np.testing.assert_allclose(evaluated(function, small), function(small), rtol=4e-16)


def test_tangent():
    x = np.linspace(-1.5, 1.5, 999)
    np.testing.assert_allclose(evaluated(np.tan, x), np.tan(x), rtol=1e-14)


def test_arctan2_in_every_octant():
    angle = np.linspace(-np.pi, np.pi, 2881)[1:-1]
    y, x = 3 * np.sin(angle), 3 * np.cos(angle)
    np.testing.assert_allclose(evaluated(np.arctan2, y, x), np.arctan2(y, x), rtol=0, atol=5e-16)
    y, x = np.array([0.0, 1.0, -1.0, 0.0, 2.0, np.nan]), np.array([1.0, 0.0, 0.0, -1.0, -1e-300, 1.0])
    np.testing.assert_allclose(evaluated(np.arctan2, y, x), np.arctan2(y, x), atol=5e-16)


CASES = {
    "arithmetic": lambda a, b: (2 * a - b / 3 + 1) * -a / (b * b + 1) - 4,
    "powers": lambda a, b: a**3 - b**2 + a**1,
    "roots": lambda a, b: np.sqrt(a * a + b * b) - np.hypot(a, 2 * b) + np.abs(b) + abs(a),
    "choices": lambda a, b: np.where(a > b, a, np.where(b >= 1, 1.0, b)) + np.where(a == a, 0.5, a),
    "extremes": lambda a, b: np.maximum(a, 0.5) + np.minimum(a, b),
    "where": lambda a, b: np.divide(a, b, out=np.ones_like(b), where=b > 1),
    "complex": lambda a, b: ((1j * a + b) * (2 - 3j) * (a * (0.5 + 1j))).real,
    "nought": lambda a, b: 0 * a + 0.0 * b + a - 0 + (1 * b),
}


@pytest.mark.parametrize("name", CASES)
def test_what_hooks_write(name):
    a, b = np.random.default_rng(0).normal(size=(2, 50))
    np.testing.assert_allclose(evaluated(CASES[name], a, b), CASES[name](a, b), rtol=1e-14, atol=1e-15)


def test_wrap_is_the_angles_own():
    from trackhelpers.angles import wrap

    inside = np.linspace(-np.pi, np.pi, 99)[:-1]
    assert np.array_equal(evaluated(symbols.wrap, inside), inside)
    np.testing.assert_allclose(evaluated(symbols.wrap, WIDE[:4001]), wrap(WIDE[:4001]), atol=1e-14)


def test_equal_operations_are_one_and_zeros_are_none():
    with tracing():
        a, b = Symbol("load", 0, 0), Symbol("load", 0, 1)
        assert a + b is a + b and a * b is not a + b
        assert a * 0 is Symbol("number", 0.0) and a + 0.0 is a and a * 1.0 is a and (2.0 * Symbol("number", 3.0)).args == (6.0,)
        assert isinstance(1j * a, Pair)


@pytest.mark.parametrize(
    "function",
    [
        bool,
        float,
        lambda a: a if a > 0 else -a,
        lambda a: np.exp(a),
        lambda a: np.array([a], dtype=float),
        lambda a: a + np.ones(3),
        lambda a: a**0.5,
        lambda a: list(a),
        np.sum,
    ],
)
def test_what_only_a_number_can_answer_is_not_traceable(function):
    with tracing(), pytest.raises(TypeError):
        function(Symbol("load", 0, 0))
    assert issubclass(NotTraceable, TypeError)


def test_a_number_that_all_runs_share_is_read_once_for_all():
    with tracing():
        kernel = kernels.Kernel([((2,), [Symbol("shared", 0, 0) + Symbol("load", 1, 0), Symbol("shared", 0, 1)])])
    common, rows = np.zeros((2, 11)), np.arange(11.0)[None]
    common[:, 0] = 3.0, 4.0  # the first of each row
    np.testing.assert_array_equal(kernel(11, common, rows)[0], [3.0 + rows[0], np.full(11, 4.0)])

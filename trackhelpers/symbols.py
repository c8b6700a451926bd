"""Symbols that stand for numbers: a hook called with them leaves behind a list of what it computes, zeros dropped and repetitions shared.

`trackhelpers.fused` compiles that list. Where a hook asks of a symbol what only a number can answer, it raises `NotTraceable`.
"""

from contextlib import contextmanager
from functools import partial
from math import pi
from threading import RLock

import numpy as np

_alone = RLock()


@contextmanager
def tracing():
    """A trace, in which equal operations are one symbol; one thread at a time."""
    with _alone:
        before, Symbol.known = Symbol.known, {}
        try:
            yield
        finally:
            Symbol.known = before


class NotTraceable(TypeError):
    """A hook that cannot be written down once for all runs."""


class Symbol:
    """A number of each run that is not known yet: an operation, and what it is applied to. Equal operations are one object."""

    __slots__ = ("args", "op")
    __array_priority__ = 1000
    ndim, shape = 1, (1,)  # as an array over the runs, to a hook that asks
    known: dict = {}  # noqa: RUF012  of the trace under way

    def __new__(cls, op, *args):
        key = op, *(id(a) if isinstance(a, Symbol) else a for a in args)
        if key not in cls.known:
            self = cls.known[key] = object.__new__(cls)
            self.op, self.args = op, args
        return cls.known[key]

    def __add__(a, b):
        return _add(a, b)

    __radd__ = __add__

    def __sub__(a, b):
        return _add(a, b, "fsub")

    def __rsub__(a, b):
        return _add(b, a, "fsub")

    def __mul__(a, b):
        return _multiply(a, b)

    __rmul__ = __mul__

    def __truediv__(a, b):
        return _divide(a, b)

    def __rtruediv__(a, b):
        return _divide(b, a)

    def __neg__(a):
        return _add(number(0.0), a, "fsub")

    def __pos__(a):
        return a

    def __lt__(a, b):
        return Symbol("<", a, number(b))

    def __le__(a, b):
        return Symbol("<=", a, number(b))

    def __gt__(a, b):
        return Symbol("<", number(b), a)

    def __ge__(a, b):
        return Symbol("<=", number(b), a)

    def __eq__(a, b):
        return Symbol("==", a, number(b))

    __hash__ = object.__hash__

    def __abs__(a):
        return Symbol("llvm.fabs", a)

    real, imag = property(lambda a: a), property(lambda a: 0.0)

    def __pow__(self, power):
        if not isinstance(power, int) or not 1 <= power <= 8:
            raise NotTraceable(f"the power {power!r}")
        return self if power == 1 else self * self ** (power - 1)

    def __array_ufunc__(self, ufunc, method, *args, out=None, where=True, **more):
        function = _UFUNCS.get(ufunc.__name__)
        if method != "__call__" or function is None or more or any(isinstance(a, np.ndarray) and a.ndim for a in args):
            raise NotTraceable(f"numpy.{ufunc.__name__}")
        value = function(*args)
        return value if where is True else choose(where, value, out[0])

    def __array_function__(self, function, types, args, more):
        if function.__name__ not in _FUNCTIONS:
            raise NotTraceable(f"numpy.{function.__name__}")
        return _FUNCTIONS[function.__name__](*args, **more)

    def __bool__(self):
        raise NotTraceable("a decision on a number that differs from run to run")

    __float__ = __int__ = __index__ = __iter__ = __len__ = __array__ = __bool__


class Pair:
    """A complex symbol."""

    ndim, shape, __array_ufunc__ = 1, (1,), None

    def __init__(self, real, imag):
        self.real, self.imag = real, imag

    def __mul__(self, b):
        return Pair(self.real * b.real - self.imag * b.imag, self.real * b.imag + self.imag * b.real)

    __rmul__ = __mul__

    def __add__(a, b):
        return Pair(a.real + b.real, a.imag + b.imag)

    __radd__ = __add__

    def __sub__(a, b):
        return Pair(a.real - b.real, a.imag - b.imag)

    def __neg__(a):
        return Pair(0.0 - a.real, 0.0 - a.imag)

    def __truediv__(a, b):
        return Pair(a.real / b, a.imag / b)


def number(a):
    if isinstance(a, Symbol):
        return a
    if isinstance(a, float | int | np.floating | np.integer) or (isinstance(a, np.ndarray) and a.ndim == 0):
        return Symbol("number", float(a))
    raise NotTraceable(f"{type(a).__name__} beside a symbol")


def _is(a, value):
    return a.op == "number" and a.args[0] == value


def _add(a, b, op="fadd"):
    if isinstance(b, Pair | complex) or isinstance(a, complex):
        return Pair(a.real + b.real, a.imag + b.imag) if op == "fadd" else Pair(a.real - b.real, a.imag - b.imag)
    a, b = number(a), number(b)
    if a.op == b.op == "number":
        return Symbol("number", a.args[0] + b.args[0] if op == "fadd" else a.args[0] - b.args[0])
    return a if _is(b, 0.0) else b if _is(a, 0.0) and op == "fadd" else Symbol(op, a, b)


def _multiply(a, b):
    if isinstance(b, Pair | complex) or isinstance(a, complex):
        return Pair(a.real * b.real - a.imag * b.imag, a.real * b.imag + a.imag * b.real)
    a, b = number(a), number(b)
    if a.op == b.op == "number":
        return Symbol("number", a.args[0] * b.args[0])
    for one, other in ((a, b), (b, a)):
        if _is(one, 0.0) or _is(one, 1.0):
            return other if _is(one, 1.0) else one
    return Symbol("fmul", a, b)


def _divide(a, b):
    a, b = number(a), number(b)
    if _is(b, 1.0) or (_is(a, 0.0) and b.op != "number"):
        return a
    return a * (1.0 / b.args[0]) if b.op == "number" and b.args[0] else Symbol("fdiv", a, b)


def choose(condition, a, b):
    """a where the condition holds, b elsewhere."""
    return Symbol("select", condition, number(a), number(b))


def polynomial(coefficients, x):
    """Σ cₖ xᵏ."""
    value = number(coefficients[-1])
    for c in coefficients[-2::-1]:
        value = value * x + c
    return value


# π/2 in three parts, and Taylor's coefficients of sine and cosine in x² up to π/4: the error is a last place, or two.
_QUARTER = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
_SIN = [(-1) ** k / float(np.prod(np.arange(1.0, 2 * k + 2))) for k in range(9)]
_COS = [(-1) ** k / float(np.prod(np.arange(1.0, 2 * k + 1))) for k in range(10)]
_ATAN = [(-1) ** k / (2 * k + 1) for k in range(17)]


def cos_sin(angle):
    """Cosine and sine of a symbol."""
    turns = Symbol("llvm.nearbyint", angle * (2 / pi))
    r = angle
    for part in _QUARTER:
        r = r - turns * part
    square, half = r * r, Symbol("llvm.floor", turns * 0.5)
    sin, cos = r * polynomial(_SIN, square), polynomial(_COS, square)
    odd = turns - half * 2.0 > 0.5
    back = half - Symbol("llvm.floor", half * 0.5) * 2.0 > 0.5  # an odd number of half turns
    one, other = choose(odd, sin, cos), choose(odd, cos, sin)
    return choose(odd, choose(back, one, -one), choose(back, -one, one)), choose(back, -other, other)


def _arctan2(y, x):
    """Taylor's series after three foldings: |y/x| to at most 1, then about 0, ½ and 1 the tangent of a small difference."""
    y, x = number(y), number(x)
    steep = abs(y) > abs(x)
    a, b = choose(steep, abs(x), abs(y)), choose(steep, abs(y), abs(x))
    t = choose(b == 0.0, 0.0, a / b)
    near = choose(t > 0.75, 1.0, choose(t > 0.25, 0.5, 0.0))
    about = choose(t > 0.75, pi / 4, choose(t > 0.25, float(np.arctan(0.5)), 0.0))
    u = (t - near) / (t * near + 1.0)
    angle = about + u * polynomial(_ATAN, u * u)
    angle = choose(steep, pi / 2 - angle, angle)
    angle = choose(x < 0.0, pi - angle, angle)
    return choose(y < 0.0, -angle, angle)


def _tan(a):
    cos, sin = cos_sin(a)
    return sin / cos


def wrap(angle):
    """The symbol in [−π, π), as `trackhelpers.angles.wrap_rows` brings it there."""
    turned = angle + pi
    inside = turned - Symbol("llvm.floor", turned / (2 * pi)) * (2 * pi) - pi
    return choose(angle < -pi, inside, choose(angle >= pi, inside, angle))


_sqrt = partial(Symbol, "llvm.sqrt")
_UFUNCS = {"add": _add, "subtract": lambda a, b: _add(a, b, "fsub"), "multiply": _multiply, "divide": _divide, "negative": lambda a: -a}
_UFUNCS |= {"sin": lambda a: cos_sin(a)[1], "cos": lambda a: cos_sin(a)[0], "tan": _tan, "arctan2": _arctan2, "sqrt": _sqrt}
_UFUNCS |= {"absolute": abs, "square": lambda a: a * a, "hypot": lambda a, b: _sqrt(a * a + b * b), "power": lambda a, b: a**b}
_UFUNCS |= {"less": lambda a, b: number(a) < b, "less_equal": lambda a, b: number(a) <= b, "equal": lambda a, b: number(a) == b}
_UFUNCS |= {"maximum": lambda a, b: choose(number(a) < b, b, a), "minimum": lambda a, b: choose(number(b) < a, b, a)}
_UFUNCS |= {"greater": lambda a, b: number(a) > b, "greater_equal": lambda a, b: number(a) >= b}
# What holds for all runs is not known: the general branch is taken.
_FUNCTIONS = {"all": lambda a: False, "any": lambda a: True, "where": choose, "shape": lambda a: (1,), "ndim": lambda a: 1}
_FUNCTIONS |= {"zeros_like": lambda a, **_: number(0.0), "ones_like": lambda a, **_: number(1.0), "full_like": lambda a, b, **_: number(b)}

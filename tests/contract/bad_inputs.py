"""What an argument may be, by an example, and what it must not be: bad values made from the good one."""

from datetime import timedelta

import numpy as np


class Fixed:
    """An argument of which nothing is asked here."""

    def __init__(self, value=None):
        self.value = value

    def bad(self):
        return iter(())


class Numbers(Fixed):
    """An array. `free`: any shape will do; `gaps`: NaN marks what is missing; `optional`: None will do; `number`: so will a number; `beyond`: what else must be refused."""

    def __init__(self, value, free=False, gaps=False, optional=False, number=False, truths=False, beyond=()):
        super().__init__(np.array(value, dtype=float))
        self.truths = truths  # an array of them will do
        self.free, self.gaps, self.optional, self.number, self.beyond = free, gaps, optional, number, beyond

    def bad(self):
        a = self.value
        first = np.zeros(a.shape, dtype=bool)
        first.flat[0] = True
        yield "complex", a + 1j
        yield "complex list", (a * (1 + 0j)).tolist()
        yield "strings", a.astype(str).tolist()
        yield "array of strings", a.astype(str)
        yield "text", "nonsense"
        if not self.truths:
            yield "booleans", a > 0
        yield "masked", np.ma.array(a, mask=first)
        yield "objects", np.full(a.shape, object())
        yield "numbers as objects", a.astype(object)
        yield "times", a.astype("m8[s]")
        yield "dict", {}
        yield "set", {1.0, 2.0}
        if a.ndim:
            for name, entry in (("None", None), ("text", "1"), ("truth", True), ("duration", timedelta(seconds=1)), ("10**400", 10**400)):
                yield f"{name} inside", _with_first(a.tolist(), entry)
            yield "ragged", [*a.tolist(), [[[1.0]]]]
        if not self.optional:
            yield "None", None
        if not self.gaps:
            for entry in (np.nan, np.inf, -np.inf):
                yield str(entry), np.where(first, entry, a)
        if not self.free:
            yield "longer", np.concatenate([a, a]) if a.ndim else np.array([a, a])
            if a.ndim and not self.number:
                yield "no axis", 1.0
            if a.ndim:
                yield "empty", a[:0]
            if a.ndim > 1:
                yield "wider", np.concatenate([a, a], axis=1)
                yield "flat", a.ravel()
        for i, value in enumerate(self.beyond):
            yield f"beyond {i}", value


class Covariance(Numbers):
    """A covariance (n, n), or (n, n, M); `definite`: it must be one of full rank."""

    def __init__(self, value, optional=False, definite=False, number=False):
        a = np.array(value, dtype=float)
        beyond = [-a, a - 2 * a[0, 0] * np.eye(len(a)).reshape(len(a), len(a), *[1] * (a.ndim - 2))]
        if len(a) > 1:
            skew, wide = a.copy(), a.copy()
            skew[0, 1] += 0.5 * np.max(a)
            wide[0, 1] = wide[1, 0] = 3 * np.max(a)
            lost = a.copy()
            lost[-1, -1] = -1e-9 * np.max(a)
            beyond += [skew, wide, lost]
        if definite:
            beyond.append(0 * a)
        super().__init__(value, optional=optional, number=number, beyond=beyond)


class Number(Fixed):
    """A number; `beyond` lists numbers that must be refused, `infinite` admits NaN and infinities, `array` arrays, `large` 10**400."""

    def __init__(self, value, beyond=(), optional=False, infinite=False, array=False, large=False):
        super().__init__(value)
        self.beyond, self.optional, self.infinite, self.array, self.large = beyond, optional, infinite, array, large

    def bad(self):
        yield "complex", complex(self.value, 1)
        yield "complex number", complex(self.value)
        yield "text", str(self.value)
        yield "truth", True
        yield "array of truth", np.array(True)
        yield "masked", np.ma.masked
        yield "object", object()
        yield "duration", timedelta(seconds=1)
        yield "NumPy's duration", np.timedelta64(1, "s")
        yield "dict", {}
        if not self.array:
            yield "list", [self.value, self.value]
        if not self.large:
            yield "10**400", 10**400
        if not self.infinite:
            yield from (("nan", np.nan), ("inf", np.inf), ("-inf", -np.inf))
        if not self.optional:
            yield "None", None
        for value in self.beyond:
            yield f"{value}", value


def Scale(value, zero=True, optional=False, array=False):
    """A number ≥ 0, or > 0."""
    return Number(value, (-1.0, -1e-12) if zero else (-1.0, 0.0, -0.0), optional, array=array)


def Probability(value, optional=False):
    """A number between 0 and 1."""
    return Number(value, (0.0, 1.0, -0.1, 1.5, 95), optional)


class Count(Number):
    """A whole number ≥ `least`."""

    def __init__(self, value, least=1, large=False):
        super().__init__(value, (2.5, float(value), str(value), least - 1), large=large)


class Choice(Fixed):
    """One of some values."""

    def bad(self):
        for value in ("nonsense", None, 17, [self.value], {}, 1j):
            yield repr(value), value


class Angles(Fixed):
    """Indices of components, of which there are n."""

    def __init__(self, value, n, optional=False):
        super().__init__(value)
        self.n, self.optional = n, optional

    def bad(self):
        for value in ((self.n,), (-1,), (0.5,), ("θ",), (None,), (True,), (1j,), "0", 0, *(() if self.optional else (None,))):
            yield repr(value), value


class Wrong(Fixed):
    """Anything; what is bad is listed."""

    def __init__(self, value, *wrong):
        super().__init__(value)
        self.wrong = wrong

    def bad(self):
        for value in self.wrong:
            yield repr(value)[:12], value


class Names(Fixed):
    """A sequence of words; `beyond` lists others that must be refused."""

    def __init__(self, value, optional=False, beyond=((1, 2), ("nonsense",))):
        super().__init__(value)
        self.optional, self.beyond = optional, beyond

    def bad(self):
        for value in ((None,), 3.0, (1.5,), (True,), (["x"],), *self.beyond, *(() if self.optional else (None,))):
            yield repr(value), value


class Text(Fixed):
    """One line of text."""

    def bad(self):
        for value in (None, 3, 1.5, b"bytes", ["text"], True, 1j):
            yield repr(value), value


class Thing(Fixed):
    """A model, a sensor, a chart …, which nothing else can stand for: TypeError will do."""

    def __init__(self, value, optional=False):
        super().__init__(value)
        self.optional = optional

    def bad(self):
        for value in ("nonsense", 3.0, object(), {}, [1.0], *(() if self.optional else (None,))):
            yield repr(value)[:12], value


class Each(Fixed):
    """A sequence of arguments; what is bad for one is bad in it, and so is another length where `length` matters."""

    def __init__(self, *kinds, length=True, optional=False, number=False):
        super().__init__([kind.value for kind in kinds])
        self.kinds, self.length, self.optional, self.number = kinds, length, optional, number

    def bad(self):
        for k, kind in enumerate(self.kinds[:2]):
            for name, value in kind.bad():
                yield f"[{k}] {name}", [*self.value[:k], value, *self.value[k + 1 :]]
        if self.length:
            yield "longer", [*self.value, self.value[-1]]
            yield "shorter", self.value[:-1]
        if not self.number:
            yield "number", 3.0
        yield "object", object()
        if not self.optional:
            yield "None", None


def _with_first(nested, entry):
    """Nested lists with another first entry."""
    return [_with_first(nested[0], entry), *nested[1:]] if isinstance(nested, list) else entry


class Mask(Fixed):
    """Truths of shape (M,): neither numbers nor words stand for them."""

    def __init__(self, value, optional=False):
        super().__init__(np.array(value))
        self.optional = optional

    def bad(self):
        a = self.value
        yield "whole numbers", a.astype(int)
        yield "numbers", a.astype(float).tolist()
        yield "words", ["yes"] * len(a)
        yield "Nones", [None] * len(a)
        yield "indices", np.flatnonzero(a)
        yield "objects", a.astype(object)
        yield "masked", np.ma.array(a, mask=a)
        yield "longer", [*a.tolist(), True]
        yield "one", True
        yield "none of them, as numbers", np.zeros(len(a))
        yield "text", "nonsense"
        if not self.optional:
            yield "None", None

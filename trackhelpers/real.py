"""What counts as real numbers, and how a message quotes what does not: what `checks` rests on."""

from numbers import Real

import numpy as np


def floats(value, name, wanted):
    """`value` as a float array; ValueError where that would read a masked entry, or change what is meant."""
    if is_masked(value):
        raise ValueError(f"{name}: expected {wanted}, got a masked array: leave out what is masked, or pass None for a missing measurement")
    try:
        array = np.asarray(value)
        if not _means_numbers(value) or array.dtype.kind not in "iufO":
            raise TypeError
        with np.errstate(over="raise"):
            return array.astype(float, copy=False)
    except (TypeError, ValueError, ArithmeticError):
        raise ValueError(f"{name}: expected {wanted}, got {said(value)}") from None


def _means_numbers(value):
    """Whether all entries of arrays and nested lists are real numbers, none a truth value."""
    if isinstance(value, (list, tuple)):
        return all(map(_means_numbers, value))
    if hasattr(value, "dtype"):
        return getattr(value.dtype, "kind", "O") in "iuf"
    if hasattr(value, "__array__"):
        return np.asarray(value).dtype.kind in "iuf"
    return isinstance(value, range) or (isinstance(value, Real) and not isinstance(value, bool))


def said(value):
    """`value` as a message quotes it."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of too many digits for Python to write down
        return f"{type(value).__name__} of too many digits"
    return text if len(text) <= 300 else f"{text[:300]} …"


def is_masked(value):
    if isinstance(value, (list, tuple)):
        return any(map(is_masked, value))
    return isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value)

"""Numbers as text: rounded to what is meant, or written in the manner of a printed one."""

import math
import re
from decimal import Decimal, InvalidOperation

import numpy as np
import pandas as pd

from .checks import check_count, check_number, check_numbers


def number(value, digits=4, trim=False):
    """Return a number as text with `digits` significant digits.

    Integers, strings and truth values keep their own form; a missing value is a dash, and minus zero is zero. Numbers below 1e-4 and
    from 1e6 on are written with an exponent. `trim` takes trailing zeros off the decimals. ValueError for `digits` that are no whole number ≥ 1, and what is no number.
    """
    digits = digits if type(digits) is int and 0 < digits < 100 else check_count(digits, "digits")
    if isinstance(value, str):
        return value
    if value is None or value is pd.NA or value != value:
        return "–"
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    value = value if type(value) is float else float(check_numbers(value, "value", "a number"))
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0.0:
        return "0"
    text = f"{value:.{digits - 1}e}"
    exponent = int(text.partition("e")[2])  # of the rounded number, so that 9.9999 counts as 10
    if -4 <= exponent < 6:
        text = f"{value:.{max(0, digits - 1 - exponent)}f}"
    if trim and "." in text:
        mantissa, e, power = text.partition("e")
        text = mantissa.rstrip("0").rstrip(".") + e + power
    return text


def residual_text(value):
    """Return a difference that ought to vanish as text: two digits, or "< 1e-9" where only rounding is left, whose digits differ from one processor to the next.

    ValueError for what is no finite number.
    """
    check_number(value, "value")
    return "< 1e-9" if abs(value) < 1e-9 else number(value, 2)


def as_printed(value, text):
    """Return `value` written in the manner of the printed number `text`: with its decimals, and its exponent if it has one. ValueError unless both are numbers."""
    value = check_number(value, "value")
    try:
        decimals = -Decimal(re.split("[eE]", text.strip())[0].replace("−", "-")).as_tuple().exponent
    except (AttributeError, InvalidOperation, TypeError):
        raise ValueError(f"text: expected a number as it was printed, for example '5.27E+00', got {text!r}") from None
    if "e" in text.lower():
        return without_minus_zero(f"{value:.{decimals}E}")
    return without_minus_zero(f"{value:.{decimals}f}")


def without_minus_zero(text):
    """A written number without the sign of a zero."""
    return text[1:] if text.startswith("-") and not re.search("[1-9]", re.split("[eE]", text)[0]) else text

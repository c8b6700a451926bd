"""Integrals along an arc: what every turn model is made of, without a division by the turn rate.

With p = x + iy, speed v and heading θ, dp/dt = v e^{iθ}. Over a step in which the heading turns by φ the displacement is a sum of

    E_n(φ) = ∫₀¹ uⁿ e^{iφu} du,

which are smooth at φ = 0, where the printed form (sin(θ+φ) − sin θ)/ω is 0/0.
"""

import math

import numpy as np
from scipy.special import spherical_jn

from trackhelpers.angles import cos_sin
from trackhelpers.checks import check_numbers
from trackhelpers.symbols import Pair, Symbol, polynomial

_SMALL = 0.5  # below this half angle the series of j₁, j₂ and j₃ needs no more than 7 terms for full double precision
# Taylor coefficients of j_l(h)/h^l in h²: (−1)^k / (2^k k! (2l+2k+1)!!), lowest power first
_SERIES = {l: [(-1.0) ** k / (2.0**k * math.factorial(k) * math.prod(range(1, 2 * (l + k) + 2, 2))) for k in range(7)] for l in (1, 2, 3)}


def unit(angle):
    """e^{i·angle}, from a cosine and a sine (NumPy's complex exponential is slower)."""
    return _complex(*cos_sin(angle))


def _complex(real, imag):
    if type(real) is float:
        return complex(real, imag)
    if isinstance(real, Symbol):
        return Pair(real, imag)
    number = np.empty(np.shape(real), dtype=complex)
    number.real, number.imag = real, imag
    return number


def _bessel(l, h):
    """Spherical Bessel function j_l(h), l = 1, 2, 3, for an array h."""
    small = np.abs(h) <= _SMALL
    square = h * h
    value = np.full_like(h, _SERIES[l][-1])
    for coefficient in reversed(_SERIES[l][:-1]):
        value *= square
        value += coefficient
    for _ in range(l):
        value *= h
    if not np.all(small):
        large = ~small
        # j_l(−h) = (−1)^l j_l(h): SciPy promises real arguments of either sign only where it recurs upwards
        value[large] = np.sign(h[large]) ** l * spherical_jn(l, np.abs(h[large]))
    return value


def turn_integrals(phi, order):
    """E₀(φ), …, E_order(φ) with E_n(φ) = ∫₀¹ uⁿ e^{iφu} du.

    From the expansion of uⁿ in Legendre polynomials on [0, 1], with h = φ/2 and spherical Bessel functions j_l(h): E₀ = e^{ih} j₀,
    E₁ = ½ e^{ih} (j₀ + i j₁), E₂ = ¼ e^{ih} (4/3 j₀ + 2i j₁ − 2/3 j₂), E₃ = ⅛ e^{ih} (2 j₀ + 18/5 i j₁ − 2 j₂ − 2/5 i j₃).

    Parameters
    ----------
    phi : array_like
        Angle turned in the step, rad, any shape.
    order : int
        0, 1, 2 or 3.

    Returns
    -------
    list of complex numpy.ndarray, each of the shape of `phi`
        Relative error below 1e-14 for every φ, 0 among them.

    Raises
    ------
    ValueError
        For another order, and what is no number.
    """
    if type(order) is not int or order not in (0, 1, 2, 3):
        raise ValueError(f"order: expected 0, 1, 2 or 3, got {order!r}")
    if type(phi) is float and phi - phi == 0:
        return _of_number(phi, order)
    if isinstance(phi, Symbol):
        return _of_symbol(phi, order)
    phi = check_numbers(phi, "phi")
    h = np.atleast_1d(0.5 * phi)
    with np.errstate(over="ignore", invalid="ignore"):  # a diverged run holds inf or NaN; and for a large h no series is used
        turn = unit(h)
        j0 = turn.imag / h if np.all(h) else np.divide(turn.imag, h, out=np.ones_like(h), where=h != 0)
        E = _combined(turn, j0, *(_bessel(l, h) for l in range(1, order + 1)))
    return [e.reshape(phi.shape) for e in E]


def _combined(turn, j0, j1=None, j2=None, j3=None):
    """E₀ and as many further integrals as there are further Bessel functions."""
    E = [turn * j0]
    if j1 is not None:
        E.append(turn * _complex(0.5 * j0, 0.5 * j1))
    if j2 is not None:
        E.append(turn * _complex((j0 - 0.5 * j2) / 3, 0.5 * j1))
    if j3 is not None:
        E.append(turn * _complex(0.25 * (j0 - j2), 0.45 * j1 - 0.05 * j3))
    return E


def _of_number(phi, order):
    """`turn_integrals` of one plain number; ValueError for inf."""
    h = 0.5 * phi
    cos, sin = math.cos(h), math.sin(h)
    square = h * h
    j = [sin / h if h else 1.0]
    if abs(h) > _SMALL:  # upwards; what this loses in j₂ and j₃ is less than rounding in the sums that they enter
        j += [(j[0] - cos) / h]
        j += [3 / h * j[1] - j[0]]
        j += [5 / h * j[2] - j[1]]
    else:
        power = 1.0
        for l in range(1, order + 1):
            power *= h
            value = 0.0
            for coefficient in reversed(_SERIES[l]):
                value = value * square + coefficient
            j.append(power * value)
    return _combined(complex(cos, sin), *j[: order + 1])


def _of_symbol(phi, order):
    """`turn_integrals` of a symbol: both forms of `_of_number`, and the choice between them."""
    h = 0.5 * phi
    cos, sin = cos_sin(h)
    small, j = abs(h) <= _SMALL, [np.where(h == 0.0, 1.0, sin / h)]
    upwards = [j[0], (j[0] - cos) / h]
    for l in range(1, order + 1):
        series = polynomial(_SERIES[l], h * h) * h**l
        j.append(np.where(small, series, upwards[l]))
        upwards.append((2 * l + 1) / h * upwards[l] - upwards[l - 1])
    return _combined(Pair(cos, sin), *j)


def turned_moments(heading, rate, dt, order):
    """e^{iθ} and the moments ∫₀^dt tⁿ e^{i(θ + ωt)} dt, n = 0, …, order, of the direction in a step that turns from `heading` θ at `rate` ω."""
    u = unit(heading)
    if order == 1 and type(rate) is float and type(dt) is float:  # the commonest case in one breath: E₀ and E₁ of one number
        E0, E1 = _of_number(rate * dt, 1)
        u_dt = u * dt
        return u, [u_dt * E0, u_dt * dt * E1]
    return u, [dt ** (n + 1) * (u * E) for n, E in enumerate(turn_integrals(rate * dt, order))]


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def integrate_along_arc(integrand, dt):
    """∫₀^dt integrand(t) dt by 24-point Gauss–Legendre quadrature, for the smooth integrands of one step.

    `integrand` takes a time of shape (24, 1, ..., 1) and returns values whose first axis is time; exact to rounding while the step turns by less than
    about 20 rad.
    """
    values = integrand(0.5 * dt * (1 + _NODES))
    return 0.5 * dt * np.tensordot(_WEIGHTS, values, axes=1)

"""Roots of many quartics at a time, (5, K), constant term first."""

from math import comb

import numpy as np

_BERNSTEIN = np.array([[comb(i, j) / comb(4, j) for j in range(5)] for i in range(5)])  # coefficients on (0, 1) from those of powers


def roots_up_to_one(quartic):
    """Real roots of quartics (5, K), all of those in (0, 1) among them: r (J,), whose they are, and which of the four (J,).

    A quartic that has one root there, as the sign changes of its Bernstein coefficients tell, is solved without the other three.
    """
    bernstein = _BERNSTEIN @ quartic
    changes = np.sum(bernstein[1:] * bernstein[:-1] <= 0, axis=0)  # at least as many as there are roots; 1 is one
    one, several = np.flatnonzero(changes == 1), np.flatnonzero(changes > 1)
    r, which, column = real_roots(quartic[:, several])
    r = np.concatenate([_single_root(quartic[:, one]), r])
    return r, np.concatenate([one, several[which]]), np.concatenate([np.zeros(len(one), dtype=int), column])


def real_roots(quartic):
    """The real roots of quartics (5, K), constant term first: r (J,), whose they are and which of the four (J,)."""
    companion = np.zeros((quartic.shape[1], 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1
    companion[:, :, 3] = (-quartic[:4] / quartic[4]).T
    values = np.linalg.eigvals(companion) if len(companion) else np.zeros((0, 4))
    real = np.abs(values.imag) <= 1e-7 * np.abs(values.real)
    return values.real[real], *np.nonzero(real)


def _single_root(quartic):
    """The root in (0, 1) of quartics (5, K) that have one there: Newton's steps, halving where one leads out of what is still open."""
    c0, c1, c2, c3, c4 = quartic
    rises, low, high, r = c0 < 0, np.zeros_like(c0), np.ones_like(c0), np.full_like(c0, 0.5)
    for _ in range(60):
        value = c0 + r * (c1 + r * (c2 + r * (c3 + r * c4)))
        under = (value < 0) == rises
        low, high = np.where(under, r, low), np.where(under, high, r)
        step = r - value / (c1 + r * (2 * c2 + r * (3 * c3 + r * 4 * c4)))
        step = np.where((step > low) & (step < high), step, 0.5 * (low + high))
        moved, r = np.abs(step - r), step
        if not np.any(moved > 1e-9):
            break
    return r

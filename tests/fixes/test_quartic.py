import numpy as np

from trackhelpers.quartic import real_roots, roots_up_to_one

QUARTICS = np.random.default_rng(4).normal(size=(5, 400))


def numpys(k):
    """The real roots of quartic k by `numpy.roots`."""
    roots = np.roots(QUARTICS[::-1, k])
    return np.sort(roots[np.abs(roots.imag) < 1e-9].real)


def test_real_roots_are_those_of_numpy():
    r, which, column = real_roots(QUARTICS)
    for k in range(400):
        np.testing.assert_allclose(np.sort(r[which == k]), numpys(k), rtol=1e-7)
    assert len(set(zip(which.tolist(), column.tolist(), strict=True))) == len(r)


def test_no_root_up_to_one_is_lost_however_it_is_found():
    r, which, column = roots_up_to_one(QUARTICS)
    for k in range(400):
        wanted, found = numpys(k), np.sort(r[which == k])
        inside = wanted[(wanted > 0) & (wanted < 1)]
        np.testing.assert_allclose(found[(found > 0) & (found < 1)], inside, rtol=1e-7)
    assert len(set(zip(which.tolist(), column.tolist(), strict=True))) == len(r)
    assert 0 < np.sum(np.bincount(which, minlength=400) == 1) < 400

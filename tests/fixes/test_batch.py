import numpy as np
import pytest
from scipy.optimize import least_squares

from trackhelpers.charts import Ellipsoid, LocalENU, geodetic
from trackhelpers.fixes import batch_fix, fix, fix_covariance
from trackhelpers.scenarios import space_tdoa as paper
from trackhelpers.sensors import range_differences

T = paper.TIMES[:200:10]
S = paper.satellites(T)
R = paper.R_TIME_OF_ARRIVAL
NADIR = paper.nadir(S[:, 0, 0])


def _runs(target, M, seed=0):
    rngs = [np.random.default_rng([seed, run]) for run in range(M)]
    position, velocity = paper.track(target, T)
    return paper.measurements(position, S, R, rngs), paper.availability("1", rngs, len(T)), position, velocity


def test_one_pair_is_the_closed_form_fix_with_its_covariance():
    z = _runs("T1", 1)[0][:, :1, 0]
    found = batch_fix(z, T[:1], S[..., :1], R, Ellipsoid(), NADIR[:2])
    p = fix(z[:, 0], S[..., 0])
    np.testing.assert_allclose(found.x, p[:2], atol=1e-3)
    np.testing.assert_allclose(found.P, fix_covariance(p, S[..., 0], R, Ellipsoid()), rtol=1e-5)
    assert found.cost < 1e-6


@pytest.mark.parametrize("chart", [Ellipsoid(), LocalENU(*geodetic(NADIR)[:2])], ids=["ellipsoid", "enu"])
@pytest.mark.parametrize("n", [2, 4])
def test_it_is_the_minimum_that_scipy_finds(n, chart):
    z, there = (part[..., 0] for part in _runs("ship", 1)[:2])
    L = np.linalg.cholesky(R)

    def whitened(x):
        q = np.stack([x[0] + 0 * T, x[1] + 0 * T]) if n == 2 else x[:2, None] + x[2:, None] * (T - T[-1])
        y = z - range_differences(chart.position(q), S)
        pairs = np.linalg.solve(L, y[:, there.all(axis=0)])
        singles = [y[i, there[i] & ~there[1 - i]] / np.sqrt(R[i, i]) for i in (0, 1)]
        return np.concatenate([pairs.ravel(), *singles])

    start = np.concatenate([chart.to_chart(NADIR), np.zeros(n - 2)])
    scale = np.array([1e4, 1e4, 10, 10][:n])
    oracle = least_squares(lambda x: whitened(scale * x), start / scale + 1, jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = batch_fix(z, T, S, R, chart, start, t0=T[-1], there=there)
    assert found.cost == pytest.approx(2 * oracle.cost, rel=1e-6)
    sigma = np.sqrt(np.diag(found.P))
    np.testing.assert_allclose((found.x - scale * oracle.x) / sigma, 0, atol=1e-3)
    np.testing.assert_allclose(found.P, np.linalg.inv(oracle.jac.T @ oracle.jac) * np.outer(scale, scale), rtol=1e-3)


@pytest.mark.parametrize("target, n", [("T2", 2), ("ship", 4)])
def test_many_runs_are_their_runs_one_by_one_and_honest(target, n):
    M = 200
    z, there, position, velocity = _runs(target, M)
    truth = np.concatenate([position[:2, -1], velocity[:2, -1]])[:n]
    start = np.concatenate([NADIR[:2], np.zeros(n - 2)])
    many = batch_fix(z, T, S, R, Ellipsoid(), start, t0=T[-1], there=there)
    for m in (0, 7):
        one = batch_fix(np.where(there, z, np.nan)[..., m], T, S, R, Ellipsoid(), start, t0=T[-1])
        for a, b in zip(one, many, strict=True):
            np.testing.assert_allclose(a, b[..., m], rtol=1e-9)
    error = many.x - truth[:, None]
    nees = np.einsum("im,mij,jm->m", error, np.linalg.inv(np.moveaxis(many.P, -1, 0)), error)
    assert np.mean(nees) == pytest.approx(n, abs=4 * np.sqrt(2 * n / M))
    freedom = there[..., 0].sum() - n
    assert np.mean(many.cost) == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom / M))


def test_a_run_with_too_little_is_nan_and_one_alone_is_refused():
    z, there, *_ = _runs("T1", 3)
    there[..., 1] = False
    there[0, :3, 1] = True
    start = [*NADIR[:2], 0.0, 0.0]
    found = batch_fix(z, T, S, R, Ellipsoid(), start, there=there)
    np.testing.assert_array_equal(np.isfinite(found.x[0]), [True, False, True])
    np.testing.assert_array_equal(np.isfinite(found.P[0, 0]), [True, False, True])
    with pytest.raises(ValueError, match="at least 4"):
        batch_fix(z[..., 1], T, S, R, Ellipsoid(), start, there=there[..., 1])
    with pytest.raises(ValueError, match="tell"):  # the same instant again and again: no velocity
        batch_fix(z[:, :4, 0], T[[0] * 4], S[..., [0] * 4], R, Ellipsoid(), start, t0=T[0])


@pytest.mark.parametrize(
    "change, words",
    [
        ({"z": np.zeros((3, 20))}, "z:"),
        ({"there": np.ones((2, 19), dtype=bool)}, "there"),
        ({"there": np.ones((2, 20))}, "there"),
        ({"satellites": S[..., :5]}, "satellites"),
        ({"t": T[:5]}, "t:"),
        ({"R": np.zeros((2, 2))}, "R"),
        ({"x0": [0.0, 0.0, 0.0]}, "x0"),
        ({"z": np.full((2, 20), np.nan), "there": np.ones((2, 20), dtype=bool)}, "finite"),
        ({"x0": [9e6, 0.0]}, "x0"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    arguments = {"z": np.zeros((2, 20)), "t": T, "satellites": S, "R": R, "chart": Ellipsoid(), "x0": NADIR[:2]}
    with pytest.raises(ValueError, match=words):
        batch_fix(**{**arguments, **change})

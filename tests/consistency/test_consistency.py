import numpy as np
import pytest
from scipy import stats

from trackhelpers.consistency import chi2_band, cramer_rao, nees, nis


def test_nees_of_the_filters_own_error_is_chi_square():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(3, 3))
    P = A @ A.T
    error = np.linalg.cholesky(P) @ rng.standard_normal((3, 20_000))
    values = nees(error, np.zeros_like(error), P)
    assert stats.kstest(values, stats.chi2(3).cdf).pvalue > 0.01
    np.testing.assert_allclose(values[0], nees(error[:, 0], np.zeros(3), P))


def test_nees_wraps_the_named_angles():
    assert nees([np.pi - 0.1], [-np.pi + 0.1], [[1.0]], angles=(0,)) == pytest.approx(0.04)


def test_common_truth_stands_beside_an_ensemble():
    x = np.random.default_rng(1).normal(size=(2, 4))
    P = np.repeat(np.eye(2)[..., None], 4, axis=2)
    np.testing.assert_allclose(nees([1.0, 2.0], x, P), ((x - [[1], [2]]) ** 2).sum(axis=0))


def test_nis_is_the_squared_mahalanobis_length_of_the_innovation():
    assert nis([3.0, 4.0], np.diag([9.0, 4.0])) == pytest.approx(5.0)


@pytest.mark.parametrize("units", [[1, 1, 1], [1e6, 1e-6, 1], [1e-9, 1e9, 1e3]])
def test_nees_and_nis_do_not_depend_on_units(units):
    rng = np.random.default_rng(2)
    A, error, units = rng.normal(size=(3, 3)), rng.normal(size=3), np.array(units)
    P, expected = A @ A.T, error @ np.linalg.solve(A @ A.T, error)
    scaled = np.outer(units, units) * P
    for value in (
        nees(units * error, np.zeros(3), scaled),
        nis(units * error, scaled),
        *nis(np.outer(units * error, [1, 1]), scaled),
    ):
        assert value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("units", [[1, 1], [1e6, 1e-6], [1e-9, 1e9]])
def test_a_covariance_that_is_not_definite_is_refused_in_all_units(units):
    with pytest.raises(ValueError, match="S: expected a positive definite"):
        nis([0, 0], np.outer(units, units) * [[1, 1.001], [1.001, 1]])


def test_what_is_masked_is_no_error():
    masked = np.ma.array([1, -999.0], mask=[False, True])
    for call in (
        lambda: nees(masked, [0, 0], np.eye(2)),
        lambda: nees([0, 0], masked, np.eye(2)),
        lambda: nis(masked, np.eye(2)),
        lambda: nis(masked[:, None], np.eye(2)),
        lambda: nis(np.zeros((2, 1)), np.ma.array(np.eye(2), mask=np.eye(2))),
    ):
        with pytest.raises(ValueError, match="masked"):
            call()


def test_nis_of_a_covariance_that_is_definite_in_other_units_only():
    """Three components of which two nearly settle the third: Cholesky fails by rounding as they are, not where each has variance one."""
    rng, taken = np.random.default_rng(0), 0
    for _ in range(200):
        units, A = 10.0 ** rng.uniform(-9, 9, 3), rng.normal(size=(3, 3))
        A[2] = A[0] + A[1] + 3e-8 * rng.normal(size=3)
        S, weights = np.outer(units, units) * (A @ A.T), [1, 2, -1] / units
        try:
            assert nis(S @ weights, S) == pytest.approx(weights @ S @ weights, rel=1e-3)
            taken += 1
        except ValueError as refused:  # singular in all units, as rounding has it
            assert "positive definite" in str(refused)
    assert taken > 50


@pytest.mark.parametrize("runs", [3, 5])
def test_a_truth_of_other_runs_is_refused(runs):
    with pytest.raises(ValueError, match="x_true, x: expected shapes"):
        nees(np.zeros((2, runs)), np.zeros((2, 4)), np.eye(2))


def test_chi2_band_narrows_to_the_mean():
    low, high = chi2_band(4, runs=100)
    assert low < 4 < high
    np.testing.assert_allclose([low * 100, high * 100], stats.chi2.ppf([0.025, 0.975], 400))


def test_cramer_rao_of_a_constant_is_variance_over_n():
    one = np.eye(1)
    bound = cramer_rao([one] * 10, [0 * one] * 10, [one] * 10, [4 * one] * 10, 1e9 * one)
    np.testing.assert_allclose(bound[:, 0, 0], 4 / np.arange(1, 11), rtol=1e-7)


def test_cramer_rao_of_a_step_without_a_measurement_is_the_prediction():
    F, Q, H = np.array([[1.0, 2.0], [0, 1]]), np.diag([0.0, 0.1]), np.array([[1.0, 0]])
    bound = cramer_rao([F] * 2, [Q] * 2, [H, None], [[[4.0]], None], np.eye(2))
    np.testing.assert_allclose(bound[1], F @ bound[0] @ F.T + Q)


def test_cramer_rao_of_a_deterministic_track_is_the_inverse_of_the_information_that_adds_up():
    """Q = 0, a wide start, four states, ten minutes of angles that change, every fifth measurement missing."""
    F, N = np.eye(4) + np.diag([1.0, 0.0, 1.0], 1), 600
    angles = 0.1 + 1e-3 * np.arange(N)
    Hs = [None if k % 5 == 0 else np.array([[np.cos(a), 0, np.sin(a), 0], [np.sin(2 * a), 0, 1, 0]]) for k, a in enumerate(angles)]
    Rs = [None if H is None else np.array([[4.0, 1.0], [1.0, 2.0]]) for H in Hs]
    bound = cramer_rao([F] * N, [np.zeros((4, 4))] * N, Hs, Rs, 1e8 * np.eye(4))
    information, back = 1e-8 * np.eye(4), np.linalg.inv(F)
    for k, H in enumerate(Hs):
        information = back.T @ information @ back
        if H is not None:
            information += H.T @ np.linalg.solve(Rs[k], H)
        if k in (20, N - 1):
            np.testing.assert_allclose(bound[k], np.linalg.inv(information), rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"F": np.eye(3)}, r"Fs\[1\]: expected shape \(2, 2\)"),
        ({"F": np.diag([1, np.nan])}, r"Fs\[1\]: expected finite"),
        ({"F": 1.0}, r"Fs\[1\]: expected shape"),
        ({"Q": [[1, 0.5], [0, 1]]}, r"Qs\[1\]: expected a symmetric"),
        ({"Q": -np.eye(2)}, r"Qs\[1\]: expected a positive semidefinite"),
        ({"H": [1.0, 0]}, r"Hs\[1\]: expected shape \(n, 2\)"),
        ({"H": [[np.inf, 0]]}, r"Hs\[1\]: expected finite"),
        ({"R": [[-1.0]]}, r"Rs\[1\]: expected a positive semidefinite"),
        ({"R": np.eye(2)}, r"Rs\[1\]: expected shape \(1, 1\)"),
        ({"R": None}, r"Rs\[1\]"),
        ({"H": [[0.0, 0]], "R": [[0.0]]}, r"Rs\[1\]: .* positive definite"),
        ({"P0": 5.0}, "P0: expected shape"),
        ({"P0": np.diag([1, 0])}, "P0: expected a positive definite"),
        ({"P0": np.ma.array(np.eye(2), mask=np.eye(2))}, "P0.*masked"),
    ],
)
def test_cramer_rao_names_the_matrix_and_its_step(changed, message):
    right = {"F": np.eye(2), "Q": np.eye(2), "H": [[1.0, 0]], "R": [[1.0]], "P0": np.eye(2)}
    wrong = right | changed
    with pytest.raises(ValueError, match=message):
        cramer_rao(*([right[key], wrong[key]] for key in "FQHR"), wrong["P0"])


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: nees([1, 2], [1, 2], np.eye(2), angles=(2,)), "angles"),
        (lambda: nees([1, 2], [1, 2, 3], np.eye(3)), "x_true"),
        (lambda: nees([1, 2], [1, 2], np.zeros((2, 2))), "P"),
        (lambda: nees([1, 2], [1, np.nan], np.eye(2)), "x"),
        (lambda: nis([1, 2], np.eye(3)), "S"),
        (lambda: nis(np.zeros((2, 4)), np.zeros((2, 2, 3))), "S"),
        (lambda: chi2_band(0), "dim"),
        (lambda: chi2_band(2, runs=0.5), "runs"),
        (lambda: chi2_band(2, level=1.0), "level"),
        (lambda: cramer_rao([], [np.eye(1)], [], [], np.eye(1)), "Fs"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


def test_matrices_that_change_and_come_back_along_a_track_are_each_taken():
    F, G = np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]])
    Q, R, other, H = 0.1 * np.eye(2), np.eye(1), 9.0 * np.eye(1), np.array([[1.0, 0.0]])
    Fs, Hs, Rs = [F, G, G, F, F], [H, None, H, H, None], [R, other, other, R, other]
    copies = [[np.array(each) if each is not None else None for each in given] for given in (Fs, [Q] * 5, Hs, Rs)]
    np.testing.assert_array_equal(cramer_rao(Fs, [Q] * 5, Hs, Rs, np.eye(2)), cramer_rao(*copies, np.eye(2)))

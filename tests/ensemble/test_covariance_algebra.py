"""The ensembles' covariance algebra on general matrices, in NumPy and compiled: entries that differ from run to run beside entries that don't, and full noise."""

import numpy as np
import pytest

from trackhelpers import fused
from trackhelpers.ensemble import covariance, unscented_compiled
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF, Matrices, check_runs, of_runs

N, M = 5, 4
RNG = np.random.default_rng(0)
A = RNG.standard_normal((N, N, M))
P = np.einsum("ikm,jkm->ijm", A, A) + 0.1 * np.eye(N)[..., None]
VARYING = RNG.standard_normal((8, M))


@pytest.fixture(params=["in NumPy", "compiled"])
def path(request, monkeypatch):
    if request.param == "in NumPy":
        monkeypatch.setattr(fused, "binding", None)


def dense(entries, shape, base=0.0):
    matrix = np.zeros((*shape, M)) + np.asarray(base)[..., None]
    for place, value in entries.items():
        matrix[place] = value
    return matrix


TRANSITIONS = [
    {},
    {(0, 1): 0.5, (2, 3): -0.7, (3, 3): 0.2},
    {(0, 2): VARYING[0], (1, 2): VARYING[1], (0, 4): VARYING[2], (3, 3): VARYING[3]},
    {(0, 1): 0.5, (4, 0): -2.0, (1, 3): VARYING[4], (2, 3): VARYING[5], (2, 2): 3.0},
]


@pytest.mark.parametrize("transition", TRANSITIONS)
@pytest.mark.parametrize("noise", [{}, {(0, 0): 1.0, (1, 0): 0.3, (4, 2): VARYING[6], (3, 3): VARYING[7]}])
def test_a_propagated_covariance_is_F_P_F_transposed_and_Q(path, transition, noise):
    F, Q = dense(transition, (N, N), np.eye(N)), dense(noise | {place[::-1]: value for place, value in noise.items()}, (N, N))
    before = P.copy()
    got = covariance.propagate(P, transition, noise)
    np.testing.assert_allclose(got, np.einsum("ijm,jkm,lkm->ilm", F, P, F) + Q, atol=1e-12)
    assert np.array_equal(got, got.swapaxes(0, 1)) and np.array_equal(P, before)


ROOT = RNG.standard_normal((3, 3, M))
FULL = np.einsum("ikm,jkm->ijm", ROOT, ROOT) + 0.1 * np.eye(3)[..., None]
SEEN = [
    {(0, 0): 1.0, (1, 3): -2.0, (2, 1): 0.5},
    {(0, 0): VARYING[0], (0, 2): VARYING[1], (1, 4): VARYING[2], (2, 2): VARYING[3], (2, 1): 1.5},
]


@pytest.mark.parametrize("entries", SEEN)
@pytest.mark.parametrize("R", [FULL[..., 0], FULL], ids=["one", "one a run"])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_a_corrected_covariance_is_the_textbooks(path, entries, R, m):
    entries = {place: value for place, value in entries.items() if place[0] < m}
    R = R[:m, :m]
    H, before = dense(entries, (m, N)), P.copy()
    K, S, posterior = covariance.correct(P, entries, R)
    for r in range(M):
        noise = R[..., r] if R.ndim == 3 else R
        innovation = H[..., r] @ P[..., r] @ H[..., r].T + noise
        gain = P[..., r] @ H[..., r].T @ np.linalg.inv(innovation)
        np.testing.assert_allclose(S[..., r], innovation, atol=1e-11)
        np.testing.assert_allclose(K[..., r], gain, atol=1e-9)
        np.testing.assert_allclose(posterior[..., r], P[..., r] - gain @ innovation @ gain.T, atol=1e-9)
    assert np.array_equal(posterior, posterior.swapaxes(0, 1)) and np.array_equal(S, S.swapaxes(0, 1)) and np.array_equal(P, before)


def test_Josephs_form_forgives_what_rounding_did_to_the_gain(monkeypatch):
    """Its two-sided product is (I − KH) P (I − KH)ᵀ + K R Kᵀ for any K, so that an error of K enters squared."""
    monkeypatch.setattr(fused, "binding", None)
    gain = covariance.gain
    monkeypatch.setattr(covariance, "gain", lambda PHt, S: 1.1 * gain(PHt, S))
    K, _, posterior = covariance.correct(P, SEEN[1], FULL)
    H = dense(SEEN[1], (3, N))
    for r in range(M):
        left = np.eye(N) - K[..., r] @ H[..., r]
        np.testing.assert_allclose(posterior[..., r], left @ P[..., r] @ left.T + K[..., r] @ FULL[..., r] @ K[..., r].T, atol=1e-10)


def test_a_run_whose_S_is_not_positive_gets_nan_and_leaves_its_neighbours(path):
    spoilt = P.copy()
    spoilt[..., 2] = -50 * np.eye(N)
    with np.errstate(all="ignore"):
        found, clean = covariance.correct(spoilt, SEEN[1], FULL), covariance.correct(P, SEEN[1], FULL)
    assert np.isnan(found[0][..., 2]).any() and np.isnan(found[2][..., 2]).any()
    others = np.arange(M) != 2
    for one, other in zip(found, clean, strict=True):
        assert np.array_equal(one[..., others], other[..., others])


def test_halves_are_copied_or_averaged():
    whole = RNG.standard_normal((3, 3, 2))
    copied, averaged = whole.copy(), whole.copy()
    covariance.copy_lower(copied)
    covariance.mirror(averaged)
    for i in range(3):
        for j in range(3):
            assert np.array_equal(copied[i, j], whole[max(i, j), min(i, j)])
    np.testing.assert_allclose(averaged, (whole + whole.swapaxes(0, 1)) / 2)
    assert np.array_equal(averaged, averaged.swapaxes(0, 1))


# --- what an unscented update computes around h


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("R", [FULL[..., 0], FULL], ids=["one", "one a run"])
@pytest.mark.parametrize("triangular", [True, False])
def test_a_compiled_unscented_update_is_the_weighted_sums(m, R, triangular):
    pytest.importorskip("llvmlite")
    weights, n = (0.25, 0.5), 4
    root = RNG.standard_normal((n, n, M))
    root = np.stack([np.tril(root[..., r]) if triangular else root[..., r] for r in range(M)], axis=-1)
    pairs = RNG.standard_normal((m, n, M))
    seen = np.concatenate([np.zeros((m, 1, M)), pairs + 0.1 * pairs**2, -pairs + 0.1 * pairs**2], axis=1) + 2.0
    P, R = 20 * np.eye(n)[..., None] + np.einsum("ikm,jkm->ijm", root, root), R[:m, :m]
    mean, S, K, posterior = unscented_compiled.corrected(root, seen, P, R, weights)
    Wm, Wc = np.array([-1.0, *[0.25] * 8]), np.array([0.5, *[0.25] * 8])  # 8 · 0.25 − 1 = 1
    for r in range(M):
        z = seen[..., r]
        points = np.concatenate([np.zeros((n, 1)), root[..., r], -root[..., r]], axis=1)
        z_hat = z @ Wm
        apart = z - z_hat[:, None]
        innovation = (Wc * apart) @ apart.T + (R[..., r] if R.ndim == 3 else R)
        cross = (Wc * points) @ apart.T
        gain = cross @ np.linalg.inv(innovation)
        np.testing.assert_allclose(mean[:, r], z_hat, atol=1e-11)
        np.testing.assert_allclose(S[..., r], innovation, atol=1e-11)
        np.testing.assert_allclose(K[..., r], gain, atol=1e-9)
        np.testing.assert_allclose(posterior[..., r], P[..., r] - gain @ cross.T, atol=1e-9)
    assert np.array_equal(S, S.swapaxes(0, 1)) and np.array_equal(posterior, posterior.swapaxes(0, 1))


def test_compiled_sigma_points_are_of_the_root_and_nan_where_there_is_none(monkeypatch):
    pytest.importorskip("llvmlite")
    spoilt, x = P.copy(), RNG.standard_normal((N, M))
    spoilt[4, 4, 1] = -1.0
    root, points = unscented_compiled.sigma_points(x, spoilt, 2.0)
    for r in (0, 2, 3):
        expected = np.linalg.cholesky(2.0 * P[..., r])
        np.testing.assert_allclose(root[..., r], expected, atol=1e-12)
        about = np.concatenate([np.zeros((N, 1)), expected, -expected], axis=1)
        np.testing.assert_allclose(points[..., r], x[:, [r]] + about, atol=1e-12)
    assert np.isnan(root[4, 4, 1]) and np.isfinite(root[:4, :4, 1]).all()
    big = np.repeat(np.eye(9)[..., None], 2, axis=2)
    assert unscented_compiled.sigma_points(np.zeros((9, 2)), big, 2.0) is None
    assert unscented_compiled.corrected(big, np.zeros((1, 19, 2)), big, np.eye(1), (0.5, 0.0)) is None
    monkeypatch.setattr(unscented_compiled, "binding", None)
    assert unscented_compiled.sigma_points(x, P, 2.0) is None
    assert unscented_compiled.corrected(P, np.zeros((1, 11, M)), P, np.eye(1), (0.1, 0.0)) is None


# --- constant matrices

F = np.array([[1.0, 0.5, 0.1], [0.0, 0.9, 0.3], [0.2, 0.0, 1.0]])
H = np.array([[1.0, 0.0, 0.4], [0.0, -2.0, 0.0]])
Q = np.array([[0.5, 0.1, 0.0], [0.1, 0.4, 0.05], [0.0, 0.05, 0.3]])
R = np.array([[1.0, 0.3], [0.3, 2.0]])
SMALL = P[:3, :3]


def test_products_with_constant_matrices():
    model, x, z = Matrices(F, H, Q, R), RNG.standard_normal((3, M)), RNG.standard_normal((2, M))
    moved, ahead = model.predict(x, SMALL)
    own = FULL[:2, :2]
    for r in range(M):
        np.testing.assert_allclose(moved[:, r], F @ x[:, r], atol=1e-13)
        np.testing.assert_allclose(ahead[..., r], F @ SMALL[..., r] @ F.T + Q, atol=1e-12)
        np.testing.assert_allclose(model.moved(SMALL)[..., r], F @ SMALL[..., r] @ F.T, atol=1e-12)
        np.testing.assert_allclose(model.innovation_covariance(SMALL)[..., r], H @ SMALL[..., r] @ H.T + R, atol=1e-12)
        np.testing.assert_allclose(model.innovation_covariance(SMALL, own)[..., r], H @ SMALL[..., r] @ H.T + own[..., r], atol=1e-12)
    for start in (SMALL, SMALL[..., :1]):
        x_post, P_post, y, S, K = model.correct(x, start, z, own)
        for r in range(M):
            before = start[..., r % start.shape[2]]
            innovation = H @ before @ H.T + own[..., r]
            gain = before @ H.T @ np.linalg.inv(innovation)
            np.testing.assert_allclose(y[:, r], z[:, r] - H @ x[:, r], atol=1e-12)
            np.testing.assert_allclose(x_post[:, r], x[:, r] + gain @ y[:, r], atol=1e-10)
            np.testing.assert_allclose(P_post[..., r], before - gain @ innovation @ gain.T, atol=1e-10)
            np.testing.assert_allclose(S[..., r], innovation, atol=1e-11)
            np.testing.assert_allclose(K[..., r], gain, atol=1e-10)


def test_the_part_of_some_runs_is_everyones_where_all_share_it():
    a, shared = np.arange(6.0).reshape(2, 3), np.ones((2, 1))
    mask = np.array([True, False, True])
    assert of_runs(a, mask).tolist() == [[0, 2], [3, 5]] and of_runs(shared, mask) is shared
    first, (second, third) = of_runs((a, (shared, a)), [1])
    assert first.tolist() == third.tolist() == [[1], [4]] and second is shared


@pytest.mark.parametrize("value", [np.zeros(3), np.zeros((3, 0)), np.zeros((3, 2, 2))])
def test_runs_are_on_the_last_axis(value):
    with pytest.raises(ValueError, match=r"^x0: expected shape \(3, M\), runs on the last axis, got"):
        check_runs(value, "x0", 3)
    with pytest.raises(ValueError, match=r"^x0: expected finite numbers, got 2 that are not"):
        check_runs([[0, np.nan], [0, np.inf], [1, 2]], "x0", 3)
    assert check_runs([[1], [2], [3]], "x0", 3).shape == (3, 1)


def filtered(**change):
    return EnsembleMatrixKF(**{"F": F, "H": H, "Q": Q, "R": R, "x0": np.ones((3, M)), "P0": np.eye(3)} | change)


def test_what_a_caller_holds_is_his_own_and_rows_may_be_one():
    given = {"F": F.copy(), "H": H[0].copy(), "x0": np.ones((3, M))}
    ens = filtered(**given, R=[[1.0]])
    for array in given.values():
        array[:] = 7.0
    assert np.array_equal(ens.matrices.F, F) and np.array_equal(ens.matrices.H, H[:1]) and np.array_equal(ens.x, np.ones((3, M)))
    assert ens.m == 1 and ens.y.shape == (0, M) and ens.S.shape == (0, 0, M) and ens.K.shape == (3, 0, M) and ens.P.shape == (3, 3, M)
    for empty in ({"F": np.zeros((0, 0))}, {"H": np.zeros((0, 3))}):
        with pytest.raises(ValueError, match=r"^F, H: expected a state and a measurement of one component or more"):
            filtered(**empty)


def test_masks_noise_and_common_measurements_of_constant_matrices():
    rng, mask = np.random.default_rng(5), np.array([True, True, False, True])
    z, own = rng.standard_normal((2, M)), FULL[:2, :2]
    for noise in (None, R, own):
        whole, part, all_ = (filtered() for _ in range(3))
        for ens in (whole, part, all_):
            ens.predict()
        whole.update(z, R=noise)
        part.update(z, R=noise, mask=mask)
        all_.update(z, R=noise, mask=np.ones(M, bool))
        for name in ("x", "P", "y", "S", "K"):
            got, wanted = getattr(part, name), getattr(whole, name)
            np.testing.assert_allclose(got[..., mask], wanted[..., mask], atol=1e-13, err_msg=name)
            assert np.array_equal(getattr(all_, name), wanted)
        assert all(np.isnan(getattr(part, name)[..., 2]).all() for name in ("y", "S", "K"))
        np.testing.assert_allclose(part.x[:, 2], F @ np.ones(3))
        assert part._steps.tolist() == [0, 0, 1, 0]
    for wrong in (z[:, 0], z[:, :3], np.zeros((2, M, 1))):
        with pytest.raises(ValueError, match=r"^z: expected shape"):
            whole.update(wrong)
    indefinite = np.where(mask, own, -1.0)
    part.update(z, R=indefinite, mask=mask)  # nobody looks at what the mask leaves out
    with pytest.raises(ValueError, match=r"^R: expected a positive semidefinite"):
        part.update(z, R=indefinite)
    truth = np.arange(3.0)
    expected = [(truth - part.x[:, r]) @ np.linalg.solve(part.P[..., r], truth - part.x[:, r]) for r in range(M)]
    np.testing.assert_allclose(part.nees(truth), expected)
    np.testing.assert_allclose(part.nees(np.repeat(truth[:, None], M, axis=1)), expected)

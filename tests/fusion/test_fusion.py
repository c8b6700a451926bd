import numpy as np
import pytest

from trackhelpers.fusion import (
    bar_shalom_campo,
    convex_combination,
    covariance_intersection,
    cross_covariance,
    information_fusion,
    maximum_likelihood,
)
from trackhelpers.motion import CV

R1, R2 = np.diag([60.0**2, 150.0**2]), np.array([[22500.0, 9000.0], [9000.0, 8100.0]])  # they do not commute
MODEL, T = CV(0.2), 2.0
F, Q = MODEL.F(np.zeros(4), T), MODEL.Q(np.zeros(4), T)
H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])


def covariance(seed, n=4):
    A = np.random.default_rng(seed).normal(size=(n, n))
    return A @ A.T + 0.1 * np.eye(n)


def kalman_step(P, R):
    P = F @ P @ F.T + Q
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return K, (np.eye(4) - K @ H) @ P


def two_filters(steps=30, P0=None, P12=None):
    """Covariances and cross-covariance of two matched filters, and the centralised one, after some steps."""
    P0 = 1e4 * np.eye(4) if P0 is None else P0
    P1, P2, Pc, P12 = P0, P0, P0, np.zeros((4, 4)) if P12 is None else P12
    both, R = np.vstack([H, H]), np.block([[R1, np.zeros((2, 2))], [np.zeros((2, 2)), R2]])
    for _ in range(steps):
        (K1, P1), (K2, P2) = kalman_step(P1, R1), kalman_step(P2, R2)
        P12 = cross_covariance(P12, F, Q, K1, H, K2, H)
        Pc = F @ Pc @ F.T + Q
        K = Pc @ both.T @ np.linalg.inv(both @ Pc @ both.T + R)
        Pc = (np.eye(4) - K @ both) @ Pc
    return P1, P2, P12, Pc


x1, x2 = np.array([1.0, 2, 3, 4]), np.array([1.5, 1, 3.5, 5])


def same(one, other, tolerance=1e-10):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, atol=tolerance * max(1.0, np.abs(b).max()))


def test_without_cross_covariance_bar_shalom_campo_is_the_convex_combination():
    P1, P2 = covariance(1), covariance(2)
    same(bar_shalom_campo(x1, P1, x2, P2, np.zeros((4, 4))), convex_combination([x1, x2], [P1, P2]))


def test_swapping_the_sensors_changes_nothing_and_forgetting_to_transpose_does():
    P1, P2, P12, _ = two_filters()
    assert np.abs(P12 - P12.T).max() > 1e-3 * np.abs(P12).max()  # only such a pair of sensors can show a mix-up
    fused = bar_shalom_campo(x1, P1, x2, P2, P12)
    same(bar_shalom_campo(x2, P2, x1, P1, P12.T), fused)
    assert np.abs(bar_shalom_campo(x1, P1, x2, P2, P12.T)[0] - fused[0]).max() > 1e-4


def test_maximum_likelihood_of_two_tracks_is_bar_shalom_campo():
    P1, P2, P12, _ = two_filters()
    same(maximum_likelihood([x1, x2], np.block([[P1, P12], [P12.T, P2]])), bar_shalom_campo(x1, P1, x2, P2, P12))


def test_maximum_likelihood_of_independent_tracks_is_the_convex_combination():
    Ps = [covariance(k) for k in range(3)]
    joint = np.zeros((12, 12))
    for k, P in enumerate(Ps):
        joint[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] = P
    same(maximum_likelihood([x1, x2, x1], joint), convex_combination([x1, x2, x1], Ps))


def test_matched_filters_are_ordered_central_below_fused_below_each():
    prior = 1e4 * np.eye(4)
    P1, P2, P12, Pc = two_filters(P0=prior, P12=prior)  # one prior, told to all
    fused = bar_shalom_campo(x1, P1, x2, P2, P12)[1]
    for smaller, larger in ((Pc, fused), (fused, P1), (fused, P2)):
        assert np.linalg.eigvalsh(larger - smaller)[0] > -1e-9 * np.abs(larger).max()


def test_equal_sensors_are_averaged():
    P, P12 = covariance(3), 0.5 * covariance(3)
    x, fused = bar_shalom_campo(x1, P, x2, P, P12)
    same((x, fused), ((x1 + x2) / 2, (P + P12) / 2))


def test_without_process_noise_independent_starts_make_all_rules_equal(monkeypatch):
    monkeypatch.setitem(globals(), "Q", np.zeros((4, 4)))
    prior = 1e4 * np.eye(4)
    P1, P2, P12, _ = two_filters(10, prior)
    Pc = two_filters(10, prior / 2)[3]  # who hears of two independent starts has half the covariance
    assert not P12.any()
    same((convex_combination([x1, x2], [P1, P2])[1],), (Pc,), 1e-8)
    same((bar_shalom_campo(x1, P1, x2, P2, P12)[1],), (Pc,), 1e-8)


def test_without_process_noise_a_common_prior_makes_the_convex_combination_overconfident(monkeypatch):
    monkeypatch.setitem(globals(), "Q", np.zeros((4, 4)))
    prior = 1e4 * np.eye(4)
    P1, P2, P12, Pc = two_filters(10, prior, prior)
    convex = convex_combination([x1, x2], [P1, P2])[1]
    assert np.linalg.eigvalsh(Pc - convex)[0] > 0  # it believes more than anybody can know
    fused = bar_shalom_campo(x1, P1, x2, P2, P12)[1]
    assert np.linalg.eigvalsh(fused - Pc)[0] > -1e-6  # this rule knows what the tracks share


def test_information_fusion_at_every_step_is_the_centralised_filter_with_feedback_and_without():
    rng = np.random.default_rng(0)
    x0, P0 = np.array([1000.0, 15, 12000, -5]), np.diag([1e4, 25.0, 1e4, 25])
    central = (x0, P0)
    apart, fused, back = [(x0, P0), (x0, P0)], (x0, P0), (x0, P0)

    def predict(track):
        return F @ track[0], F @ track[1] @ F.T + Q

    def update(track, z, R):
        K = track[1] @ H.T @ np.linalg.inv(H @ track[1] @ H.T + R)
        return track[0] + K @ (z - H @ track[0]), (np.eye(4) - K @ H) @ track[1]

    for _ in range(25):
        zs = [H @ x0 + rng.multivariate_normal([0, 0], R) for R in (R1, R2)]
        central = update(update(predict(central), zs[0], R1), zs[1], R2)
        before = [predict(track) for track in apart]
        apart = [update(track, z, R) for track, z, R in zip(before, zs, (R1, R2), strict=True)]
        fused = information_fusion(*predict(fused), *zip(*apart, strict=True), *zip(*before, strict=True))
        prior = predict(back)
        local = [update(prior, z, R) for z, R in zip(zs, (R1, R2), strict=True)]
        back = information_fusion(*prior, *zip(*local, strict=True), (prior[0],) * 2, (prior[1],) * 2)
    same(fused, central, 1e-9)
    same(back, central, 1e-9)


def test_covariance_intersection_minimises_the_determinant():
    P1, P2 = covariance(4), covariance(5)
    best = np.linalg.det(covariance_intersection(x1, P1, x2, P2)[1])
    for omega in np.linspace(0, 1, 101):
        information = omega * np.linalg.inv(P1) + (1 - omega) * np.linalg.inv(P2)
        assert best <= (1 + 1e-12) / np.linalg.det(information)


def test_covariance_intersection_of_equal_shapes_is_the_convex_state_with_twice_its_covariance():
    P1 = np.diag([1.0, 4.0])
    P2 = np.diag([4.0, 1.0])  # by symmetry ω = ½
    x, P = covariance_intersection([1.0, 2.0], P1, [3.0, 0.0], P2)
    convex = convex_combination([[1.0, 2.0], [3.0, 0.0]], [P1, P2])
    same((x, P), (convex[0], 2 * convex[1]))


def test_covariance_intersection_of_equal_covariances_takes_the_middle():
    P = np.diag([1e4, 1e-2, 1.0, 5.0]) + 1e-3
    same(covariance_intersection(x1, P, x2, P * (1 + 1e-13)), ((x1 + x2) / 2, P), 1e-9)


def test_covariance_intersection_never_believes_more_than_is_true():
    P1, P2 = covariance(6, 2), covariance(7, 2)
    _, P = covariance_intersection([0.0, 0], P1, [0.0, 0], P2)
    L1, L2 = np.linalg.cholesky(P1), np.linalg.cholesky(P2)
    inverse = np.linalg.inv
    omega = np.linalg.lstsq((inverse(P1) - inverse(P2)).reshape(-1, 1), (inverse(P) - inverse(P2)).ravel(), rcond=None)[0][0]
    A, B = omega * P @ inverse(P1), (1 - omega) * P @ inverse(P2)
    for angle in np.linspace(0, 2 * np.pi, 13):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        P12 = 0.999 * L1 @ turn @ L2.T  # as correlated as two errors can be
        true = A @ P1 @ A.T + B @ P2 @ B.T + A @ P12 @ B.T + B @ P12.T @ A.T
        assert np.linalg.eigvalsh(P - true)[0] > -1e-9


def test_cross_covariance_equals_the_batch_closed_form():
    """Both errors written as sums over all past noises, multiplied term by term: P12 = Σ A₁…A₁ (I−K₁H) Q (I−K₂H)ᵀ A₂ᵀ…"""
    steps, P1, P2 = 12, 1e4 * np.eye(4), 1e4 * np.eye(4)
    P12, gains = np.zeros((4, 4)), []
    for _ in range(steps):
        (K1, P1), (K2, P2) = kalman_step(P1, R1), kalman_step(P2, R2)
        gains.append((np.eye(4) - K1 @ H, np.eye(4) - K2 @ H))
        P12 = cross_covariance(P12, F, Q, K1, H, K2, H)
    batch = np.zeros((4, 4))
    for k in range(steps):
        left, right = gains[k]
        for A1, A2 in gains[k + 1 :]:
            left, right = A1 @ F @ left, A2 @ F @ right
        batch += left @ Q @ right.T
    same((P12,), (batch,))


def test_a_common_prior_that_nobody_has_left_is_handled():
    P = covariance(8)
    same(bar_shalom_campo(x1, P, x1, P, P), (x1, P))
    same(maximum_likelihood([x1, x1], np.tile(P, (2, 2))), (x1, P), 1e-8)


@pytest.mark.parametrize("rule", ["convex", "bsc", "ci", "information"])
def test_an_ensemble_equals_its_runs_one_by_one(rule):
    rng = np.random.default_rng(1)
    M = 5
    xs = rng.normal(size=(2, 4, M))
    Ps = [np.stack([covariance(10 * i + m) for m in range(M)], axis=-1) for i in range(2)]
    rules = {
        "convex": lambda x, P: convex_combination(x, P),
        "bsc": lambda x, P: bar_shalom_campo(x[0], P[0], x[1], P[1], 0.2 * P[0]),
        "ci": lambda x, P: covariance_intersection(x[0], P[0], x[1], P[1]),
        "information": lambda x, P: information_fusion(0 * x[0], P[0], x, P, 0 * np.asarray(x), [P[0], P[1]]),
    }
    Ps[1] = Ps[0] + Ps[1]
    whole = rules[rule](xs, Ps)
    for m in range(M):
        same((whole[0][:, m], whole[1][..., m]), rules[rule](xs[..., m], [P[..., m] for P in Ps]), 1e-9)


def test_one_covariance_serves_all_runs():
    xs = np.random.default_rng(2).normal(size=(2, 4, 6))
    P1, P2 = covariance(1), covariance(2)
    for fused in (
        convex_combination(xs, [P1, P2]),
        bar_shalom_campo(xs[0], P1, xs[1], P2, 0.1 * P1),
        covariance_intersection(xs[0], P1, xs[1], P2),
        maximum_likelihood(xs, np.block([[P1, 0.1 * P1], [0.1 * P1, P2]])),
    ):
        assert fused[0].shape == (4, 6) and fused[1].shape == (4, 4)


I4 = np.eye(4)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: convex_combination([], []), "xs"),
        (lambda: convex_combination([x1, x2], [I4]), "Ps"),
        (lambda: convex_combination([x1, x2[:3]], [I4, I4]), "xs"),
        (lambda: convex_combination([x1, x2], [I4, np.eye(3)]), r"Ps\[1\]"),
        (lambda: convex_combination([x1, x2], [I4, 0 * I4]), r"Ps\[1\]"),
        (lambda: convex_combination([x1, x2 * np.nan], [I4, I4]), "xs"),
        (lambda: convex_combination([x1, np.ones((4, 3))], [I4, I4]), "xs"),
        (lambda: bar_shalom_campo(x1, I4, x2[:3], I4, I4), "x2"),
        (lambda: bar_shalom_campo(x1, -I4, x2, I4, I4), "P1"),
        (lambda: bar_shalom_campo(x1, I4, x2, I4, np.eye(3)), "P12"),
        (lambda: bar_shalom_campo(x1, I4, x2, I4, 2 * I4), "P12"),
        (lambda: maximum_likelihood([], I4), "xs"),
        (lambda: maximum_likelihood([x1, x2], I4), "P_joint"),
        (lambda: maximum_likelihood([x1, x2], np.block([[I4, 2 * I4], [2 * I4, I4]])), "P_joint"),
        (lambda: covariance_intersection(x1, I4, x2, -I4), "P2"),
        (lambda: cross_covariance(I4, F, Q, np.ones((4, 2)), H, np.ones((4, 3)), H), "K2"),
        (lambda: cross_covariance(I4, F[:3], Q, np.ones((4, 2)), H, np.ones((4, 2)), H), "F"),
        (lambda: information_fusion(x1, I4, [x1], [I4], [x1, x2], [I4, I4]), "x_priors"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()

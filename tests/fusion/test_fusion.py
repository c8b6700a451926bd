import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trackhelpers.angles import residual, wrap
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


JOINT = np.random.default_rng(20).normal(size=(10, 12))
JOINT = JOINT @ JOINT.T  # of two tracks whose errors are correlated
A1, A2, A12 = JOINT[:5, :5], JOINT[5:, 5:], JOINT[:5, 5:]
RULES = {
    "convex": lambda xs, D, **angles: convex_combination(xs, [D @ A1 @ D, D @ A2 @ D], **angles),
    "BSC": lambda xs, D, **angles: bar_shalom_campo(xs[0], D @ A1 @ D, xs[1], D @ A2 @ D, D @ A12 @ D, **angles),
    "ML": lambda xs, D, **angles: maximum_likelihood(xs, np.kron(np.eye(2), D) @ JOINT @ np.kron(np.eye(2), D), **angles),
    "CI": lambda xs, D, **angles: covariance_intersection(xs[0], D @ A1 @ D, xs[1], D @ A2 @ D, **angles),
    "information": lambda xs, D, **angles: information_fusion(
        xs[0], 2 * D @ A1 @ D, xs, [D @ A1 @ D, D @ A2 @ D], 0.9 * xs, [2 * D @ A1 @ D, 3 * D @ A2 @ D], **angles
    ),
}
I5 = np.eye(5)
every_rule = pytest.mark.parametrize("rule", RULES.values(), ids=RULES)


@pytest.mark.parametrize("runs", [(), (4,)])
@every_rule
def test_two_headings_beside_west_are_fused_beside_west(rule, runs):
    xs = np.zeros((2, 5, *runs))
    xs[:, 3] = np.reshape([3.10, -3.12], (2, *[1] * len(runs)))
    if rule is RULES["information"]:
        fused = information_fusion(xs[0], I5, xs, [I5 / 2, I5 / 2], xs[::-1], [I5, I5], angles=(3,))[0]
    else:
        fused = rule(xs, I5, angles=(3,))[0]
    assert fused.shape == (5, *runs)
    assert np.all(np.cos(fused[3] - np.pi) > 0.99) and np.all(np.abs(fused[3]) <= np.pi)


def test_equal_headings_beside_west_meet_in_the_middle():
    xs = np.zeros((2, 5))
    xs[:, 3] = 3.10, -3.12
    for x, _ in (
        convex_combination(xs, [I5, I5], angles=(3,)),
        bar_shalom_campo(xs[0], I5, xs[1], I5, 0.5 * I5, angles=(3,)),
        maximum_likelihood(xs, np.eye(10), angles=(3,)),
        covariance_intersection(xs[0], I5, xs[1], I5, angles=(3,)),
    ):
        np.testing.assert_allclose(x, [0, 0, 0, 3.13159265, 0], atol=1e-8)


@pytest.mark.parametrize("runs", [(), (3,)])
@pytest.mark.parametrize("turn", [0.5, np.pi - 1, np.pi, 7.0, -1 - 9 * np.pi])
@every_rule
def test_turning_all_headings_turns_the_fused_heading(rule, turn, runs):
    rng = np.random.default_rng(21)
    xs = rng.normal(size=(2, 5, *runs))
    xs[:, 3] = 1 + np.reshape([-0.1, 0.1], (2, *[1] * len(runs)))  # to both sides of a heading
    turned = xs.copy()
    turned[:, 3] = wrap(turned[:, 3] + turn)
    call = rule
    if rule is RULES["information"]:  # whose priors must be turned alike
        call = lambda xs, D, **angles: information_fusion(xs[0], 2 * A1, xs, [A1, A2], xs[::-1], [2 * A1, 3 * A2], **angles)  # noqa: E731
    (x, P), (y, Q_) = call(xs, I5, angles=(3,)), call(turned, I5, angles=(3,))
    x[3] += turn
    np.testing.assert_allclose(residual(x, y, (3,)), 0, atol=1e-12)
    np.testing.assert_array_equal(P, Q_)


@every_rule
def test_without_angles_nothing_is_wrapped(rule):
    xs = np.random.default_rng(22).normal(size=(2, 5))
    for a, b in zip(rule(xs, I5), rule(xs, I5, angles=()), strict=True):
        assert np.array_equal(a, b)
    far = xs + 50.0
    if rule is not RULES["information"]:
        np.testing.assert_allclose(rule(far, I5)[0], rule(xs, I5)[0] + 50.0, atol=1e-9)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(powers=st.lists(st.floats(-6, 6), min_size=5, max_size=5))
@every_rule
def test_other_units_give_the_same_estimate_in_other_units(rule, powers):
    xs = np.random.default_rng(23).normal(size=(2, 5))
    D = np.diag(10.0 ** np.array(powers))
    (x, P), (y, scaled) = rule(xs, I5), rule(xs @ D, D)
    back = np.linalg.inv(D)
    np.testing.assert_allclose(back @ y, x, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(back @ scaled @ back, P, rtol=1e-8, atol=1e-9)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(powers=st.lists(st.floats(-6, 6), min_size=2, max_size=2))
def test_a_direction_that_both_tracks_share_is_left_alone_in_all_units(powers):
    """Both errors are equal along (1, 1): the difference's covariance is singular, whatever the units."""
    D = np.diag(10.0 ** np.array(powers))
    common, own = np.ones((2, 2)), np.outer([1, -1], [1, -1])
    P1, P2 = D @ (common + own) @ D, D @ (common + 4 * own) @ D
    x1, x2 = D @ [1.0, 0.0], D @ [2.0, -1.0]  # they differ along (1, −1)
    expected = np.array([1.2, -0.2])
    x, P = bar_shalom_campo(x1, P1, x2, P2, D @ common @ D)
    np.testing.assert_allclose(np.linalg.inv(D) @ x, expected, atol=1e-9)
    y, same_P = maximum_likelihood([x1, x2], np.block([[P1, D @ common @ D], [D @ common @ D, P2]]))
    np.testing.assert_allclose(np.linalg.inv(D) @ y, expected, atol=1e-9)
    for each in (P, same_P):
        np.testing.assert_allclose(np.linalg.inv(D) @ each @ np.linalg.inv(D), common + 0.8 * own, atol=1e-9)


def test_small_and_large_variances_are_weighed_alike():
    P1, x1, x2 = np.diag([1e6, 1e-6]), np.zeros(2), np.ones(2)
    for x, _ in (
        bar_shalom_campo(x1, P1, x2, 4 * P1, np.zeros((2, 2))),
        maximum_likelihood([x1, x2], np.diag([1e6, 1e-6, 4e6, 4e-6])),
        maximum_likelihood([x1, x2], np.diag([1e6, 1e-8, 4e6, 4e-8])),
    ):
        np.testing.assert_allclose(x, [0.2, 0.2], atol=1e-12)


def test_maximum_likelihood_takes_a_track_that_knows_a_component():
    for unit in (1e-6, 1, 1e6):
        joint = np.diag([0, 1, 1, 1, 0, 1]) * np.tile([unit**2, 1], 3)
        x, P = maximum_likelihood([[unit, 0], [2 * unit, 3], [unit, 0]], joint)
        np.testing.assert_allclose([x[0] / unit, x[1], P[0, 0] / unit**2, P[1, 1]], [1, 1, 0, 1 / 3], atol=1e-9)


def test_one_common_covariance_stands_beside_one_of_each_run():
    """Four runs of four components: a covariance (n, n) must not be taken for one that varies over the runs."""
    xs = np.random.default_rng(24).normal(size=(2, 4, 4))
    P1 = covariance(1)
    P2 = np.stack([covariance(m) for m in range(2, 6)], axis=-1)
    whole = {
        "convex": (convex_combination, lambda x, P: (x, P)),
        "CI": (covariance_intersection, lambda x, P: (x[0], P[0], x[1], P[1])),
        "information": (information_fusion, lambda x, P: (x[0], 2 * P[0], x, P, x[::-1], [2 * P[0], 2 * P[1]])),
    }
    for rule, arguments in whole.values():
        x, P = rule(*arguments(xs, [P1, P2]))
        for m in range(4):
            same((x[:, m], P[..., m]), rule(*arguments(xs[..., m], [P1, P2[..., m]])))


@pytest.mark.parametrize("angles", [(5,), (-1,), (0.5,), 3, "3"])
def test_angles_are_indices(angles):
    for rule in RULES.values():
        with pytest.raises(ValueError, match="angles: expected indices from 0 to 4"):
            rule(np.ones((2, 5)), I5, angles=angles)


def test_a_masked_estimate_is_no_estimate():
    masked = np.ma.array(x2, mask=[0, 0, 0, 1])
    for call in (
        lambda: convex_combination([x1, masked], [I4, I4]),
        lambda: bar_shalom_campo(masked, I4, x2, I4, 0 * I4),
        lambda: maximum_likelihood([x1, x2], np.ma.array(np.eye(8), mask=np.eye(8))),
        lambda: bar_shalom_campo(x1, I4, x2, I4, np.ma.array(0 * I4, mask=I4)),
    ):
        with pytest.raises(ValueError, match="masked"):
            call()

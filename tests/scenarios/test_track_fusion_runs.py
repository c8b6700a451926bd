import numpy as np
import pytest

from trackhelpers.fusion import bar_shalom_campo, convex_combination, covariance_intersection
from trackhelpers.motion import CV
from trackhelpers.scenarios import track_fusion as scene
from trackhelpers.scenarios.track_fusion_runs import (
    DEFINED,
    METHODS,
    axis_errors,
    combined_covariance,
    exact,
    over,
    rule_weights,
    rules,
    sampled,
    steady_state,
    worse_from,
)

F, Q = scene.MODEL.F(np.zeros(4), scene.T), scene.MODEL.Q(np.zeros(4), scene.T)
H = scene.CROSSED[0].H(np.zeros(4))
CONVEX, BSC, CENTRAL = (METHODS.index(name) for name in ("convex", "BSC", "centralised"))


def settled(pair, **keywords):
    return steady_state(F, Q, H, pair[0].R, pair[1].R, **keywords)


def test_weights_are_what_the_rules_do_to_any_estimates():
    state = settled(scene.CROSSED)
    x1, x2 = np.random.default_rng(0).normal(size=(2, 4, 7))
    direct = {
        "convex": convex_combination([x1, x2], [state.P1, state.P2]),
        "BSC": bar_shalom_campo(x1, state.P1, x2, state.P2, state.P12),
        "CI": covariance_intersection(x1, state.P1, x2, state.P2),
    }
    for name, (W1, P) in rule_weights(state.P1, state.P2, state.P12).items():
        np.testing.assert_allclose(W1 @ x1 + (np.eye(4) - W1) @ x2, direct[name][0], atol=1e-10)
        np.testing.assert_allclose(P, direct[name][1], rtol=1e-12)


@pytest.mark.parametrize("start", ["prior", "two points"])
def test_all_steps_at_once_equal_the_rules_step_by_step(start):
    plan = scene.design(scene.CROSSED, 25, start=start)
    at_once, stepwise = rules(plan), scene.fuse(plan)
    assert tuple(at_once) == METHODS
    for name in METHODS:
        np.testing.assert_allclose(at_once[name].W[..., DEFINED], stepwise[name].W[..., DEFINED], atol=1e-10)
        np.testing.assert_allclose(at_once[name].P[..., DEFINED], stepwise[name].P[..., DEFINED], rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize(("start", "sigma_a"), [("prior", 0.0), ("two points", 0.0), ("two points", 0.2)])
@pytest.mark.parametrize("pair", [scene.PAIRS["A"], scene.CROSSED], ids=["A", "crossed"])
def test_runs_and_recursion_agree(start, sigma_a, pair):
    truth, runs = scene.accelerated(50), 600
    plan = scene.design(pair, 50, start=start)
    methods = rules(plan)
    without, by_runs = exact(plan, methods, truth, sigma_a), sampled(plan, methods, truth, runs, seed=7, sigma_a=sigma_a)
    (mean_square,) = by_runs.by_run
    deviation = mean_square.mean(axis=-1) - np.mean(without.rms[..., DEFINED] ** 2, axis=-1)
    assert np.abs(deviation / (mean_square.std(axis=-1) / np.sqrt(runs))).max() < 4.5
    np.testing.assert_allclose(over(by_runs)[1], over(without)[1], rtol=0.06)
    np.testing.assert_allclose(over(by_runs)[0] ** 2, mean_square.mean(axis=-1))


def test_steady_state_is_the_limit_of_the_recursion():
    plan, state = scene.design(scene.CROSSED, 500), settled(scene.CROSSED)
    for found, limit in ((state.P1, plan.P[0]), (state.P2, plan.P[1]), (state.central, plan.P[2]), (state.P12, plan.P12)):
        np.testing.assert_allclose(found, limit[..., -1], rtol=1e-7, atol=1e-6)
    assert np.abs(state.P12 - state.P12.T).max() > 10  # an exchanged index would show


def test_steady_bias_is_the_limit_of_an_accelerated_track():
    truth, plan = scene.accelerated(400), scene.design(scene.CROSSED, 400)
    d = truth[:, -1] - F @ truth[:, -2]
    bias, covariance = scene.exact_errors(plan, truth)
    state = settled(scene.CROSSED, Q_true=0 * Q, d=d)
    np.testing.assert_allclose(state.bias.ravel(), bias[:, -1], rtol=1e-6)
    np.testing.assert_allclose(state.P1, covariance[:4, :4, -1], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(state.P12, 0, atol=1e-8)  # a deterministic truth leaves the tracks independent


def test_one_axis_in_its_own_units_is_one_axis_of_four_dimensions():
    state = settled(scene.PAIRS["A"])
    errors, believed = axis_errors(1.5, scene.SIGMA_A * scene.T**2 / 100)
    fused = rule_weights(state.P1, state.P2, state.P12)
    true = [combined_covariance(W, *state[:3]) for W, _ in fused.values()]
    for found, P in zip(errors, [state.P1, state.P2, *true, state.central], strict=True):
        np.testing.assert_allclose(found, [P[0, 0] / 100**2, P[1, 1] * scene.T**2 / 100**2], rtol=1e-6)
    np.testing.assert_allclose(believed, fused["convex"][1][0, 0] / 100**2, rtol=1e-6)


@pytest.mark.parametrize("index", [1e-3, 0.008, 0.5])
@pytest.mark.parametrize("ratio", [1.5, 3.0, 8.0])
def test_matched_errors_are_ordered_and_the_convex_combination_believes_too_much(ratio, index):
    errors, believed = axis_errors(ratio, index)
    assert np.all(errors[CENTRAL] < errors[BSC])
    assert np.all(errors[BSC] < np.minimum(errors[CONVEX], errors[0]))
    assert believed < errors[CONVEX, 0]


def test_on_a_straight_track_the_convex_combination_beats_even_the_centralised_filter():
    errors, _ = axis_errors(1.5, 0.008, truth="straight")
    assert np.argmin(errors[:, 0]) == CONVEX
    bent, _ = axis_errors(1.5, 0.008, truth="straight", acceleration=0.375)
    assert bent[CONVEX, 0] > bent[BSC, 0] and np.argmin(bent[:, 0]) == CENTRAL


@pytest.mark.parametrize("component", [0, 1])
def test_at_the_limiting_ratio_fusing_and_not_fusing_are_equal(component):
    ratio = worse_from(0.008, component)
    for factor, worse in ((0.99, False), (1.01, True)):
        errors, _ = axis_errors(factor * ratio, 0.008)
        assert (errors[CONVEX, component] > errors[0, component]) == worse


def test_the_limit_in_velocity_is_half_that_in_position():
    assert worse_from(0.008, 0) / worse_from(0.008, 1) == pytest.approx(2, rel=0.01)
    assert np.isnan(worse_from(0.008, 0, highest=3.0))


def test_the_convex_combination_of_a_matched_pair_is_overconfident_and_the_others_are_honest():
    plan = scene.design(scene.PAIRS["A"], 201)
    _, nees = over(exact(plan, rules(plan), scene.straight(), sigma_a=0.2))
    assert nees[CONVEX] == pytest.approx(5.71, abs=0.01)
    np.testing.assert_allclose(np.delete(nees, CONVEX), 4, rtol=1e-9)


def test_without_process_noise_in_filters_and_truth_all_but_intersection_agree():
    plan = scene.design(scene.CROSSED, 30, model=CV(0.0))
    root, nees = over(exact(plan, rules(plan), scene.straight(30)))
    np.testing.assert_allclose(root[CONVEX], root[CENTRAL], rtol=1e-8)
    np.testing.assert_allclose(root[BSC], root[CENTRAL], rtol=1e-8)
    np.testing.assert_allclose(nees[[CONVEX, BSC, CENTRAL]], 4, rtol=1e-8)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: axis_errors(0.5, 0.1), "ratio"),
        (lambda: axis_errors(2.0, 0.0), "index"),
        (lambda: axis_errors(2.0, 0.1, truth="bent"), "truth"),
        (lambda: steady_state(F, Q, H, -np.eye(2), np.eye(2)), "R1"),
        (lambda: steady_state(F, Q[:2, :2], H, np.eye(2), np.eye(2)), "Q"),
        (lambda: rule_weights(np.eye(2), np.eye(3), np.eye(2)), "Ps"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()

"""Interacting models of any kind: what must be equal is equal, and headings are mixed the short way round."""

import copy

import numpy as np
import pytest

from trackhelpers.filters import MotionEKF, MotionIMM, MotionKF, MotionUKF
from trackhelpers.motion import CA, CTRV, CV
from trackhelpers.sensors import Lidar, Position

CHAIN = np.array([[0.95, 0.05], [0.1, 0.9]])


def run(imm, zs, sensor, dt=0.5):
    xs = []
    for z in zs:
        imm.predict(dt)
        imm.update(z, sensor)
        xs.append(imm.x)
    return np.array(xs)


@pytest.mark.parametrize(("Filter", "model"), [(MotionKF, CV(0.5)), (MotionEKF, CTRV(1.0, 0.2)), (MotionUKF, CTRV(1.0, 0.2))])
def test_two_equal_models_are_one_filter(Filter, model):
    x0, P0 = np.array([0.0, -4.0, 0.0, 0.6] if model.linear else [0, 0, 4.0, 3.1, 0]), 0.25 * np.eye(model.n)
    noise = 0.5 * np.random.default_rng(0).normal(size=(40, 2))
    zs = [None if k == 7 else np.array([-2.0 * k, 0.3 * k]) + noise[k] for k in range(40)]
    sensor = Position(0.5, model.state)
    imm, kf = MotionIMM([Filter(model, x0, P0) for _ in range(2)], [0.3, 0.7], CHAIN), Filter(model, x0, P0)
    for z in zs:
        for each in (imm, kf):
            each.predict(0.5)
            each.update(z, sensor)
        np.testing.assert_allclose(imm.x, kf.x, atol=1e-9)
        np.testing.assert_allclose(imm.P, kf.P, atol=1e-9)
        assert imm.log_likelihood == pytest.approx(kf.log_likelihood, abs=1e-9)


def test_models_of_one_layout_are_the_textbooks_interacting_models():
    """Blom and Bar-Shalom's step, written out."""
    zs = np.random.default_rng(1).normal(size=(30, 2)).cumsum(axis=0)
    quiet, lively = CA(0.0), CA(0.5)
    x0, P0 = np.zeros(6), np.kron(np.eye(2), np.diag([1.0, 1, 1]))
    imm = MotionIMM([MotionKF(model, x0, P0) for model in (quiet, lively)], [0.9, 0.1], CHAIN)
    mu, xs, Ps = np.array([0.9, 0.1]), [x0, x0], [P0, P0]
    H, R = np.eye(6)[[0, 3]], np.eye(2)
    for z in zs:
        after = mu @ CHAIN
        w = CHAIN * mu[:, None] / after
        means = [sum(w[i, j] * xs[i] for i in range(2)) for j in range(2)]
        spreads = [sum(w[i, j] * (Ps[i] + np.outer(xs[i] - means[j], xs[i] - means[j])) for i in range(2)) for j in range(2)]
        likelihood = np.empty(2)
        for j, model in enumerate((quiet, lively)):
            F, Q = model.F(x0, 0.5), model.Q(x0, 0.5)
            P = F @ spreads[j] @ F.T + Q
            S, y = H @ P @ H.T + R, z - H @ F @ means[j]
            K = P @ H.T @ np.linalg.inv(S)
            xs[j], Ps[j] = F @ means[j] + K @ y, P - K @ S @ K.T
            likelihood[j] = np.exp(-0.5 * y @ np.linalg.solve(S, y)) / np.sqrt(np.linalg.det(S))
        mu = after * likelihood / (after @ likelihood)
        imm.predict(0.5)
        imm.update(z, Position(1.0, quiet.state))
        np.testing.assert_allclose(imm.mu, mu, atol=1e-9)
        np.testing.assert_allclose(imm.x, mu[0] * xs[0] + mu[1] * xs[1], atol=1e-9)


def test_headings_are_mixed_the_short_way_round():
    model = CTRV(0.5, 0.1)
    filters = [MotionEKF(model, [0, 0, 5, heading, 0], 0.01 * np.eye(5)) for heading in (3.10, -3.12)]
    imm = MotionIMM(filters, [0.5, 0.5], CHAIN)
    assert abs(imm.x[3]) > 3.1 and imm.P[3, 3] < 0.02
    imm.predict(0.1)
    assert abs(imm.x[3]) > 3.0 and imm.P[3, 3] < 0.03


def to_cartesian(x):
    return np.stack([x[0], x[2] * np.cos(x[3]), x[1], x[2] * np.sin(x[3])])


def from_cartesian(c, x):
    return np.array([c[0], c[2], np.hypot(c[1], c[3]), np.arctan2(c[3], c[1]), x[4]])


def straight_and_turning(mu=(0.5, 0.5)):
    cv, ctrv = CV(0.3), CTRV(0.3, 0.3)
    P = np.diag([0.25, 1.0, 0.25, 1.0])
    kf = MotionKF(cv, [0, 5.0, 0, 0], P)
    ekf = MotionEKF(ctrv, [0, 0, 5.0, 0, 0], np.diag([0.25, 0.25, 1.0, 0.04, 0.09]))
    imm = MotionIMM([kf, ekf], mu, CHAIN, common=cv.state, maps=[None, (to_cartesian, from_cartesian)])
    return imm, [Position(0.5, cv.state), Position(0.5, ctrv.state)]


def test_models_of_different_layouts_find_out_which_one_is_in_force():
    rng, x = np.random.default_rng(2), np.array([0, 0, 5.0, 0, 0])
    imm, sensors = straight_and_turning()
    turning, alone, errors = [], MotionKF(CV(0.3), imm.filters[0].x, imm.filters[0].P), []
    for k in range(160):
        x[4] = 0.5 if 60 <= k < 110 else 0.0
        x = CTRV().f(x, 0.5)
        z = x[:2] + 0.5 * rng.standard_normal(2)
        for each, sensor in ((imm, sensors), (alone, sensors[0])):
            each.predict(0.5)
            each.update(z, sensor)
        turning.append(imm.mu[1])
        errors.append([np.hypot(*(each.x[[0, 2]] - x[:2])) for each in (imm, alone)])
    assert np.mean(turning[75:110]) > np.mean(turning[20:60]) + 0.3
    ours, plain = np.sqrt(np.mean(np.square(errors[70:110]), axis=0))
    assert ours < 0.5 * plain
    assert imm.state == ("x", "vx", "y", "vy") and imm.nees(to_cartesian(x)) < 30


def test_mixing_leaves_a_model_as_it_was_that_nobody_comes_to():
    """With the identity as chain nothing is mixed, and the two filters run as if they were alone."""
    imm, sensors = straight_and_turning()
    imm.M = np.eye(2)
    alone = [MotionKF(CV(0.3), imm.filters[0].x, imm.filters[0].P), MotionEKF(CTRV(0.3, 0.3), imm.filters[1].x, imm.filters[1].P)]
    noise = 0.5 * np.random.default_rng(3).normal(size=(20, 2))
    for k in range(20):
        z = noise[k] + [2.5 * (k + 1), 0]
        imm.predict(0.5)
        imm.update(z, sensors)
        for kf, sensor in zip(alone, sensors, strict=True):
            kf.predict(0.5)
            kf.update(z, sensor)
    for kf, own in zip(alone, imm.filters, strict=True):
        np.testing.assert_allclose(own.x, kf.x, atol=1e-6)
        np.testing.assert_allclose(own.P, kf.P, atol=1e-6)


def test_a_missed_scan_moves_the_chain_once_a_prediction_and_is_no_evidence():
    imm, _ = straight_and_turning((0.9, 0.1))
    for _ in range(3):
        imm.predict(0.1)
        before = imm.mu.copy(), imm.x.copy(), imm.P.copy()
        for _ in range(2):
            imm.update(None)
        for one, other in zip(before, (imm.mu, imm.x, imm.P), strict=True):
            np.testing.assert_allclose(other, one, atol=1e-12)
    np.testing.assert_allclose(imm.mu, [0.9, 0.1] @ np.linalg.matrix_power(CHAIN, 3))
    assert imm.log_likelihood == pytest.approx(0) and "MotionIMM" in type(imm).__name__ and "mu" in repr(imm)


def test_a_refused_call_leaves_every_filter_as_it_was():
    imm, sensors = straight_and_turning()
    run(imm, np.zeros((3, 2)), sensors)
    before = copy.deepcopy([imm.x, imm.P, imm.mu, *(kf.x for kf in imm.filters), *(kf.P for kf in imm.filters)])
    for call in (
        lambda: imm.update([0.0, 0.0], [sensors[0], Lidar(state=CV().state)]),  # the second filter cannot take it
        lambda: imm.update([0.0, np.nan], sensors),
        lambda: imm.update([0.0, 0.0], sensors[:1]),
        lambda: imm.predict(-1.0),
    ):
        with pytest.raises(ValueError):
            call()
        for one, other in zip(before, [imm.x, imm.P, imm.mu, *(kf.x for kf in imm.filters), *(kf.P for kf in imm.filters)], strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"filters": []}, "filters"),
        ({"mu0": [0.5, 0.6]}, "mu0"),
        ({"transition": np.ones((2, 2))}, "transition"),
        ({"common": ("x", "w")}, "common"),
        ({"maps": [None]}, "maps"),
    ],
)
def test_bad_arguments_are_named(change, name):
    model = CV(0.5)
    arguments = {"filters": [MotionKF(model, np.zeros(4), np.eye(4)) for _ in range(2)], "mu0": [0.5, 0.5], "transition": CHAIN} | change
    with pytest.raises(ValueError, match=name):
        MotionIMM(**arguments)

"""Blocks of a flight are runs of an ensemble, the contenders are the filters that they are called, and blocks drawn anew are counted right."""

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF
from trackhelpers.ensemble.motion_imm import EnsembleMotionIMM
from trackhelpers.filters import MotionEKF, MotionIMM
from trackhelpers.follow import follow
from trackhelpers.motion import CTRV, CV
from trackhelpers.scenarios.real_aircraft.cast import CAST, StraightTurn
from trackhelpers.scenarios.real_aircraft.paths import HORIZONS, Flight, Smooth, flight, radar, reported, seconds, smoothed, turned
from trackhelpers.scenarios.real_aircraft.scores import average_nis, drawn_blocks, interval, rms, run, tried, tuned
from trackhelpers.sensors import Position


@pytest.fixture(scope="module")
def circle():
    """A target on a circle for 900 s, one report in ten missing."""
    t = np.arange(900.0)
    angle, radius = 0.02 * t, 5000.0
    p = radius * np.stack([np.cos(angle), np.sin(angle)])
    v, a = 0.02 * np.stack([-p[1], p[0]]), -(0.02**2) * p
    rng = np.random.default_rng(0)
    z = p + 10 * rng.normal(size=p.shape)
    z[:, ::10] = np.nan
    seen = Flight(t, z, np.where(np.isnan(z), np.nan, v), None, None, None)
    return {"circle": (seen, turned(v, 10.0, 0.0), Smooth(np.stack([p[0], v[0], a[0], p[1], v[1], a[1]]), None, (5,)))}


def test_noise_is_turned_into_the_track():
    R = turned(np.array([[100.0, 0.0], [0.0, 200.0]]), 5.0, 0.1)
    np.testing.assert_allclose(R[..., 0], np.diag([125.0, 25.0]))
    np.testing.assert_allclose(R[..., 1], np.diag([25.0, 425.0]))


@pytest.mark.parametrize("T", [1, 5])
def test_blocks_follow_each_other_and_stay_within_the_path(T):
    k = seconds(1300, T)
    assert k.shape == (420 // T, 3) and k.max() + 30 < 1300
    assert np.all(np.diff(k, axis=0) == T)
    scored = k[120 // T :]
    assert (scored[0, 1:] - scored[-1, :-1] == T).all()  # what is scored leaves nothing out


def test_the_smoother_finds_the_path_and_keeps_a_false_report_out(circle):
    seen, R, truth = circle["circle"]
    z = seen.z.copy()
    z[:, 402] += 500.0
    found = smoothed(seen._replace(z=z), R, sigma_v=1.0)
    assert found.outliers == (402,)
    assert np.sqrt(np.mean((found.x[[0, 3]] - truth.x[[0, 3]]) ** 2)) < 4


def test_a_block_of_the_ensemble_is_a_filter_of_one_target(circle):
    blocks = reported(circle)
    score = run("CTRV", (1.0, 0.003), blocks)
    model, (x0, P0) = CTRV(1.0, 0.003), start_of(score, blocks)
    zs = [z if seen else None for z, seen in zip(blocks.z[..., 0].T, blocks.mask[:, 0], strict=True)]
    history = follow(MotionEKF(model, x0, P0), zs, Position(10.0, model.state), 1.0)
    np.testing.assert_allclose(score.x[..., 0], history.x, rtol=1e-7, atol=1e-7)
    assert not blocks.mask[blocks.index == 5].any()  # the outlier


def start_of(score, blocks):
    from trackhelpers.scenarios.real_aircraft.cast import polar

    x0, P0 = polar(blocks.start[:, :1], blocks.P0, 5)
    return x0[:, 0], P0[..., 0]


def test_every_contender_follows_a_circle_and_predicts_it(circle):
    blocks = radar(circle, 5, 50.0, 3, np.random.default_rng(1))
    found = tried(blocks)
    settings = tuned(found, blocks, ["circle"])
    assert set(settings) == set(CAST) and settings["UKF–CTRA"] == settings["CTRA"]
    counts = drawn_blocks(blocks, "circle", np.random.default_rng(2), samples=50)
    errors = {name: [rms(run(name, settings[name], blocks), blocks, counts, h)[0] for h in HORIZONS] for name in CAST}
    assert all(values[0] < 75 and values[0] < values[-1] for values in errors.values())
    assert errors["CTRV"][2] < errors["CV"][2] and errors["UKF–CTRA"][2] == pytest.approx(errors["CTRA"][2], rel=0.05)
    nis = average_nis(found["CTRV"][settings["CTRV"]], blocks, counts)
    assert 1.5 < nis[0] < 2.5


def test_the_bias_filter_predicts_by_its_own_transition(circle):
    blocks = radar(circle, 5, 50.0, 1, np.random.default_rng(1))
    score = run("ABMA", (1.0, 10.0), blocks)
    x = score.x[..., 0][:, -1]
    for _ in range(2):
        x = score.ensemble.matrices.F @ x
    np.testing.assert_allclose(CAST["ABMA"].ahead(score.ensemble, score.x, 10)[:, -1, 0], (x[:4] + x[4:])[[0, 2]])


def test_straight_flight_in_the_state_of_a_turn_is_constant_velocity():
    x, dt = np.array([3.0, -4.0, 150.0, 0.7, 0.3]), 2.0
    cv, polar = CV(1.5), StraightTurn(1.5)
    c = np.array([3.0, 150 * np.cos(0.7), -4.0, 150 * np.sin(0.7)])
    np.testing.assert_allclose(polar.f(x, dt)[:2], cv.f(c, dt)[[0, 2]])
    assert polar.f(x, dt)[4] == 0
    J = np.array([[1.0, 0, 0, 0], [0, 0, np.cos(0.7), -150 * np.sin(0.7)], [0, 1, 0, 0], [0, 0, np.sin(0.7), 150 * np.cos(0.7)]])
    Q = polar.Q(x, dt)[:4, :4]
    np.testing.assert_allclose(J @ Q @ J.T, cv.Q(c, dt), atol=1e-9)
    steps = 1e-6 * np.eye(5)
    numeric = np.array([(polar.f(x + d, dt) - polar.f(x - d, dt)) / 2e-6 for d in steps]).T
    np.testing.assert_allclose(polar.F(x, dt), numeric, atol=1e-5)


def test_an_ensemble_of_interacting_models_is_the_filter_of_one_target():
    models, chain = (StraightTurn(0.5), CTRV(2.0, 0.05)), [[0.9, 0.1], [0.2, 0.8]]
    x0, P0 = np.array([[0.0, 0, 10, 3.1, 0], [5.0, 5, 12, -3.1, 0.1]]).T, np.diag([1.0, 1, 1, 0.05, 0.01])
    many = EnsembleMotionIMM([EnsembleEKF(model, x0, P0) for model in models], [0.7, 0.3], chain)
    single = [MotionIMM([MotionEKF(model, x, P0) for model in models], [0.7, 0.3], chain) for x in x0.T]
    rng, sensor = np.random.default_rng(3), Position(1.0, models[0].state)
    for k in range(40):
        z, seen = 10 * rng.normal(size=(2, 2)) - [[8.0 * k], [0.0]], np.array([k % 7 != 3, True])
        R = np.repeat(np.diag([1.0, 2.0])[..., None], 2, axis=2)
        for each in (many, *single):
            each.predict(0.5)
        many.update(z, sensor, mask=seen, R=R)
        for j, imm in enumerate(single):
            imm.update(z[:, j] if seen[j] else None, sensor, R=R[..., j])
            np.testing.assert_allclose(many.x[:, j], imm.x, rtol=1e-7, atol=1e-7)
            np.testing.assert_allclose(many.P[..., j], imm.P, rtol=1e-6, atol=1e-7)
            np.testing.assert_allclose(many.mu[:, j], imm.mu, atol=1e-7)
    before = many.mu.copy()
    many.update(None)
    assert np.array_equal(many.mu, before)


def test_models_of_different_states_or_probabilities_that_are_none_are_refused():
    a, b = EnsembleEKF(CV(1.0), np.zeros((4, 2)), np.eye(4)), EnsembleEKF(CTRV(1.0, 0.1), np.zeros((5, 2)), np.eye(5))
    with pytest.raises(ValueError, match="filters"):
        EnsembleMotionIMM([a, b], [0.5, 0.5], np.eye(2))
    with pytest.raises(ValueError, match="mu0"):
        EnsembleMotionIMM([a, a], [0.5, 0.6], np.eye(2))
    with pytest.raises(ValueError, match="transition"):
        EnsembleMotionIMM([a, a], [0.5, 0.5], np.ones((2, 2)))


def test_blocks_drawn_anew(circle):
    blocks = reported({"other": circle["circle"], **circle})
    counts = drawn_blocks(blocks, "circle", np.random.default_rng(0), samples=30)
    own = blocks.flight == "circle"
    assert counts.shape == (31, len(own)) and (counts.sum(axis=1) == own.sum()).all() and not counts[:, ~own].any()
    assert (counts[0] == own).all()
    found = interval(np.r_[2.0, np.linspace(1, 3, 101)])
    assert found.value == 2.0 and found.low == pytest.approx(1.05) and found.high == pytest.approx(2.95)


@pytest.mark.parametrize("stretch", ["737", "A310", "A380", "helicopter"])
def test_a_stretch_of_a_recording_is_on_whole_seconds(stretch):
    flown = flight(stretch)
    seen = np.isfinite(flown.z[0])
    assert np.array_equal(flown.t, np.arange(flown.t[0], flown.t[0] + len(flown.t)))
    assert flown.z.shape == flown.v.shape == (2, len(flown.t)) and 0.6 < seen.mean() < 1
    step = np.diff(flown.z, axis=1)[:, :-1]
    middle = np.diff(flown.z[:, seen], axis=1).sum(axis=1) - (flown.z[:, seen][:, -1] - flown.z[:, seen][:, 0])
    assert np.allclose(middle, 0) and np.nanmedian(np.hypot(*step) / np.hypot(*flown.v[:, :-2])) == pytest.approx(1, abs=0.05)

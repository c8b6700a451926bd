"""The compiled step is NumPy's step: for every model and sensor that can be traced, in any number of runs, beside a run that has broken down."""

import gc
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest

from trackhelpers import arrays, fused, kernels
from trackhelpers.consistency import nees
from trackhelpers.ensemble import EnsembleEKF, EnsembleKF, EnsembleUKF, covariance
from trackhelpers.follow import follow
from trackhelpers.motion import CA, CCA, CSAA, CSAV, CTRA, CTRV, CV, LinearModel, PolarCA, PolarCV, Singer
from trackhelpers.sensors import Lidar, LinearSensor, Position, Radar, RangeBearing, Sensor

pytestmark = pytest.mark.skipif(fused.binding is None, reason="llvmlite is not installed")

TURNING = {
    "CTRV": lambda **more: CTRV(0.5, 0.1, **more),
    "CTRA": lambda **more: CTRA(0.3, 0.1, **more),
    "CSAV": lambda **more: CSAV(3.0, 0.5, 0.05, **more),
    "CSAA": lambda **more: CSAA(3.0, 0.3, 0.05, **more),
    "CCA": lambda **more: CCA(0.3, 0.01, **more),
}
TRACED = {name: make() for name, make in TURNING.items()}
TRACED |= {
    "CTRV, continuous": TURNING["CTRV"](noise="continuous"),
    "CTRV, exact": TURNING["CTRV"](noise="exact"),
    "CTRA, exact": TURNING["CTRA"](noise="exact"),
}
TRACED |= {"CTRV, constant Q": TURNING["CTRV"](Q=np.diag([1e-4, 1e-4, 0.01, 1e-4, 1e-4]))}
TRACED |= {"CV": CV(0.5), "CA": CA(0.5), "PolarCV": PolarCV(0.5, 0.2), "PolarCA": PolarCA(0.5, 0.2), "Singer": Singer(1.0, 20.0)}
TRACED |= {"given": LinearModel(CV(0.5).F(np.zeros(4), 0.1), CV(0.5).Q(np.zeros(4), 0.1), 0.1, CV(0.5).state)}
LEFT = {"CSAV, exact": TURNING["CSAV"](noise="exact")}
R = np.array([[0.09, 0.001, 0.01], [0.001, 0.0009, 0.0], [0.01, 0.0, 0.09]])


def plain():
    """Without the compiler."""
    return patch.object(fused, "binding", None)


def sensors(model):
    if not {"θ", "vx"} & set(model.state):
        return [Position(0.2, model.state)]
    return [
        Lidar(state=model.state),
        Radar(R=R, state=model.state, position=(-40.0, 5.0), heading=0.3),
        Radar(state=model.state, rows=("ψ",)),
    ]


def start(model, M, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(model.n, M)) * 0.3
    x[0] += 5.0
    return x


def run(model, M, steps, Ensemble=EnsembleEKF, mask=None, seen=None):
    """States, covariances and innovations of an ensemble on random measurements about a target that stays near."""
    ens, taken = Ensemble(model, start(model, M), 0.1 * np.eye(model.n)), sensors(model)
    rng, history = np.random.default_rng(1), []
    for k in range(steps):
        sensor = taken[k % len(taken)]
        z = sensor.h(start(model, M, 2)) + 0.1 * rng.normal(size=(sensor.m, M)) * np.array(sensor.sigma)[:, None]
        ens.predict(0.1)
        ens.update(z, sensor, mask=None if mask is None else mask[k % len(mask)])
        history.append((ens.x, ens.P, ens.y, ens.S, ens.K))
    return ens, history


KEPT = ("x", "P", "y", "S", "K")


@cache
def one_by_one(name, compiled):
    """500 steps of a model, with all that can be kept of them, for the tests that compare with them."""
    with patch.object(fused, "binding", fused.binding if compiled else None):
        return followed(TRACED[name], 13, 500, False, keep=KEPT)


@pytest.mark.parametrize("name", TRACED)
def test_500_steps_are_numpys(name):
    ours, theirs = (one_by_one(name, compiled) for compiled in (True, False))
    for kept in KEPT:
        for k in (0, 1, 2, 30, 499):
            a, b = (getattr(history, kept)[..., k, :] for history in (ours, theirs))
            assert np.array_equal(np.isnan(a), np.isnan(b)), (kept, k)  # of a sensor with fewer rows
            assert np.nanmax(np.abs(a - b)) <= 1e-12 * max(1.0, np.nanmax(np.abs(b))), (kept, k)
    assert np.array_equal(ours.filter.P, np.swapaxes(ours.filter.P, 0, 1))


@pytest.mark.parametrize("name", TRACED)
def test_these_models_and_their_sensors_are_traced(name):
    model = TRACED[name]
    x, P = start(model, 4), np.repeat(np.eye(model.n)[..., None], 4, axis=2)
    assert fused.predict(model, x, P, 0.1) is not None
    for sensor in sensors(model):
        assert fused.update(sensor, model, x, P, sensor.h(x), sensor.R) is not None


@pytest.mark.parametrize("name", LEFT)
def test_what_cannot_be_traced_is_left_to_numpy(name):
    model = LEFT[name]
    x, P = start(model, 4), np.repeat(np.eye(model.n)[..., None], 4, axis=2)
    assert fused.predict(model, x, P, 0.1) is None
    ens = EnsembleEKF(model, x, P)
    ens.predict(0.1)
    np.testing.assert_allclose(ens.x, model.normalise(model.f(x, 0.1)), atol=1e-12)


def test_masks_and_an_R_of_each_run_are_numpys():
    model, rng = TRACED["CTRV"], np.random.default_rng(4)
    masks = [None, rng.random(40) < 0.5, np.arange(40) == 7, None]
    ours = run(model, 40, 12, mask=masks)[1]
    with plain():
        theirs = run(model, 40, 12, mask=masks)[1]
    for a, b in zip(ours[-1] + ours[2], theirs[-1] + theirs[2], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    noise = R[..., None] * rng.uniform(0.5, 2.0, 40)
    for given in (noise, 2 * R):
        made = []
        for compiled in (True, False):
            ens = EnsembleEKF(model, start(model, 40), np.eye(5))
            with patch.object(fused, "binding", fused.binding if compiled else None):
                ens.update(Radar().h(start(model, 40, 2)), Radar(), R=given)
            made.append((ens.x, ens.P, ens.S))
        for a, b in zip(*made, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)


@pytest.mark.parametrize("M", [1, 2, 7, 8, 9, 40])
def test_a_run_does_not_depend_on_those_beside_it(M):
    """In one loop of the same width to the bit, in another one to rounding."""
    model = TRACED["CTRV"]
    whole, part = (EnsembleEKF(model, start(model, 40)[:, :runs], np.eye(5)) for runs in (40, M))
    for sensor in (Radar(), Lidar()):
        z = sensor.h(start(model, 40, 2))
        for ens in (whole, part):
            ens.predict(0.1)
            ens.update(z[:, : ens.runs], sensor)
    np.testing.assert_allclose(whole.P[..., :M], part.P, atol=1e-13)
    if M >= kernels.LANES:
        assert np.array_equal(whole.x[:, :M], part.x) and np.array_equal(whole.P[..., :M], part.P)


@pytest.mark.parametrize("broken", [3, 38])
def test_a_run_that_breaks_down_leaves_its_neighbours_bit_for_bit(broken):
    model = TRACED["CTRV"]
    clean, spoilt = (EnsembleEKF(model, start(model, 40), np.eye(5)) for _ in range(2))
    spoilt.P[0, 0, broken] = -50.0
    for sensor in (Radar(), Lidar()):
        for ens in (clean, spoilt):
            ens.predict(0.1)
            ens.update(sensor.h(start(model, 40, 2)), sensor)
    others = np.arange(40) != broken
    assert np.array_equal(np.flatnonzero(spoilt.failed), [broken])
    assert np.array_equal(spoilt.x[:, others], clean.x[:, others]) and np.array_equal(spoilt.P[..., others], clean.P[..., others])


def test_models_that_differ_in_their_numbers_share_the_code():
    x, P = start(TRACED["CTRV"], 9), np.repeat(np.eye(5)[..., None], 9, axis=2)
    fused.predict(CTRV(0.7, 0.2), x, P, 0.1)
    before = kernels._compiled.cache_info().misses
    for sigma in (0.1, 1.3):
        got = fused.predict(CTRV(sigma, 0.4), x, P, 0.2)
        with plain():
            ens = EnsembleEKF(CTRV(sigma, 0.4), x, P)
            ens.predict(0.2)
        np.testing.assert_allclose(got[1], ens.P, atol=1e-13)
    assert kernels._compiled.cache_info().misses == before


def test_an_overridden_hook_reaches_the_compiled_step():
    class Braking(CTRV):
        def _f(self, x, dt, parts):
            px, py, v, heading, w = super()._f(x, dt, parts)
            return px, py, 0.9 * v, heading, w

    model, x = Braking(0.5, 0.1), start(TRACED["CTRV"], 9)
    ens = EnsembleEKF(model, x, np.eye(5))
    ens.predict(0.1)
    np.testing.assert_allclose(ens.x, model.normalise(model.f(x, 0.1)), atol=1e-13)


def test_a_hook_that_decides_by_a_run_s_number_is_left_to_numpy():
    class Bounded(CTRV):
        def _f(self, x, dt, parts):
            rows = list(super()._f(x, dt, parts))
            if np.max(rows[2]) > 1.0:
                rows[2] = np.minimum(rows[2], 1.0)
            return rows

    model, x = Bounded(0.5, 0.1), start(TRACED["CTRV"], 9) + 2
    ens = EnsembleEKF(model, x, np.eye(5))
    ens.predict(0.1)
    np.testing.assert_allclose(ens.x[2], 1.0)


def test_bounds_hold_in_the_compiled_step():
    class Forward(CTRV):
        bounds = {"v": (0.0, 2.0)}  # noqa: RUF012

    x = start(TRACED["CTRV"], 9)
    x[2] = np.linspace(-4, 4, 9)
    ens = EnsembleEKF(Forward(0.5, 0.1), x, np.eye(5))
    ens.predict(0.1)
    np.testing.assert_array_equal(ens.x[2], np.clip(x[2], 0, 2))


def test_one_sensor_serves_models_with_bounds_and_without():
    class Forward(CTRV):
        bounds = {"v": (0.0, 2.0)}  # noqa: RUF012

    radar, x = Radar(), start(TRACED["CTRV"], 9)
    found = []
    for kind in (Forward, CTRV):
        ens = EnsembleEKF(kind(0.5, 0.1), x, np.eye(5))
        ens.update(radar.h(x) - np.array([[0], [0], [5.0]]), radar)
        found.append(ens.x[2].min())
    assert found[0] >= 0 > found[1]


def test_a_sensor_that_moves_is_asked_anew_each_time():
    class Moving(Position):
        def at(self, t):
            return Position(0.2, self.state, position=(t, 0.0))

    model = TRACED["CV"]
    x, P = start(model, 9), np.repeat(np.eye(4)[..., None], 9, axis=2)
    assert fused.update(Moving(0.2, model.state), model, x, P, x[[0, 2]], np.eye(2)) is None


def test_a_residual_of_its_own_is_kept():
    class Odd(Lidar):
        def residual(self, z, z_hat):
            return Sensor.residual(self, z, z_hat) * 0.0

    x = start(TRACED["CTRV"], 9)
    ens = EnsembleEKF(TRACED["CTRV"], x, np.eye(5))
    ens.update(x[:2] + 1.0, Odd())
    np.testing.assert_array_equal(ens.x, x)


def test_linear_filters_with_their_own_P_and_the_linear_transform_are_numpys():
    model = TRACED["CV"]
    P = np.eye(4)[..., None] * np.linspace(1, 2, 11)
    sensor, z = LinearSensor(np.eye(2, 4), np.eye(2), model.state), start(model, 11, 2)[:2]
    for Ensemble in (EnsembleKF, EnsembleUKF):
        ours, theirs = (Ensemble(model, start(model, 11), P) for _ in range(2))
        ours.predict(0.3)
        ours.update(z, sensor)
        with plain():
            theirs.predict(0.3)
            theirs.update(z, sensor)
        np.testing.assert_allclose(ours.P, theirs.P, atol=1e-13)


def test_the_algebra_on_entries_is_numpys():
    rng, model = np.random.default_rng(0), TRACED["CTRA"]
    x, A = start(model, 21), rng.normal(size=(6, 6, 21))
    P = arrays.congruence(A, np.eye(6)) + np.eye(6)[..., None]
    _, transition, noise = model.linearised(x, 0.3)
    sensor = RangeBearing(state=model.state)
    calls = [
        lambda: covariance.propagate(P, transition, noise),
        lambda: covariance.correct(P, sensor.linearised(x)[1], sensor.R),
        lambda: arrays.mahalanobis(x, P),
    ]
    for call in calls:
        ours = call()
        with plain():
            theirs = call()
        for a, b in zip(np.atleast_1d(ours) if isinstance(ours, np.ndarray) else ours, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11)


def test_steps_of_any_length_cost_no_trace_each():
    model = Singer(1.0, 20.0)  # whose noise wants dt as a number
    x, P = start(model, 9), np.repeat(np.eye(6)[..., None], 9, axis=2)
    got = [fused.predict(model, x, P, 0.1 + 0.01 * k) is not None for k in range(20)]
    assert got == [True] * fused.MOST_STEPS + [False] * (20 - fused.MOST_STEPS)
    assert fused.predict(model, x, P, 0.1) is not None


def followed(model, M, steps, at_once, *, ens=None, sensor=None, dt=0.1, **more):
    """`follow` over the measurements of `run`, with a truth common to all runs; `at_once`: in one loop, or step by step."""
    taken = [sensor] if sensor else sensors(model)
    taken, rng = [taken[k % len(taken)] for k in range(steps)], np.random.default_rng(1)
    zs = [s.h(start(model, M, 2)) + 0.1 * rng.normal(size=(s.m, M)) * np.array(s.sigma)[:, None] for s in taken]
    truth = start(model, M, 2)[:, :1] + 0.01 * rng.normal(size=(model.n, steps))
    ens = EnsembleEKF(model, start(model, M), 0.1 * np.eye(model.n)) if ens is None else ens
    with patch.object(fused, "run", fused.run if at_once else lambda *arguments: None):
        return follow(ens, zs, taken, dt, **({"truth": truth} | more))


def alike(a, b, kept):
    pairs = {name: (getattr(a, name), getattr(b, name)) for name in kept}
    pairs |= {f"{name} in the end": (getattr(a.filter, name), getattr(b.filter, name)) for name in ("x", "P", "y", "S", "K")}
    for name, (one, other) in pairs.items():
        assert one.shape == other.shape and one.flags.c_contiguous
        assert np.abs(one - other).max(initial=0) <= 1e-12 * max(1.0, np.abs(other).max(initial=0)), name


@pytest.fixture
def counted(monkeypatch):
    """How many runs were made at once."""
    made, run_at_once = [], fused.run

    def counting(*arguments):
        ran = run_at_once(*arguments)
        made.append(ran is not None)
        return ran

    monkeypatch.setattr(fused, "run", counting)
    return made


@pytest.mark.parametrize("name", TRACED)
def test_500_steps_at_once_are_those_one_by_one_and_numpys(name, counted):
    model = TRACED[name]
    whole = followed(model, 13, 500, True)
    assert counted == [True]
    for compiled in (True, False):
        alike(whole, one_by_one(name, compiled), ("x", "nees"))
    assert np.array_equal(whole.filter.P, np.swapaxes(whole.filter.P, 0, 1))


@pytest.mark.parametrize("name", LEFT)
def test_a_run_of_a_model_that_cannot_be_traced_goes_step_by_step(name, counted):
    history = followed(LEFT[name], 4, 6, True)
    assert counted == [False]
    alike(history, followed(LEFT[name], 4, 6, False), ("x", "nees"))


@pytest.mark.parametrize("M", [1, 2, 7, 8, 9, 64, 127, 128, 129, 200])
def test_runs_at_once_in_any_number(M, counted):
    model = TRACED["CTRV"]
    alike(followed(model, M, 7, True), followed(model, M, 7, False), ("x", "nees"))
    assert counted == [True]


@pytest.mark.parametrize("keep", [(), ("P",), ("x", "P", "y", "S"), ("K",)])
def test_what_is_kept_of_steps_at_once(keep, counted):
    model = TRACED["CTRV"]
    for sensor in (Radar(R=R), Lidar()):
        alike(*(followed(model, 20, 9, at_once, sensor=sensor, keep=keep) for at_once in (True, False)), (*keep, "nees"))
    assert counted == [True, True]


def test_y_of_several_sizes_is_padded_step_by_step(counted):
    model = TRACED["CTRV"]
    history = followed(model, 9, 6, True, keep=("y",))
    assert counted == [False]
    assert np.isnan(history.y[2, 0]).all() and np.isfinite(history.y[:, 1]).all()


def test_a_truth_of_each_run_no_truth_and_steps_of_any_length(counted):
    model, rng = TRACED["CTRA"], np.random.default_rng(8)
    for truth in (rng.normal(size=(6, 12, 21)), None):
        pair = [followed(model, 21, 12, at_once, truth=truth, dt=list(np.linspace(0, 0.3, 12))) for at_once in (True, False)]
        alike(*pair, ("x",) if truth is None else ("x", "nees"))
    assert counted == [True, True]
    np.testing.assert_allclose(
        pair[0].filter.nees(truth := rng.normal(size=6)), nees(truth, pair[1].filter.x, pair[1].filter.P, (3,)), rtol=1e-9
    )


def test_a_model_that_wants_its_step_as_a_number_goes_at_once_where_all_are_the_same(counted):
    model = TRACED["Singer"]
    followed(model, 9, 5, True)
    history = followed(model, 9, 5, True, dt=[0.1, 0.2, 0.1, 0.1, 0.1])
    assert counted == [True, False] and np.isfinite(history.x).all()


@pytest.mark.parametrize("missed", [[0], [3, 4], [6], [0, 1, 2, 3, 4, 5, 6]])
def test_missed_scans_among_steps_at_once(missed, counted):
    model, radar = TRACED["CTRV"], Radar()
    zs = [None if k in missed else radar.h(start(model, 9, 2)) for k in range(7)]
    pair = []
    for at_once in (True, False):
        ens = EnsembleEKF(model, start(model, 9), np.eye(5))
        with patch.object(fused, "run", fused.run if at_once else lambda *arguments: None):
            pair.append(follow(ens, zs, [None if k == 3 and z is None else radar for k, z in enumerate(zs)], 0.1))
    if len(missed) < 7:
        alike(*pair, ("x",))
    else:
        np.testing.assert_allclose(pair[0].x, pair[1].x, atol=1e-13)
        assert pair[0].filter.K.shape == (5, 0, 9)
    assert counted == [True]


def test_what_was_traced_goes_with_the_model_and_the_sensor():
    model, radar = CTRV(0.5, 0.1), Radar()
    for _ in range(5):
        followed(CTRV(0.5, 0.1), 9, 3, True, sensor=radar)
        followed(model, 9, 3, True, sensor=Radar())
    gc.collect()
    assert sum(radar in sensors for sensors in fused._kept_together.values()) == 0
    assert len(fused._kept_together[model]) == 0


def test_states_that_somebody_sets_as_whole_numbers_are_read_as_numbers():
    model = TRACED["CTRV"]
    pair = []
    for at_once in (True, False):
        ens = EnsembleEKF(model, start(model, 9), np.eye(5))
        ens.x = np.ones((5, 9), dtype=int)
        pair.append(followed(model, 9, 4, at_once, ens=ens))
    alike(*pair, ("x", "nees"))


def test_a_step_that_the_model_refuses_is_refused_at_its_place():
    model = TRACED["given"]
    ens = EnsembleEKF(model, start(model, 9), np.eye(4))
    with pytest.raises(ValueError, match=r"zs\[2\]: dt: expected 0.1 s"):
        followed(model, 9, 4, True, ens=ens, dt=[0.1, 0.1, 0.2, 0.1])
    assert np.isfinite(ens.x).all() and ens.y.shape == (3, 9)


def test_masks_other_noise_an_iterated_filter_and_a_subclass_go_step_by_step(counted):
    model = TRACED["CTRV"]

    class Other(EnsembleEKF):
        pass

    followed(model, 9, 4, True, masks=[None, np.arange(9) < 3, None, None])
    followed(model, 9, 4, True, sensor=Radar(), Rs=R)
    followed(model, 9, 4, True, ens=EnsembleEKF(model, start(model, 9), np.eye(5), iterations=2))
    followed(model, 9, 4, True, ens=Other(model, start(model, 9), np.eye(5)))
    followed(
        TRACED["CV"], 9, 4, True, sensor=Position(0.2, TRACED["CV"].state), ens=EnsembleKF(TRACED["CV"], start(TRACED["CV"], 9), np.eye(4))
    )
    assert counted == []
    followed(model, 9, 4, True, masks=[None] * 4)
    assert counted == [True]


@pytest.mark.parametrize("broken", [3, 70, 199])
def test_a_run_that_breaks_down_in_steps_at_once_leaves_its_neighbours_bit_for_bit(broken):
    model, made = TRACED["CTRV"], []
    for spoilt in (False, True):
        ens = EnsembleEKF(model, start(model, 200), 0.1 * np.eye(5))
        if spoilt:
            ens.P[0, 0, broken] = -50.0
        made.append(followed(model, 200, 20, True, ens=ens))
    clean, spoilt = made
    others = np.arange(200) != broken
    assert np.array_equal(np.flatnonzero(spoilt.filter.failed), [broken])
    assert np.isnan(spoilt.nees[-1, broken])
    for a, b in ((clean.x, spoilt.x), (clean.nees, spoilt.nees), (clean.filter.P, spoilt.filter.P)):
        assert np.array_equal(a[..., others], b[..., others])


def test_a_measurement_that_is_refused_stops_the_run_at_its_step():
    model, radar = TRACED["CTRV"], Radar()
    zs = [radar.h(start(model, 9, 2)) for _ in range(4)]
    bad = [*zs[:2], np.full((3, 9), np.nan), zs[3]]
    stopped, expected = (EnsembleEKF(model, start(model, 9), np.eye(5)) for _ in range(2))
    with pytest.raises(ValueError, match=r"zs\[2\]: z: expected finite measurements"):
        follow(stopped, bad, radar, 0.1)
    follow(expected, zs[:2], radar, 0.1)
    expected.predict(0.1)
    np.testing.assert_allclose(stopped.x, expected.x, atol=1e-13)


def test_a_run_of_measurements_for_all_of_whole_numbers_or_of_parts_of_arrays():
    model, lidar = TRACED["CTRV"], Lidar()
    block = np.random.default_rng(3).normal(size=(2, 6, 18))
    given = [
        list(np.moveaxis(block, 1, 0)[..., ::2]),  # not in one piece
        np.moveaxis(block, 1, 0)[..., ::2].astype(np.float32),
        [[[1], [2]]] * 6,
    ]
    for zs in given:
        made = []
        for at_once in (True, False):
            ens = EnsembleEKF(model, start(model, 9), np.eye(5))
            with patch.object(fused, "run", fused.run if at_once else lambda *arguments: None):
                made.append(follow(ens, zs, lidar, 0.1))
        alike(*made, ("x",))

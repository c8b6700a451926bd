"""An ensemble whose runs miss different scans is, run by run, the single filter that is fed with None; with a noise of its own in every run and call too."""

import numpy as np
import pytest

from trackhelpers.ensemble import switching
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.filters import MatrixKF
from trackhelpers.filters.base import OneTarget
from trackhelpers.scenarios.augmented_bias import contenders as c
from trackhelpers.scenarios.augmented_bias import target

M, STEPS = 4, 240
PLAIN = c.Adaptive("plain", (MatrixKF, EnsembleMatrixKF), lambda x0, single: ((c.F, c.H, c.Q, target.R, x0, target.P0), {}))
CONTENDERS = [
    PLAIN,
    c.strong_tracking(1.0),
    c.strong_tracking(1.0, "per axis", rho=0.8),
    c.variance_inflation(probability=0.99),
    c.input_estimation(window=6, probability=0.99),
    c.variable_dimension(window=3, enter=0.99, leave=0.8),
    c.variable_dimension(c.CORRELATED),
    c.interacting(),
]
IDS = [f"{i}-{each.name}" for i, each in enumerate(CONTENDERS)]
STEP_COUNTERS = CONTENDERS[4:6]


def scenario(seed):
    """Starts (4, M), measurements (STEPS, 2, M) of targets that accelerate now and then, masks (STEPS, M) with long gaps, and R (STEPS, 2, 2, M)."""
    rng = np.random.default_rng(seed)
    a = np.where(rng.random((STEPS // 40, 2, M)) < 0.5, rng.normal(scale=2.0, size=(STEPS // 40, 2, M)), 0.0).repeat(40, axis=0)
    v = 5 + np.cumsum(a, axis=0)
    z = np.cumsum(v - a / 2, axis=0) + np.sqrt(3) * rng.standard_normal((STEPS, 2, M))
    mask = rng.random((STEPS, M)) < np.array([0.3, 0.6, 0.9, 1.0])
    mask[100:130, :2], mask[200:205], mask[220] = False, False, True
    roots = rng.normal(size=(STEPS, 2, 2, M))
    return (
        np.array([0.0, 5.0, 0.0, 5.0])[:, None] + rng.normal(size=(4, M)),
        z,
        mask,
        np.einsum("tikm,tjkm->tijm", roots, roots) + np.eye(2)[..., None],
    )


OWN = ("mu", "u", "changes", "fading", "manoeuvring", "statistic")  # of some filters


def told(filters, axis):
    """What the single filters, or an ensemble, say after a step: name -> array, runs last."""
    names = ["estimate", "estimate_P", *(name for name in OWN if hasattr(filters[0], name))]
    return {name: np.stack([getattr(kf, name) for kf in filters], axis=axis).astype(float) for name in names}


def assert_same_runs(ours, theirs):
    """Lists over the steps of what `told` says of the ensemble and of the filters."""
    for name, (rtol, atol) in {"estimate": (1e-10, 1e-7), "estimate_P": (1e-8, 1e-7), **dict.fromkeys(OWN, (1e-7, 1e-7))}.items():
        if name in theirs[0]:
            pair = [np.stack([step[name] for step in steps]) for steps in (ours, theirs)]
            np.testing.assert_allclose(pair[0], pair[1].reshape(pair[0].shape), rtol=rtol, atol=atol, err_msg=name)


def innovations(singles):
    """y (2, M) and S (2, 2, M) of filters of one target, NaN where a filter has missed its scan."""
    y, S = np.full((2, M), np.nan), np.full((2, 2, M), np.nan)
    for r, kf in enumerate(singles):
        if kf.y.size:
            y[:, r], S[..., r] = kf.y, kf.S
    return y, S


@pytest.mark.parametrize("noise", ["always the same", "one a call", "one a run and call"])
@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_each_run_is_the_single_filter_that_is_fed_with_None(contender, noise):
    x0, zs, masks, Rs = scenario(7)
    ens, singles = contender.ensemble(x0), [contender.single(x0[:, r]) for r in range(M)]
    ours, theirs, seen, expected = [], [], [], []
    for k, (z, mask) in enumerate(zip(zs, masks, strict=True)):
        ens.predict()
        whole = {"always the same": None, "one a call": Rs[k, ..., 0], "one a run and call": Rs[k]}[noise]
        hidden = np.where(mask, z, np.nan)  # nobody looks at what the mask leaves out
        ens.update(hidden, R=whole, mask=None if mask.all() else mask)
        for r, kf in enumerate(singles):
            own = whole[..., r] if noise == "one a run and call" else whole
            kf.predict()
            kf.update(z[:, r] if mask[r] else None, R=own)
        ours.append(told([ens], 0))
        theirs.append(told(singles, -1))
        if mask.any():
            seen.append((ens.y, ens.S))
            expected.append(innovations(singles))
        assert [kf.y.size > 0 for kf in singles] == mask.tolist()
    assert_same_runs(ours, theirs)
    for a, b, rtol in zip(*(map(np.array, zip(*pairs, strict=True)) for pairs in (seen, expected)), (1e-9, 1e-8), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-7)  # NaN equals NaN
    if hasattr(ens, "manoeuvring"):
        switches = np.abs(np.diff([step["manoeuvring"][0] for step in ours], axis=0)).sum(axis=0)
        assert np.all(switches[1:] > 1)  # something did happen
    assert np.max(getattr(ens, "changes", 2)) > 1


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_a_scan_that_nobody_saw_changes_nothing_and_leaves_no_older_evidence(contender):
    x0, zs, _, _ = scenario(1)
    ens, bare = contender.ensemble(x0), contender.ensemble(x0)
    for k, z in enumerate(zs[:150]):
        for each in (ens, bare):
            each.predict()
            if k % 4:
                each.update(z)
        if k % 4 == 0:
            ens.update(None) if k % 8 else ens.update(np.full((2, M), np.nan), mask=np.zeros(M, dtype=bool))
            assert ens.y.shape == (0, M) and ens.S.shape == (0, 0, M)
        assert np.array_equal(ens.estimate, bare.estimate) and np.array_equal(ens.estimate_P, bare.estimate_P)


@pytest.mark.parametrize("contender", STEP_COUNTERS, ids=lambda each: each.name)
def test_what_counts_steps_takes_one_measurement_a_run_and_prediction(contender):
    x0, zs, _, _ = scenario(2)
    ens, whole, first = contender.ensemble(x0), contender.ensemble(x0), np.arange(M) < 2
    for z in zs[:60]:
        ens.predict()
        whole.predict()
        ens.update(z, mask=first)
        x, P = ens.estimate.copy(), ens.estimate_P.copy()
        with pytest.raises(RuntimeError, match="predict"):
            ens.update(z)
        assert np.array_equal(ens.estimate, x) and np.array_equal(ens.estimate_P, P)
        ens.update(z, mask=~first)
        whole.update(z)
    np.testing.assert_allclose(ens.estimate, whole.estimate, atol=1e-8)


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_one_measurement_may_serve_all_runs_and_the_nees_is_that_of_each(contender):
    x0, zs, _, _ = scenario(3)
    ens, each = contender.ensemble(x0), contender.ensemble(x0)
    singles = [contender.single(x0[:, r]) for r in range(M)]
    for z in zs[:60]:
        for kf in (ens, each, *singles):
            kf.predict()
        ens.update(z[:, :1])
        each.update(np.repeat(z[:, :1], M, axis=1))
        for kf in singles:
            kf.update(z[:, 0])
    assert np.array_equal(ens.estimate, each.estimate) and not ens.failed.any()
    truth = np.array([300.0, 5.0, 300.0, 5.0])
    assert all(isinstance(kf, OneTarget) for kf in singles)
    np.testing.assert_allclose(ens.nees(truth), [kf.nees(truth) for kf in singles], rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"mask": [1, 0, 1, 1]}, "mask"),
        ({"mask": np.ones(3, dtype=bool)}, "mask"),
        ({"z": np.zeros((3, M))}, "z"),
        ({"z": np.zeros(2)}, "z"),
        ({"z": np.full((2, M), np.nan), "mask": np.arange(M) < 2}, "z"),
        ({"R": np.eye(3)}, "R"),
        ({"R": -np.eye(2)}, "R"),
        ({"R": np.zeros((2, 2, M - 1))}, "R"),
        ({"R": -np.ones((2, 2, M)), "mask": np.arange(M) < 2}, "R"),
    ],
)
@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_a_refused_call_changes_nothing(contender, arguments, word):
    x0, zs, masks, _ = scenario(4)
    ens = contender.ensemble(x0)
    for z, mask in zip(zs[:30], masks, strict=False):
        ens.predict()
        ens.update(z, mask=mask)
    ens.predict()
    before = ens.__dict__.copy()
    with pytest.raises(ValueError, match=word):
        ens.update(**{"z": zs[30]} | arguments)
    assert ens.__dict__.keys() == before.keys() and all(ens.__dict__[name] is before[name] for name in before)


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_nothing_that_a_caller_holds_is_changed_in_place(contender):
    """Neither the ensemble's arrays of an earlier step nor the measurement, whose buffer may be filled anew."""
    x0, zs, masks, _ = scenario(5)
    ens, other, buffer, held = contender.ensemble(x0), contender.ensemble(x0), np.empty((2, M)), []
    for k, (z, mask) in enumerate(zip(zs[:120], masks, strict=False)):
        buffer[:] = z
        for each, given in ((ens, buffer), (other, z)):
            each.predict()
            each.update(given, mask=mask if k % 2 else None)
        buffer[:] = 1e6
        held.append([(array, array.copy()) for array in (ens.estimate, ens.estimate_P, ens.x, ens.P, ens.y, ens.S)])
        assert np.array_equal(ens.estimate, other.estimate)
    for array, then in (pair for step in held for pair in step):
        np.testing.assert_array_equal(array, then)


def test_a_chain_moves_with_every_prediction_in_every_run():
    ens = switching.EnsembleIMM(c.MODEL, c.ACCELERATING, target.R, target.T, scenario(6)[0], target.P0)
    for _ in range(20):
        ens.predict()
    assert ens.mu == pytest.approx(np.repeat([[0.6768], [0.3232]], M, axis=1), abs=1e-3)

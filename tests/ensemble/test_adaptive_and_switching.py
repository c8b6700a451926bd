"""Each ensemble of a filter for manoeuvring targets is that filter, run by run, over the whole of Table 1."""

from unittest.mock import patch

import numpy as np
import pytest

from trackhelpers import fused
from trackhelpers.consistency import nees
from trackhelpers.ensemble import adaptive, switching
from trackhelpers.ensemble.adaptive import EnsembleStrongTrackingKF
from trackhelpers.ensemble.many_matrix_filters import EnsembleMatrixKF
from trackhelpers.filters import MatrixKF, StrongTrackingKF
from trackhelpers.scenarios.augmented_bias import contenders as c
from trackhelpers.scenarios.augmented_bias import target

M = 3
RNGS = [np.random.default_rng(child) for child in np.random.SeedSequence(5).spawn(M)]
X0, Z = target.simulate(RNGS, target.truth())
Z = Z[:, :700]  # to the first manoeuvre and out of it again
CONTENDERS = [
    c.plain(),
    c.augmented(),
    c.accelerating(c.CORRELATED, "Singer"),
    c.strong_tracking(4.0),
    c.strong_tracking(1.0),
    c.strong_tracking(1.0, "per axis", rho=0.8),
    c.variance_inflation(),
    c.variance_inflation(window=10, probability=0.9, inflation=20.0),
    c.input_estimation(),
    c.input_estimation(window=6, probability=0.99),
    c.variable_dimension(),
    c.variable_dimension(c.CORRELATED, window=8, enter=0.9, leave=0.5),
    c.interacting(),
    c.interacting(c.CORRELATED, stay=(0.9, 0.95)),
]
IDS = [f"{i}-{each.name}" for i, each in enumerate(CONTENDERS)]


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_an_ensemble_is_the_filter_of_its_name_in_every_run(contender):
    L, found = getattr(contender, "to_estimate", None), contender.followed(X0, Z)
    for r in (0, M - 1):
        kf, xs, Ps = contender.single(X0[:, r]), [], []
        for z in Z[:, :, r].T:
            kf.predict()
            kf.update(z)
            xs.append(kf.estimate if L is None else L @ kf.x)
            Ps.append(kf.estimate_P if L is None else L @ kf.P @ L.T)
        np.testing.assert_allclose(found.x[..., r], np.transpose(xs), atol=1e-9, rtol=1e-13)  # positions reach 1e5 m
        np.testing.assert_allclose(np.broadcast_to(found.P, (4, 4, len(xs), M))[..., r], np.moveaxis(Ps, 0, -1), atol=1e-8)


def test_the_augmented_filter_as_matrices_is_the_filterpy_subclass():
    linear, kf = c.augmented(), c.augmented_kf(X0[:, 0])
    for z, x in zip(Z[:, :, 0].T, linear.estimates(X0, Z)[..., 0].T, strict=True):
        kf.predict()
        kf.update(z)
        np.testing.assert_allclose(x, kf.estimate, atol=1e-9, rtol=1e-13)


def test_a_run_that_breaks_down_is_named_and_leaves_its_neighbours_bit_for_bit():
    clean, spoilt = (EnsembleStrongTrackingKF(c.F, c.H, c.Q, target.R, X0, target.P0) for _ in range(2))
    spoilt.P[0, 0, 1] = -500.0
    for k in range(30):
        for ens in (clean, spoilt):
            ens.predict()
            ens.update(Z[:, k])
    assert np.array_equal(np.flatnonzero(spoilt.failed), [1]) and not clean.failed.any()
    assert np.array_equal(spoilt.x[:, [0, 2]], clean.x[:, [0, 2]])


def test_the_plain_ensemble_is_the_plain_filter():
    ens, kf = EnsembleMatrixKF(c.F, c.H, c.Q, target.R, X0, target.P0), MatrixKF(c.F, c.H, c.Q, target.R, X0[:, 2], target.P0)
    for k in range(50):
        ens.predict()
        ens.update(Z[:, k])
        kf.predict()
        kf.update(Z[:, k, 2])
    np.testing.assert_allclose(ens.x[:, 2], kf.x, atol=1e-10)
    np.testing.assert_allclose(ens.P[..., 2], kf.P, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"x0": np.zeros(4)}, "x0"),
        ({"x0": np.full((4, 2), np.nan)}, "x0"),
        ({"Q": -np.eye(4)}, "Q"),
        ({"H": np.eye(3)}, "H"),
        ({"P0": np.ones((4, 4, 3))}, "P0"),
    ],
)
def test_bad_arguments_are_named(change, name):
    arguments = {"F": c.F, "H": c.H, "Q": c.Q, "R": target.R, "x0": X0, "P0": target.P0} | change
    with pytest.raises(ValueError, match=name):
        EnsembleMatrixKF(**arguments)


@pytest.mark.parametrize("contender", CONTENDERS[3::2], ids=lambda each: each.name)
def test_a_bad_measurement_is_named(contender):
    ens = contender.ensemble(X0)
    ens.predict()
    for z in (np.zeros((2, M + 1)), np.zeros((3, M))):
        with pytest.raises(ValueError, match="z"):
            ens.update(z)


def make(name, **more):
    """An ensemble by its class's name, with sound arguments but for those given."""
    matrices = {"F": c.F, "H": c.H, "Q": c.Q, "R": target.R, "x0": X0, "P0": target.P0}
    pair = {"quiet": c.MODEL, "manoeuvring": c.ACCELERATING, "R": target.R, "dt": 1.0, "x0": X0, "P0": target.P0}
    sound = {"EnsembleInputEstimationKF": matrices | {"G": c.GAMMA}}.get(
        name, pair if name in ("EnsembleVariableDimensionKF", "EnsembleIMM") else matrices
    )
    module = switching if name in ("EnsembleVariableDimensionKF", "EnsembleIMM") else adaptive
    return getattr(module, name)(**sound | more)


@pytest.mark.parametrize(
    ("name", "bad", "word"),
    [
        ("EnsembleStrongTrackingKF", {"rho": -1}, "rho"),
        ("EnsembleStrongTrackingKF", {"beta": np.nan}, "beta"),
        ("EnsembleStrongTrackingKF", {"factors": "two"}, "factors"),
        ("EnsembleStrongTrackingKF", {"factors": "per axis", "H": np.ones((2, 4))}, "factors"),
        ("EnsembleStrongTrackingKF", {"F": np.full((4, 4), np.nan)}, "F"),
        ("EnsembleVarianceInflationKF", {"inflation": -5}, "inflation"),
        ("EnsembleVarianceInflationKF", {"window": 0}, "window"),
        ("EnsembleInputEstimationKF", {"probability": 2}, "probability"),
        ("EnsembleInputEstimationKF", {"G": np.full((4, 2), np.nan)}, "G"),
        ("EnsembleInputEstimationKF", {"window": 0}, "window"),
        ("EnsembleVariableDimensionKF", {"leave": 2}, "leave"),
        ("EnsembleVariableDimensionKF", {"enter": 2}, "probability"),
        ("EnsembleVariableDimensionKF", {"dt": 0}, "dt"),
        ("EnsembleVariableDimensionKF", {"manoeuvring": c.MODEL}, "manoeuvring"),
        ("EnsembleVariableDimensionKF", {"x0": np.full((4, 3), np.nan)}, "x0"),
        ("EnsembleIMM", {"stay": (1.5, 0.9)}, "stay"),
        ("EnsembleIMM", {"mu": (5, -1)}, "mu"),
        ("EnsembleIMM", {"x0": np.full((4, 3), np.inf)}, "x0"),
        ("EnsembleIMM", {"R": np.eye(3)}, "R"),
    ],
)
def test_bad_settings_are_named(name, bad, word):
    with pytest.raises(ValueError, match=word):
        make(name, **bad)


@pytest.mark.parametrize("name", ["EnsembleInputEstimationKF", "EnsembleVariableDimensionKF"])
def test_a_second_measurement_in_a_step_and_a_nan_are_refused(name):
    ens = make(name)
    with pytest.raises(RuntimeError, match="predict"):
        ens.update(Z[:, 0])
    ens.predict()
    with pytest.raises(ValueError, match="z"):
        ens.update(np.full((2, M), np.nan))
    ens.update(Z[:, 0])
    with pytest.raises(RuntimeError, match="predict"):
        ens.update(Z[:, 0])


def test_two_measurements_at_one_instant_correct_twice_as_in_the_single_filter():
    ens, kf = make("EnsembleStrongTrackingKF", beta=1.0), StrongTrackingKF(c.F, c.H, c.Q, target.R, X0[:, 1], target.P0, beta=1.0)
    for k in range(30):
        ens.predict()
        kf.predict()
        for z in (Z[:, k], Z[:, k] + 0.5):
            ens.update(z)
            kf.update(z[:, 1])
    np.testing.assert_allclose(ens.P[..., 1], kf.P, atol=1e-10)
    np.testing.assert_allclose(ens.x[:, 1], kf.x, atol=1e-9)


def test_interacting_models_agree_with_the_single_filter_after_a_jump():
    ens, kf = make("EnsembleIMM"), c.interacting().single(X0[:, 0])
    for k in range(12):
        z = Z[:, k] + (200.0 if k == 8 else 0.0)
        ens.predict()
        ens.update(z)
        kf.predict()
        kf.update(z[:, 0])
        np.testing.assert_allclose(ens.mu[:, 0], kf.mu, atol=1e-9)
        np.testing.assert_allclose(ens.estimate[:, 0], kf.estimate, atol=1e-8)


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_the_compiled_step_is_numpys(contender):
    compiled = contender.followed(X0, Z)
    with patch.object(fused, "binding", None):
        plain = contender.followed(X0, Z)
    for ours, theirs in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("contender", CONTENDERS, ids=IDS)
def test_what_is_judged_step_by_step_is_what_the_whole_history_says(contender):
    truth = Z[:, :, 0].repeat(2, axis=0)
    x, P, by_step = contender.followed(X0, Z)
    judged = contender.judged(X0, Z, truth)
    np.testing.assert_array_equal(judged.x, x)
    np.testing.assert_allclose(judged.nis, by_step, rtol=1e-12)
    if contender.honest:
        np.testing.assert_allclose(judged.nees, nees(truth[..., None], x, P), rtol=1e-9)
    else:
        assert judged.nees is None

"""Interacting models with headings over M runs: run by run the single filter, with runs that miss a scan."""

import numpy as np
import pytest

from trackhelpers.ensemble import EnsembleEKF, EnsembleUKF
from trackhelpers.ensemble.motion_imm import EnsembleMotionIMM, mixed
from trackhelpers.filters import MotionEKF, MotionIMM, MotionUKF
from trackhelpers.motion import CTRA, CTRV
from trackhelpers.sensors import Lidar, Radar

QUIET, LIVELY, M = CTRV(0.3, 0.05), CTRV(2.0, 0.5), 3
CHAIN, MU = np.array([[0.9, 0.1], [0.3, 0.7]]), [0.8, 0.2]
X0 = np.array([30.0, 1.0, 5.0, 3.1, 0.1])[:, None] + 0.1 * np.random.default_rng(0).standard_normal((5, M))
P0 = np.diag([0.2, 0.3, 0.5, 0.05, 0.02])
R = np.array([[0.04, 0.01], [0.01, 0.09]])


def make(kind=EnsembleEKF, **change):
    arguments = {"filters": [kind(model, X0, P0) for model in (QUIET, LIVELY)], "mu0": MU, "transition": CHAIN} | change
    return EnsembleMotionIMM(**arguments)


@pytest.mark.parametrize(("many", "one"), [(EnsembleEKF, MotionEKF), (EnsembleUKF, MotionUKF)])
def test_each_run_is_the_single_filter_that_is_fed_with_None(many, one):
    ens, rng = make(many), np.random.default_rng(1)
    singles = [MotionIMM([one(model, X0[:, m], P0) for model in (QUIET, LIVELY)], MU, CHAIN) for m in range(M)]
    assert np.array_equal(ens.mu, np.repeat(np.array(MU)[:, None], M, axis=1)) and ens.y.shape == (0, M) and ens.S.shape == (0, 0, M)
    np.testing.assert_allclose(ens.x, X0, atol=1e-12)
    assert ens.model is ens.filters[0].model is QUIET
    for k, (sensor, mask, noise) in enumerate(
        [
            (Lidar(), None, None),
            (Radar(), np.arange(M) != 1, None),
            (Lidar(), None, R),
            (Radar(), np.arange(M) == 1, None),
            (Radar(), None, None),
        ]
    ):
        z = sensor.h(QUIET.f(X0, 0.3 * (k + 1))) + 0.3 * rng.standard_normal((sensor.m, M))
        for each in (ens, *singles):
            each.predict(0.3)
        for m, imm in enumerate(singles):
            np.testing.assert_allclose(ens.mu[:, m], imm.mu, atol=1e-10)
            np.testing.assert_allclose(ens.P[..., m], imm.P, atol=1e-9)
        ens.update(z, sensor, mask=mask, R=noise)
        for m, imm in enumerate(singles):
            measured = mask is None or mask[m]
            imm.update(z[:, m] if measured else None, sensor, R=noise)
            np.testing.assert_allclose(ens.mu[:, m], imm.mu, atol=1e-9)
            np.testing.assert_allclose(ens.estimate[:, m], imm.x, atol=1e-8)
            np.testing.assert_allclose(ens.estimate_P[..., m], imm.P, atol=1e-8)
            assert measured or np.isnan(ens.y[:, m]).all()
    assert np.abs(ens.mu[0] - ens.mu[0, 0]).max() > 1e-3
    mu, x = ens.mu, ens.x
    ens.update(None)
    assert ens.y.shape == (0, M) and ens.S.shape == (0, 0, M) and np.array_equal(ens.mu, mu) and np.array_equal(ens.x, x)


def test_innovations_are_moments_of_the_mixture_and_bearings_are_mixed_the_short_way():
    ens, radar = make(), Radar()
    ens.predict(0.5)
    ahead = ens.mu
    ens.update(radar.h(X0) + np.array([1.0, 0.1, 0.5])[:, None], radar)
    y, S = mixed(ahead, [(kf.y, kf.S) for kf in ens.filters], (1,))
    np.testing.assert_allclose(ens.y, y, atol=1e-12)
    np.testing.assert_allclose(ens.S, S, atol=1e-12)
    apart = [kf.y - y for kf in ens.filters]
    for m in range(M):
        by_hand = sum(ahead[i, m] * (kf.S[..., m] + np.outer(apart[i][:, m], apart[i][:, m])) for i, kf in enumerate(ens.filters))
        np.testing.assert_allclose(S[..., m], by_hand, atol=1e-10)
    x, P = mixed(
        np.array([[0.5], [0.5]]), [(np.array([[3.1], [0.0]]), np.zeros((2, 2, 1))), (np.array([[-3.1], [2.0]]), np.zeros((2, 2, 1)))], (0,)
    )
    assert abs(abs(x[0, 0]) - np.pi) < 1e-12 and x[1, 0] == 1.0
    half = np.pi - 3.1
    np.testing.assert_allclose(P[..., 0], [[half**2, half], [half, 1.0]], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"filters": [QUIET, LIVELY]}, "filters: expected ensembles"),
        ({"filters": [MotionEKF(model, X0[:, 0], P0) for model in (QUIET, LIVELY)]}, "filters: expected ensembles"),
        ({"filters": 3}, "filters: expected two or more"),
        ({"filters": [EnsembleEKF(QUIET, X0, P0)]}, "filters: expected two or more"),
        ({"filters": [EnsembleEKF(QUIET, X0, P0), EnsembleEKF(LIVELY, X0[:, :2], P0)]}, "filters: expected two or more"),
        (
            {"filters": [EnsembleEKF(QUIET, X0, P0), EnsembleEKF(CTRA(1.0, 0.1), np.zeros((6, M)), np.eye(6))]},
            "filters: expected two or more",
        ),
        ({"mu0": [0.5, 0.6]}, "mu0"),
        ({"mu0": [1.0]}, "mu0"),
        ({"transition": CHAIN.T}, "transition"),
        ({"transition": [[1.1, -0.1], [0.5, 0.5]]}, "transition"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        make(**change)


@pytest.mark.parametrize("call", [lambda e: e.predict(-1.0), lambda e: e.update(np.zeros((2, M)), Lidar(), R=-np.eye(2))])
def test_a_refused_call_leaves_every_filter_as_it_was(call):
    ens = make()
    ens.predict(0.1)
    before = [ens.__dict__.copy(), *(kf.__dict__.copy() for kf in ens.filters)]
    with pytest.raises(ValueError):
        call(ens)
    for each, then in zip((ens, *ens.filters), before, strict=True):
        assert each.__dict__.keys() == then.keys() and all(each.__dict__[name] is then[name] for name in then)


def test_an_update_that_fails_in_the_second_filter_leaves_the_first():
    ens = make()
    ens.filters[1].model = CTRA(1.0, 0.1)
    x = ens.filters[0].x
    with pytest.raises(ValueError, match="sensor"):
        ens.update(np.zeros((2, M)), Lidar())
    assert ens.filters[0].x is x and ens.y.shape == (0, M)
    with pytest.raises(ValueError):
        ens.predict(0.1)
    assert ens.filters[0].x is x


def test_a_model_that_nobody_comes_to_does_no_harm():
    ens = make(mu0=[1.0, 0.0], transition=np.eye(2))
    ens.predict(0.2)
    alone = EnsembleEKF(QUIET, X0, P0)
    alone.predict(0.2)
    np.testing.assert_allclose(ens.filters[0].x, alone.x, atol=1e-12)
    np.testing.assert_allclose(ens.filters[0].P, alone.P, atol=1e-12)
    assert np.array_equal(ens.mu, np.repeat([[1.0], [0.0]], M, axis=1))

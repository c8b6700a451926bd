"""The strong tracking filter: plain where it should be, strong where it should be, and what its one factor does to the other axis."""

import numpy as np
import pytest

from trackhelpers.filters import MatrixKF, StrongTrackingKF
from trackhelpers.filters.strong_tracking import axes_seen, fading_factor
from trackhelpers.motion import CV

MODEL = CV(0.1)
F, Q = MODEL.F(np.zeros(4), 1.0), MODEL.Q(np.zeros(4), 1.0)
H, R, X0, P0 = np.eye(4)[[0, 2]], 3.0 * np.eye(2), np.array([0.0, 5.0, 0.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0])


def data(a=0.0, steps=200, seed=0):
    """Measured positions (steps, 2); x accelerates by `a` from step 50 on."""
    t = np.arange(1.0, steps + 1)
    track = np.stack([5 * t + 0.5 * a * np.maximum(t - 50, 0) ** 2, 5 * t], axis=1)
    return track + np.sqrt(3) * np.random.default_rng(seed).standard_normal((steps, 2))


def run(kf, zs):
    rows = []
    for z in zs:
        kf.predict()
        kf.update(z)
        rows.append((kf.x.copy(), kf.P.copy(), kf.K.copy(), np.copy(getattr(kf, "fading", 1.0))))
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("factors", ["one", "per axis"])
def test_a_factor_of_one_is_the_plain_filter_bit_for_bit(factors):
    strong = run(StrongTrackingKF(F, H, Q, R, X0, P0, beta=1e9, factors=factors), data(2.0))
    plain = run(MatrixKF(F, H, Q, R, X0, P0), data(2.0))
    assert np.all(strong[3] == 1)
    for a, b in zip(strong[:3], plain[:3], strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("factors", ["one", "per axis"])
def test_the_factor_follows_its_definition(factors):
    """With a scan missed now and then, and a noise of its own in every other call."""
    kf = StrongTrackingKF(F, H, Q, R, X0, P0, beta=1.0, rho=0.9, factors=factors)
    V, largest = None, 1.0
    for k, z in enumerate(data(2.0, 80)):
        moved = F @ kf.P @ F.T
        kf.predict()
        if k % 5 == 3:
            kf.update(None)
            continue
        gamma, own = z - H @ kf.x, R * (1 + k % 2)
        V = np.outer(gamma, gamma) if V is None else (0.9 * V + np.outer(gamma, gamma)) / 1.9
        N, M = np.diag(V - H @ Q @ H.T - own), np.diag(H @ moved @ H.T)
        expected = np.maximum(1.0, N / M) if factors == "per axis" else max(1.0, N.sum() / M.sum())
        D = np.diag(np.sqrt(np.repeat(expected, 4 // np.size(expected))))
        kf.update(z, R=own if k % 2 else None)
        np.testing.assert_allclose(kf.fading, expected, rtol=1e-12)
        np.testing.assert_allclose(kf.P_prior, D @ moved @ D + Q, rtol=1e-12)
        largest = max(largest, np.max(kf.fading))
    assert largest > 1


def test_one_factor_carries_the_manoeuvre_in_x_into_y_and_several_do_not():
    for factors, same in (("one", False), ("per axis", True)):
        quiet, busy = (run(StrongTrackingKF(F, H, Q, R, X0, P0, 1.0, factors=factors), data(a)) for a in (0.0, 2.0))
        assert np.array_equal(quiet[0][:, 2:], busy[0][:, 2:]) is same


def test_under_acceleration_the_lag_is_a_fraction_of_the_plain_filters():
    zs = data(2.0, 400)
    truth = 5 * 400 + 350.0**2
    lag = {kf.__class__: truth - run(kf, zs)[0][-1, 0] for kf in (StrongTrackingKF(F, H, Q, R, X0, P0), MatrixKF(F, H, Q, R, X0, P0))}
    assert abs(lag[StrongTrackingKF]) < 5 < 25 < lag[MatrixKF]


def test_exchanging_the_axes_exchanges_the_estimates():
    swap = [2, 3, 0, 1]
    for factors in ("one", "per axis"):
        a = run(StrongTrackingKF(F, H, Q, R, X0, P0, factors=factors), data(2.0))[0]
        b = run(StrongTrackingKF(F, H, Q, R, X0, P0, factors=factors), data(2.0)[:, ::-1])[0]
        np.testing.assert_allclose(a, b[:, swap], atol=1e-9)


def test_a_missing_measurement_leaves_the_prediction_and_V():
    kf = StrongTrackingKF(F, H, Q, R, X0, P0)
    kf.predict()
    kf.update([5.0, 5.0])
    V = kf.V.copy()
    kf.predict()
    x, P = kf.x.copy(), kf.P.copy()
    kf.update(None)
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P) and np.array_equal(kf.V, V) and kf.y.size == 0


def test_each_component_belongs_to_the_measurement_that_sees_it():
    assert axes_seen(F, H).tolist() == [0, 0, 1, 1]
    with pytest.raises(ValueError, match="per axis"):
        axes_seen(F, np.ones((2, 4)))
    with pytest.raises(ValueError, match="per axis"):
        axes_seen(np.eye(4), H)  # nobody sees the velocities
    assert fading_factor(3.0, 0.0) == 1 and fading_factor(-2.0, 1.0) == 1


BAD = [
    ({"rho": 0.0}, "rho"),
    ({"rho": 1.01}, "rho"),
    ({"rho": np.nan}, "rho"),
    ({"beta": -1.0}, "beta"),
    ({"factors": "two"}, "factors"),
    ({"F": np.eye(3)}, "F"),
    ({"H": np.eye(3)}, "H"),
    ({"Q": -np.eye(4)}, "Q"),
    ({"R": np.array([[1.0, 2.0], [0.0, 1.0]])}, "R"),
    ({"P0": np.eye(2)}, "P0"),
    ({"x0": np.full(4, np.nan)}, "x0"),
]


@pytest.mark.parametrize(("change", "name"), BAD)
def test_bad_arguments_are_named(change, name):
    arguments = {"F": F, "H": H, "Q": Q, "R": R, "x0": X0, "P0": P0} | change
    with pytest.raises(ValueError, match=name):
        StrongTrackingKF(**arguments)


@pytest.mark.parametrize("z", [[1.0], [1.0, np.nan], "two"])
def test_a_bad_measurement_leaves_the_filter_as_it_was(z):
    kf = StrongTrackingKF(F, H, Q, R, X0, P0)
    kf.predict()
    x, P = kf.x.copy(), kf.P.copy()
    with pytest.raises(ValueError, match="z"):
        kf.update(z)
    assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P) and kf.V is None

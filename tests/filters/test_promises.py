"""What every filter for manoeuvring targets promises: no older evidence after a missed scan, R for one call, refused calls that change nothing, and filterpy's methods only where they are right."""

from copy import deepcopy

import numpy as np
import pytest

from trackhelpers.consistency import nees
from trackhelpers.filters import (
    AugmentedBiasKF,
    InputEstimationKF,
    ManoeuvreIMM,
    MatrixKF,
    StrongTrackingKF,
    VariableDimensionKF,
    VarianceInflationKF,
)
from trackhelpers.motion import CA, CV

T = 1.0
REST, TURN = CV(0.1), CA(0.1)
F, Q, G = (getattr(REST, name)(np.zeros(4), T) for name in "FQG")
H, R, X0, P0 = np.eye(4)[[0, 2]], 3.0 * np.eye(2), np.array([0.0, 5.0, 0.0, 5.0]), np.diag([3.0, 1.0, 3.0, 1.0])


def make(name, F=F, Q=Q, R=R, P0=P0, models=(REST, TURN), **more):
    """A filter by its name; P0 = 0 with R = 0 and Q = 0 is asked for below."""
    matrices = {"F": F, "H": H, "Q": Q, "R": R, "x0": X0, "P0": P0}
    pair = {"quiet": models[0], "manoeuvring": models[1], "R": R, "dt": T, "x0": X0, "P0": P0}
    return {
        "plain": lambda: MatrixKF(**matrices),
        "bias": lambda: AugmentedBiasKF(**matrices, Q_bias=Q),
        "strong": lambda: StrongTrackingKF(**matrices, beta=1.0, **more),
        "strong per axis": lambda: StrongTrackingKF(**matrices, beta=1.0, factors="per axis", **more),
        "inflation": lambda: VarianceInflationKF(**matrices, **more),
        "input": lambda: InputEstimationKF(**matrices, G=G, **more),
        "variable dimension": lambda: VariableDimensionKF(**pair, **more),
        "interacting": lambda: ManoeuvreIMM(**pair, **more),
    }[name]()


NAMES = ["plain", "bias", "strong", "strong per axis", "inflation", "input", "variable dimension", "interacting"]
ADAPTIVE = NAMES[2:7]


def driven(kf, steps=40, begin=20):
    """After some steps of a target that accelerates from `begin` on, with a missed scan now and then."""
    rng = np.random.default_rng(1)
    for k in range(1, steps + 1):
        kf.predict()
        z = np.array([5 * k + max(k - begin, 0) ** 2, 5.0 * k]) + np.sqrt(3) * rng.standard_normal(2)
        kf.update(None if k % 7 == 3 else z)
    return kf


def state(kf):
    """All attributes, those of inner filters too, as far as they can be compared."""
    return {name: [state(each) for each in value] if name == "filters" else deepcopy(value) for name, value in kf.__dict__.items()}


def assert_same(a, b):
    assert type(a) is type(b)
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for name in a:
            assert_same(a[name], b[name])
    elif isinstance(a, (list, tuple)):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            assert_same(one, other)
    else:
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("name", NAMES)
def test_after_a_missed_scan_no_older_evidence_is_left_and_the_filter_can_be_printed(name):
    kf = make(name)
    assert "x = " in str(kf)
    driven(kf)
    kf.predict()
    assert "x = " in str(kf)
    x, P = kf.x.copy(), kf.P.copy()
    for _ in range(3):
        kf.update(None)
        assert np.array_equal(kf.x, x) and np.array_equal(kf.P, P)
        assert kf.z is None and kf.y.size == 0 and kf.S.size == 0
        assert kf.log_likelihood == 0 and kf.mahalanobis == 0 and np.all(kf.likelihood == 1)
        assert "x = " in str(kf)


@pytest.mark.parametrize("name", NAMES)
def test_a_missed_scan_is_no_evidence(name):
    """A step with None is a bare prediction, for everything that comes after."""
    with_none, bare, rng = driven(make(name)), driven(make(name)), np.random.default_rng(0)
    for k in range(30):
        z = np.array([3000.0, 200.0]) + 5 * k + rng.standard_normal(2)
        for kf in (with_none, bare):
            kf.predict()
            if k % 3:
                kf.update(z)
        if k % 3 == 0:
            with_none.update(None)
        assert np.array_equal(with_none.x, bare.x) and np.array_equal(with_none.P, bare.P)


@pytest.mark.parametrize("name", NAMES)
def test_another_R_holds_for_one_call(name):
    own = np.array([[9.0, 2.0], [2.0, 5.0]])
    kf, other = driven(make(name)), driven(make(name))
    for k, given in enumerate((own, None, own, None)):
        z = np.array([40 + k + 400.0, 5 * (40 + k)])
        for each in (kf, other):
            each.predict()
        kf.update(z, R=given)
        for each in (other, *getattr(other, "filters", ())):
            each.R = R if given is None else own
        other.update(z, **({"R": own} if name == "interacting" and given is not None else {}))
        np.testing.assert_allclose(kf.x, other.x, rtol=1e-13)
        np.testing.assert_allclose(kf.P, other.P, rtol=1e-13)
        np.testing.assert_allclose(kf.S, other.S, rtol=1e-13)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("z", "noise", "word"),
    [
        ([1.0], None, "z"),
        ([1.0, np.nan], None, "z"),
        ("two", None, "z"),
        ([500.0, 200.0], -np.eye(2), "R"),
        ([500.0, 200.0], np.eye(3), "R"),
        ([500.0, 200.0], [[1.0, 2.0], [0.0, 1.0]], "R"),
    ],
)
def test_a_refused_measurement_changes_nothing(name, z, noise, word):
    kf = driven(make(name))
    kf.predict()
    before = state(kf)
    with pytest.raises(ValueError, match=word):
        kf.update(z, R=noise)
    assert_same(state(kf), before)


def certain(name):
    """A filter whose prediction is certain: P = 0 and no noise at all; nothing of the IMM's acceleration either."""
    kf = make(name, Q=np.zeros((4, 4)), R=np.zeros((2, 2)), P0=np.zeros((4, 4)), models=(CV(0.0), CA(0.0)))
    kf.predict()
    return kf


@pytest.mark.parametrize("name", NAMES)
def test_a_measurement_that_cannot_be_weighed_is_refused_by_name_and_changes_nothing(name):
    kf = certain(name)
    before = state(kf)
    with pytest.raises(ValueError, match=r"S: expected a positive definite innovation covariance.*nothing can be weighed"):
        kf.update([5.0, 5.0])
    assert_same(state(kf), before)
    kf.update([5.0, 5.0], R=R)
    np.testing.assert_allclose(kf.estimate, F @ X0)


@pytest.mark.parametrize("name", ["plain", "strong", "inflation"])
def test_a_singular_S_is_refused_whatever_the_units(name):
    """Two measured components that are one, up to rounding, and two whose variances are 1e20 apart but that are independent."""
    for scale in (1e-6, 1.0, 1e6):
        a = scale * np.array([0.1, 0.3])
        kf = make(name, Q=np.zeros((4, 4)), R=np.outer(a, a), P0=np.zeros((4, 4)))
        kf.predict()
        with pytest.raises(ValueError, match="S: expected"):
            kf.update([5.0, 5.0])
    kf = make(name, R=np.diag([1e-10, 1e10]), Q=np.zeros((4, 4)), P0=np.zeros((4, 4)))
    kf.predict()
    kf.update([5.0, 5.0])


def test_an_imm_whose_second_filter_refuses_leaves_the_first_as_it_was():
    imm = driven(make("interacting"))
    imm.predict()
    imm.filters[1].H = np.zeros((3, 6))
    before = state(imm)
    with pytest.raises(ValueError):
        imm.update([500.0, 200.0])
    assert_same(state(imm), before)


@pytest.mark.parametrize("name", ADAPTIVE)
@pytest.mark.parametrize(
    "method", ["rts_smoother", "batch_filter", "get_update", "get_prediction", "update_sequential", "update_steadystate"]
)
def test_filterpys_methods_that_would_go_past_the_adaptation_refuse_by_name(name, method):
    kf = driven(make(name))
    before = state(kf)
    with pytest.raises(NotImplementedError, match=rf"{type(kf).__name__}\.{method}: .*use "):
        getattr(kf, method)([1.0, 2.0])
    assert_same(state(kf), before)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_filterpys_fading_memory_is_refused(name):
    kf = make(name)
    assert kf.alpha == 1
    with pytest.raises(NotImplementedError, match="alpha"):
        kf.alpha = 1.02


@pytest.mark.parametrize("name", ["plain", "bias"])
@pytest.mark.parametrize("method", ["batch_filter", "update_sequential", "update_correlated", "predict_steadystate", "log_likelihood_of"])
def test_filterpys_methods_that_break_on_vectors_or_after_a_missed_scan_refuse_by_name(name, method):
    with pytest.raises(NotImplementedError, match=method):
        getattr(driven(make(name)), method)([1.0, 2.0])


def test_what_is_right_on_constant_matrices_stays():
    kf = driven(make("plain"))
    (x, P), z = kf.get_prediction(), np.array([500.0, 200.0])
    kf.predict()
    assert np.array_equal(x, kf.x) and np.array_equal(P, kf.P)
    np.testing.assert_array_equal(kf.residual_of(z), z - H @ x)
    x, P = kf.get_update(z)
    kf.update(z)
    np.testing.assert_allclose(kf.x, x)
    np.testing.assert_allclose(kf.P, P)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("steps", [19, 30])
def test_the_nees_is_that_of_the_estimate(name, steps):
    kf, truth = driven(make(name), steps), np.array([100.0, 5.0, 95.0, 5.0])
    assert kf.estimate.shape == (4,) and kf.estimate_P.shape == (4, 4)
    assert kf.nees(truth) == pytest.approx(nees(truth, kf.estimate, kf.estimate_P))
    assert kf.nees(kf.estimate) == 0


@pytest.mark.parametrize("name", NAMES)
def test_the_measurement_can_be_reused_as_a_buffer(name):
    """What a filter remembers is its own copy."""
    kf, other, buffer, rng = make(name), make(name), np.empty(2), np.random.default_rng(2)
    for k in range(1, 60):
        z = np.array([5 * k + max(k - 20, 0) ** 2, 5.0 * k]) + rng.standard_normal(2)
        buffer[:] = z
        for each, given in ((kf, buffer), (other, z)):
            each.predict()
            each.update(given)
        buffer[:] = 1e6
        assert np.array_equal(kf.x, other.x)

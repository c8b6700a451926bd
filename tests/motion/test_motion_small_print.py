"""What models of motion declare, refuse and share: defaults, names, noise of every kind, and the same step where it is compiled."""

import mpmath
import numpy as np
import pytest

from trackhelpers import fused
from trackhelpers.motion import CA, CCA, CSAA, CSAV, CTRA, CTRV, CV, LinearModel, PolarCA, PolarCV, Singer, turn_integrals
from trackhelpers.motion.arc import integrate_along_arc, turned_moments, unit
from trackhelpers.motion.base import MotionModel, pair

L = 2.7
PLANAR = [PolarCV, PolarCA, CTRV, CTRA, CCA, lambda *s, **k: CSAV(L, *s, **k), lambda *s, **k: CSAA(L, *s, **k)]
NAMES = ["PolarCV", "PolarCA", "CTRV", "CTRA", "CCA", "CSAV", "CSAA"]
every_planar = pytest.mark.parametrize("make", PLANAR, ids=NAMES)


# --- declarations


@pytest.mark.parametrize(
    ("model", "state", "angles", "white", "backwards", "linear"),
    [
        (CV(), "x vx y vy", (), (1, 3), (), True),
        (CA(axes=1), "x vx ax", (), (2,), (), True),
        (Singer(axes=3), "x vx ax y vy ay z vz az", (), (2, 5, 8), (), True),
        (PolarCV(), "x y θ v", (2,), (3, 2), (3,), False),
        (PolarCA(), "x y θ v a", (2,), (4, 2), (3, 4), False),
        (CTRV(), "x y v θ ω", (3,), (2, 4), (2,), False),
        (CTRA(), "x y v θ ω a", (3,), (5, 4), (2, 5), False),
        (CSAV(L), "x y v θ Φ", (3, 4), (2, 4), (2, 4), False),
        (CSAA(L), "x y v θ Φ a", (3, 4), (5, 4), (2, 4, 5), False),
        (CCA(), "x y v θ c a", (3,), (5, 4), (2, 4, 5), False),
    ],
)
def test_a_model_declares_its_state(model, state, angles, white, backwards, linear):
    assert (model.state, model.angles, model.white, model.backwards, model.linear) == (
        tuple(state.split()),
        angles,
        white,
        backwards,
        linear,
    )
    assert model.noise == ("continuous" if isinstance(model, Singer) else "straight") and model.n == len(model.state)


def test_what_is_not_named_is_no_noise_in_two_axes():
    for make in (CV, CA, *PLANAR):
        assert set(make().sigmas) == {0.0} and len(make().sigmas) == 2
    assert Singer().sigmas == (1.0, 1.0) and Singer().tau == 20.0 and CV().axes == CA().axes == Singer().axes == 2


def test_a_model_introduces_itself():
    assert repr(CV(1.5, axes=1)) == "CV(state=(x, vx), sigmas=(1.5,), noise='straight')"
    assert repr(CTRV(Q=np.eye(5), noise="exact")) == "CTRV(state=(x, y, v, θ, ω), Q=constant, noise='exact')"


@pytest.mark.parametrize("axes", [0, 4, True, 1.0, "2", np.timedelta64(2)])
@pytest.mark.parametrize("make", [CV, CA, Singer])
def test_axes_are_one_to_three(make, axes):
    with pytest.raises(ValueError, match=r"^axes: expected 1, 2 or 3, got"):
        make(axes=axes)


@pytest.mark.parametrize("sigma", [(1.0, 2.0, 3.0), [1.0, 2.0, 3.0], np.array([1.0, 2.0, 3.0])])
def test_a_deviation_of_each_axis_or_of_all(sigma):
    assert CV(sigma, axes=3).sigmas == (1.0, 2.0, 3.0) and CV(np.float64(2.0), axes=np.int64(3)).sigmas == (2.0, 2.0, 2.0)
    for make, name in ((CV, "sigma_a"), (CA, "sigma_da"), (Singer, "sigma_m")):
        with pytest.raises(ValueError, match=f"^{name}: expected one number or 2, one an axis, got 3"):
            make(sigma)
        with pytest.raises(ValueError, match=f"^{name}: expected a finite number ≥ 0"):
            make(-1.0)


@pytest.mark.parametrize("make", [lambda w: CSAV(w), lambda w: CSAA(w)])
def test_a_wheelbase_is_a_length(make):
    assert make(0.5).wheelbase == 0.5
    for wrong, words in ((0, "a length > 0 m, got 0"), (-1.0, "a finite number ≥ 0")):
        with pytest.raises(ValueError, match=f"^wheelbase: expected {words}"):
            make(wrong)


# --- noise


def along(model, x, dt, count=2000):
    """∫ Φ diag(σ²) Φᵀ by the midpoint rule."""
    total = np.zeros((model.n, model.n))
    for t in (np.arange(count) + 0.5) * dt / count:
        F = model.F(model.f(x, t), dt - t)
        total += dt / count * sum(s**2 * np.outer(F[:, d], F[:, d]) for s, d in zip(model.sigmas, model.white, strict=True))
    return total


X = np.array([3.0, -2.0, 2.0, 0.7, 0.5, 0.3])


@every_planar
@pytest.mark.parametrize("noise", ["straight", "exact", "continuous"])
def test_a_step_is_f_F_and_Q_for_one_target_and_for_runs(make, noise):
    model = make(1.5, 0.4, noise=noise)
    x = X[: model.n]
    f, F, Q = model.step(x, 0.3)
    for got, wanted in ((f, model.f(x, 0.3)), (F, model.F(x, 0.3)), (Q, model.Q(x, 0.3))):
        np.testing.assert_allclose(got, wanted, atol=1e-14)
    if noise == "continuous":
        np.testing.assert_allclose(Q, along(model, x, 0.3, 200), atol=1e-5)
        with pytest.raises(NotImplementedError, match=r"the input of .* is white in time, so that no G multiplies it; use Q"):
            model.G(x, 0.3)
    else:
        G = model.G(x, 0.3)
        assert G.shape == (model.n, 2)
        np.testing.assert_allclose(Q, G @ np.diag([1.5**2, 0.4**2]) @ G.T, atol=1e-14)
    runs = np.stack([x, 2 * x, -x], axis=1)
    for got, name in zip(model.step(runs, 0.3), "fFQ", strict=True):
        for r in range(3):
            np.testing.assert_allclose(got[..., r], getattr(model, name)(runs[:, r], 0.3), atol=1e-13)


@every_planar
@pytest.mark.parametrize("noise", ["straight", "exact", "continuous"])
def test_a_constant_noise_is_the_noise_of_every_step(make, noise):
    Q = np.diag(np.arange(1.0, 7.0)) + 0.5
    n = make().n
    model = make(Q=Q[:n, :n], noise=noise)
    for x in (X[:n], np.stack([X[:n]] * 2, axis=1)):
        assert np.array_equal(model.step(x, 0.3)[2].reshape(n, n, -1)[..., 0], Q[:n, :n])
        assert np.array_equal(model.Q(x, 2.0).reshape(n, n, -1)[..., -1], Q[:n, :n])


def test_continuous_noise_of_a_linear_model_follows_the_step():
    model = CA([1.0, 2.0], noise="continuous")
    for dt in (0.5, 0.25, 0.5, 0.0, 2.0):
        axis = np.array([[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]])
        np.testing.assert_allclose(model.Q(np.zeros(6), dt), np.kron(np.diag([1.0, 4.0]), axis), rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(model.step(np.zeros(6), dt)[2], model.Q(np.zeros(6), dt), atol=1e-15)


@every_planar
def test_continuous_noise_of_any_trailing_axes_is_that_of_each(make):
    model = make(1.5, 0.4, noise="continuous")
    x = np.random.default_rng(1).standard_normal((model.n, 2, 3, 2))
    whole = model.Q(x, 0.4)
    assert whole.shape == (model.n, model.n, 2, 3, 2)
    for place in ((0, 0, 0), (1, 2, 0), (0, 1, 1)):
        np.testing.assert_allclose(whole[(..., *place)], model.Q(x[(..., *place)], 0.4), atol=1e-13)
        np.testing.assert_allclose(model.Q(x[..., 1], 0.4), whole[..., 1], atol=1e-13)


@pytest.mark.parametrize("make", [CTRV, PolarCV])  # of one rule for all
def test_continuous_noise_written_out_in_symbols_is_that_of_numbers(make):
    pytest.importorskip("llvmlite")
    model = make(1.5, 0.4, noise="continuous")
    x = np.random.default_rng(2).standard_normal((model.n, 9))
    _, Q = fused.predict(model, x, np.zeros((model.n, model.n, 9)), 0.4)
    np.testing.assert_allclose(Q, model.Q(x, 0.4), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("make", [CV, CA])
def test_held_inputs_of_a_linear_model_have_no_arc(make):
    one, other = make(1.5), make(1.5, noise="exact")
    np.testing.assert_array_equal(one.G(np.zeros(one.n), 0.4), other.G(np.zeros(one.n), 0.4))
    np.testing.assert_array_equal(one.step(np.zeros(one.n), 0.4)[2], other.Q(np.zeros(one.n), 0.4))
    with pytest.raises(ValueError, match=r"^noise: expected one of"):
        make(noise="white")


class Falling(MotionModel):
    """A height whose speed is pushed, with a noise of its own."""

    state, white = ("z", "vz"), (1,)

    def _f(self, x, dt, parts):
        return x[0] + dt * x[1], x[1]

    def _Q(self, x, dt, parts):
        return {(1, 1): 7.0 * dt}


class Pushed(Falling):
    _Q = MotionModel._Q

    def _G(self, x, dt, parts):
        return {(1, 0): dt}


def test_a_noise_that_a_subclass_writes_goes_before_and_an_arc_that_it_lacks_is_named():
    for noise in ("straight", "exact", "continuous"):
        model = Falling([("s", 1.0)], noise)
        assert model.Q(np.zeros(2), 0.5).tolist() == model.step(np.zeros(2), 0.5)[2].tolist() == [[0, 0], [0, 3.5]]
    assert Pushed([("s", 2.0)]).Q(np.zeros(2), 0.5).tolist() == [[0, 0], [0, 1.0]]
    with pytest.raises(NotImplementedError, match="Pushed lacks the hook _G_exact"):
        Pushed([("s", 1.0)], "exact").G(np.zeros(2), 0.5)
    np.testing.assert_allclose(Pushed([("s", 2.0)], "continuous").Q(np.zeros(2), 0.5)[1], [4 * 0.125, 2.0], rtol=1e-8)


# --- the same step compiled


COMPILED = [*((make, "straight") for make in PLANAR), *((make, "exact") for make in PLANAR[:4])]  # an integral by quadrature is not traced


@pytest.mark.parametrize(("make", "noise"), COMPILED, ids=[*NAMES, *(f"{name}-exact" for name in NAMES[:4])])
def test_a_compiled_step_is_that_of_the_hooks(make, noise):
    """Straight ahead, hardly turning, on both sides of where a series ends, and round and round."""
    pytest.importorskip("llvmlite")
    model, rng = make(1.5, 0.4, noise=noise), np.random.default_rng(0)
    turns = np.array([0.0, 1e-9, -1e-3, 0.9, 1.1, -1.9, 2.1, 30.0])
    x = rng.standard_normal((model.n, len(turns)))
    if model.n > 4 and model.state[4] != "a":
        x[2], x[4] = 2.0, turns if model.state[4] != "Φ" else np.arctan(L * turns / 2)
    A = rng.standard_normal((model.n, model.n, len(turns)))
    P = np.einsum("ikm,jkm->ijm", A, A)
    for dt in (0.0, 1.0):
        got = fused.predict(model, x, P, dt)
        F, Q = model.F(x, dt), model.Q(x, dt)
        np.testing.assert_allclose(got[0], model.normalise(model.f(x, dt)), atol=1e-12)
        np.testing.assert_allclose(got[1], np.einsum("ijm,jkm,lkm->ilm", F, P, F) + Q, rtol=1e-10, atol=1e-9)


# --- arcs


def exact_integrals(phi, order):
    with mpmath.workdps(40):
        phi = mpmath.mpf(phi)
        return [complex(mpmath.quad(lambda u, n=n: u**n * mpmath.exp(1j * phi * u), mpmath.linspace(0, 1, 9))) for n in range(order + 1)]


PHIS = np.array([0.0, 1e-8, -0.3, 0.7, 0.99, 1.01, -1.5, 2.5, 6.0, -12.0])


@pytest.fixture(scope="module")
def exact():
    return np.array([exact_integrals(phi, 3) for phi in PHIS]).T


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_integrals_of_numbers_and_arrays_of_any_shape_are_one(order, exact):
    for phi in (PHIS, PHIS.reshape(2, 5), PHIS[:4], PHIS[5:]):  # also such that all are small, or none is
        found = turn_integrals(phi, order)
        start = 5 if phi is not PHIS and phi.shape == (5,) else 0
        assert len(found) == order + 1 and all(e.shape == phi.shape for e in found)
        np.testing.assert_allclose(np.array([e.ravel() for e in found]), exact[: order + 1, start : start + phi.size], rtol=0, atol=2e-15)
    for phi, values in zip(PHIS.tolist(), exact.T, strict=True):
        np.testing.assert_allclose(turn_integrals(phi, order), values[: order + 1], rtol=0, atol=2e-15)
    assert (
        turn_integrals(1, order)[0].shape == ()
        and np.isnan(turn_integrals(np.inf, order)[0])
        and np.isnan(turn_integrals(np.array([np.nan, 1.0]), order)[0][0])
    )


@pytest.mark.parametrize("order", [-1, 4, 1.0, True, None])
def test_orders_are_nought_to_three(order):
    with pytest.raises(ValueError, match=r"^order: expected 0, 1, 2 or 3, got"):
        turn_integrals(0.1, order)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_moments_of_the_direction_are_integrals_of_one_number_as_of_many(order):
    heading, rate, dt = 0.4, -0.9, 1.7
    exact = [complex(mpmath.quad(lambda t, n=n: t**n * mpmath.exp(1j * (heading + rate * t)), [0, dt])) for n in range(order + 1)]
    for h, r in ((heading, rate), (np.array([heading]), np.array([rate]))):
        u, moments = turned_moments(h, r, dt, order)
        np.testing.assert_allclose(np.ravel(u), np.exp(1j * heading), atol=1e-15)
        np.testing.assert_allclose(np.ravel(moments), exact, atol=1e-14)
    assert unit(0.3) == pytest.approx(np.exp(0.3j)) and pair(2, 3 + 4j) == {(0, 2): 3.0, (1, 2): 4.0}


def test_integrals_along_an_arc_are_of_smooth_functions():
    assert integrate_along_arc(lambda t: np.exp(1j * t), 2.0) == pytest.approx((np.exp(2j) - 1) / 1j, abs=1e-14)
    found = integrate_along_arc(lambda t: t[:, None] ** 3 * np.array([1.0, 2.0]), 2.0)
    np.testing.assert_allclose(found, [4.0, 8.0], rtol=1e-14)


# --- one motion, two names


@every_planar
def test_a_state_is_folded_to_the_nearer_name_of_each_run(make):
    model = make()
    heading, speed = model.angles[0], model.backwards[0]
    x = np.zeros(model.n)
    x[list(model.backwards)], x[heading] = [2.0, 0.1, 0.2][: len(model.backwards)], 0.5
    back = x.copy()
    back[list(model.backwards)] *= -1
    back[heading] = 0.5 - np.pi
    np.testing.assert_allclose(model.fold(back), x, atol=1e-14)
    np.testing.assert_allclose(model.fold(x), x, atol=1e-14)
    near = np.stack([x, back, x + 0.3, back - 0.3], axis=1)
    for start in (x, x[:, None], np.repeat(x[:, None], 4, axis=1)):
        folded = model.fold(start, near=near) if start.ndim > 1 else np.stack([model.fold(start, near=n) for n in near.T], axis=1)
        np.testing.assert_allclose(folded, np.stack([x, back, x, back], axis=1), atol=1e-14)
    still = x.copy()
    still[speed] = 0.0
    assert model.fold(still)[heading] == 0.5  # at rest nothing is turned
    given = back.copy()
    model.fold(back)
    assert np.array_equal(back, given)
    for wrong in (
        {"x": np.zeros(model.n + 1)},
        {"x": x, "near": np.zeros(3)},
        {"x": np.zeros((model.n, 2)), "near": np.zeros((model.n, 3))},
    ):
        with pytest.raises(ValueError, match=r"^x|^near"):
            model.fold(**wrong)


def test_a_model_without_a_heading_gives_the_state_back():
    x = np.arange(4.0)
    folded = CV().fold(x)
    assert np.array_equal(folded, x) and folded is not x


# --- given matrices, and Singer's


def test_a_given_model_has_one_step():
    F, Q = np.array([[1.0, 0.5], [-0.1, 0.9]]), np.array([[2.0, 0.3], [0.3, 1.0]])
    model = LinearModel(F, Q, 0.5, ("p", "q"), angles=(1,))
    x = np.array([[1.0, 2.0], [3.0, -1.0]])
    assert model.linear and model.angles == (1,) and model.dt == 0.5 and LinearModel(F, Q, 0.5, "pq").angles == ()
    for dt in (0.5, 0.5 * (1 + 5e-13), 0.5 * (1 - 5e-13)):
        np.testing.assert_allclose(model.f(x, dt), F @ x)
        np.testing.assert_array_equal(model.F(x[:, 0], dt), F)
        np.testing.assert_array_equal(model.Q(x[:, 0], dt), Q)
    for dt in (0.5 * (1 + 2e-12), 0.5 * (1 - 2e-12), 1.0, 0.0, 5.0):
        for call in (model.f, model.F, model.Q, model.step, model.linearised):
            with pytest.raises(ValueError, match=r"^dt: expected 0\.5 s, for which the matrices were given, got"):
                call(x, dt)
    with pytest.raises(ValueError, match=r"^dt: expected a step > 0 s, got 0"):
        LinearModel(F, Q, 0, "pq")
    with pytest.raises(ValueError, match=r"^angles: expected indices from 0 to 1"):
        LinearModel(F, Q, 0.5, "pq", angles=(2,))
    with pytest.raises(ValueError, match=r"^state: expected"):
        LinearModel(F, Q, 0.5, "pp")


@pytest.mark.parametrize("ratio", [1e-3, 0.1, 1.9, 2.1, 3.9, 30.0, 127.0, 129.0, 255.0, 257.0, 700.0])
def test_two_steps_of_singer_are_one_of_their_sum_from_short_to_very_long(ratio):
    model, tau = Singer(1.3, 0.7, axes=1), 0.7
    x, dt = np.array([1.0, 2.0, 3.0]), ratio * tau
    F, Q = model.F(x, dt), model.Q(x, dt)
    np.testing.assert_allclose(model.F(x, 2 * dt), F @ F, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(model.Q(x, 2 * dt), F @ Q @ F.T + Q, rtol=1e-10)
    np.testing.assert_allclose(model.f(x, dt), F @ x, rtol=1e-12)


@pytest.mark.parametrize("u", [0.0, 1e-9, 0.3, 0.4999, 0.5, 0.5001, 2.0, 800.0])
def test_singers_response_is_exact_on_both_sides_of_where_its_series_ends(u):
    tau = 2.0
    F = Singer(1.0, tau, axes=1).F(np.zeros(3), u * tau)
    with mpmath.workdps(40):
        m, decay = mpmath.mpf(u), mpmath.exp(-mpmath.mpf(u))
        expected = [[1, u * tau, tau**2 * (decay - 1 + m)], [0, 1, tau * (1 - decay)], [0, 0, decay]]
        expected = np.array([[float(value) for value in row] for row in expected])
    np.testing.assert_allclose(F, expected, rtol=1e-13, atol=1e-300)


@pytest.mark.parametrize("tau", [0, -1.0, np.nan])
def test_a_correlation_time_is_longer_than_nothing(tau):
    with pytest.raises(ValueError, match=r"^tau: expected"):
        Singer(1.0, tau)

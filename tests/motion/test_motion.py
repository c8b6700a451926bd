import mpmath
import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise, Q_discrete_white_noise
from scipy.integrate import solve_ivp

from trackhelpers.angles import cos_sin
from trackhelpers.motion import CA, CCA, CSAA, CSAV, CTRA, CTRV, CV, PolarCA, PolarCV, turn_integrals

L = 2.7
MODELS = [
    CV(1.0),
    CV([1.0, 2.0, 3.0], axes=3),
    CA(1.0),
    CA(0.5, axes=1),
    CTRV(2.0, 0.3),
    CTRA(1.0, 0.3),
    CSAV(L, 1.0, 0.1),
    CCA(1.0, 0.1),
    CSAA(L, 1.0, 0.1),
    PolarCV(1.0, 0.1),
    PolarCA(1.0, 0.1),
]
identify = [f"{type(m).__name__}-{m.n}" for m in MODELS]


def rates(model):
    """dx/dt of a model as its differential equation, inputs u in the order of its sigmas; written apart from trackhelpers."""
    name = type(model).__name__

    def cartesian(t, x, u):
        k = model.n // model.axes
        dx = np.zeros(model.n)
        for axis in range(model.axes):
            dx[axis * k : axis * k + k - 1] = x[axis * k + 1 : axis * k + k]
        return dx

    def planar(t, x, u):
        if name.startswith("Polar"):
            heading, v = x[2], x[3]
            tail = [u[1], u[0]] if name == "PolarCV" else [u[1], x[4], u[0]]
            return np.array([v * np.cos(heading), v * np.sin(heading), *tail])
        v, heading = x[2], x[3]
        turn = {"CTRV": x[4], "CTRA": x[4], "CCA": x[4] * v}.get(name, np.tan(x[4]) / L * v)
        tail = [u[0], turn, u[1]] if model.n == 5 else [x[5], turn, u[1], u[0]]
        return np.array([v * np.cos(heading), v * np.sin(heading), *tail])

    return cartesian if model.linear else planar


def integrated(model, x, dt, u=(0.0, 0.0)):
    solution = solve_ivp(rates(model), (0, dt), x, args=(u,), rtol=1e-12, atol=1e-13)
    return solution.y[:, -1]


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_f_solves_the_differential_equation(model):
    rng = np.random.default_rng(0)
    for _ in range(20):
        x, dt = rng.normal(size=model.n), rng.uniform(0, 1.5)
        np.testing.assert_allclose(model.f(x, dt), integrated(model, x, dt), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_F_is_the_derivative_of_f(model):
    rng = np.random.default_rng(1)
    h = 1e-6
    for scale in (1.0, 1e-3, 0.0):  # 0: straight ahead
        x, dt = rng.normal(size=model.n), rng.uniform(0.1, 1.5)
        if not model.linear:
            x[4:5] *= scale
        difference = np.stack([(model.f(x + h * e, dt) - model.f(x - h * e, dt)) / (2 * h) for e in np.eye(model.n)], axis=1)
        np.testing.assert_allclose(model.F(x, dt), difference, atol=2e-8 * max(1, np.abs(difference).max()))


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_any_trailing_axes_equal_one_target_at_a_time(model):
    rng = np.random.default_rng(2)
    X, dt = rng.normal(size=(model.n, 3, 2)), 0.7
    for function in (model.f, model.F, model.Q, model.G):
        whole = function(X, dt)
        for i in range(3):
            for j in range(2):
                np.testing.assert_allclose(whole[..., i, j], function(X[:, i, j], dt), atol=1e-15)


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_linearised_entries_fill_up_to_F_and_Q(model):
    X, dt = np.random.default_rng(3).normal(size=(model.n, 4)), 0.7
    f, transition, noise = model.linearised(X, dt)
    np.testing.assert_array_equal(f, model.f(X, dt))
    F = np.repeat(np.eye(model.n)[..., None], 4, axis=2)
    Q = np.zeros((model.n, model.n, 4))
    for index, value in transition.items():
        F[index] = value
    for (i, j), value in noise.items():
        Q[i, j] = Q[j, i] = value
    np.testing.assert_allclose(F, model.F(X, dt), atol=1e-15)
    np.testing.assert_allclose(Q, model.Q(X, dt), atol=1e-15)


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_zero_time_changes_nothing(model):
    x = np.random.default_rng(4).normal(size=model.n)
    np.testing.assert_array_equal(model.f(x, 0), x)
    np.testing.assert_array_equal(model.F(x, 0), np.eye(model.n))


def curved(noise, **replace):
    models = [CTRV(2.0, 0.3, noise), CTRA(1.0, 0.3, noise), CSAV(L, 1.0, 0.1, noise), CCA(1.0, 0.1, noise), CSAA(L, 1.0, 0.1, noise)]
    return [*models, PolarCV(1.0, 0.1, noise), PolarCA(1.0, 0.1, noise)]


@pytest.mark.parametrize("model", curved("exact"), ids=lambda m: type(m).__name__)
def test_exact_gain_is_the_response_to_a_constant_input(model):
    rng = np.random.default_rng(5)
    h = 1e-5
    for _ in range(5):
        x, dt = rng.normal(size=model.n), rng.uniform(0.1, 1.0)
        response = [(integrated(model, x, dt, h * e) - integrated(model, x, dt, -h * e)) / (2 * h) for e in np.eye(2)]
        np.testing.assert_allclose(model.G(x, dt), np.stack(response, axis=1), atol=1e-6)


def test_ctrv_noise_is_that_of_the_thesis_with_its_squares():
    T, th, sa, sw = 0.1, 0.4, 2.0, 0.3
    G = np.array([[T**2 / 2 * np.cos(th), 0], [T**2 / 2 * np.sin(th), 0], [T, 0], [0, T**2 / 2], [0, T]])  # (3.13)
    np.testing.assert_allclose(CTRV(sa, sw).Q([1, 2, 5, th, 0.3], T), G @ np.diag([sa**2, sw**2]) @ G.T, atol=1e-18)


@pytest.mark.parametrize(("model", "dim"), [(CV(1.5, axes=2), 2), (CA(1.5, axes=2), 3)])
def test_cartesian_noise_is_filterpys(model, dim):
    np.testing.assert_allclose(model.Q(np.zeros(model.n), 0.3), Q_discrete_white_noise(dim, 0.3, 1.5**2, block_size=2), atol=1e-16)


def test_constant_Q_replaces_the_gain_and_broadcasts():
    Q = np.diag([1.0, 2, 3, 4, 5])
    model = CTRV(Q=Q)
    assert np.array_equal(model.Q(np.zeros((5, 7)), 0.1)[..., 3], Q)


@pytest.mark.parametrize("w", [0.0, 1e-300, 1e-16, -1e-12, 1e-8, 1e-4, -0.3, 2.0, 9.99, 10.01, -40.0])
def test_ctrv_is_exact_to_1e_14_at_any_turn_rate(w):
    mpmath.mp.dps = 50
    v, th, dt = 5.2, 0.7, 0.1
    step = CTRV().f([0, 0, v, th, w], dt)
    F = CTRV().F([0, 0, v, th, w], dt)

    def integral(n):
        return mpmath.quad(lambda t: t**n * mpmath.exp(1j * (mpmath.mpf(th) + mpmath.mpf(w) * t)), mpmath.linspace(0, mpmath.mpf(dt), 4))

    for got, exact in [
        (mpmath.mpc(*step[:2].tolist()), v * integral(0)),
        (mpmath.mpc(*F[:2, 2].tolist()), integral(0)),
        (mpmath.mpc(*F[:2, 4].tolist()), 1j * v * integral(1)),
    ]:
        assert abs(got - exact) <= 1e-14 * abs(exact)


def test_cosine_and_sine_by_the_half_angle_are_exact_to_the_last_places():
    angle = np.concatenate([np.linspace(-10, 10, 4001), [np.pi, -np.pi, np.pi / 2, 1e-300, 1e5, 1e10]])
    cos, sin = cos_sin(angle)
    np.testing.assert_allclose(cos, [float(mpmath.cos(a)) for a in angle.tolist()], rtol=0, atol=5e-16)
    np.testing.assert_allclose(sin, [float(mpmath.sin(a)) for a in angle.tolist()], rtol=2e-15, atol=0)
    assert (cos_sin(0.0), np.isnan(cos_sin(np.nan)).all()) == ((1, 0), True)


@pytest.mark.parametrize("phi", [0.0, 1e-9, 0.5, 0.999999, 1.000001, 3.0, 6.283, 50.0, -2.0])
def test_turn_integrals_are_the_integrals(phi):
    mpmath.mp.dps = 40
    parts = mpmath.linspace(0, 1, 3 + int(abs(phi)) // 3)  # half a turn each, or less
    for n, value in enumerate(turn_integrals(phi, 3)):
        exact = mpmath.quad(lambda u, n=n: u**n * mpmath.exp(1j * mpmath.mpf(phi) * u), parts)
        assert abs(mpmath.mpc(complex(value)) - exact) <= 1e-14 * abs(exact)


@pytest.mark.parametrize("dt", [0.05, 1.0])
def test_the_models_are_each_others_special_cases(dt):
    x, y, v, th, w, a = 1.0, 2.0, 5.0, 0.6, 0.3, 0.8
    ctrv = CTRV().f([x, y, v, th, w], dt)
    np.testing.assert_allclose(CTRA().f([x, y, v, th, w, 0], dt)[:5], ctrv, rtol=1e-14)
    np.testing.assert_allclose(CCA().f([x, y, v, th, w / v, 0], dt)[:4], ctrv[:4], rtol=1e-14)
    np.testing.assert_allclose(CSAV(L).f([x, y, v, th, np.arctan(L * w / v)], dt)[:4], ctrv[:4], rtol=1e-13)
    cca, csaa = CCA().f([x, y, v, th, 0.1, a], dt), CSAA(L).f([x, y, v, th, np.arctan(0.1 * L), a], dt)
    np.testing.assert_allclose(csaa[[0, 1, 2, 3, 5]], cca[[0, 1, 2, 3, 5]], rtol=1e-13)
    polar = PolarCA().f([x, y, th, v, a], dt)
    np.testing.assert_allclose(CTRA().f([x, y, v, th, 0, a], dt)[[0, 1, 3, 2, 5]], polar, rtol=1e-14)
    np.testing.assert_allclose(CTRV().f([x, y, v, th, 0], dt)[[0, 1, 3, 2]], PolarCV().f([x, y, th, v], dt), rtol=1e-14)
    vx, vy = v * np.cos(th), v * np.sin(th)
    np.testing.assert_allclose(CV().f([x, vx, y, vy], dt)[[0, 2]], PolarCV().f([x, y, th, v], dt)[:2], rtol=1e-14)


def test_names_and_angles_of_the_states():
    assert CTRV().state == ("x", "y", "v", "θ", "ω") and CTRV().angles == (3,)
    assert CA(axes=2).state == ("x", "vx", "ax", "y", "vy", "ay")
    assert CSAA(L).state == ("x", "y", "v", "θ", "Φ", "a")
    assert PolarCA().angles == (2,)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: CTRV().f(np.zeros(4), 0.1), "x"),
        (lambda: CTRV().f([0, 0, np.nan, 0, 0], 0.1), "x"),
        (lambda: CTRV().F(np.zeros(5), -0.1), "dt"),
        (lambda: CTRV().Q("here", 0.1), "x"),
        (lambda: CTRV(sigma_a=-1), "sigma_a"),
        (lambda: CTRV(sigma_w=np.nan), "sigma_w"),
        (lambda: CTRV(noise="arc"), "noise"),
        (lambda: CTRV(Q=np.eye(4)), "Q"),
        (lambda: CTRV(Q=np.eye(5) + np.eye(5, k=1)), "Q"),
        (lambda: CV(1.0, axes=4), "axes"),
        (lambda: CA([1.0, 2.0], axes=3), "sigma_da"),
        (lambda: CSAV(0.0), "wheelbase"),
        (lambda: CSAA("long"), "wheelbase"),
        (lambda: turn_integrals(0.1, 4), "order"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=name):
        call()


@pytest.mark.parametrize("model", MODELS, ids=identify)
def test_two_steps_are_one_of_their_length(model):
    x = np.random.default_rng(10).normal(size=(model.n, 6))
    np.testing.assert_allclose(model.f(model.f(x, 0.4), 0.9), model.f(x, 1.3), rtol=1e-10, atol=1e-10)
    F = model.F(x[:, 0], 1.3)
    np.testing.assert_allclose(model.F(model.f(x[:, 0], 0.4), 0.9) @ model.F(x[:, 0], 0.4), F, rtol=1e-8, atol=1e-8)


def mirrored(model, x):
    """The state seen in the x axis: y, the heading and its rate or the steering angle change their sign."""
    if model.linear:
        k = model.n // model.axes
        return np.concatenate([x[:k], -x[k : 2 * k], x[2 * k :]])
    kept = {"x", "v", "a"}
    return np.array([row if name in kept else -row for name, row in zip(model.state, x, strict=True)])


@pytest.mark.parametrize("model", [m for m in MODELS if m.n > 3], ids=lambda m: type(m).__name__)
def test_what_is_seen_in_a_mirror_moves_as_its_image(model):
    x = np.random.default_rng(11).normal(size=(model.n, 5))
    np.testing.assert_allclose(model.f(mirrored(model, x), 0.7), mirrored(model, model.f(x, 0.7)), rtol=1e-12, atol=1e-12)
    signs = np.outer(*2 * [mirrored(model, np.ones(model.n))])
    np.testing.assert_allclose(model.Q(mirrored(model, x[:, 0]), 0.7), signs * model.Q(x[:, 0], 0.7), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("model", MODELS[4:], ids=lambda m: type(m).__name__)
def test_a_turned_start_gives_the_turned_track(model):
    x, turn = np.random.default_rng(12).normal(size=model.n), 0.8
    heading = 3 if model.state[2] == "v" else 2
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def turned(state):
        state = np.array(state)
        state[:2], state[heading] = rotation @ state[:2], state[heading] + turn
        return state

    difference = model.f(turned(x), 0.7) - turned(model.f(x, 0.7))
    np.testing.assert_allclose((difference + np.pi) % (2 * np.pi) - np.pi, 0, atol=1e-12)


@pytest.mark.parametrize("noise", ["straight", "exact", "continuous"])
@pytest.mark.parametrize("make", [CV, CA, CTRV, CTRA, PolarCV, PolarCA, CCA, lambda **k: CSAV(L, **k), lambda **k: CSAA(L, **k)])
def test_no_noise_is_what_a_model_has_when_none_is_named(make, noise):
    model = make(noise=noise)
    assert not model.Q(np.full(model.n, 0.3), 0.7).any()


def test_white_noise_integrated_over_a_step_is_filterpys_and_does_not_depend_on_its_split():
    np.testing.assert_allclose(
        CV(1.5, axes=1, noise="continuous").Q(np.zeros(2), 0.6), Q_continuous_white_noise(2, 0.6, 1.5**2), rtol=1e-12
    )
    np.testing.assert_allclose(
        CA(1.5, axes=1, noise="continuous").Q(np.zeros(3), 0.6), Q_continuous_white_noise(3, 0.6, 1.5**2), rtol=1e-12
    )
    for model in (CV([1.0, 2.0], noise="continuous"), CA(0.5, noise="continuous")):
        x = np.zeros(model.n)
        F = model.F(x, 0.9)
        np.testing.assert_allclose(F @ model.Q(x, 0.4) @ F.T + model.Q(x, 0.9), model.Q(x, 1.3), rtol=1e-12)


@pytest.mark.parametrize("make", [CTRV, CTRA, PolarCV, PolarCA, CCA])
def test_white_noise_of_a_turning_target_is_summed_along_its_way(make):
    model, dt, count = make(1.5, 0.4, noise="continuous"), 0.6, 400
    x = np.array([3.0, -2.0, 2.0, 0.7, 0.5, 0.3])[: model.n]
    expected = np.zeros((model.n, model.n))
    for t in (np.arange(count) + 0.5) * dt / count:  # the midpoint rule
        transition = model.F(model.f(x, t), dt - t)
        for sigma, driven in zip(model.sigmas, model.white, strict=True):
            expected += sigma**2 * dt / count * np.outer(transition[:, driven], transition[:, driven])
    np.testing.assert_allclose(model.Q(x, dt), expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("phi", [-0.999, 0.9, 0.999])
def test_the_series_is_full_to_the_end_of_its_range(phi):
    values = turn_integrals(np.array([phi]), 3)
    for n in range(4):
        exact = mpmath.quad(lambda u, n=n: u**n * mpmath.exp(1j * phi * u), [0, 1])
        assert abs(values[n][0] - complex(exact)) < 2e-15


@pytest.mark.parametrize("model", [m for m in MODELS if not m.linear], ids=lambda m: type(m).__name__)
def test_a_motion_told_backwards_is_the_same_motion(model):
    x = np.random.default_rng(13).normal(size=(model.n, 8))
    speed, heading = model.state.index("v"), model.angles[0]
    folded = model.fold(x)
    assert (folded[speed] >= 0).all() and (np.abs(folded[heading]) <= np.pi).all()
    forwards = x[speed] >= 0
    np.testing.assert_allclose(folded[:, forwards], x[:, forwards], atol=1e-12)  # their headings lie within half a turn
    np.testing.assert_allclose(model.f(folded, 0.7)[:2], model.f(x, 0.7)[:2], atol=1e-12)
    near = model.fold(folded, near=x)
    np.testing.assert_allclose(near, x, atol=1e-12)
    np.testing.assert_allclose(model.fold(folded[:, 0], near=x[:, 0]), x[:, 0], atol=1e-12)


@pytest.mark.parametrize("make", [CTRV, CTRA, PolarCV, PolarCA, CCA, lambda *s, **k: CSAV(L, *s, **k), lambda *s, **k: CSAA(L, *s, **k)])
def test_the_straight_gain_is_the_exact_one_of_a_short_step(make):
    straight, exact, dt = make(1.0, 0.1), make(1.0, 0.1, noise="exact"), 1e-5
    x = np.array([3.0, -2.0, 2.0, 0.7, 0.5, 0.3])[: straight.n]
    G, expected = straight.G(x, dt), exact.G(x, dt)
    np.testing.assert_allclose(G[G != 0], expected[G != 0], rtol=1e-3)

"""Edges of what the rules of manoeuvre detection take, and their arithmetic written out on a few numbers."""

import numpy as np
import pytest

from trackhelpers import manoeuvre as m
from trackhelpers.manoeuvre_checks import check_innovations, check_probabilities, check_window
from trackhelpers.motion import CA, CTRV, CV, Singer


def tail(limit, alpha, terms=45):
    """P(Σ αʲ χ²₂ > limit): a sum of exponential variables with the different means 2 αʲ."""
    means = 2.0 * alpha ** np.arange(terms)
    shares = [np.prod([means[j] / (means[j] - other) for k, other in enumerate(means) if k != j]) for j in range(terms)]
    return float(np.sum(np.array(shares) * np.exp(-limit / means)))


@pytest.mark.parametrize("probability", [0.65, 0.7, 0.8, 0.9, 0.99, 0.999, 0.999999])
def test_a_limit_of_a_sum_of_exponentials_is_passed_as_often_as_promised(probability):
    """Also just above the mean, where the bracket of the root begins."""
    assert tail(m.fading_limit(2, 2, probability), 0.5) == pytest.approx(1 - probability, rel=0.05)


def test_a_limit_without_memory_is_the_chi_square_quantile():
    assert m.fading_limit(2, 1, 0.9) == pytest.approx(-2 * np.log(0.1))
    assert m.fading_limit(1, 1, 0.95) == pytest.approx(3.841458820694124)
    assert m.fading_limit(2, 1, 0.05) == pytest.approx(-2 * np.log(0.95))
    for bad, word in (((0, 2, 0.9), "dim"), ((2, 0, 0.9), "window"), ((2, 2, 1.0), "probability"), ((2, 2, 0.0), "probability")):
        with pytest.raises(ValueError, match=f"^{word}: expected"):
            m.fading_limit(*bad)
    with pytest.raises(ValueError, match=r"^probability: expected one above that of the sum's mean, 0\.6"):
        m.fading_limit(2, 2, 0.3)


def test_a_fading_sum_forgets_a_window_of_measurements():
    assert m.fading_sum(10.0, 3.0, 5) == 11.0 and m.fading_sum(10.0, 3.0, 1) == 3.0
    np.testing.assert_allclose(m.fading_sum([10.0, 20.0], [3.0, 0.0], 2), [8.0, 10.0])
    for bad, word in ((([1.0, 2.0], [1.0, 2.0, 3.0], 2), "total, nis"), ((1.0, 1.0, 0), "window"), (("a", 1.0, 2), "total")):
        with pytest.raises(ValueError, match=f"^{word}: expected"):
            m.fading_sum(*bad)


class Counting(m.OneAPrediction):
    pass


@pytest.mark.parametrize(("steps", "refused"), [(0, True), (1, False), (3, False), (np.array([1, 2]), False), (np.array([1, 0]), True)])
def test_a_measurement_wants_a_prediction_before_it_in_every_run(steps, refused):
    counting = Counting()
    assert counting._steps == 0
    counting._steps = steps
    if refused:
        with pytest.raises(RuntimeError, match=r"^update: expected one measurement after each predict\(\)"):
            counting._one_a_prediction()
    else:
        assert counting._one_a_prediction() is None


def test_rows_of_positions_and_axes_of_runs():
    assert m.position_rows(CA(axes=3)).tolist() == np.eye(9)[[0, 3, 6]].tolist() and m.position_rows(CV(axes=1)).tolist() == [[1, 0]]
    with pytest.raises(ValueError, match=r"^model: expected a model"):
        m.position_rows("CV")
    A, P = np.zeros((2, 3)), np.zeros((4, 4, 5))
    assert m.with_runs(A, P).shape == (2, 3, 1) and m.with_runs(A, P[..., 0]).shape == (2, 3) and m.with_runs(P, P).shape == P.shape
    assert m.with_runs(np.zeros(2), P).shape == (2, 1, 1)


# --- what is taken and what is not


@pytest.mark.parametrize("value", [1e-300, 0.5, 1.0, 1])
def test_forgetting_factors(value):
    assert m.check_forgetting(value) == value
    for wrong in (0, 0.0, 1 + 1e-12, 2, -0.5, np.nan):
        with pytest.raises(ValueError, match=r"^rho: expected a (forgetting factor in \(0, 1\]|finite number ≥ 0)"):
            m.check_forgetting(wrong)
    with pytest.raises(ValueError, match=r"^other: "):
        m.check_forgetting(2.0, "other")


@pytest.mark.parametrize("value", [1, 1.0, 100.0])
def test_inflation_factors(value):
    assert m.check_inflation(value) == value
    for wrong in (1 - 1e-12, 0, -2, np.inf):
        with pytest.raises(ValueError, match=r"^inflation: expected a f"):
            m.check_inflation(wrong)


def test_windows_and_steps():
    assert check_window(1) == 1 and check_window(np.int64(7), "dim", 7) == 7 and m.check_step(1e-9) == 1e-9
    with pytest.raises(ValueError, match=r"^dim: expected a whole number ≥ 7, got 6"):
        check_window(6, "dim", 7)
    with pytest.raises(ValueError, match=r"^window: expected a whole number ≥ 1, got 0"):
        check_window(0)


@pytest.mark.parametrize("pair", [(CV(), CA()), (CV(axes=1), CA(axes=1)), (CV(axes=3), Singer(axes=3))])
def test_pairs_of_models(pair):
    assert m.check_pair(*pair) is None


@pytest.mark.parametrize(
    ("pair", "word"),
    [
        ((CV(), CV()), "quiet, manoeuvring"),
        ((CA(), CA()), "quiet, manoeuvring"),
        ((CV(axes=1), CA()), "quiet, manoeuvring"),
        ((CV(), CA(axes=3)), "quiet, manoeuvring"),
        ((CTRV(), CTRV()), "quiet, manoeuvring"),
        ((CV(), CTRV()), "quiet, manoeuvring"),
        (("CV", CA()), "quiet"),
        ((CV(), "CA"), "manoeuvring"),
    ],
)
def test_other_pairs_are_refused(pair, word):
    with pytest.raises(ValueError, match=f"^{word}: expected"):
        m.check_pair(*pair)


@pytest.mark.parametrize(
    ("stay", "mu", "words"),
    [
        ((0.0, 0.5), (0.5, 0.5), "stay: expected two probabilities between 0 and 1"),
        ((0.5, 1.0), (0.5, 0.5), "stay: expected two probabilities"),
        ((0.5, -0.1), (0.5, 0.5), "stay: expected two probabilities"),
        ((0.5, 0.5), (0.0, 1.0), "mu: expected two probabilities"),
        ((0.5, 0.5), (0.5, 0.5 + 2e-9), "mu: expected probabilities that sum to 1"),
        ((0.5, 0.5), (0.5, 0.5 - 2e-9), "mu: expected probabilities that sum to 1"),
        ((0.5, 0.5, 0.5), (0.5, 0.5), "stay: expected shape"),
        ((0.5, 0.5), ((0.5, 0.5),) * 2, "mu: expected shape"),
    ],
)
def test_chains_that_are_none(stay, mu, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        m.check_switching(stay, mu)


def test_chains():
    chain, mu = m.check_switching([0.9, 0.6], [0.25, 0.75 + 5e-10])
    np.testing.assert_allclose(chain, [[0.9, 0.1], [0.4, 0.6]])
    assert mu[0] == 0.25


def test_probabilities_sum_to_one_along_the_last_axis():
    p = np.array([[0.0, 1.0], [0.25, 0.75 + 5e-10]])
    found = check_probabilities(p, "p", (2, 2))
    assert np.array_equal(found, p) and found is not p and check_probabilities([0.2, 0.8], "p", (2,)).tolist() == [0.2, 0.8]
    for wrong in (
        p.T,
        [[1.1, -0.1], [0.5, 0.5]],
        [[np.nan, 1.0], [0.5, 0.5]],
        [[0.5, 0.5 + 2e-9], [0.5, 0.5]],
        [[0.5, 0.5 - 2e-9], [0.5, 0.5]],
        [[0, 0], [0.5, 0.5]],
    ):
        with pytest.raises(ValueError, match=r"^p: expected probabilities that sum to 1"):
            check_probabilities(wrong, "p", (2, 2))
    for wrong in ([0.5, 0.5], np.full((2, 3), 1 / 3), np.full((3, 2), 0.5)):
        with pytest.raises(ValueError, match=r"^p: expected shape"):
            check_probabilities(wrong, "p", (2, 2))


F, G, H = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[0.5], [1.0]]), np.array([[1.0, 0.0]])


@pytest.mark.parametrize("wrong", [G[:, 0], np.zeros((2, 0)), np.ones((3, 1)), np.full((2, 1), np.inf), G[..., None]])
def test_inputs_that_are_none(wrong):
    with pytest.raises(ValueError, match=r"^G: expected finite numbers of shape \(2, q\), one column an input, got shape"):
        m.check_input(F, wrong, H, 3)


def test_inputs_that_are_seen_soon_enough():
    for gain, least in ((G, 1), ([[0.0], [1.0]], 2), (np.eye(2), 2)):
        found, window = m.check_input(F, gain, H, least)
        assert np.array_equal(found, gain) and found is not gain and window == least
        if least > 1:
            with pytest.raises(
                ValueError, match=rf"^window: expected enough steps to see {np.shape(gain)[1]} inputs in 1 measured components, got 1"
            ):
                m.check_input(F, gain, H, least - 1)
    with pytest.raises(ValueError, match=r"^window: expected a whole number"):
        m.check_input(F, G, H, 0)


SOUND = {"y": [np.ones(1)] * 2, "S": [np.eye(1)] * 2, "K": [np.ones((2, 1))] * 2, "steps": [1, 2], "F": F, "G": G, "H": H}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"y": np.ones((2, 1))}, "y, S, K, steps: expected sequences"),
        ({"y": [np.ones(1)]}, "y, S, K, steps: expected sequences"),
        ({"steps": [1, 1, 1]}, "y, S, K, steps: expected sequences"),
        ({"y": [], "S": [], "K": [], "steps": []}, "y, S, K, steps: expected sequences"),
        ({"G": G[:, 0]}, r"G: expected finite numbers of shape \(n, q\)"),
        ({"G": np.zeros((2, 0))}, "G: expected finite numbers"),
        ({"G": np.full((2, 1), np.nan)}, "G: expected finite numbers"),
        ({"F": np.eye(3)}, "F: expected shape"),
        ({"H": np.ones((1, 3))}, "H: expected shape"),
        ({"y": [np.ones(1), np.ones(2)]}, r"y\[1\]: expected shape"),
        ({"S": [np.eye(1), np.eye(2)]}, r"S\[1\]: expected shape"),
        ({"S": [np.eye(1), np.ones((1, 2))]}, r"S\[1\], K\[1\]: expected shapes \(1, 1, \.\.\.\) and \(2, 1, \.\.\.\)"),
        ({"K": [np.ones((2, 2)), np.ones((2, 1))]}, r"S\[0\], K\[0\]: expected shapes"),
        ({"K": [np.ones((2, 1, 3)), np.ones((2, 1))]}, r"S\[0\], K\[0\]: expected shapes"),
        ({"S": [np.ones((1, 1, 3)), np.eye(1)]}, r"S\[0\], K\[0\]: expected shapes"),
        ({"K": [np.ones((3, 1)), np.ones((2, 1))]}, r"K\[0\]: expected shape"),
        ({"steps": [1, 0]}, r"steps\[1\]: expected whole numbers ≥ 1, got 0"),
        ({"steps": [1.0, 1]}, r"steps\[0\]: expected whole numbers"),
        ({"steps": [True, 1]}, r"steps\[0\]: expected whole numbers"),
        ({"steps": [1, np.array([1, 1])]}, r"steps\[1\]: expected whole numbers"),
    ],
)
def test_innovations_that_do_not_fit_are_named(change, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        m.constant_input(**SOUND | change)


def test_innovations_that_fit():
    y, S, K, steps, *_ = check_innovations(**SOUND | {"steps": [np.array([1]), np.uint8(2)], "y": [[1], [2]]})
    assert y[1].dtype == float and len(S) == len(K) == len(steps) == 2
    runs = {"y": [np.ones((1, 3))], "S": [np.ones((1, 1, 3))], "K": [np.ones((2, 1, 3))]}
    for count in (np.array([1, 2, 1]), 2, np.array([2])):
        check_innovations(**SOUND | runs | {"steps": [count]})
    for count in (np.array([1, 2]), np.array([1, 0, 1])):
        with pytest.raises(ValueError, match=r"^steps\[0\]: expected whole numbers"):
            check_innovations(**SOUND | runs | {"steps": [count]})


def test_an_input_over_steps_of_several_lengths_by_hand():
    """b⁻ = F b + G for each step, b = (I − K H) b⁻ after a measurement; weighted least squares on H b⁻ u."""
    K, S, y = (
        [np.array([[0.6], [0.3]]), np.array([[0.5], [0.2]])],
        [np.array([[2.0]]), np.array([[3.0]])],
        [np.array([1.5]), np.array([4.0])],
    )
    b = F @ (F @ np.zeros((2, 1)) + G) + G  # two steps
    first = H @ b
    b = b - K[0] @ first
    b = F @ b + G
    second = H @ b
    b = b - K[1] @ second
    information = first.T @ first / 2 + second.T @ second / 3
    weighted = first.T @ y[0] / 2 + second.T @ y[1] / 3
    u, covariance, shift, significance = m.constant_input(y, S, K, [2, 1], F, G, H)
    np.testing.assert_allclose(u, weighted / information[0])
    np.testing.assert_allclose(covariance, 1 / information)
    np.testing.assert_allclose(shift, b)
    np.testing.assert_allclose(significance, weighted @ u)
    runs = [[np.repeat(a[..., None], 2, axis=-1) for a in part] for part in (y, S, K)]
    found = m.constant_input(*runs, [np.array([2, 1]), 1], F, G, H)
    alone = m.constant_input(y, S, K, [1, 1], F, G, H)
    for many, one, other in zip(found, (u, covariance, shift, significance), alone, strict=True):
        np.testing.assert_allclose(many[..., 0], one)
        np.testing.assert_allclose(many[..., 1], other)


def test_a_start_by_hand_with_correlated_errors():
    x, P, z, R, T = np.array([1.0, 2.0]), np.array([[4.0, 1.0], [1.0, 3.0]]), np.array([9.0]), np.array([[0.5]]), 2.0
    state, covariance = m.manoeuvre_start(x, P, z, R, T)
    a = 2 * (9.0 - 1.0 - 2.0 * T) / T**2
    np.testing.assert_allclose(state, [9.0, 2.0 + T * a, a])
    B, A = np.array([[0, 0], [-2 / T, -1], [-2 / T**2, -2 / T]]), np.array([[1], [2 / T], [2 / T**2]])
    np.testing.assert_allclose(covariance, B @ P @ B.T + A @ R @ A.T)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"dt": 0.0}, "dt: expected times > 0 s"),
        ({"dt": -1.0}, "dt: expected times > 0 s"),
        ({"dt": np.inf}, "dt: expected times > 0 s"),
        ({"dt": np.nan}, "dt: expected times > 0 s"),
        ({"dt": np.ones(2)}, r"dt: expected one time, or one a run, shape \(\), got \(2,\)"),
        ({"x": np.zeros(3)}, "x: expected shape"),
        ({"x": np.zeros((2, 3))}, "x: expected shape"),
        ({"P": np.eye(3)}, "P: expected shape"),
        ({"P": -np.eye(2)}, "P: expected a positive"),
        ({"R": np.eye(2)}, "R: expected shape"),
        ({"R": [[-1.0]]}, "R: expected a positive"),
    ],
)
def test_a_start_that_does_not_fit_is_named(change, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        m.manoeuvre_start(**{"x": np.zeros(2), "P": np.eye(2), "z": np.ones(1), "R": [[1.0]], "dt": 1.0} | change)

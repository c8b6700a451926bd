"""Section 4.1: the conditional distribution is exact, the variants are the filters they say they are, and one of them printed Table 3."""

import numpy as np
import pytest
from scipy import stats

from trackhelpers.ensemble import EnsembleKF
from trackhelpers.follow import follow
from trackhelpers.forensics import ca_search, ca_variants
from trackhelpers.forensics.ca_variants import family, respond
from trackhelpers.motion import CA
from trackhelpers.scenarios.thesis import ca_source
from trackhelpers.sensors import Position

Q = 0.25 * np.eye(3)
PRINTED = {"state": ["A"], "covariance": ["A P Aᵀ"], "quotients": [1.0], "gain": ["from P⁻"], "late": [0]}
TEXTBOOK = PRINTED | {"covariance": ["A (P Aᵀ)ᵀ"]}


def measurements(runs, seed=0):
    """Records (200, M) with the thesis's noise."""
    return ca_source.truth()[0][:, None] + ca_source.SIGMA * np.random.default_rng(seed).normal(size=(ca_source.STEPS, runs))


def filtered(z):
    """What the printed filter makes of z (N, M): estimates (N, 3, M), the start first."""
    model = CA(axes=1, Q=Q)
    kf = EnsembleKF(model, np.zeros((3, z.shape[1])), np.zeros((3, 3)))
    x = follow(kf, z[1:, None], Position(sigma=ca_source.SIGMA, state=model.state), ca_source.T).x
    return np.concatenate([np.zeros((1, 3, z.shape[1])), x.swapaxes(0, 1)])


@pytest.fixture(scope="module")
def z():
    return measurements(4)


@pytest.fixture(scope="module")
def textbook():
    """Measurements (200, 1) of the textbook's example: noise of twelve numbers each from its generator, started at 0."""
    r, noise = 0, np.zeros((200, 12))
    for i in np.ndindex(noise.shape):
        r = (2053 * r + 13849) % 65536
        noise[i] = r / 65536
    return (ca_source.truth()[0] + 0.5 * (noise.sum(axis=1) - 6))[:, None]


def test_textbook_s_noise_is_the_measured_column(textbook):
    printed = ca_search.table_3()
    np.testing.assert_allclose(textbook[printed.samples, 0], printed.measured, atol=printed.measured_rounding)


def test_textbook_s_routine_prints_every_filtered_cell_of_table_3_and_the_printed_filter_does_not(textbook):
    printed = ca_search.table_3()
    inside = {}
    for name, settings in (("textbook", TEXTBOOK), ("printed", PRINTED)):
        x = respond(family(**settings), textbook)[1][printed.samples[1:], :, 0, 0]
        inside[name] = np.abs(x - printed.filtered) <= printed.rounding * (1 + 1e-9)
    assert inside["textbook"].all()
    assert not inside["printed"][:, 1:].any()


def test_printed_rounding_is_half_a_unit_of_the_third_digit():
    printed = ca_search.table_3()
    assert printed.filtered[0].tolist() == [5.51, 0.0761, 0.00485]
    np.testing.assert_allclose(printed.rounding[0], [0.005, 0.00005, 0.000005])
    np.testing.assert_allclose(printed.rounding[-1], [0.05, 0.05, 0.005])


def test_family_s_printed_member_is_the_package_s_filter(z):
    prior, posterior = respond(family(**PRINTED), z)
    np.testing.assert_allclose(posterior[:, :, 0], filtered(z), atol=1e-9)
    np.testing.assert_allclose(prior[1:, :, 0], ca_variants.A @ filtered(z)[:-1], atol=1e-9)


def test_every_covariance_of_the_family_is_the_product_of_its_name(z):
    A, P = ca_variants.A, np.arange(9.0).reshape(3, 3)
    named = {
        "A P A": A @ P @ A,
        "Aᵀ P A": A.T @ P @ A,
        "Aᵀ P Aᵀ": A.T @ P @ A.T,
        "A (P Aᵀ)ᵀ": A @ (P @ A.T).T,
        "A P Aᵀ": A @ P @ A.T,
        "left out": P,
    }
    for name, wanted in named.items():
        left, transposed, right = ca_variants.COVARIANCE[name]
        np.testing.assert_allclose(left @ (P.T if transposed else P) @ right, wanted, atol=1e-12)


@pytest.mark.parametrize("covariance", ["A (P Aᵀ)ᵀ", "A P A"])
def test_gain_is_the_unsymmetric_recursion_s_first_column(covariance):
    left, transposed, right = ca_variants.COVARIANCE[covariance]
    K = ca_variants.gains(family(**PRINTED | {"covariance": [covariance], "quotients": [4.0], "gain": ["from P⁻", "from P"]}), 30)
    P, R, H = np.zeros((3, 3)), 0.0625, np.array([[1.0, 0, 0]])
    for k in range(1, 30):
        P = left @ (P.T if transposed else P) @ right + Q
        gain = P @ H.T / (H @ P @ H.T + R)
        P = (np.eye(3) - gain @ H) @ P
        np.testing.assert_allclose(K[k, :, 0], gain[:, 0], rtol=1e-9)
        np.testing.assert_allclose(K[k, :, 1], (P @ H.T / (H @ P @ H.T + R))[:, 0], rtol=1e-9)


def test_late_member_s_predictions_and_estimates_are_those_of_delayed_measurements(z):
    on_time, late = (respond(family(**PRINTED | {"late": [late]}), w)[1] for late, w in ((0, np.vstack([z[:1], z[:-1]])), (1, z)))
    np.testing.assert_allclose(late, on_time, atol=1e-12)


def test_open_loop_member_forgets_everything_but_the_last_measurement(z):
    variants = family(**PRINTED | {"state": ["prior (2.9)"]})
    prior, posterior = respond(variants, z)
    assert not prior.any()
    np.testing.assert_allclose(posterior[1:, 0, 0], ca_variants.gains(variants)[1:, 0] * z[1:], atol=1e-12)


def test_filter_without_velocity_lags_by_one_minus_k_over_k_samples():
    variants = family(**PRINTED | {"state": ["left out"], "quotients": [0.25, 1.0, 4.0]})
    ramp = np.arange(400.0)[:, None]
    lag = ramp[-1] - respond(variants, ramp)[1][-1, 0, :, 0]
    K = ca_variants.gains(variants, 400)[-1, 0]
    np.testing.assert_allclose(lag, (1 - K) / K, rtol=1e-9)


def test_response_is_the_linear_map_of_the_measurements(z):
    variants = family(state=["A", "left out", "prior (2.9)"], covariance=["A P Aᵀ", "Aᵀ P A"], quotients=[0.5])
    posterior = respond(variants, z[:61])[1][5::5]
    np.testing.assert_allclose(np.einsum("ijv,jm->ivm", ca_search.response(variants), z[:61]), posterior.reshape(36, -1, 4), atol=1e-9)


@pytest.fixture(scope="module")
def conditional_runs():
    """The printed filter's rows (36, M) when the thirteen printed measurements are given and all others drawn."""
    printed, rng = ca_search.table_3(), np.random.default_rng(3)
    z = ca_source.truth(61)[0][:, None] + 0.5 * rng.normal(size=(61, 20000))
    z[printed.samples] = printed.measured[:, None] + printed.measured_rounding * rng.uniform(-1, 1, size=(13, 20000))
    rows = filtered(z)[printed.samples[1:]].reshape(36, -1)
    return rows + printed.rounding.ravel()[:, None] * rng.uniform(-1, 1, size=rows.shape)


def test_condition_is_what_monte_carlo_converges_to(conditional_runs):
    printed = ca_search.table_3()
    mean, covariance = ca_search.condition(ca_search.response(family(**PRINTED)), printed)
    sd = np.sqrt(np.diag(covariance[..., 0]))
    assert np.abs((conditional_runs.mean(axis=1) - mean[:, 0]) / sd).max() < 5 / np.sqrt(20000)
    correlation = covariance[..., 0] / np.outer(sd, sd)
    np.testing.assert_allclose(np.cov(conditional_runs / sd[:, None]), correlation, atol=0.05)


def test_chi_square_of_runs_of_the_filter_itself_has_36_degrees_of_freedom(conditional_runs):
    printed = ca_search.table_3()
    mean, covariance = ca_search.condition(ca_search.response(family(**PRINTED)), printed)
    squares = [ca_search.chi_square(mean, covariance, row.reshape(12, 3), printed.rounding)[0][0] for row in conditional_runs.T[:600]]
    assert stats.kstest(squares, stats.chi2(36).cdf).pvalue > 1e-3


def test_log_density_is_the_multivariate_normal_s(conditional_runs):
    printed = ca_search.table_3()
    mean, covariance = ca_search.condition(ca_search.response(family(**TEXTBOOK)), printed)
    for columns in ((0, 1, 2), (1,)):
        pick = np.arange(36).reshape(12, 3)[:, columns].ravel()
        squares, density = ca_search.chi_square(mean, covariance, printed.filtered, printed.rounding, columns)
        known = stats.multivariate_normal(mean[pick, 0], covariance[np.ix_(pick, pick)][..., 0], allow_singular=True)
        np.testing.assert_allclose(density[0], known.logpdf(printed.filtered.ravel()[pick]), rtol=1e-6)
        assert 0 < squares[0] < stats.chi2(len(pick)).ppf(0.95)


def test_score_of_table_3_singles_out_the_transposed_product():
    scores = ca_search.score_table_3(family(state=["A", "left out"], quotients=[0.5, 1.0]), block=7)
    best = scores.sort_values("χ²").iloc[0]
    assert (best["state"], best["covariance"], best["Q/R"], best["gain"], best["late"]) == ("A", "A (P Aᵀ)ᵀ", 1.0, "from P⁻", 0)
    assert best["p"] > 0.05 and (scores["p"] > 1e-6).sum() == 1


def test_error_statistics_are_those_of_the_errors_and_samples_they_name(z):
    variants, s = family(**PRINTED | {"state": ["A", "prior (2.9)"], "late": [0, 1]}), ca_source.truth().T[..., None, None]
    prior, posterior = respond(variants, z)
    errors = {
        "truth − x": s[:, 0] - posterior[:, 0],
        "truth − x⁻": s[:, 0] - prior[:, 0],
        "measured − x": z[:, None] - posterior[:, 0],
        "measured − x⁻": z[:, None] - prior[:, 0],
        "next truth − x": s[1:, 0] - posterior[:-1, 0],
        "whole state": np.linalg.norm(s - posterior, axis=1),
    }
    samples = {"all": slice(None), "but the first": slice(1, None), "every fifth": slice(None, None, 5)}
    found = ca_search.error_statistics(variants, z)
    assert list(found) == [(error, name) for error in errors for name in samples]
    for (error, name), figures in found.items():
        size = np.abs(errors[error][samples[name]])
        wanted = np.stack([size.max(axis=0), size.mean(axis=0), np.sqrt((size**2).mean(axis=0))])
        np.testing.assert_allclose(figures, wanted, rtol=1e-12)


def test_score_of_table_4_places_the_printed_numbers_among_the_runs():
    z, variants = measurements(80), family(**PRINTED | {"state": ["A", "left out"]})
    scores = ca_search.score_table_4(variants, z, printed=(5.0, 0.83, 1.03), block=1).set_index(["error", "samples", "state"])
    row = scores.loc[("truth − x", "all", "left out")]
    size = np.abs(ca_source.truth()[0][:, None] - respond(variants, z)[1][:, 0, 1])
    mean, rms = size.mean(axis=0), np.sqrt((size**2).mean(axis=0))
    np.testing.assert_allclose([row["mean"], row["RMS"]], [np.median(mean), np.median(rms)], rtol=1e-12)
    assert row["% mean"] == pytest.approx(100 * np.mean(mean < 0.83)) and row["% max"] == pytest.approx(50)
    off = np.array([mean.mean() - 0.83, rms.mean() - 1.03])
    assert row["d"] == pytest.approx(np.sqrt(off @ np.linalg.solve(np.cov(mean, rms), off)), rel=1e-3)
    assert len(scores) == 2 * 6 * 3


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: ca_search.condition(np.zeros((36, 60)), ca_search.table_3()), "response"),
        (lambda: family(state=["B"]), "state"),
        (lambda: family(covariance="A P A"), "covariance"),
        (lambda: family(quotients=[0.0]), "quotients"),
        (lambda: family(late=[2]), "late"),
        (lambda: respond(family(**PRINTED), np.zeros(5)), "z"),
    ],
)
def test_bad_arguments_are_named(call, named):
    with pytest.raises(ValueError, match=rf"^{named}: expected"):
        call()

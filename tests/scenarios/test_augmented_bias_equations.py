"""Paper 3's rebuilt equations: what a fragment can refute, and opponents that notice a wrong reading."""

import nbformat
import numpy as np
import pytest

from trackhelpers.filters import augmented_matrices
from trackhelpers.scenarios.augmented_bias import equations as eqs
from trackhelpers.scenarios.augmented_bias import opponents
from trackhelpers.scenarios.thesis.equations import largest_difference, random_systems
from trackhelpers.suite import NOTEBOOKS

CHAPTER = NOTEBOOKS / "3_augmented_bias" / "2_augmented_filter.ipynb"


@pytest.fixture(scope="module")
def points():
    return eqs.random_points(np.random.default_rng(3), n=3, m=2)


def test_all_31_equations_are_there_and_every_reading_accounts_for_its_fragment():
    table = eqs.equations()
    assert list(table.index) == list(range(1, 32))
    assert (table != "").all(axis=None)
    assert not [n for n, row in table.iterrows() if eqs.surplus(row.fragment, row.reading)]


def test_surplus_counts_characters_and_looks_only_one_way():
    assert eqs.surplus(",1,1XX", "X Φ_k,k-1") == ",1X"
    assert eqs.surplus("X", "XXX ΛΦ−") == ""
    assert eqs.surplus("Φ~−", "") == ""  # no glyphs of ours


def test_a_character_speaks_against_r3_and_the_uncorrected_r2_alone():
    fragments = eqs.equations()["fragment"]
    lacking = {name: {n: eqs.surplus(fragments[n], text) for n, text in forms.items()} for name, forms in eqs.RIVALS.items()}
    assert {name for name, found in lacking.items() if any(found.values())} == {"R3", "R2 uncorrected"}
    assert lacking["R3"] == {10: ",", 13: ",", 15: "", 16: ",", 23: "+"}


def test_the_chapter_shows_the_fragments_of_the_file():
    text = "\n".join(cell.source for cell in nbformat.read(CHAPTER, as_version=4).cells if cell.cell_type == "markdown")
    missing = [n for n, fragment in eqs.equations()["fragment"].items() if f"| ({n}) | `{fragment}`" not in text]
    assert not missing


def test_one_step_by_the_definitions_is_the_augmented_transition(points):
    for p in points:
        A = augmented_matrices(p.F, p.H, p.Q, p.Q_bias, "R1")
        np.testing.assert_allclose(eqs.step_map(p), np.hstack([A.F, np.eye(6)]), atol=1e-12)
        np.testing.assert_allclose(eqs.step_covariance(p), A.F @ p.P @ A.F.T + A.Q, atol=1e-12)


def test_batch_and_recursion_agree_for_any_number_of_measurements(points):
    for p in points[:5]:
        for steps in (1, 2, 6):
            for one, other in zip(eqs.batch(p, p.z[:steps]), eqs.recursion(p, p.z[:steps]), strict=True):
                np.testing.assert_allclose(one, other, atol=1e-9)


def test_batch_with_a_useless_sensor_is_the_prediction(points):
    p = points[0]._replace(R=1e14 * np.eye(2))
    x, P = eqs.batch(p, p.z[:1])
    np.testing.assert_allclose(x, eqs.moved(p, p.x, 0 * p.w, 0 * p.n), atol=1e-9)
    np.testing.assert_allclose(P, eqs.step_covariance(p), atol=1e-9)


def test_every_equation_of_section_2_agrees_with_its_opponent():
    assert list(opponents.PAIRS) == list(range(13, 32))
    residuals = opponents.residuals(np.random.default_rng(5))
    assert max(residuals.values()) <= 1e-9


@pytest.mark.parametrize("reading", ["R2", "R3", "R4"])
def test_the_opponents_notice_another_reading(points, reading):
    def stacked(p):
        A = augmented_matrices(p.F, p.H, p.Q, p.Q_bias, reading)
        return np.vstack([A.F, A.H])

    assert largest_difference(points, stacked, opponents.PAIRS[17].opponent) > 0.1


@pytest.mark.parametrize("number", opponents.PAIRS)
def test_the_opponents_notice_a_wrong_number(points, number):
    """Each opponent differs from its printed form once the latter is off by a millionth."""
    pair = opponents.PAIRS[number]
    cases = random_systems(np.random.default_rng(4), n=4, m=2) if number in opponents.GENERAL else points
    assert largest_difference(cases, lambda p: pair.printed(p) * (1 + 1e-6), pair.opponent) > 1e-9


def test_the_outcomes_of_the_noise_have_its_moments_and_no_others(points):
    for p in points:
        np.testing.assert_allclose(opponents.PAIRS[27].opponent(p), opponents.PAIRS[27].printed(p), atol=1e-12)
        larger = p._replace(Q_bias=p.Q_bias + 1e-3 * np.eye(3))
        added = opponents.PAIRS[27].opponent(larger) - opponents.PAIRS[27].opponent(p)
        np.testing.assert_allclose(added, np.diag([0, 0, 0, 1e-3, 1e-3, 1e-3]), atol=1e-12)


def test_fading_as_printed_is_the_short_form(points):
    for p in points:
        X, XL, LX, L = p.P[:3, :3], p.P[:3, 3:], p.P[3:, :3], p.P[3:, 3:]
        ratio = p.F @ (X + XL + LX + L) @ np.linalg.inv(X) @ np.linalg.inv(p.F)
        np.testing.assert_allclose(opponents.fading(p.F, p.P), ratio, atol=1e-9)

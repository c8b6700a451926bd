"""A notebook answers what it is asked, all of it and nothing else, and the answers are read with their questions."""

import numpy as np
import pytest

from trackhelpers.ledger import Found, Ledger, compare, questions_of, read_ledger, summary, verdict
from trackhelpers.ledger.files import ANSWER_COLUMNS

ANSWERS = {
    "t9-vx-max": 3.6120492,
    "gain": Found(0.25, error="the transpose is missing"),
    "spread": np.linspace(0.4, 0.6, 100),
    "better": (0.9, 0.85, 0.95),
    "nees": (4.1, 4.0, 4.2),
}


@pytest.fixture
def ledger(ask):
    ask()
    return Ledger("1_thesis", "2_kalman_filter")


def test_answer_echoes_nothing_and_write_counts_the_verdicts(ledger, tmp_path):
    assert ledger.answer({"t9-vx-max": 3.6120492}) is None
    assert ledger.answer({id: answer for id, answer in ANSWERS.items() if id != "t9-vx-max"}) is None
    table = ledger.write()
    path = tmp_path / "results" / "1_thesis__2_kalman_filter.csv"
    assert path.read_text(encoding="utf-8").splitlines() == [
        ",".join(ANSWER_COLUMNS),
        "t9-vx-max,3.612049,,,reproduced under an assumption,",
        "gain,0.2,,,paper in error,the transpose is missing",
        "spread,0.5,0.405,0.595,reproduced,the printed value is at percentile 50.0 of 100 runs",
        "better,0.9,0.85,0.95,undecided,",
        "nees,4.1,4,4.2,beyond the paper,",
        "figure-7,,,,not checkable,",
    ]
    assert table.frame["rows"].to_dict() == {
        "reproduced": 1,
        "reproduced under an assumption": 1,
        "paper in error": 1,
        "undecided": 1,
        "not checkable": 1,
        "beyond the paper": 1,
    }
    assert table._repr_html_ is None and table._repr_markdown_().endswith("(../results/1_thesis__2_kalman_filter.md)")


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"nees": 4.0, "unasked": 1.0}, "'unasked' is not asked"),
        ({"nees": 4.0, "gain": 0.0}, "'gain' was answered before"),
        ({"nees": 4.0, "better": np.nan}, "'better'.*got nan"),
        ({"nees": 4.0, "better": (0.5, 0.6, 0.7)}, "expected low ≤ ours ≤ high"),
        ({"nees": 4.0, "figure-7": 1.0}, "rule is 'lost'"),
        ({"nees": 4.0, "timing": 1.0}, "withdrawn"),
        ({"nees": 4.0, "better": Found(0.5, error="wrong")}, "bear the paper out"),
    ],
)
def test_a_refused_call_answers_nothing(ledger, answers, words):
    ledger.answer({"gain": 0.0})
    with pytest.raises(ValueError, match=words):
        ledger.answer(answers)
    assert list(ledger.answers) == ["gain"]


@pytest.mark.parametrize("id", ANSWERS)
def test_a_question_without_an_answer_is_named_and_nothing_is_written(ledger, tmp_path, id):
    ledger.answer({other: answer for other, answer in ANSWERS.items() if other != id})
    with pytest.raises(ValueError, match=rf"asks \['{id}'\]"):
        ledger.write()
    assert not (tmp_path / "results").exists()


def test_a_notebook_without_questions_has_no_ledger(ask):
    ask()
    with pytest.raises(ValueError, match="1_thesis__3_motion_models has no file of questions"):
        Ledger("1_thesis", "3_motion_models")


def test_answers_are_read_with_their_questions(ledger, tmp_path):
    ledger.answer(ANSWERS)
    ledger.write()
    rows = read_ledger(tmp_path / "results")
    assert rows["notebook"].tolist() == ["1_thesis/2_kalman_filter"] * 6
    by_id = rows.set_index("id")
    assert by_id.loc["t9-vx-max", ["kind", "quantity", "paper", "tolerance", "note", "rule", "known_before", "set"]].tolist() == [
        "table",
        "largest error (m/s)",
        "3.612049",
        "5e-07",
        "lidar σ = 0.15 m",
        "cell",
        "asked with the answer",
        "2026-11-22",
    ]
    assert by_id.loc["gain", ["paper", "tolerance", "note"]].tolist() == ["", "1e-09", "the transpose is missing"]
    assert by_id.loc["better", "paper"] == "clearly better" and "was '< 1'" in by_id.loc["better", "changed"]
    assert by_id.loc["figure-7", "note"] == "the scan has no drawing"
    asked = questions_of("1_thesis", "2_kalman_filter")
    assert all(verdict(asked[row["id"]], row) == row["verdict"] for row in rows.to_dict("records"))
    assert summary(rows)["total"].tolist() == [6]


def test_an_answer_that_is_not_asked_is_found_when_the_ledger_is_read(ledger, ask, tmp_path):
    ledger.answer(ANSWERS)
    ledger.write()
    ask(ask().read_text(encoding="utf-8").replace("[nees]", "[nis]"))
    with pytest.raises(ValueError, match=r"answers \['nees'\]"):
        read_ledger(tmp_path / "results")


def test_compare_finds_a_changed_answer(ledger, tmp_path):
    ledger.answer(ANSWERS)
    ledger.write()
    path = tmp_path / "results" / "1_thesis__2_kalman_filter.csv"
    other = tmp_path / "other" / path.name
    other.parent.mkdir()
    other.write_text(path.read_text(encoding="utf-8").replace("better,0.9,", "better,0.89,"), encoding="utf-8")
    assert compare(path.parent, path.parent) == []
    assert compare(path.parent, other.parent) == ["1_thesis/2_kalman_filter: better: ours: '0.9' against '0.89'"]

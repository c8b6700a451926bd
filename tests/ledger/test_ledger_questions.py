"""Questions are read strictly: what is unknown, missing or impossible is named with its file, id and field."""

from datetime import date

import pytest

from trackhelpers.ledger import questions_of, read_questions
from trackhelpers.published import published

GOOD = {
    "kind": '"claim"',
    "where": '"§4"',
    "asks": '"ratio"',
    "rule": '"< 1"',
    "set": "2026-11-22",
}


def table(id="a-question", **changes):
    fields = GOOD | changes
    return f"[{id}]\n" + "".join(f"{name} = {value}\n" for name, value in fields.items() if value is not None)


def test_questions_come_in_their_order_with_their_fields(ask):
    ask()
    questions = questions_of("1_thesis", "2_kalman_filter")
    assert list(questions) == ["t9-vx-max", "gain", "spread", "better", "nees", "figure-7", "timing"]
    assert read_questions() == {"1_thesis/2_kalman_filter": questions}
    first = questions["t9-vx-max"]
    assert first.printed == published("thesis", 9).loc["vx", "max"] == "3.612049"
    assert (first.notebook, first.allowed, first.set) == ("1_thesis/2_kalman_filter", 5e-7, date(2026, 11, 22))
    assert questions["better"].changes == ["2026-11-24: was '< 1', 'better' is read as by 10 % throughout; turned reproduced"]
    assert questions["timing"].withdrawn["verdict"] == "not reproduced"
    assert [questions[id].paper for id in ("gain", "spread", "better", "nees")] == ["", "0.50", "clearly better", ""]


def test_a_notebook_without_a_file_has_no_questions(ask):
    assert questions_of("1_thesis", "2_kalman_filter") is None
    assert read_questions() == {}


def test_rows_of_a_table_without_labels_are_counted_from_0(ask):
    ask(table(kind='"table"', rule='"cell"', printed='{ table = "thesis 3", row = 2, column = "s_true" }'))
    assert questions_of("1_thesis", "2_kalman_filter")["a-question"].printed == published("thesis", 3).loc[2, "s_true"]


CELLS = {"kind": '"table"', "where": '"Table 9"', "rule": '"cell"', "printed": '{ table = "thesis 9" }'}


def test_cells_of_a_table_are_a_question_each(ask):
    ask(table("t9", **CELLS, cells='{ vx-max = ["vx", "max"], y-rms = ["y", "RMSE"] }') + table())
    questions = questions_of("1_thesis", "2_kalman_filter")
    assert list(questions) == ["t9-vx-max", "t9-y-rms", "a-question"]
    assert questions["t9-y-rms"].printed == published("thesis", 9).loc["y", "RMSE"]
    assert questions["t9-y-rms"].where == "Table 9, y, RMSE"
    assert questions["t9-y-rms"].asks == questions["t9-vx-max"].asks == "ratio"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cells": '["vx"]'}, "cells"),
        ({"cells": '{ a = ["vx"] }'}, "cells"),
        ({"cells": '{ a = ["vz", "max"] }'}, "printed"),
        ({"cells": '{ A = ["vx", "max"] }'}, "id"),
        ({"cells": '{ a = ["vx", "max"] }', "printed": '"1.0"'}, "printed"),
        ({"cells": '{ a = ["vx", "max"] }', "printed": '{ table = "thesis 9", row = "vx" }'}, "printed"),
    ],
)
def test_bad_cells_are_named(ask, changes, words):
    ask(table("t9", **(CELLS | changes)))
    with pytest.raises(ValueError, match=rf"1_thesis__2_kalman_filter\.toml: t9.*{words}.*expected"):
        read_questions()


def test_a_cell_and_a_question_of_one_id_are_refused(ask):
    ask(table("t9", **CELLS, cells='{ vx-max = ["vx", "max"] }') + table("t9-vx-max"))
    with pytest.raises(ValueError, match=r"t9-vx-max.*twice"):
        read_questions()


@pytest.mark.parametrize("rule", ["< 0.9", ">= 3", "== 6", "in [0, 1)", "in (0.9, 1.1)", "in [1, 1]", "> -1e-3", "equation", "beyond"])
def test_rules_that_something_satisfies_are_taken(ask, rule):
    ask(table(rule=f'"{rule}"'))
    assert questions_of("1_thesis", "2_kalman_filter")["a-question"].rule == rule


CELL = {"kind": '"table"', "rule": '"cell"', "printed": '"1.0"'}
CHANGE = '[{{ on = {on}, was = "< 2", because = "typo", turned = "{turned}" }}]'


@pytest.mark.parametrize(
    ("field", "changes"),
    [
        *((field, {field: None}) for field in GOOD),
        ("colour", {"colour": '"red"'}),
        ("kind", {"kind": '"opinion"'}),
        ("where", {"where": '""'}),
        ("asks", {"asks": '"two\\nlines"'}),
        ("asks", {"asks": "3"}),
        ("rule", {"rule": '"about 3"'}),
        ("rule", {"rule": '"in [1, 0]"'}),
        ("rule", {"rule": '"in (1, 1]"'}),
        ("rule", {"rule": '"> inf"'}),
        ("rule", {"rule": '"> 1e999"'}),
        ("rule", {"rule": "3"}),
        ("set", {"set": '"2026-11-22"'}),
        ("set", {"set": "2026-11-22T10:00:00"}),
        ("printed", CELL | {"printed": None}),
        ("printed", CELL | {"printed": '"one"'}),
        ("printed", CELL | {"printed": "1.0"}),
        ("printed", CELL | {"printed": '{ table = "thesis 6", row = "vx", column = "max" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis nine", row = "vx", column = "max" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis 9", row = "vz", column = "max" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis 9", row = 2, column = "max" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis 9", row = "vx", column = "most" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis 9", row = "vx" }'}),
        ("printed", CELL | {"printed": '{ table = "thesis 9", row = "vx", column = "max", digits = 3 }'}),
        ("printed", {"rule": '"beyond"', "printed": '"1.0"'}),
        ("tolerance", {"tolerance": "0.1"}),
        ("tolerance", CELL | {"tolerance": "0.0"}),
        ("tolerance", CELL | {"tolerance": "nan"}),
        ("tolerance", CELL | {"tolerance": "true"}),
        ("note", {"rule": '"lost"'}),
        ("assumption", {"rule": '"beyond"', "assumption": '"none"'}),
        ("changed", {"changed": '"yesterday"'}),
        ("changed", {"changed": '[{ on = 2026-11-24, was = "< 2" }]'}),
        ("changed", {"changed": CHANGE.format(on="2026-11-21", turned="reproduced")}),
        ("changed", {"changed": CHANGE.format(on="2026-11-24", turned="good")}),
        ("withdrawn", {"withdrawn": "true"}),
        ("withdrawn", {"withdrawn": '{ on = 2026-11-24, why = "", verdict = "nothing" }'}),
    ],
)
def test_a_bad_field_is_named_with_its_file_and_question(ask, field, changes):
    ask(table(**changes))
    with pytest.raises(ValueError, match=rf"1_thesis__2_kalman_filter\.toml: a-question: {field}.*expected"):
        read_questions()


@pytest.mark.parametrize("id", ["A-question", "a_question", "a--question", "-a", "9-vx", '"a b"'])
def test_ids_are_in_kebab_case(ask, id):
    ask(table(id))
    with pytest.raises(ValueError, match=r"1_thesis__2_kalman_filter\.toml: .*: id, expected"):
        read_questions()


@pytest.mark.parametrize(
    ("text", "words"), [(table() * 2, "twice"), ("a = [", "not TOML"), ("a = 3", "expected a table"), ("", "asks nothing")]
)
def test_a_file_that_holds_no_questions_is_refused(ask, text, words):
    ask(text)
    with pytest.raises(ValueError, match=words):
        read_questions()


def test_a_question_may_change_from_nothing(ask):
    ask(table(changed=CHANGE.format(on="2026-11-22", turned="nothing")))
    assert questions_of("1_thesis", "2_kalman_filter")["a-question"].changed[0]["was"] == "< 2"

"""Pages of rows and the marks of links, text by text, from questions and answers alone."""

from datetime import date

import numpy as np
import pandas as pd
import pytest

from trackhelpers.ledger import MARKS, Ledger, Question, compare, questions_of, read_ledger, read_questions, summary
from trackhelpers.ledger.record import links, marked, record

ROW = "../results/1_thesis__2_kalman_filter.md#gain"


def page(text, asked=None, **row):
    rows = {"gain": {"verdict": "reproduced", "ours": "0.61237", "low": "-1234.5678", "high": "", "rule": "cell"} | row}
    return marked(text, {"1_thesis/2_kalman_filter": rows} if asked is None else asked, "here")


@pytest.mark.parametrize("verdict", MARKS)
def test_a_link_to_a_row_is_marked_with_its_verdict(verdict):
    for shown in ("?", "", "✗ paper in error", "3.0"):
        assert page(f"so [{shown}]({ROW}), so", verdict=verdict) == f"so [{MARKS[verdict]}]({ROW}), so"
    for start in ("results", "../results", "notebooks/results"):
        link = f"({start}/1_thesis__2_kalman_filter.md#gain)"
        assert page(f"[?]{link}") == f"[{MARKS['reproduced']}]{link}"


@pytest.mark.parametrize(
    ("shown", "ours", "filled"),
    [
        ("?", "0.61237", "0.6124"),
        ("", "1234.5678", "1235"),
        ("1.5", "0.61237", "0.6"),
        ("2", "0.61237", "1"),
        ("−0.000", "-0.61237", "−0.612"),
        ("about 7.00 m", "0.61237", "0.61"),
        ("5 %", "0.61237", "61 %"),
        ("5.0 %", "0.61237", "61.2 %"),
        ("10.25%", "-0.61237", "−61.24 %"),
        ("?", "1e-12", "0"),
    ],
)
def test_a_link_to_a_number_keeps_its_decimals(shown, ours, filled):
    link = f'({ROW} "ours")'
    assert page(f"[{shown}]{link}", ours=ours) == f"[{filled}]{link}"


def test_the_ends_of_an_interval_can_be_linked_and_other_links_stay():
    assert page(f'[0.0]({ROW} "low")') == f'[−1234.6]({ROW} "low")'
    for other in (f'[0.0]({ROW} "middle")', "[?](other.md#gain)", "[?](../results/1_thesis__2_kalman_filter.md)", f"[a[b]({ROW[1:]})"):
        assert page(other) == other


def test_links_that_lead_nowhere_are_named():
    with pytest.raises(
        ValueError, match=r"^notebook here links to the number 'high' of the row 'gain' of 1_thesis/2_kalman_filter, which has none"
    ):
        page(f'[0.0]({ROW} "high")')
    for asked, known in (({}, r"\[\]"), ({"1_thesis/2_kalman_filter": {"other": None}}, r"\['other'\]")):
        with pytest.raises(
            ValueError, match=f"^notebook here links to the row 'gain' of 1_thesis/2_kalman_filter, expected one out of {known}"
        ):
            page(f"[?]({ROW})", asked)
    assert page(f"[✓]({ROW})", {"1_thesis/2_kalman_filter": {"gain": None}}) == f"[?]({ROW})"


def test_links_are_listed_once_in_their_order():
    text = f'[?]({ROW}) [?](results/1_thesis__b.md#x) [1]({ROW} "ours") [?](x.md#y) [?](notebooks/results/2_a__b_c.md#gain-2)'
    assert links(text) == [("1_thesis/2_kalman_filter", "gain"), ("1_thesis/b", "x"), ("2_a/b_c", "gain-2")]
    assert links("") == []


def question(id, **fields):
    return Question(
        **{
            "notebook": "1_thesis/2_kalman_filter",
            "id": id,
            "kind": "claim",
            "where": "§4",
            "asks": "ratio",
            "rule": "< 0.9",
            "set": date(2026, 11, 22),
        }
        | fields
    )


def test_a_page_tells_every_row_with_what_is_known_of_it_and_what_was_withdrawn():
    change = {"on": date(2026, 11, 24), "was": "< 1", "because": "by 10 %", "turned": "reproduced"}
    gone = {"on": date(2026, 11, 25), "why": "no *row*", "verdict": "not reproduced"}
    source = {"table": "thesis 9", "row": "v_x", "column": "max"}
    questions = {
        "first": question("first", asks="gain $K_k$ of [ours] and a_b", changed=(change,), known_before="asked with the answer"),
        "cell": question("cell", kind="table", rule="cell", printed="3.6", source=source),
        "gone": question("gone", withdrawn=gone),
    }
    columns = {"low": "", "high": "", "note": "", "tolerance": "", "set": "2026-11-22"}
    rows = pd.DataFrame(
        [
            columns
            | {"id": "first", "ours": "0.512345", "low": "0.4", "high": "1", "verdict": "undecided", "rule": "< 0.9", "note": "R > 0"},
            columns | {"id": "cell", "ours": "4", "verdict": "paper in error", "rule": "cell", "tolerance": "0.05"},
        ]
    )
    assert record("1_thesis/2_kalman_filter", questions, rows) == (
        "# Rows of 1_thesis/2_kalman_filter\n\n"
        "What [the notebook](../1_thesis/2_kalman_filter.ipynb) asked of its paper, by which rule, and what came out: 2 rows.\n\n"
        '<a id="first"></a>\n\n## first\n\ngain $K_k$ of \\[ours\\] and a\\_b\n\n'
        "* verdict: **~ undecided**\n* where: §4\n* rule: \\< 0.9\n* ours: 0.5123 \\[0.4, 1\\]\n* assumption, error, note: R \\> 0\n"
        "* known before: asked with the answer\n* rule set: 2026-11-22\n"
        "* changed: 2026-11-24: was '\\< 1', by 10 %; turned reproduced\n\n"
        '<a id="cell"></a>\n\n## cell\n\nratio\n\n'
        "* verdict: **✗ paper in error**\n* where: §4\n* printed: 3.6 (table thesis 9, row v\\_x, column max)\n* rule: cell, to 0.05\n* ours: 4\n"
        "* rule set: 2026-11-22\n\n"
        '<a id="gone"></a>\n\n## gone\n\nratio\n\n'
        "* withdrawn 2026-11-25: no \\*row\\*; the verdict was not reproduced\n* rule: \\< 0.9\n"
    )


def test_dollars_that_enclose_nothing_are_escaped():
    rows = pd.DataFrame(
        [
            {
                "id": "a",
                "ours": "1",
                "low": "",
                "high": "",
                "note": "$5 and `x`|{y}~ $a_1 + b_1$ and $c_2$",
                "tolerance": "",
                "set": "s",
                "verdict": "reproduced",
                "rule": "beyond",
            }
        ]
    )
    assert "* assumption, error, note: \\$5 and \\`x\\`\\|\\{y\\}\\~ " not in record(
        "n", {"a": question("a")}, rows
    )  # a formula begins at the first $
    rows["note"] = "`x`|{y}~ $a_1 + b_1$ and $c_2$ for 5 $"
    assert "* assumption, error, note: \\`x\\`\\|\\{y\\}\\~ $a_1 + b_1$ and $c_2$ for 5 \\$\n" in record("n", {"a": question("a")}, rows)


def test_what_a_question_says_of_itself():
    cell = question("a", rule="cell", printed="−3.60")
    assert cell.value == -3.6 and cell.allowed == pytest.approx(0.005) and cell.paper == "−3.60" and cell.changes == []
    assert question("a", rule="cell", printed="3.6", tolerance=0.2).allowed == 0.2
    assert question("a", rule="equation").allowed == 1e-9 and question("a", rule="equation").paper == ""
    assert question("a").allowed is None and question("a").paper == "< 0.9" and question("a", printed="less").paper == "less"
    for rule in ("random cell", "beyond", "lost"):
        assert question("a", rule=rule).paper == "" and question("a", rule=rule).allowed is None


@pytest.mark.parametrize(
    ("paper", "notebook", "word"),
    [
        ("1-thesis", "a", "paper"),
        ("1_thesis", "A", "notebook"),
        ("1__thesis", "a", "paper"),
        ("_a", "a", "paper"),
        ("a_", "a", "paper"),
        ("", "a", "paper"),
        (1, "a", "paper"),
        ("a", None, "notebook"),
    ],
)
def test_names_of_a_ledger_are_lower_case_words(ask, paper, notebook, word):
    ask()
    with pytest.raises(ValueError, match=f"^{word} is .*, expected lower-case words joined by single underscores"):
        Ledger(paper, notebook)


def test_names_of_notebooks_are_parted_once(ask):
    """The first two underscores part the paper from the notebook; further ones are the notebook's."""
    path = ask(name="1_thesis__a__b")
    questions = read_questions()
    assert list(questions) == ["1_thesis/a__b"] and questions["1_thesis/a__b"]["gain"].notebook == "1_thesis/a__b"
    assert questions_of("1_thesis", "a__b", path.parent)["gain"].notebook == "1_thesis/a__b"
    path.rename(path.with_name("thesis.toml"))
    with pytest.raises(ValueError, match=r"^thesis\.toml: expected a name such as <paper>__<notebook>\.toml"):
        read_questions()


HEAD = "id,ours,low,high,verdict,note\n"


@pytest.fixture
def folders(tmp_path):
    for name in "ab":
        (tmp_path / name).mkdir()
    return tmp_path / "a", tmp_path / "b"


def two(folders, a, b, name="1_thesis__n__m"):
    for folder, text in zip(folders, (a, b), strict=True):
        (folder / f"{name}.csv").write_text(HEAD + text, encoding="utf-8")
    return folders


@pytest.mark.parametrize(
    ("a", "b", "differ"),
    [
        ("1", "1.00002", False),
        ("1", "1.000021", True),
        ("-1", "-1.00002", False),
        ("100", "100.0019", False),
        ("100", "100.0021", True),
        ("0", "1e-9", False),
        ("0", "1.1e-9", True),
        ("", "0", True),
        ("1", "", True),
    ],
)
def test_numbers_differ_beyond_a_flip_of_the_sixth_digit(folders, a, b, differ):
    for column, (one, other) in enumerate(
        [(f"x,{a},,,v,n", f"x,{b},,,v,n"), (f"x,1,{a},2,v,n", f"x,1,{b},2,v,n"), (f"x,1,1,{a},v,n", f"x,1,1,{b},v,n")]
    ):
        name = ("ours", "low", "high")[column]
        assert compare(*two(folders, one + "\n", other + "\n")) == ([f"1_thesis/n__m: x: {name}: {a!r} against {b!r}"] if differ else [])
    assert compare(*folders, rtol=1.0, atol=1.0) == ([] if a and b else [f"1_thesis/n__m: x: high: {a!r} against {b!r}"])
    for bad in ({"rtol": -1}, {"atol": np.nan}):
        with pytest.raises(ValueError, match=f"^{next(iter(bad))}: expected"):
            compare(*folders, **bad)


def test_texts_rows_and_files_differ_wherever_they_do(folders):
    assert compare(*two(folders, "x,1,,,v,n\ny,2,,,v,n\n", "x,1,,,w,1.0\ny,2,,,v,n\n")) == [
        "1_thesis/n__m: x: verdict: 'v' against 'w'",
        "1_thesis/n__m: x: note: 'n' against '1.0'",
    ]
    a, b = two(folders, "x,1,,,v,n\ny,2,,,v,n\n", "z,1,,,v,n\ny,2,,,v,n\n")
    assert compare(a, b) == [f"1_thesis/n__m: rows differ: ['x'] only in {a}, ['z'] only in {b}, or their order"]
    (b / "1_thesis__n__m.csv").unlink()
    (b / "1_thesis__other.csv").write_text(HEAD + "x,1,,,v,n\n", encoding="utf-8")
    (b / "nothing.csv").write_text("not a ledger", encoding="utf-8")
    missing = [f"1_thesis/n__m: missing in {b}", f"1_thesis/other: missing in {a}"]
    assert compare(a, b) == missing and compare(a, b, exclude=["1_thesis/n__m"]) == missing[1:]


def test_a_row_that_is_read_is_joined_with_its_question(ask, tmp_path):
    ask()
    (tmp_path / "results").mkdir()
    rows = [
        "t9-vx-max,3.6,,,reproduced under an assumption,as printed",
        "gain,1e-12,,,reproduced,",
        "better,0.5,0.4,0.6,reproduced,",
        "figure-7,,,,not checkable,",
    ]
    (tmp_path / "results" / "1_thesis__2_kalman_filter.csv").write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")
    ledger = read_ledger(tmp_path / "results").set_index("id")
    first = ledger.loc["t9-vx-max"]
    assert first["notebook"] == "1_thesis/2_kalman_filter" and first["quantity"] == "largest error (m/s)" and first["paper"] == "3.612049"
    assert (
        first["note"] == "lidar σ = 0.15 m; as printed"
        and first["tolerance"] == "5e-07"
        and first["known_before"] == "asked with the answer"
    )
    assert ledger["tolerance"].tolist() == ["5e-07", "1e-09", "", ""] and ledger["set"].tolist() == ["2026-11-22"] * 4
    assert ledger.loc["better", "changed"] == "2026-11-24: was '< 1', 'better' is read as by 10 % throughout; turned reproduced"
    assert ledger.loc["figure-7", "note"] == "the scan has no drawing" and ledger.loc["better", "paper"] == "clearly better"
    for id in ("timing", "unheard"):
        (tmp_path / "results" / "1_thesis__2_kalman_filter.csv").write_text(HEAD + f"{id},1,,,reproduced,\n", encoding="utf-8")
        with pytest.raises(
            ValueError, match=rf"^1_thesis__2_kalman_filter\.csv answers \['{id}'\], which 1_thesis__2_kalman_filter\.toml does not ask"
        ):
            read_ledger(tmp_path / "results")


@pytest.mark.parametrize("table", [None, [], pd.DataFrame({"verdict": ["reproduced"]}), pd.DataFrame({"notebook": ["a/b"]})])
def test_only_a_ledger_is_summed_up(table):
    with pytest.raises(ValueError, match=r"^ledger is "):
        summary(table)

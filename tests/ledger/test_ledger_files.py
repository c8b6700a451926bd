"""The ledger's files: stable bytes, nothing half written, and every difference found."""

import os

import pytest

from trackhelpers.ledger import VERDICTS, Found, Ledger, compare, files, read_ledger, summary, summary_markdown
from trackhelpers.ledger.reading import COLUMNS

ASKED = """[{0}]
kind = "table"
where = "Table 9"
asks = "RMSE, x"
printed = "1.0"
rule = "cell"
set = 2026-11-22

[{1}]
kind = "equation"
where = "(2.11)"
asks = "gain"
rule = "equation"
set = 2026-11-22
"""


def write(folder, monkeypatch, notebook="2_kalman_filter", ours=1.0, note="", residual=2e-16, ids=("cell", "equation")):
    """A notebook's ledger in `folder`, its questions beside the folder."""
    questions = folder.parent / f"questions of {folder.name}"
    monkeypatch.setenv("TRACKHELPERS_RESULTS", str(folder))
    monkeypatch.setenv("TRACKHELPERS_QUESTIONS", str(questions))
    questions.mkdir(exist_ok=True)
    (questions / f"1_thesis__{notebook}.toml").write_text(ASKED.format(*ids), encoding="utf-8")
    ledger = Ledger("1_thesis", notebook)
    ledger.answer({ids[0]: Found(ours, note=note), ids[1]: residual})
    return ledger.write()


@pytest.fixture
def folders(tmp_path):
    return tmp_path / "a", tmp_path / "b"


def test_write_gives_the_same_bytes_twice_and_leaves_nothing_else(folders, monkeypatch):
    for ours in (1.0, 1.0 + 1e-15):
        write(folders[0], monkeypatch, ours=ours)
        assert [path.name for path in folders[0].iterdir()] == ["1_thesis__2_kalman_filter.csv"]
    assert (folders[0] / "1_thesis__2_kalman_filter.csv").read_bytes() == (
        b"id,ours,low,high,verdict,note\ncell,1,,,reproduced,\nequation,1e-10,,,reproduced,\n"
    )


def test_a_failed_write_leaves_the_old_file(folders, monkeypatch):
    write(folders[0], monkeypatch)
    before = (folders[0] / "1_thesis__2_kalman_filter.csv").read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write(folders[0], monkeypatch, ours=3.0)
    assert [path.read_bytes() for path in folders[0].iterdir()] == [before]


def test_without_the_variable_who_plays_writes_beside_the_committed_ledger(tmp_path, monkeypatch):
    monkeypatch.delenv("TRACKHELPERS_RESULTS", raising=False)
    monkeypatch.setattr(files, "__file__", str(tmp_path / "site-packages" / "trackhelpers" / "ledger" / "files.py"))
    (tmp_path / "clone" / "notebooks" / "1_thesis").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "clone" / "notebooks" / "1_thesis")
    assert files.results_folder() == tmp_path / "clone" / "build" / "results"
    assert files.committed_folder() == tmp_path / "clone" / "notebooks" / "results"
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileNotFoundError, match="TRACKHELPERS_RESULTS"):
        files.results_folder()
    monkeypatch.setenv("TRACKHELPERS_RESULTS", str(tmp_path / "elsewhere"))
    assert files.results_folder() == tmp_path / "elsewhere"


def test_read_ledger_joins_the_notebooks_in_their_order(folders, monkeypatch):
    write(folders[0], monkeypatch, "4_1_accelerating_source")
    write(folders[0], monkeypatch, "2_kalman_filter")
    ledger = read_ledger(folders[0])
    assert list(ledger.columns) == ["notebook", *COLUMNS]
    assert ledger["notebook"].tolist() == ["1_thesis/2_kalman_filter"] * 2 + ["1_thesis/4_1_accelerating_source"] * 2
    assert ledger["paper"].tolist() == ["1.0", "", "1.0", ""]


def test_read_ledger_refuses_an_empty_folder_and_other_columns(tmp_path):
    with pytest.raises(ValueError, match="holds no ledger file"):
        read_ledger(tmp_path)
    (tmp_path / "1_thesis__x.csv").write_text("id,verdict\na,reproduced\n", encoding="utf-8")
    with pytest.raises(ValueError, match="has the columns"):
        read_ledger(tmp_path)


def test_summary_counts_every_row_once(folders, monkeypatch):
    write(folders[0], monkeypatch, "2_kalman_filter", ours=3.0)
    write(folders[0], monkeypatch, "3_motion_models")
    ledger = read_ledger(folders[0])
    counts = summary(ledger)
    assert list(counts.columns) == [*VERDICTS, "total"]
    assert counts.loc["1_thesis/2_kalman_filter"].tolist() == [1, 0, 1, 0, 0, 0, 0, 0, 2]
    assert counts["total"].sum() == len(ledger)
    assert summary_markdown(ledger).splitlines()[2:] == [
        "| 1_thesis | 3 | 0 | 1 | 0 | 0 | 0 | 0 | 0 | 4 |",
        "| together | 3 | 0 | 1 | 0 | 0 | 0 | 0 | 0 | 4 |",
    ]
    with pytest.raises(ValueError, match="'excellent'"):
        summary(ledger.assign(verdict="excellent"))


def test_compare_is_silent_on_what_rounding_does(folders, monkeypatch):
    write(folders[0], monkeypatch, ours=1.0, residual=2e-16)
    write(folders[1], monkeypatch, ours=1.0 + 1e-9, residual=7e-15)
    assert compare(*folders) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"ours": 1.001}, "1_thesis/2_kalman_filter: cell: ours: '1' against '1.001'"),
        ({"residual": 3e-9}, "equation: verdict: 'reproduced' against 'not reproduced'"),
        ({"note": "another"}, "cell: note: '' against 'another'"),
        ({"ids": ("cell", "other")}, "['equation'] only in"),
        ({"ids": ("equation", "cell")}, "or their order"),
    ],
)
def test_compare_finds_a_changed_number_text_row_or_order(folders, monkeypatch, changes, words):
    write(folders[0], monkeypatch)
    write(folders[1], monkeypatch, **changes)
    assert any(words in line for line in compare(*folders))


def test_compare_reports_missing_files_from_both_sides_unless_excluded(folders, monkeypatch):
    write(folders[0], monkeypatch, "2_kalman_filter")
    write(folders[1], monkeypatch, "3_motion_models")
    assert compare(*folders) == [
        f"1_thesis/2_kalman_filter: missing in {folders[1]}",
        f"1_thesis/3_motion_models: missing in {folders[0]}",
    ]
    assert compare(*folders, exclude={"1_thesis/2_kalman_filter", "1_thesis/3_motion_models"}) == []

import pytest

QUESTIONS = """
[t9-vx-max]
kind = "table"
where = "Table 9, vx"
asks = "largest error (m/s)"
printed = { table = "thesis 9", row = "vx", column = "max" }
rule = "cell"
assumption = "lidar σ = 0.15 m"
known_before = "asked with the answer"
set = 2026-11-22

[gain]
kind = "equation"
where = "(2.11)"
asks = "gain: printed form against the derivation"
rule = "equation"
set = 2026-11-22

[spread]
kind = "table"
where = "§4"
asks = "RMSE of x (m)"
printed = "0.50"
rule = "random cell"
set = 2026-11-22

[better]
kind = "claim"
where = "§4.1"
asks = "RMSE over the rival's"
printed = "clearly better"
rule = "< 0.9"
set = 2026-11-22
changed = [{ on = 2026-11-24, was = "< 1", because = "'better' is read as by 10 % throughout", turned = "reproduced" }]

[nees]
kind = "claim"
where = "beyond"
asks = "average NEES"
rule = "beyond"
set = 2026-11-22

[figure-7]
kind = "figure"
where = "Figure 7"
asks = "the curve"
rule = "lost"
note = "the scan has no drawing"
set = 2026-11-22

[timing]
kind = "claim"
where = "§5"
asks = "seconds a run"
rule = "< 1"
set = 2026-11-22
withdrawn = { on = 2026-11-25, why = "timings are no rows", verdict = "not reproduced" }
"""


@pytest.fixture
def ask(tmp_path, monkeypatch):
    """A function that writes a file of questions, 1_thesis__2_kalman_filter.toml unless named; results go beside it."""
    monkeypatch.setenv("TRACKHELPERS_QUESTIONS", str(tmp_path / "questions"))
    monkeypatch.setenv("TRACKHELPERS_RESULTS", str(tmp_path / "results"))
    (tmp_path / "questions").mkdir()

    def write(text=QUESTIONS, name="1_thesis__2_kalman_filter"):
        path = tmp_path / "questions" / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write

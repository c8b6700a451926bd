"""What is handed out holds every exercise and no solution."""

import ast
from functools import cache

import nbformat
import pytest
from IPython.core.inputtransformer2 import TransformerManager

from trackhelpers.suite import NOTEBOOKS, ROOT, notebooks, student

TASK = "# your code here"


def name(path):
    return path.relative_to(NOTEBOOKS).with_suffix("").as_posix()


@pytest.fixture(scope="module")
def handed_out(tmp_path_factory):
    return student.copy(out=tmp_path_factory.mktemp("build") / "student")


@cache
def read(path):
    return nbformat.read(path, as_version=4).cells


@pytest.mark.parametrize("path", notebooks(), ids=name)
def test_no_solution_survives_and_every_task_can_be_run(handed_out, path):
    whole, left = read(path), read(handed_out / path.relative_to(NOTEBOOKS))
    solutions = [cell for cell in whole if student.is_solution(cell)]
    text = "\n".join(cell.source for cell in left)
    stored = nbformat.writes(nbformat.v4.new_notebook(cells=left))
    assert not [cell.id for cell in left if student.is_solution(cell)] and "**Discussion" not in text
    for cell in solutions:
        assert cell.source not in text
        for output in cell.outputs:
            shown = (
                output.get("text") or output["data"].get("text/html") or output["data"].get("image/png") or "".join(output["data"].values())
            )
            assert len(shown) < 40 or (nbformat.v4.new_raw_cell(shown).source not in text and shown.strip() not in stored)
    tasks = [cell for cell in left if cell.cell_type == "code" and TASK in cell.source]
    assert len(tasks) == len([cell for cell in whole if cell.cell_type == "code" and TASK in cell.source])
    for cell in left:
        if cell.cell_type == "code":
            ast.parse(TransformerManager().transform_cell(cell.source))


@pytest.mark.parametrize("path", notebooks(), ids=name)
def test_what_is_left_needs_nothing_of_a_solution(path):
    """A name that only a solution defines is used by no cell that stays, so the copy runs."""
    cells, defined, needed = read(path), {}, set()
    for cell in cells:
        if cell.cell_type == "code":
            tree = ast.parse(TransformerManager().transform_cell(cell.source))
            for node in ast.walk(tree):
                names = (
                    [node.id]
                    if isinstance(node, ast.Name)
                    else [node.arg]
                    if isinstance(node, ast.arg)
                    else [node.name]
                    if isinstance(node, ast.FunctionDef | ast.ClassDef)
                    else []
                )
                names += [
                    (alias.asname or alias.name).split(".")[0] for alias in getattr(node, "names", []) if isinstance(alias, ast.alias)
                ]
                stores = not isinstance(getattr(node, "ctx", ast.Store()), ast.Load)
                for each in names:
                    if stores:
                        defined.setdefault(each, set()).add(student.is_solution(cell))
                    elif not student.is_solution(cell):
                        needed.add(each)
    assert not [each for each in needed if defined.get(each) == {True}]


def test_headings_and_the_rest_of_the_text_stay(handed_out):
    for path in notebooks():
        headings = [
            [line for cell in cells if cell.cell_type == "markdown" for line in cell.source.splitlines() if line.startswith("#")]
            for cells in (read(path), read(handed_out / path.relative_to(NOTEBOOKS)))
        ]
        assert headings[0] == headings[1], name(path)


def test_what_the_copy_links_to_comes_along(handed_out):
    assert (handed_out / "results").is_dir() and handed_out.name == "student"
    assert {path.name for path in (NOTEBOOKS / "results").glob("*.md")} == {path.name for path in (handed_out / "results").glob("*.md")}
    assert (ROOT / "Makefile").read_text(encoding="utf-8").count("suite student") == 1

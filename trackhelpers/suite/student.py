"""A copy of the notebooks without the solutions of the exercises, to hand out."""

import re
import shutil
from pathlib import Path

import nbformat

from trackhelpers.suite import NOTEBOOKS, ROOT, form, notebooks

__all__ = ["copy", "is_solution", "without_solutions"]

SOLUTION = "hide-input"  # the tag of a cell that solves an exercise
_DISCUSSION = re.compile(r"^\*\*Discussion\b.*?(?=^#|\Z)", re.DOTALL | re.MULTILINE)  # up to the next heading
_FOLDED = re.compile(r"Below each empty cell a solution is folded away; try first\.\n*")


def is_solution(cell):
    """Whether a cell solves an exercise."""
    return cell.cell_type == "code" and SOLUTION in cell.metadata.get("tags", [])


def without_solutions(notebook):
    """Take the solutions of a notebook's exercises out, with their output and the discussion after each, in place, and return it."""
    kept, solved = [], False
    for cell in notebook.cells:
        if is_solution(cell):
            solved = True
            continue
        if cell.cell_type == "markdown":
            cell.source = _FOLDED.sub("", cell.source)
            if solved:
                cell.source, solved = _DISCUSSION.sub("", cell.source), False
            if not cell.source.strip():
                continue
        kept.append(cell)
    notebook.cells = kept
    return form.normalise(notebook)


def copy(folder=NOTEBOOKS, out=ROOT / "build" / "student"):
    """Write the notebooks below `folder` to `out` without their solutions, with all that they link to, and return `out`."""
    folder, out = Path(folder), Path(out)
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(folder, out, ignore=shutil.ignore_patterns("*.ipynb", ".*"))
    for path in notebooks(folder):
        form.write(without_solutions(nbformat.read(path, as_version=4)), out / path.relative_to(folder))
    return out

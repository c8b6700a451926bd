"""The notebook shows, the package serves: scenarios hold truth, measurements and cast, and what one notebook alone uses stands in it."""

import ast
import re
from collections import Counter

import nbformat
import pytest

from trackhelpers.suite import ROOT, notebooks

PACKAGE = ROOT / "trackhelpers"
SOURCES = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
OWN_ROOMS = {"forensics", "published", "scenarios", "suite"}  # searches, printed formulas, a paper's truth, and what runs the notebooks
# Names that design and users count on, though no two notebooks do yet.
OFFERED = {"FDOA", "Plane", "available", "lidar_radar_log", "MotionIMM", "information_fusion", "PolarCV", "PolarCA"}
OFFERED |= {"maximum_likelihood", "error_table"}


@pytest.mark.parametrize("path", [path for path in SOURCES if "scenarios" in path.parts], ids=lambda path: path.stem)
def test_scenarios_run_no_filter_fit_nothing_and_draw_nothing(path):
    found = re.findall(r"\.predict\(|\.update\(|least_squares|minimize|curve_fit|\bplt\.|\bplots\b|\bTable\(", SOURCES[path])
    assert not found


def test_what_a_single_notebook_uses_stands_in_it():
    code = ["\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code") for path in notebooks()]
    lonely, word, notebooks_of = [], re.compile(r"\w+"), Counter()
    for text in code:
        notebooks_of.update(set(word.findall(text)))
    words = {path: Counter(word.findall(source)) for path, source in SOURCES.items()}
    for path, source in SOURCES.items():
        if OWN_ROOMS & set(path.relative_to(PACKAGE).parts):
            continue
        for node in ast.parse(source).body:
            if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_") or node.name in OFFERED:
                continue
            elsewhere = any(node.name in words[at] for at in SOURCES if at != path and at.name != "__init__.py")
            here = words[path][node.name] > 1 + source.count(f'"{node.name}"')
            if not elsewhere and not here and notebooks_of[node.name] < 2:
                lonely.append(f"{path.relative_to(ROOT)}: {node.name}")
    assert not lonely


def test_no_module_is_too_long_to_read_at_one_sitting():
    long = {str(path.relative_to(ROOT)): source.count("\n") for path, source in SOURCES.items() if source.count("\n") > 270}
    assert not long

"""Runs the notebooks, stores them normalised, and builds the web book: ``python -m trackhelpers.suite refresh|book``."""

import re
from pathlib import Path

from trackhelpers import datasets

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
FIRST_PAGE = "00_start_here.ipynb"

# Notebooks that need a public file that may be out of reach; without it they are skipped by name and keep their committed outputs.
NEEDS = {"1_thesis/4_3_public_log.ipynb": "obj_pose-laser-radar-synthetic-input.txt"}


def notebooks(folder=NOTEBOOKS):
    """Return the notebooks below `folder` in reading order, numbers in names counted as numbers; hidden folders are left out."""
    found = [p for p in Path(folder).rglob("*.ipynb") if not any(part.startswith(".") for part in p.relative_to(folder).parts)]
    return sorted(found, key=lambda p: [_natural(part) for part in p.relative_to(folder).parts])


def _natural(name):
    """Sort key that puts 2_b before 10_a; the pieces alternate between text and number, so that keys compare."""
    return [int(piece) if i % 2 else piece for i, piece in enumerate(re.split(r"(\d+)", name))]


def missing_data(path, folder=NOTEBOOKS):
    """Return why the notebook `path` below `folder` cannot run here, or None if it can."""
    needed = NEEDS.get(Path(path).relative_to(folder).as_posix())
    if needed is None or datasets.available(needed):
        return None
    return f"{Path(path).name} needs {needed}, which is neither here nor to be downloaded"

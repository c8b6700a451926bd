"""Runs the notebooks, stores them normalised, and builds the web book: ``python -m trackhelpers.suite refresh|book``."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"
FIRST_PAGE = "00_start_here.ipynb"

# Notebooks that need a public file that may be out of reach; without it they are skipped by name and keep their committed outputs.
NEEDS = {"1_thesis/4_3_public_log.ipynb": "obj_pose-laser-radar-synthetic-input.txt"}

# Those that run longest (half a minute), the longest first: begun last, one of them would run on alone.
LONGEST = (
    "4_space_tdoa/4_starts_and_formations.ipynb",
    "4_space_tdoa/4_simulation.ipynb",
    "1_thesis/5_3_epidemic.ipynb",
    "3_augmented_bias/3_simulation.ipynb",
    "5_real_targets/2_ships.ipynb",
    "1_thesis/5_1_ukf_ctra.ipynb",
    "5_real_targets/1_aircraft.ipynb",
)


def notebooks(folder=NOTEBOOKS):
    """Return the notebooks below `folder` in reading order, numbers in names counted as numbers; hidden folders are left out."""
    found = [p for p in Path(folder).rglob("*.ipynb") if not any(part.startswith(".") for part in p.relative_to(folder).parts)]
    return sorted(found, key=lambda p: [_natural(part) for part in p.relative_to(folder).parts])


def _natural(name):
    """Sort key that puts 2_b before 10_a; the pieces alternate between text and number, so that keys compare."""
    return [int(piece) if i % 2 else piece for i, piece in enumerate(re.split(r"(\d+)", name))]


def longest_first(items, folder=NOTEBOOKS, path=Path):
    """Return `items` with the notebooks of `LONGEST` first, the others after them as they come.

    Parameters
    ----------
    items : iterable
        Paths below `folder`, or anything of which `path` tells its own; the items of one notebook keep their order.
    """
    rank = {Path(folder) / name: i for i, name in enumerate(LONGEST)}
    return sorted(items, key=lambda item: rank.get(path(item), len(LONGEST)))


def missing_data(path, folder=NOTEBOOKS):
    """Return why the notebook `path` below `folder` cannot run here, or None if it can."""
    from trackhelpers import datasets  # with pandas: the third of a second before Ctrl-C is listened to

    needed = NEEDS.get(Path(path).relative_to(folder).as_posix())
    reason = None if needed is None else datasets.why_not(needed)
    return reason and f"{Path(path).name} needs {needed}: {reason}"

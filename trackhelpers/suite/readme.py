"""The README's generated parts: the summary of the ledger, the measured speed, and one figure taken from a notebook."""

import base64

import nbformat

from trackhelpers.ledger import read_ledger
from trackhelpers.ledger.readme import replaced, with_summary
from trackhelpers.suite import NOTEBOOKS, ROOT

FIGURE = ROOT / "book" / "readme.png"
SPEED = ROOT / "benchmarks" / "results.md"
FIGURE_TAG = "readme-figure"


def tagged_figure(folder=NOTEBOOKS):
    """Bytes of the PNG that the one cell tagged ``readme-figure`` shows.

    Raises
    ------
    ValueError
        When not exactly one figure is tagged.
    """
    found = []
    for path in sorted(folder.rglob("*.ipynb")):
        for cell in nbformat.read(path, as_version=4).cells:
            if FIGURE_TAG in cell.metadata.get("tags", []):
                found += [output.data["image/png"] for output in cell.outputs if "image/png" in output.get("data", {})]
    if len(found) != 1:
        raise ValueError(f"the tag {FIGURE_TAG!r} marks {len(found)} figures, expected exactly one")
    return base64.b64decode(found[0])


def generated(text):
    """Return the README's `text` with its generated blocks in step with the committed ledger and the last measurement."""
    _, _, measured = SPEED.read_text(encoding="utf-8").partition("\n")
    return replaced(with_summary(text, read_ledger()), "speed", measured.strip().replace("\n## ", "\n#### ") + "\n")


def write():
    """Bring README.md and its figure in step with what is committed."""
    readme = ROOT / "README.md"
    readme.write_text(generated(readme.read_text(encoding="utf-8")), encoding="utf-8", newline="\n")
    FIGURE.write_bytes(tagged_figure())

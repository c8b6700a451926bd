"""What the form of a notebook that answers questions asks for, as numbers: short open cells, bookkeeping out of sight, a length that can be read at one sitting."""

import ast
import re
from statistics import median

from IPython.core.inputtransformer2 import TransformerManager

__all__ = ["faults", "statements", "unintroduced", "untagged", "words"]

MOST_STATEMENTS, MEDIAN_STATEMENTS, LINE, MOST_WORDS = 15, 6, 82, 3500

_LEDGER = re.compile(r"(?<![\w.])ledger\.")
_FIGURE = re.compile(r"\bplots\.show\(|\bPlayground\(")
_CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
_DISPLAYED = re.compile(r"\$\$(.*?)\$\$", re.DOTALL)
_NOT_WORDS = re.compile(
    r"```.*?```|\$\$.*?\$\$|\$[^$\n]+\$|^[ \t]*\|[^\n]*\|[ \t]*$|</?[a-zA-Z][^>\n]*>|\]\([^)]*\)", re.DOTALL | re.MULTILINE
)


def statements(source):
    """Return the number of statements of a code cell, those inside functions and loops counted too."""
    tree = ast.parse(TransformerManager().transform_cell(source))
    return sum(isinstance(node, ast.stmt) for node in ast.walk(tree))


def words(notebook):
    """Return the number of words of a notebook's text, without formulas, code, tables and the addresses of links."""
    text = "\n\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    return len(re.findall(r"\w[\w'’-]*", _NOT_WORDS.sub(" ", text)))


def _folded(cell):
    return bool({"hide-cell", "hide-input"} & set(cell.metadata.get("tags", [])))


def untagged(notebook):
    """Return a line of text for each displayed equation, ``$$…$$``, that does not carry exactly one ``\\tag``."""
    found = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            for equation in _DISPLAYED.findall(_CODE.sub("", cell.source)):
                tags = len(re.findall(r"\\tag\b", equation))
                if tags != 1:
                    found.append(f"cell {cell.id} has an equation with {tags} tags, expected one: {' '.join(equation.split())[:60]}")
    return found


def unintroduced(notebook):
    """Return a line of text for each open code cell that follows a code cell, open or folded, or a heading, without a sentence between.

    One that only waits for the reader needs none, nor does the one that writes the ledger, nor do those before the first section, which prepare its picture and are folded in the book.
    """
    found, before, cells = [], None, notebook.cells
    sections = [i for i, cell in enumerate(cells) if cell.cell_type == "markdown" and re.search("^## ", cell.source, flags=re.MULTILINE)]
    for cell in cells[sections[0] :] if sections else cells:
        if cell.cell_type == "markdown" and not cell.source.strip():
            continue
        if cell.cell_type == "code" and before in ("another code cell", "a heading") and not _folded(cell) and statements(cell.source):
            if before != "a heading" or not _LEDGER.search(cell.source):
                found.append(f"cell {cell.id} follows {before}, expected text that says what it is for")
        headed = cell.cell_type == "markdown" and cell.source.rstrip().splitlines()[-1].startswith("#")
        before = "another code cell" if cell.cell_type == "code" else "a heading" if headed else "text"
    return found


def faults(notebook):
    """Return what keeps a notebook from its form, a line of text each.

    Open code cells have at most 15 statements, figures (`plots.show`, `Playground`) excepted, and 6 in the median; lines have at most 82 characters; a cell shows at most one figure; the ledger is
    spoken to in the first code cell, the last one, and at most one folded cell a section (tag ``hide-cell``, ``jupyter.source_hidden``); the text has at most 3500 words;
    a displayed equation has one number (`untagged`), and text leads to each open cell (`unintroduced`).
    """
    found, counts, sections = [], [], []
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    section = "before the first section"
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            section = (re.findall(r"^## +(.*)", cell.source, flags=re.MULTILINE) or [section])[-1]
            continue
        if cell.cell_type != "code":
            continue
        tags = cell.metadata.get("tags", [])
        figures, count = len(_FIGURE.findall(cell.source)), statements(cell.source)
        wide = max((len(line) for line in cell.source.splitlines()), default=0)
        if wide > LINE:
            found.append(f"cell {cell.id} has a line of {wide} characters, expected at most {LINE}")
        if figures > 1:
            found.append(f"cell {cell.id} shows {figures} figures, expected one a cell")
        if not _folded(cell) and not figures and count:  # a cell that is a comment waits for the reader
            counts.append(count)
            if count > MOST_STATEMENTS:
                found.append(f"cell {cell.id} has {count} statements, expected at most {MOST_STATEMENTS}")
        if not _LEDGER.search(cell.source) or cell is code[0] or cell is code[-1]:
            continue
        if "hide-cell" not in tags or not cell.metadata.get("jupyter", {}).get("source_hidden"):
            found.append(f"cell {cell.id} speaks to the ledger, expected it folded: tag hide-cell, jupyter.source_hidden")
        if section in sections:
            found.append(f"section {section!r} has a second cell of bookkeeping ({cell.id}), expected at most one")
        sections.append(section)
    if counts and median(counts) > MEDIAN_STATEMENTS:
        found.append(f"the median of the open cells is {median(counts)} statements, expected at most {MEDIAN_STATEMENTS}")
    if words(notebook) > MOST_WORDS:
        found.append(f"the text has {words(notebook)} words, expected at most {MOST_WORDS}")
    return found + untagged(notebook) + unintroduced(notebook)

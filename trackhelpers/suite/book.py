"""Builds the web book: every notebook run afresh, then static pages that load nothing from outside."""

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import nbformat

from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, ROOT, form, notebooks
from trackhelpers.suite.run import run

# Captions of the parts; a folder that is not named here gets its name, made readable.
PARTS = {
    "1_thesis": "1 · The thesis",
    "2_track_fusion": "2 · Track fusion",
    "3_augmented_bias": "3 · Augmented bias",
    "4_space_tdoa": "4 · Space targets by TDOA",
    "5_real_targets": "5 · Real targets",
}


def build(folder=NOTEBOOKS, out=ROOT / "build"):
    """Run the notebooks below `folder` and build the book from them.

    Writes ``notebooks/`` (as run), ``results/`` (their ledgers) and ``book/html/`` into `out`, and returns the path of the first page.

    Raises
    ------
    FileNotFoundError
        If `folder` lacks 00_start_here.ipynb, the book's first page.
    NotebookError
        If a notebook does not run to its end.
    RuntimeError
        If Sphinx warns, or a page would load something from the network.
    """
    folder, out = Path(folder), Path(out)
    if not (folder / FIRST_PAGE).exists():
        raise FileNotFoundError(f"{folder / FIRST_PAGE}: the book's first page is missing")
    executed = out / "notebooks"
    for old in (executed, out / "results", out / "book"):
        shutil.rmtree(old, ignore_errors=True)
    # Pictures and tables that the notebooks' text refers to come along.
    shutil.copytree(folder, executed, ignore=shutil.ignore_patterns("*.ipynb", ".*"))
    (out / "results").mkdir()
    run(notebooks(folder), lambda path: executed / path.relative_to(folder), folder=folder, results=out / "results")
    return pages(executed, out / "book")


def pages(executed, out):
    """Build the pages of the notebooks below `executed` into ``out/html`` and return the path of the first one."""
    source, html = out / "source", out / "html"
    shutil.copytree(executed, source)
    for path in notebooks(source):
        form.write(for_the_book(nbformat.read(path, as_version=4)), path)
    for path in (source / "results").glob("*.md"):
        path.write_text(page_of_rows(path.read_text(encoding="utf-8")), encoding="utf-8")
    first = nbformat.read(source / FIRST_PAGE, as_version=4)
    first.cells.append(nbformat.v4.new_markdown_cell(contents(source), id="table-of-contents"))
    form.write(first, source / FIRST_PAGE)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-c", ROOT / "book"]
    if subprocess.run([*command, "-d", out / "doctrees", source, html]).returncode:
        raise RuntimeError("Sphinx warned, see above: the book is not built")
    outside = outside_addresses(html)
    if outside:
        raise RuntimeError("the book would load from the network:\n" + "\n".join(outside))
    start = Path(FIRST_PAGE).with_suffix(".html").name
    index = html / "index.html"
    index.write_text(f'<!DOCTYPE html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={start}">\n', encoding="utf-8")
    return index


def for_the_book(notebook):
    """Give what is folded away its prompt and each figure its caption as alt text, in place, and return the notebook."""
    for cell in notebook.cells:
        options = {}
        if "hide-cell" in cell.metadata.get("tags", []):
            options |= {"code_prompt_show": "Bookkeeping", "code_prompt_hide": "Bookkeeping"}
        captions = [output.data.get("text/markdown", "") for output in cell.get("outputs", []) if "data" in output]
        captions = [plain(text) for text in captions if text.startswith("**Figure ")]
        if captions:
            options["image"] = {"alt": " ".join(captions)}
        if options:
            cell.metadata["mystnb"] = options
    return notebook


def plain(markdown):
    """Return a caption as it would be read aloud: no marks of emphasis, code or formulas, of a link its text."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", markdown)
    text = re.sub(r"\*\*|[`$]", "", text)
    return " ".join(re.sub(r"\*(\S(?:[^*]*\S)?)\*", r"\1", text).split())


def page_of_rows(text):
    """Return a notebook's page of rows for the book, which reaches it by links alone; its headings are anchors there."""
    return "---\norphan: true\n---\n\n" + re.sub(r'<a id="[^"]*"></a>\n\n', "", text)


def contents(source):
    """Return the book's table of contents in MyST: one hidden toctree a folder, its notebooks in reading order."""
    parts = {}
    for path in notebooks(source):
        if path.name != FIRST_PAGE:
            parts.setdefault(path.relative_to(source).parts[0], []).append(path.relative_to(source).with_suffix("").as_posix())
    blocks = []
    for part, names in parts.items():
        caption = PARTS.get(part) or re.sub(r"^(\d+)\W", r"\1 · ", part.replace("_", " "))
        blocks.append("\n".join(["```{toctree}", ":hidden:", f":caption: {caption}", "", *names, "```"]))
    return "\n\n".join(blocks)


class _Loads(HTMLParser):
    """Collects the addresses that a browser fetches by itself when it shows a page; a link to follow is not one."""

    def __init__(self):
        super().__init__()
        self.addresses = []

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag == "link" and not {"stylesheet", "icon", "preload", "modulepreload", "manifest"} & set((attrs.get("rel") or "").split()):
            return
        names = {"link": ["href"], "object": ["data"], "use": ["href"], "image": ["href"], "video": ["src", "poster"]}.get(
            tag, ["src", "srcset"]
        )
        self.addresses += [attrs[name] for name in names if attrs.get(name)]


def outside_addresses(html):
    """Return ``page: address`` for everything that pages and style sheets below `html` would load from another host."""
    found = []
    for page in sorted(Path(html).rglob("*")):
        if page.suffix == ".html":
            text = page.read_text(encoding="utf-8")
            parser = _Loads()
            parser.feed(text)
            styles, scripts = ("\n".join(re.findall(rf"<{tag}.*?</{tag}>", text, flags=re.DOTALL)) for tag in ("style", "script"))
            addresses = parser.addresses + _in_styles(styles) + re.findall(r"""(?:from|import)[\s(]*["']([^"']+)""", scripts)
        elif page.suffix == ".css":
            addresses = _in_styles(page.read_text(encoding="utf-8"))
        else:
            continue
        found += [f"{page.relative_to(html)}: {a}" for a in addresses if re.match(r"(https?:)?//", a.strip())]
    return found


def _in_styles(css):
    return re.findall(r"""(?:url\(|@import)\s*["']?([^"')\s;]+)""", css)

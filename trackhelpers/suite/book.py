"""Builds the web book: every notebook run afresh, then static pages that load nothing from outside."""

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import nbformat

from trackhelpers.ledger import read_ledger
from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, ROOT, form, notebooks, written
from trackhelpers.suite.api_page import GROUPS, api_pages, homes
from trackhelpers.suite.for_the_book import for_the_book
from trackhelpers.suite.ledger_page import by_number, ledger_page, places_of, titles
from trackhelpers.suite.run import run

# Captions of the parts; a folder that is not named here gets its name, made readable.
PARTS = {
    "1_thesis": "1 · The thesis",
    "2_track_fusion": "2 · Track fusion",
    "3_augmented_bias": "3 · Augmented bias",
    "4_space_tdoa": "4 · Space targets by TDOA",
    "5_real_targets": "5 · Real targets",
}

# Said on the first page: any printed number is two clicks away from its proof, on a phone too, where the table of contents is out of sight.
LOOK_UP = "To look something up: [a table, figure or equation by its number](by_number.md), or [the whole ledger](ledger.md)."


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
        If Sphinx warns, a page would load something from the network, or a link leads nowhere.
    """
    folder, out = Path(folder), Path(out)
    if not (folder / FIRST_PAGE).exists():
        raise FileNotFoundError(f"{folder / FIRST_PAGE}: the book's first page is missing")
    executed = out / "notebooks"
    fresh, book = out / "book.part", out / "book"
    for old in (executed, out / "results", fresh):
        shutil.rmtree(old, ignore_errors=True)
    # Pictures and tables that the notebooks' text refers to come along.
    shutil.copytree(folder, executed, ignore=shutil.ignore_patterns("*.ipynb", ".*"))
    (out / "results").mkdir()
    run(notebooks(folder), lambda path: executed / path.relative_to(folder), folder=folder, results=out / "results")
    try:
        index = pages(executed, fresh, with_written=True, with_reference=True)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
    shutil.rmtree(book, ignore_errors=True)  # the old book stays until the new one is whole
    fresh.rename(book)
    return book / index.relative_to(fresh)


def pages(executed, out, with_written=False, with_reference=False):
    """Build the pages of the notebooks below `executed`, and if asked the written ones and the API reference, into ``out/html`` and return the path of the first one."""
    source, html = out / "source", out / "html"
    shutil.copytree(executed, source)
    chapters = {path.relative_to(source).with_suffix("").as_posix(): nbformat.read(path, as_version=4) for path in notebooks(source)}
    ledger = read_ledger(source / "results", source / "questions") if any((source / "results").glob("*__*.csv")) else None
    places, called = {} if ledger is None else places_of(ledger), titles(chapters)
    for name, text in api_pages(chapters).items() if with_reference else ():
        (source / name).write_text(text, encoding="utf-8")
    known = homes() if with_reference else {}
    for name, notebook in chapters.items():
        rows = () if ledger is None else ledger.loc[ledger["notebook"] == name, "id"]
        form.write(for_the_book(notebook, name, places, list(rows), known), source / f"{name}.ipynb")
    if ledger is not None:
        (source / "ledger.md").write_text(ledger_page(ledger, called), encoding="utf-8")
        (source / "by_number.md").write_text(by_number(places), encoding="utf-8")
    if with_written:
        written.lay(source)
    for path in (source / "results").glob("*.md"):
        path.write_text(page_of_rows(path.read_text(encoding="utf-8"), called), encoding="utf-8")
    first = nbformat.read(source / FIRST_PAGE, as_version=4)
    if ledger is not None:
        first.cells.insert(1, nbformat.v4.new_markdown_cell(LOOK_UP, id="look-up"))
    first.cells.append(nbformat.v4.new_markdown_cell(contents(source), id="table-of-contents"))
    form.write(first, source / FIRST_PAGE)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-c", ROOT / "book"]
    # in a session of its own, so that Ctrl-C is this program's to tell of
    if subprocess.run([*command, "-d", out / "doctrees", source, html], start_new_session=True).returncode:
        raise RuntimeError("Sphinx warned, see above: the book is not built")
    for page in html.rglob("*.html"):
        page.write_text(without_empty_headers(page.read_text(encoding="utf-8")), encoding="utf-8")
    outside = outside_addresses(html)
    if outside:
        raise RuntimeError("the book would load from the network:\n" + "\n".join(outside))
    dead = dead_links(html)
    if dead:
        raise RuntimeError("the book has links that lead nowhere:\n" + "\n".join(dead))
    start = Path(FIRST_PAGE).with_suffix(".html").name
    index = html / "index.html"
    index.write_text(f'<!DOCTYPE html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={start}">\n', encoding="utf-8")
    return index


def without_empty_headers(text):
    """Return a page whose tables have a plain cell where a header cell would be empty, as in the corner of a matrix: a reader's voice would announce it."""
    return re.sub(r"<th([^>]*)>(\s|&nbsp;|&#160;|<p>\s*</p>)*</th>", r"<td\1></td>", text)


def page_of_rows(text, called):
    """Return a notebook's page of rows for the book, which reaches it by links alone: its headings are anchors there, its title is the chapter's, of `called`."""
    text = re.sub(r"^# Rows of (.*)$", lambda name: f"# Rows of {called.get(name[1], name[1])}", text, count=1, flags=re.MULTILINE)
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
        blocks.append(_toctree(caption, names))
    there = (source / "pages").exists()
    if there:
        blocks.append(_toctree("The papers, in their own order", [f"pages/{Path(page).stem}" for page in written.PAPERS]))
    look_up = [
        *(["ledger", "by_number"] if (source / "ledger.md").exists() else []),
        *([f"pages/{p}" for p in written.LOOK_UP] if there else []),
    ]
    if look_up:
        blocks.append(_toctree("To look things up", look_up))
    if (source / f"{next(iter(GROUPS))}.md").exists():
        blocks.append(_toctree("API reference", GROUPS))
    return "\n\n".join(blocks)


def _toctree(caption, names):
    return "\n".join(["```{toctree}", ":hidden:", f":caption: {caption}", "", *names, "```"])


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


class _Links(HTMLParser):
    """Collects the links of a page and the places in it that a link may name."""

    def __init__(self):
        super().__init__()
        self.links, self.places = [], {""}

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.places |= {attrs.get("id"), attrs.get("name") if tag == "a" else None} - {None}
        if tag == "a" and attrs.get("href"):
            self.links.append(attrs["href"])


def dead_links(html):
    """Return ``page: link`` for every link between pages below `html` to a file, or to a place in it, that is not there."""
    pages = {}
    for path in Path(html).rglob("*.html"):
        pages[path.resolve()] = page = _Links()
        page.feed(path.read_text(encoding="utf-8"))
    found = []
    for path, page in pages.items():
        for link in page.links:
            address = urlsplit(link)
            target = (path.parent / unquote(address.path)).resolve() if address.path else path
            if address.scheme or address.netloc or "=" in address.fragment:  # "#q=…" is asked of the ledger's page
                continue
            there = unquote(address.fragment) in pages[target].places if target in pages else target.exists()
            if not there:
                found.append(f"{path.relative_to(Path(html).resolve())}: {link}")
    return sorted(found)


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

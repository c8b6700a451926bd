"""What the book adds to a notebook: prompts for what is folded, alt texts, a place to point at for every row, links from equation numbers, the language of Chinese words."""

import base64
import re
import struct

import nbformat

__all__ = ["for_the_book", "plain"]

MOVED = {
    "../book/pages/": "pages/",
    "../book/symbols.csv": "pages/symbols.md",
}  # from the start page: where a link leads in the repository, and in the book
STORED_DPI = 150  # of `plots.show`
PROMPTS = {"hide-cell": "Bookkeeping", "imports": "Imports", "picture": "How the picture is drawn", "cast": "The cast"}
_OWN_ROW = re.compile(r"\[[^\]\[]*\]\(\.\./results/([a-z0-9_]+?__[a-z0-9_]+)\.md#([a-z0-9-]+)")
_CHINESE = re.compile(r"[\u3400-\u9fff\uff00-\uffef\u3000-\u303f]+")
_NUMBERED = re.compile(r"(\$\$(?:(?!\$\$).)*?\\tag\{([^}]*)\}.*?\$\$)", re.DOTALL)
_TAG = re.compile(r"\\tag\{([^}]*)\}")
# Pieces of Markdown in which nothing is to be replaced: code, formulas, links, HTML, headings.
_UNTOUCHED = re.compile(r"(```.*?```|`[^`]*`|\$\$.*?\$\$|\$[^$\n]+\$|!?\[[^\]]*\]\([^)]*\)|<[^>]+>|^#+ .*?$)", re.DOTALL | re.MULTILINE)


def for_the_book(notebook, name="", places=None, rows=(), homes=None):
    """Make a notebook ready for the book, in place, and return it.

    Parameters
    ----------
    notebook : nbformat.NotebookNode
        As it is stored.
    name : str
        ``1_thesis/2_kalman_filter``.
    places : dict, optional
        (paper, "Equation", number) -> (notebook, id) of the row that settles it, as `trackhelpers.suite.ledger_page.places_of` gives it.
    rows : sequence of str
        Ids of the notebook's rows.
    homes : dict, optional
        Name of a class or function -> (page, full name) in the API reference, as `trackhelpers.suite.api_page.homes` gives it.
    """
    pointed, named = set(), set()
    shown = {tag for cell in notebook.cells if cell.cell_type == "markdown" for tag in _TAG.findall(cell.source)}
    _fold_the_opening(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            for here, there in MOVED.items():
                cell.source = cell.source.replace(f"]({here}", f"]({there}")
            cell.source = with_chinese(with_equations(with_places(cell.source, name, pointed), name, places or {}, shown))
            cell.source = with_reference(cell.source, name, homes or {}, named)
        options = {}
        for tag, prompt in PROMPTS.items():
            if tag in cell.metadata.get("tags", []):
                options |= {"code_prompt_show": prompt, "code_prompt_hide": prompt}
        captions = [output.data.get("text/markdown", "") for output in cell.get("outputs", []) if "data" in output]
        captions = [plain(text) for text in captions if text.startswith("**Figure ")]
        if captions:
            options["image"] = {"alt": " ".join(captions)} | _width(cell)
        if options:
            cell.metadata["mystnb"] = options
    _point_at_answers(notebook, [id for id in rows if id not in pointed])
    return notebook


def _width(cell):
    """The width at which a cell's image is shown where there is room: 96 pixels an inch, so that letters of 7 pt have more than 9 pixels."""
    for output in cell.outputs:
        png = output.get("data", {}).get("image/png")
        if png:
            (pixels,) = struct.unpack(">I", base64.b64decode(png[:48])[16:20])  # of a PNG's head
            return {"width": f"{pixels * 96 / STORED_DPI:.0f}px"}
    return {}


def _fold_the_opening(notebook):
    """Before the first section the reader meets the situation and its picture; what draws it is folded, cells of a kind in a row in one fold."""
    sections = [
        i for i, cell in enumerate(notebook.cells) if cell.cell_type == "markdown" and re.search(r"^## ", cell.source, flags=re.MULTILINE)
    ]
    opening, cells, last = notebook.cells[: next(iter(sections), None)], [], None
    for cell in opening:
        kind = None
        if cell.cell_type == "code" and not {"hide-cell", "hide-input"} & set(cell.metadata.get("tags", [])):
            only_imports = all(re.match(r"from |import |[ )]|plots\.use_style|ledger = |$", line) for line in cell.source.splitlines())
            kind = "imports" if only_imports else "picture" if "plots.show(" in cell.source else "cast"
            cell.metadata["tags"] = [*cell.metadata.get("tags", []), "hide-input", kind]
        if kind and kind == last and not cells[-1].outputs:
            cell.source = f"{cells.pop().source}\n\n\n{cell.source}"
        cells.append(cell)
        last = kind
    notebook.cells[: len(opening)] = cells


def with_places(text, name, pointed):
    """Markdown with an anchor ``row-<id>`` before the first mark of each of the notebook's own rows; `pointed` collects the ids."""

    def place(link):
        page, id = link.groups()
        if page != name.replace("/", "__", 1) or id in pointed:
            return link[0]
        pointed.add(id)
        return f'<a id="row-{id}"></a>{link[0]}'

    return _OWN_ROW.sub(place, text)


def _point_at_answers(notebook, ids):
    """Before the cells that answer questions, anchors of the rows that the text does not mention: each before the cell that writes most of its id."""
    answering = [cell for cell in notebook.cells if cell.cell_type == "code" and "ledger." in cell.source] or notebook.cells[-1:]
    before = {}
    for id in ids:
        written = {
            cell.id: max((k for k in range(len(id) + 1) if re.search(r"[\"']" + re.escape(id[:k]), cell.source)), default=0)
            for cell in answering
        }
        before.setdefault(max(reversed(answering), key=lambda cell: written[cell.id]).id, []).append(id)
    cells = []
    for cell in notebook.cells:
        if cell.id in before:
            anchors = "".join(f'<a id="row-{id}"></a>' for id in before[cell.id])
            cells.append(nbformat.v4.new_markdown_cell(anchors, id=f"rows-{len(cells)}"))
        cells.append(cell)
    notebook.cells = cells


def with_equations(text, name, places, shown=()):
    """Markdown with an anchor ``eq-<number>`` before each numbered equation, and links from where the text says a number.

    A number or letter in `shown`, those of the notebook's equations, leads to the equation; another number of the paper, (2.13), to where
    `places` says that it is settled. What the piece of text itself shows is in sight.
    """
    paper = name.split("/")[0]
    known = {}
    for (of, kind, number), (notebook, id) in places.items():
        if of == paper and kind == "Equation":
            known[number] = f"{'' if notebook == name else f'../{notebook}.html'}#row-{id}"
    known |= {number: f"#{_anchor(number)}" for number in shown if number not in _TAG.findall(text)}
    if known:
        alternatives = "|".join(re.escape(each) for each in sorted(known, key=len, reverse=True))
        pieces = _UNTOUCHED.split(text)
        for i in range(0, len(pieces), 2):
            pieces[i] = re.sub(rf"\(({alternatives})\)", lambda match: f'<a href="{known[match[1]]}">{match[0]}</a>', pieces[i])
        text = "".join(pieces)
    return _NUMBERED.sub(lambda match: f'<a id="{_anchor(match[2])}"></a>\n\n{match[1]}', text)


def _anchor(number):
    return "eq-" + re.sub(r"[^A-Za-z0-9]+", "-", number.replace("'", "-prime")).strip("-")


def with_reference(text, name, homes, named):
    """Markdown in which the first `MotionEKF` of a notebook leads to the API reference; `named` collects the names."""

    def link(match):
        if match[1] not in homes or match[1] in named:
            return match[0]
        named.add(match[1])
        page, full = homes[match[1]]
        return f'<a href="{"../" if "/" in name else ""}{page}.html#{full}">{match[0]}</a>'

    pieces = re.split(r"(```.*?```|\$\$.*?\$\$|!?\[[^\]]*\]\([^)]*\)|^#+ .*?$|^\|.*?$)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(piece if i % 2 else re.sub(r"`([A-Za-z]\w*)`", link, piece) for i, piece in enumerate(pieces))


def with_chinese(text):
    """Markdown in which Chinese words say their language."""
    pieces = _UNTOUCHED.split(text)
    return "".join(piece if i % 2 else _CHINESE.sub(r'<span lang="zh">\g<0></span>', piece) for i, piece in enumerate(pieces))


def plain(markdown):
    """Return a caption as it would be read aloud: no marks of emphasis, code or formulas, of a link its text."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", markdown)
    text = re.sub(r"\*\*|[`$]", "", text)
    return " ".join(re.sub(r"\*(\S(?:[^*]*\S)?)\*", r"\1", text).split())

"""Two pages of the book to look things up: the whole ledger, searched as one types, and an index by the numbers that the papers print."""

import re
from html import escape

from trackhelpers.ledger import MARKS, VERDICTS
from trackhelpers.ledger.numbers import short, shown

__all__ = ["by_number", "ledger_page", "places_of", "titles"]

PAPERS = {
    "1_thesis": "Paper 1, the thesis",
    "2_track_fusion": "Paper 2, track fusion",
    "3_augmented_bias": "Paper 3, augmented bias",
    "4_space_tdoa": "Paper 4, TDOA from space",
    "5_real_targets": "Real targets",
}
_NUMBERED = re.compile(
    r"Tables? (\d+)|Figures? (\d+)|(?<!conclusion )(?<!§\d )(?<!§\d\.\d )\((\d+(?:\.\d+)?)\)(?:(?:–| to )\((\d+(?:\.\d+)?)\))?"
)

SCRIPT = """
const list = [...document.querySelectorAll("#ledger > li")], box = document.querySelector("#ledger-search");
const picks = [...document.querySelectorAll("#ledger-filter select")], count = document.querySelector("#ledger-count");
const texts = list.map(row => row.textContent.toLowerCase());
function show() {
  const words = box.value.toLowerCase().split(/\\s+/).filter(word => word);
  let left = 0;
  list.forEach((row, i) => {
    const fits = picks.every(pick => !pick.value || row.dataset[pick.name] === pick.value) && words.every(word => texts[i].includes(word));
    row.hidden = !fits;
    left += fits;
  });
  count.textContent = left + " of " + list.length + " rows";
}
box.addEventListener("input", show);
picks.forEach(pick => pick.addEventListener("change", show));
const asked = new URLSearchParams(location.hash.slice(1));
if (asked.has("q")) box.value = asked.get("q");
picks.forEach(pick => { if (asked.has(pick.name)) pick.value = asked.get(pick.name); });
show();
"""


def titles(chapters):
    """Return what a link to a chapter is called, name -> "Paper 1, chapter 2 · The Kalman filter"; `chapters` maps a name to a notebook."""
    found = {}
    for name, notebook in chapters.items():
        text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
        heading = re.search(r"^# +(.*)", text, flags=re.MULTILINE)
        title = heading[1] if heading else name
        paper = PAPERS.get(name.split("/")[0], "").partition(",")[0]
        found[name] = f"{paper}, {'chapter ' if title[0].isdigit() else ''}{title}" if paper else title
    return found


def places_of(ledger):
    """Return where each printed table, figure and equation is settled first: (paper, kind, number) -> (notebook, id), in the order of the ledger."""
    places = {}
    for row in ledger.to_dict("records"):
        paper = row["notebook"].split("/")[0]
        for table, figure, first, last in _NUMBERED.findall(row["where"]):
            kind = "Table" if table else "Figure" if figure else "Equation"
            if kind == "Equation" and ("." in first) != (paper == "1_thesis"):
                continue  # another number in brackets
            for number in [table or figure] if kind != "Equation" else _range(first, last or first):
                places.setdefault((paper, kind, number), (row["notebook"], row["id"]))
    return places


def _range(first, last):
    chapter, dot, low = first.rpartition(".")
    return [f"{chapter}{dot}{number}" for number in range(int(low), int(last.rpartition(".")[2]) + 1)]


def by_number(places):
    """Return the page that leads from a printed number to its proof, as Markdown."""
    lines = ["# By number", "", "Every table, figure and equation that the papers number, and where it is settled; the marks stand there."]
    for paper, title in PAPERS.items():
        kinds = {kind: [key for key in places if key[:2] == (paper, kind)] for kind in ("Table", "Figure", "Equation")}
        if any(kinds.values()):
            lines += ["", f"## {title}"]
        for kind, keys in kinds.items():
            links = []
            for key in sorted(keys, key=lambda key: [int(part) for part in key[2].split(".")]):
                notebook, id = places[key]
                text = f"({key[2]})" if kind == "Equation" else f"{kind}&nbsp;{key[2]}"
                links.append(f'<a href="{notebook}.html#row-{id}">{text}</a>')
            if links:
                lines += ["", f"**{kind}s:** " + " · ".join(links)]
    return "\n".join(lines) + "\n"


def ledger_page(ledger, called=None):
    """Return the whole ledger as a page that filters as one types, from a file too: MyST with HTML and a few lines of script; `called` are the chapters' `titles`."""
    rows = "\n".join(_row(row, (called or {}).get(row["notebook"], row["notebook"])) for row in ledger.to_dict("records"))
    papers = {paper: title for paper, title in PAPERS.items() if ledger["notebook"].str.startswith(paper + "/").any()}
    verdicts = {verdict: verdict for verdict in VERDICTS if (ledger["verdict"] == verdict).any()}
    kinds = {kind: kind for kind in sorted(set(ledger["kind"]))}
    selects = "".join(
        _select(name, label, options) for name, label, options in (("p", "paper", papers), ("v", "verdict", verdicts), ("k", "kind", kinds))
    )
    return f"""# The ledger

Every question that was put to the papers and to real targets, with what came out: what the paper prints, or the bound of our rule where it prints no number, and what we found. The first link of a row leads to the place in a notebook where it is settled, the last one to its rule and history.

```{{raw}} html
<form id="ledger-filter" onsubmit="return false"><label>search <input id="ledger-search" type="search" placeholder="Table 9, NEES, gain …"></label>{selects}
<output id="ledger-count"></output></form>
<ol id="ledger">
{rows}
</ol>
<script>{SCRIPT}</script>
```
"""


def _select(name, label, options):
    choices = "".join(f'<option value="{escape(value)}">{escape(text)}</option>' for value, text in options.items())
    return f'<label>{label} <select name="{name}"><option value="">all</option>{choices}</select></label>'


def _row(row, title):
    ours = escape(shown(row)) + (f" [{short(row['low'])}, {short(row['high'])}]" if row["low"] else "")
    paper, page = row["notebook"].split("/")[0], row["notebook"].replace("/", "__", 1)
    parts = [_asked(row["paper"]), f"ours: {ours}" if ours else "", escape(row["note"])]
    return (
        f'<li data-p="{paper}" data-v="{row["verdict"]}" data-k="{row["kind"]}">'
        f'<a href="{row["notebook"]}.html#row-{row["id"]}">{escape(row["where"])}</a> {_formulas(escape(row["quantity"]))} '
        f"<b>{MARKS[row['verdict']]}</b> <small>{_formulas('; '.join(filter(None, parts)))} "
        f'<a href="results/{page}.html#{row["id"]}">{_formulas(escape(title))}: {row["id"]}</a></small></li>'
    )


def _asked(text):
    """What stands in the paper, or, where that is no number, the bound that our rule sets."""
    bound = re.match(r"[<>=]|in [\[(]", text)
    return f"{'rule' if bound else 'paper'}: {escape(text)}" if text else ""


def _formulas(text):
    """Formulas between dollar signs, as Sphinx marks them for MathJax."""
    return re.sub(r"\$([^$]+)\$", r'<span class="math notranslate nohighlight">\\(\1\\)</span>', text)

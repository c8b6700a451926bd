"""The web book holds every notebook and opens without network."""

import re

import nbformat
import pytest

from trackhelpers.suite import book, form
from trackhelpers.suite.for_the_book import plain
from trackhelpers.suite.run import run

SHOW = """import matplotlib.pyplot as plt
from trackhelpers import plots
plots.use_style()
fig, ax = plt.subplots()
plots.show(fig, "1-1", "The *error* of $x$ in the [first run](#run), `x < 1`.")"""


@pytest.fixture(scope="module")
def shown(store_in, tmp_path_factory):
    """The text of a notebook that shows a figure, after a run."""
    path = store_in(tmp_path_factory.mktemp("shown"), "1_thesis/1_first.ipynb", SHOW)
    run([path], lambda p: p, folder=path.parents[1])
    return path.read_text(encoding="utf-8")


def linked(shown):
    """The text of that notebook, whose caption leads to the first page."""
    return shown.replace("(#run)", "(../00_start_here.ipynb)")


@pytest.fixture(scope="module")
def library(store_in, shown, tmp_path_factory):
    """Folders of the notebooks and the pages of a book that has one of each kind, and the reference."""
    folder = tmp_path_factory.mktemp("library")
    start = store_in(folder, "00_start_here.ipynb", title="The map: [first](1_thesis/1_first.ipynb), $x^2$")
    store_in(folder, "1_thesis/1_first.ipynb", "1 + 1", title="The first chapter")
    store_in(folder, "1_thesis/2_shown.ipynb").write_text(linked(shown), encoding="utf-8")
    path = store_in(folder, "1_thesis/3_folded.ipynb", "1 + 1", "2 + 2")
    notebook = nbformat.read(path, as_version=4)
    for cell, tag in zip(notebook.cells[1:], ("hide-input", "hide-cell"), strict=True):
        cell.metadata = nbformat.from_dict({"tags": [tag], "jupyter": {"source_hidden": True}})
    nbformat.write(notebook, path)
    store_in(folder, "2_more_of_it/1_second.ipynb", title="The second chapter")
    return start.parent, book.pages(start.parent, folder / "book", with_reference=True).parent


def test_pages_of_a_book_load_nothing_from_outside(library):
    _, html = library
    page = (html / "00_start_here.html").read_text(encoding="utf-8").partition("<nav")[2]
    assert book.outside_addresses(html) == []
    assert "00_start_here.html" in (html / "index.html").read_text(encoding="utf-8")
    assert page.index("1 · The thesis") < page.index("The first chapter") < page.index("2 · more of it") < page.index("The second chapter")
    assert (html / "_static/mathjax/tex-chtml.js").exists()
    assert "class trackhelpers.motion" in re.sub("<[^>]*>", "", (html / "api_models.html").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.html", '<script src="https://outside.example/a.js"></script>'),
        ("a.html", '<link rel="stylesheet" href="//outside.example/a.css">'),
        ("a.html", '<img alt="" src="http://outside.example/a.png">'),
        ("a.html", "<style>@import 'https://outside.example/a.css';</style>"),
        ("a.html", '<script type="module">import x from "https://outside.example/a.js"</script>'),
        ("deep/a.css", "@font-face { src: url(https://outside.example/a.woff2) }"),
    ],
)
def test_whatever_a_page_would_load_from_outside_is_found(tmp_path, name, text):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(text, encoding="utf-8")
    (found,) = book.outside_addresses(tmp_path)
    assert found.startswith(f"{name}: ")
    assert "outside.example" in found


def test_links_to_follow_and_local_files_are_not_outside(tmp_path):
    (tmp_path / "a.html").write_text(
        '<a href="https://outside.example">x</a><img src="b.png"><link rel="canonical" href="https://x.example">'
    )
    assert book.outside_addresses(tmp_path) == []


def test_a_book_without_its_first_page_is_refused(store):
    with pytest.raises(FileNotFoundError, match=r"00_start_here\.ipynb"):
        book.build(store("1_thesis/1_first.ipynb").parents[1])


def test_a_shown_figure_is_one_image_with_its_caption_below_and_as_alt_text(shown, library):
    image, caption = nbformat.reads(shown, as_version=4).cells[1].outputs
    assert set(image.data) == {"image/png", "text/plain"} and set(caption.data) == {"text/markdown", "text/plain"}
    assert form.with_palette(image.data["image/png"]) == image.data["image/png"]
    page = (library[1] / "1_thesis/2_shown.html").read_text(encoding="utf-8")
    ((alt, width),) = re.findall(r'<img alt="([^"]*)" src="[^"]*_images/[^"]*" style="width: (\d+)px;"', page)
    assert 640 <= int(width) <= 700  # of 7 inches
    assert alt == "Figure 1-1. The error of x in the first run, x &lt; 1."
    assert "<strong>Figure 1-1.</strong> The <em>error</em> of" in page


def test_folded_bookkeeping_has_a_prompt_of_its_own(library):
    notebooks, html = library
    page = (html / "1_thesis/3_folded.html").read_text(encoding="utf-8")
    assert re.findall(r'<p class="collapsed[^>]*>(.*?)</p>', page) == ["Show the solution", "Bookkeeping"]
    assert "mystnb" not in (notebooks / "1_thesis/3_folded.ipynb").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("caption", "read"),
    [("**Figure 1.** A $x_k$ *and* `y`", "Figure 1. A x_k and y"), ("a * b [c](d.md#e) x_1_2", "a * b c x_1_2"), ("2*3 **b**", "2*3 b")],
)
def test_alt_text_is_the_caption_without_its_markup(caption, read):
    assert plain(caption) == read


def test_a_second_build_has_the_same_bytes(store, shown, tmp_path):
    start = store("00_start_here.ipynb", title="The map")
    store("1_thesis/1_first.ipynb").write_text(linked(shown), encoding="utf-8")
    books = [book.pages(start.parent, tmp_path / name).parent for name in ("one", "two")]
    one, two = ({path.relative_to(html): path.read_bytes() for path in html.rglob("*") if path.is_file()} for html in books)
    assert [path for path in one | two if one.get(path) != two.get(path)] == []


def test_a_header_cell_that_would_be_empty_is_a_plain_one():
    table = '<tr><th class="blank">&nbsp;</th><th>x</th></tr><tr><th><p></p></th><td></td></tr>'
    plain_cells = '<tr><td class="blank"></td><th>x</th></tr><tr><td></td><td></td></tr>'
    assert book.without_empty_headers(table) == plain_cells


def test_a_page_of_rows_is_named_for_its_chapter():
    text = '# Rows of 1_thesis/1_first\n\n<a id="gain"></a>\n\n## gain\n'
    page = book.page_of_rows(text, {"1_thesis/1_first": "Paper 1, chapter 1 · The first"})
    assert page.endswith("# Rows of Paper 1, chapter 1 · The first\n\n## gain\n")

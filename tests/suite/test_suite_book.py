"""The web book holds every notebook and opens without network."""

import pytest

from trackhelpers.suite import book


def test_pages_of_a_book_load_nothing_from_outside(store, tmp_path):
    start = store("00_start_here.ipynb", title="The map: [first](1_thesis/1_first.ipynb), $x^2$")
    store("1_thesis/1_first.ipynb", "1 + 1", title="The first chapter")
    store("2_more_of_it/1_second.ipynb", title="The second chapter")
    index = book.pages(start.parent, tmp_path / "book")
    page = (index.parent / "00_start_here.html").read_text(encoding="utf-8").partition("<nav")[2]
    assert book.outside_addresses(index.parent) == []
    assert "00_start_here.html" in index.read_text(encoding="utf-8")
    assert page.index("1 · The thesis") < page.index("The first chapter") < page.index("2 · more of it") < page.index("The second chapter")
    assert (index.parent / "_static/mathjax/tex-chtml.js").exists()


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

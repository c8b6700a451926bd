"""The book from its files: what moves, moves; nothing is fetched, nothing complains, on a desk and on a phone, light and dark."""

import os
from pathlib import Path

import pytest

WIDTHS = (1280, 390)
SLIDERS = "figure.playground input[type=range]"
# The paths of a playground's pictures, by which one sees that it moved.
DRAWN = "input => [...input.closest('figure').querySelectorAll('.c')].map(path => path.getAttribute('d')).join()"


@pytest.fixture(
    scope="module", params=[(width, scheme) for width in WIDTHS for scheme in ("light", "dark")], ids=lambda p: f"{p[0]}-{p[1]}"
)
def visit(request, browser, pages):
    """Opens a page of the book; a complaint in the console, or anything that is not a file, is kept in ``visit.faults``."""
    width, scheme = request.param
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page = context.new_page()
    page.set_default_timeout(60_000)
    faults = []
    page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("request", lambda sent: faults.append(sent.url) if not sent.url.startswith(("file:", "data:", "blob:")) else None)

    def visit(path):
        faults.clear()
        page.goto(path.as_uri())
        return page

    visit.faults, visit.width, visit.scheme = faults, width, scheme
    yield visit
    context.close()


def every(pages):
    found = [path for path in sorted(pages.rglob("*.html")) if "_static" not in path.parts and path.name != "index.html"]  # it leads on
    assert len(found) > 25
    return found


def test_every_slider_moves_its_figure(visit, pages):
    moved = 0
    for path in every(pages):
        if 'class="playground"' not in path.read_text(encoding="utf-8"):
            continue
        page = visit(path)
        for slider in page.locator(SLIDERS).all():
            slider.focus()
            seen = []
            for key in ("Home", "End", "ArrowLeft", "ArrowLeft"):
                page.keyboard.press(key)
                seen.append(slider.evaluate(DRAWN))
            assert len(set(seen)) > 1, f"{path.name}: {slider.get_attribute('aria-label')}"
            assert slider.get_attribute("aria-label") and slider.get_attribute("aria-valuetext")
            moved += 1
        for picture in page.locator("figure.playground svg[role=img]").all():
            box = picture.bounding_box()
            assert box["x"] >= 0 and box["x"] + box["width"] <= visit.width and box["width"] > 250, path.name
            size = picture.evaluate("svg => 12 * svg.getBoundingClientRect().width / 360")
            assert size >= 9, f"letters of {size:.1f} px"
        assert visit.faults == [], path.name
        if os.environ.get("PICTURES"):
            for k, figure in enumerate(page.locator("figure.playground").all()):
                figure.screenshot(path=Path(os.environ["PICTURES"]) / f"{path.stem}-{k}-{visit.width}-{visit.scheme}.png")
    assert moved >= 14


def test_the_letters_stand_out_from_the_page(visit, pages):
    page = visit(next(path for path in every(pages) if 'class="playground"' in path.read_text(encoding="utf-8")))
    contrast = page.locator("figure.playground").first.evaluate(
        """figure => {
          const light = colour => {
            const [r, g, b] = colour.match(/[\\d.]+/g).map(v => v / 255).map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
            return 0.2126 * r + 0.7152 * g + 0.0722 * b;
          };
          let back = figure;
          while (/, 0\\)|transparent/.test(getComputedStyle(back).backgroundColor)) back = back.parentElement;
          const [a, b] = [light(getComputedStyle(figure).color), light(getComputedStyle(back).backgroundColor)].sort((x, y) => y - x);
          return (a + 0.05) / (b + 0.05);
        }"""
    )
    assert contrast > 7
    assert (page.evaluate("document.documentElement.dataset.theme") or "light") == visit.scheme


def test_every_fold_opens_and_no_page_complains(visit, pages):
    opened = 0
    for path in every(pages):
        page = visit(path)
        folds = page.locator("details.hide")
        for k in range(folds.count()):
            fold = folds.nth(k)
            assert fold.evaluate(
                "fold => { const before = fold.open; fold.querySelector('summary').click(); return fold.open !== before; }"
            )
            opened += 1
        assert visit.faults == [], path.name
    assert opened > 100


def test_the_ledger_is_searched_as_one_types(visit, pages):
    path = pages / "ledger.html"
    if not path.exists():
        pytest.skip("this book has no page of the ledger")
    page = visit(path)
    rows = page.locator("#ledger > li")
    whole = rows.count()
    page.locator("#ledger-search").press_sequentially("Table 9")
    left = page.locator("#ledger > li:not([hidden])")
    assert 0 < left.count() < whole
    assert all("table" in text.lower() and "9" in text for text in left.all_text_contents())
    page.locator("#ledger-search").fill("no row says this")
    assert left.count() == 0
    page.locator("#ledger-search").fill("")
    assert left.count() == whole
    assert visit.faults == []

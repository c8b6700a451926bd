"""A playground holds the numbers that its function computes, in the same bytes every time, and its sliders move the curves in a browser."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest

from trackhelpers.play import LIMIT, Ellipse, Playground
from trackhelpers.suite.run import run

CHROMIUM = shutil.which("chromium")
X = np.linspace(0, 10, 40)
SQUARE = np.array([[2.0, 0.6], [0.6, 1.0]])


def curves(rate=1.0, shift=0.0, power=1.0):
    return {
        "wave & <co>": (X, np.where(X > 5, np.nan, np.sin(rate * X) ** power + shift)),
        "still": (X, np.cos(X)),
        "dots": (X[::8], rate * X[::8]),
        "area": (np.r_[X, X[::-1]], np.r_[0 * X - 1, 0 * X + rate]),
        "round": Ellipse([5.0, shift], rate * SQUARE),
        "say": f"rate <{rate:.2f}>",
    }


def playground():
    made = Playground(curves, rate=np.linspace(0.5, 2, 7), shift=[-0.5, 0.0, 0.25]).begin("the rate", rate=1.0)
    made.panel("time (s)", "x < y", {"wave & <co>": "blue -", "still": "truth --", "dots": "measured .", "area": "band fill"})
    return made.panel("x", "y", {"round": "orange -"}, equal=True)


def numbers(page):
    return json.loads(re.search(r"const data = (.*);\n", page)[1])


def pictures(page):
    return [ElementTree.fromstring(unquote(text)) for text in re.findall(r'src="data:image/svg\+xml,([^"]*)"', page)]


def drawn(page):
    """The curves' paths of all pictures."""
    return [path.get("d") for picture in pictures(page) for path in picture.iter() if path.get("class") == "c"]


def test_bytes_repeat_and_are_few():
    page = playground().html("1-1", "A caption")
    assert page == playground().html("1-1", "A caption")
    assert len(page.encode()) < LIMIT
    assert not re.search(r"0x[0-9a-f]{6}|e-\d\d", page)


def test_rounding_errors_change_no_byte():
    def shaken(**values):
        return {
            name: found if name in ("say", "round") else tuple(v * (1 + 1e-13) for v in found) for name, found in curves(**values).items()
        }

    looks = {"wave & <co>": "blue -", "area": "band fill"}
    pages = [Playground(f, rate=[0.53, 1.01]).panel("x", "y", looks).html("1", "x") for f in (curves, shaken)]
    assert pages[0] == pages[1]


def test_the_numbers_in_the_page_are_those_computed():
    made = playground()
    data = numbers(made.html("1-1", "x"))
    for panel, stored in zip(made.panels, data["panels"], strict=True):
        for name, curve in zip(panel.looks, stored["curves"], strict=True):
            for i, rate in enumerate(made.sliders["rate"]):
                for j, shift in enumerate(made.sliders["shift"]):
                    for axis in (0, 1):
                        held = curve["xy"[axis]]
                        start = held["n"] * (held["s"][0] * i + held["s"][1] * j)
                        found = np.array(held["v"][start : start + held["n"]], dtype=float) * panel.unit[axis]
                        expected = np.asarray(curves(rate, shift)[name][axis], dtype=float)
                        assert np.allclose(found, expected, atol=0.51 * panel.unit[axis], rtol=0, equal_nan=True), name
        for (low, high), unit in zip(panel.limits, panel.unit, strict=True):
            assert 1e3 <= (high - low) / unit <= 1e4 + 1
    assert data["words"] == ["rate <", ">"] and data["numbers"]["v"] == [
        "0.50",
        "0.75",
        "1.00",
        "1.25",
        "1.50",
        "1.75",
        "2.00",
    ]  # once a rate


def test_what_a_slider_does_not_change_is_stored_once():
    first, second = numbers(playground().html("1-1", "x"))["panels"]
    assert first["curves"][1]["y"]["s"] == [0, 0] and len(first["curves"][1]["y"]["v"]) == len(X)
    assert first["curves"][2]["y"]["s"] == [1, 0] and second["curves"][0]["y"]["s"] == [3, 1]


def test_texts_are_escaped_and_nothing_is_loaded_from_elsewhere():
    page = playground().html("1-1", 'A "caption" <b> of $x_k$')
    assert 'id="playground-1-1"' in page and 'aria-label="A &quot;caption&quot; &lt;b&gt; of x_k"' in page
    assert "<co>" not in page and "<b>" not in page and "rate <" not in page
    one, two = pictures(page)
    assert one.get("aria-label") == "x < y against time (s): wave & <co>, still, dots, area" and one.get("role") == "img"
    assert two.get("aria-label") == "y against x: round"
    assert re.findall(r"(?:https?:)?//[^\s\"']*", unquote(page)) == ["http://www.w3.org/2000/svg"] * 2  # a name, no address


def test_an_ellipse_holds_its_share():
    samples = np.random.default_rng(3).multivariate_normal([1.0, 2.0], SQUARE, size=20_000)
    (mx, a, _), (my, b, c) = Ellipse([1.0, 2.0], SQUARE)
    u = np.linalg.solve([[a, 0], [b, c]], (samples - [mx, my]).T)
    assert abs(np.mean(np.sum(u**2, axis=0) < 1) - 0.95) < 0.01


def test_logarithmic_axes_are_stored_as_logarithms():
    made = Playground(lambda q: {"gain": ([0.01, 1, 100], [q, 1, 2])}, q=[0.1, 10]).panel("Q", "K", {"gain": "blue -"}, log="x")
    page = made.html("1", "x")
    curve = numbers(page)["panels"][0]["curves"][0]
    assert (curve["x"]["v"] == [-20000, 0, 20000] and made.panels[0].unit[0] == 1e-3) or curve["x"]["v"] == [-2000, 0, 2000]
    assert {"0.01", "0.1", "1", "10", "100"} <= {text.text for text in pictures(page)[0].iter() if text.tag.endswith("text")}


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Playground(curves), "expected one or two"),
        (lambda: Playground(curves, rate=[1], shift=[0], power=[1]), "expected one or two"),
        (lambda: playground().panel("x", "y", {"nothing": "blue -"}), "none of those of the function"),
        (lambda: playground().panel("x", "y", {"still": "red -"}), "expected a colour"),
        (lambda: playground().panel("x", "y", {"still": "blue"}), "expected a colour"),
        (lambda: playground().show(1, "x"), "number is 1"),
        (lambda: playground().show("1", " "), "caption is ' '"),
        (
            lambda: (
                Playground(lambda a: {"y": (X, np.sin(a * X))}, a=np.linspace(1, 2, 500)).panel("x", "y", {"y": "blue -"}).show("1", "x")
            ),
            "at most 60000",
        ),
    ],
)
def test_what_cannot_be_shown_is_named(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_free_sliders_redraw_with_the_same_function_in_under_300_ms():
    box = playground().free(rate=(0.1, 5.0), power=(1.0, 3.0))
    *sliders, picture = box.children
    assert [slider.description for slider in sliders] == ["the rate", "power"] and sliders[0].value == 1.0
    before = picture.value
    begun = time.perf_counter()
    sliders[0].value = 3.0
    assert time.perf_counter() - begun < 0.3
    assert picture.value != before and "rate &lt;3.00&gt;" in picture.value and picture.value.count("<img alt=") == 2


needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


def after(page, tmp_path, script=""):
    """The page as chromium holds it after `script`."""
    path = tmp_path / "page.html"
    path.write_text(f'<!DOCTYPE html><meta charset="utf-8">{page}<pre id="times"></pre><script>{script}</script>', encoding="utf-8")
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--dump-dom",
        path.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


def paths(dom):
    return re.findall(r'<path class="c" d="([^"]*)"', dom)


@needs_chromium
def test_in_a_browser_the_still_picture_and_the_first_values_are_the_same(tmp_path):
    page = playground().html("1-1", "x")
    dom = after(page, tmp_path)
    assert paths(dom) == drawn(page) and "<img" not in dom
    assert dom.count('type="range"') == 2 and 'aria-label="the rate"' in dom and 'aria-valuetext="1"' in dom


@needs_chromium
def test_moving_a_slider_moves_the_curves_in_under_a_millisecond(tmp_path):
    move = """const [rate, shift] = document.querySelectorAll("input");
    rate.value = 6; shift.value = 0; shift.dispatchEvent(new Event("input"));
    const begun = performance.now();
    for (let k = 0; k < 200; k++) rate.dispatchEvent(new Event("input"));
    document.querySelector("#times").textContent = "ms " + (performance.now() - begun) / 200;"""
    made = playground()
    dom = after(made.html("1-1", "x"), tmp_path, move)
    made.begin(rate=2.0, shift=-0.5)
    assert paths(dom) == drawn(made.html("1-1", "x"))
    assert "rate &lt;2.00&gt;" in dom and 'aria-valuetext="2"' in dom and 'aria-valuetext="−0.5"' in dom
    assert float(re.search(r"ms ([\d.]+)<", dom)[1]) < 1


@needs_chromium
def test_without_script_the_still_picture_stands(tmp_path):
    dom = after(re.sub(r"<script>.*</script>", "", playground().html("1-1", "x"), flags=re.DOTALL), tmp_path)
    assert dom.count("<img alt=") == 2 and "A still picture" in dom and "<input" not in dom


CELL = """import numpy as np
from trackhelpers.play import Playground
x = np.arange(5.0)
Playground(lambda a: {{"y": (x, a * x)}}, a=[1, {last}]).panel("x", "y", {{"y": "blue -"}}, ylim=(0, 9)).show("1-1", "See.")"""


def test_the_comparison_of_notebooks_sees_a_changed_number(tmp_path):
    import nbformat

    cell = nbformat.v4.new_code_cell(CELL.format(last=2), id="play")
    path = tmp_path / "notebooks/1_thesis/1.ipynb"
    path.parent.mkdir(parents=True)
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), path)
    run([path], lambda p: p, folder=tmp_path / "notebooks")
    outputs = nbformat.read(path, as_version=4).cells[0].outputs
    assert [set(output.data) for output in outputs] == [{"text/html", "text/plain"}, {"text/markdown", "text/plain"}]
    path.write_text(path.read_text(encoding="utf-8").replace("a=[1, 2]", "a=[1, 2.001]"), encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-m", "pytest", "--color=no", "--assert=plain", "--nbval", "-p", "no:cacheprovider", "notebooks"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 1 and "text/html" in done.stdout, done.stdout

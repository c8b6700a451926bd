"""Notebooks have one stored form, and the committed ones are in it."""

import base64
import io

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
from PIL import Image

from trackhelpers.suite import NOTEBOOKS, form, notebooks

v4 = nbformat.v4


def test_a_normalised_notebook_is_its_own_normal_form(store):
    path = store("a.ipynb", "x = 1", "x")
    once = form.dumps(form.normalise(nbformat.read(path, as_version=4)))
    assert form.dumps(form.normalise(nbformat.reads(once, as_version=4))) == once


def test_normalising_drops_what_changes_by_itself_and_keeps_the_rest():
    editors = {"execution": {"iopub.status.busy": "now"}, "vscode": {"languageId": "python"}, "jupyter": {"source_hidden": False}}
    cell = v4.new_code_cell("x", id="kept", execution_count=7, metadata={"tags": ["hide-input"], **editors})
    data = {"text/plain": "<object object at 0x7f3a10>", "text/html": "<b>0x10</b>"}
    widget = v4.new_output("display_data", {"text/plain": "0%", form.WIDGET: {"model_id": "random"}})
    cell.outputs = [widget, v4.new_output("execute_result", data, execution_count=7), v4.new_output("stream", text="<f at 0xdead>\n")]
    notebook = form.normalise(
        v4.new_notebook(cells=[cell], metadata={"widgets": {}, "language_info": {"name": "python", "version": "3.9"}})
    )
    result, stream = notebook.cells[0].outputs
    assert notebook.metadata == form.METADATA
    assert notebook.cells[0].metadata == {"tags": ["hide-input"], "jupyter": {"source_hidden": True}}
    assert notebook.cells[0].id == "kept"
    assert result.execution_count == notebook.cells[0].execution_count == 1
    assert result.data == {"text/plain": "<object object at 0x0>", "text/html": "<b>0x10</b>"}
    assert stream.text == "<f at 0x0>\n"


def test_a_figure_keeps_its_size_and_look_and_is_stored_once_and_for_all():
    figure, ax = plt.subplots(figsize=(3, 2))
    ax.plot([0, 1, 0], color="#0072B2")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", transparent=True)
    plt.close(figure)
    stored = form.with_palette(base64.b64encode(drawn.getvalue()).decode())
    assert form.with_palette(stored) == stored
    before = Image.alpha_composite(Image.new("RGBA", Image.open(drawn).size, "white"), Image.open(drawn).convert("RGBA"))
    after = Image.open(io.BytesIO(base64.b64decode(stored)))
    difference = np.abs(np.subtract(before.convert("RGB"), after.convert("RGB"), dtype=float))
    assert after.size == before.size and difference.max() < 24


def test_notebooks_are_listed_in_reading_order(store):
    names = ["00_start_here.ipynb", "1_a/2_b.ipynb", "1_a/4_1_c.ipynb", "1_a/10_d.ipynb", "2_e/1_f.ipynb"]
    paths = [store(name) for name in reversed(names)][::-1]
    store("1_a/.ipynb_checkpoints/2_b.ipynb")
    assert notebooks(paths[0].parent) == paths


@pytest.mark.parametrize("path", notebooks(), ids=lambda p: p.relative_to(NOTEBOOKS).as_posix())
def test_committed_notebooks_are_as_refresh_stores_them(path):
    # nbval compares nothing in a cell that was never run, so run they must be, from top to bottom.
    text = path.read_text(encoding="utf-8")
    notebook = nbformat.reads(text, as_version=4)
    kinds = {(o.output_type, o.get("name")) for cell in notebook.cells for o in cell.get("outputs", [])}
    same = form.dumps(form.normalise(notebook)) == text
    assert same, f"python -m trackhelpers.suite refresh {path.relative_to(NOTEBOOKS.parent)} puts it right (or git checkout takes it back)"
    assert not kinds & {("error", None), ("stream", "stderr")}
    assert path.stat().st_size < 1_000_000


def test_a_small_dot_keeps_its_colour_in_a_figure_of_many_shades():
    shades = np.linspace(0, 255, 200 * 200).reshape(200, 200)
    picture = np.stack([shades, shades.T, 255 - shades], axis=-1).astype(np.uint8)
    picture[100:103, 100:103] = [0, 114, 178]
    drawn = io.BytesIO()
    Image.fromarray(picture).save(drawn, "PNG")
    stored = Image.open(io.BytesIO(base64.b64decode(form.with_palette(base64.b64encode(drawn.getvalue()).decode()))))
    assert stored.mode == "P"
    off = np.abs(np.subtract(np.asarray(stored.convert("RGB")), picture, dtype=float))
    assert off[101, 101].max() <= form.OFF

"""The one form in which notebooks are stored: equal content gives equal bytes."""

import base64
import io
import re

import nbformat
from PIL import Image, ImageChops

from trackhelpers.whole import write_whole

# No version of Python or of a package in it: those change without the notebook changing.
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"file_extension": ".py", "mimetype": "text/x-python", "name": "python", "pygments_lexer": "ipython3"},
}
KEPT = ("tags",)  # of a cell's metadata; the rest is what some editor remembers
FOLDED = {"hide-cell", "hide-input"}  # tags of cells whose source JupyterLab hides too
ADDRESS = re.compile(r"\bat 0x[0-9A-Fa-f]+")
COLOURS = (
    128  # in a stored figure: no eye tells it from the drawn one, and it takes a third of the bytes, in every version that history keeps
)
OFF = 40  # of 255: a channel that is farther off is another colour, such as that of a small dot which the palette has no room for
WIDGET = "application/vnd.jupyter.widget-view+json"


def normalise(notebook):
    """Bring an executed notebook into the stored form, in place, and return it.

    Cell ids, tags and outputs stay; figures are stored with a palette. Execution times, what editors remember of a cell, widget views (their ids are random), the addresses in
    ``<object at 0x…>`` and everything in the notebook's metadata but kernel and language go; execution counts run from 1, and what is folded by its tag is folded in JupyterLab.
    """
    notebook.metadata = nbformat.from_dict(METADATA)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in notebook.cells:
        for name in set(cell.metadata) - set(KEPT):
            del cell.metadata[name]
        if FOLDED & set(cell.metadata.get("tags", [])):
            cell.metadata["jupyter"] = nbformat.from_dict({"source_hidden": True})
    for count, cell in enumerate(code, start=1):
        cell.execution_count = count
        cell.outputs = [output for output in cell.outputs if WIDGET not in output.get("data", {})]
        for output in cell.outputs:
            if output.output_type == "execute_result":
                output.execution_count = count
            if output.output_type == "stream":
                output.text = ADDRESS.sub("at 0x0", output.text)
            data = output.get("data", {})
            for kind in [k for k in data if k.startswith("text/")]:
                data[kind] = ADDRESS.sub("at 0x0", data[kind])
            if "image/png" in data:
                data["image/png"] = with_palette(data["image/png"])
    return notebook


def with_palette(png):
    """Return a PNG, as base64 text, on white and with a palette of `COLOURS` colours, or of 256 where a pixel would become another colour with fewer.

    One that has a palette already comes back as it is.
    """
    image = Image.open(io.BytesIO(base64.b64decode(png)))
    if image.mode == "P":
        return png
    flat = Image.new("RGB", image.size, "white")
    flat.paste(image, mask=image.getchannel("A") if "A" in image.mode else None)
    for colours, method in ((COLOURS, Image.Quantize.MEDIANCUT), (256, Image.Quantize.MEDIANCUT), (256, Image.Quantize.MAXCOVERAGE)):
        stored = flat.quantize(colours, method, dither=Image.Dither.NONE)
        off = ImageChops.difference(flat, stored.convert("RGB"))
        if max(high for _, high in off.getextrema()) <= OFF:
            break
    small = io.BytesIO()
    stored.save(small, "PNG", optimize=True)
    return base64.b64encode(small.getvalue()).decode("ascii")


def dumps(notebook):
    """Return the text of the notebook's file, which ends in a newline; an invalid notebook raises nbformat's ValidationError."""
    nbformat.validate(notebook)
    return nbformat.writes(notebook, version=nbformat.NO_CONVERT).rstrip("\n") + "\n"


def write(notebook, path):
    """Write the notebook to `path` at once or not at all, so that a run broken off leaves the old file."""
    write_whole(path, dumps(notebook))

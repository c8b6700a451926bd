import nbformat
import pytest

from trackhelpers.suite import form


@pytest.fixture
def store(tmp_path):
    """Write a notebook of a title and the given code cells below a fresh notebooks/ folder; return its path."""

    def write(name, *code, title="A title"):
        path = tmp_path / "notebooks" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        notebook = nbformat.v4.new_notebook(metadata=form.METADATA)
        notebook.cells = [nbformat.v4.new_markdown_cell(f"# {title}", id="title")]
        notebook.cells += [nbformat.v4.new_code_cell(source, id=f"code-{i}") for i, source in enumerate(code, start=1)]
        nbformat.write(notebook, path)
        return path

    return write

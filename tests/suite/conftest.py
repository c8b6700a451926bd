import nbformat
import pytest

from trackhelpers.suite import form


@pytest.fixture(scope="session")
def store_in():
    """Write a notebook of a title and the given code cells below `folder`/notebooks; return its path."""

    def write(folder, name, *code, title="A title"):
        path = folder / "notebooks" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        notebook = nbformat.v4.new_notebook(metadata=form.METADATA)
        notebook.cells = [nbformat.v4.new_markdown_cell(f"# {title}", id="title")]
        notebook.cells += [nbformat.v4.new_code_cell(source, id=f"code-{i}") for i, source in enumerate(code, start=1)]
        nbformat.write(notebook, path)
        return path

    return write


@pytest.fixture
def store(store_in, tmp_path):
    """The same below a fresh folder."""

    def write(name, *code, title="A title"):
        return store_in(tmp_path, name, *code, title=title)

    return write

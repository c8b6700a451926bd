"""A file is written as a whole or not at all, whoever writes it and whatever happens meanwhile."""

import errno
import os
from functools import cache

import nbformat
import pytest

from trackhelpers.ledger import read_ledger, read_questions
from trackhelpers.suite import form, readme, records, written
from trackhelpers.whole import write_whole


class Full:
    """A disk that is full."""

    def __init__(self, error):
        self.error = error

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def write(self, data):
        raise self.error


@pytest.fixture(params=[OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()], ids=["full disk", "Ctrl-C"])
def failing(request, monkeypatch):
    def fdopen(handle, *_, **__):
        os.close(handle)
        return Full(request.param)

    monkeypatch.setattr(os, "fdopen", fdopen)
    return type(request.param)


def below(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("data", ["θ\r\n", b"\x00\xff"])
def test_what_is_written_is_there_byte_by_byte(tmp_path, data):
    write_whole(tmp_path / "new" / "file", "old")
    write_whole(tmp_path / "new" / "file", data)
    assert below(tmp_path / "new") == {(tmp_path / "file").relative_to(tmp_path): data if isinstance(data, bytes) else data.encode()}
    assert (tmp_path / "new" / "file").stat().st_mode & 0o777 == 0o644


def test_a_failed_write_leaves_the_old_file_and_nothing_beside_it(tmp_path, failing):
    (tmp_path / "file").write_text("old")
    with pytest.raises(failing):
        write_whole(tmp_path / "file", "new")
    assert below(tmp_path) == {(tmp_path / "file").relative_to(tmp_path): b"old"}


ledger, questions = cache(read_ledger), cache(read_questions)
WRITERS = {
    "notebook": lambda folder: form.write(nbformat.v4.new_notebook(), folder / "a.ipynb"),
    "README and its figure": lambda folder: readme.write(),
    "written pages": lambda folder: written.write(folder),
    "pages of rows": lambda folder: records.write_records(folder, ledger(), questions()),
}


@pytest.mark.parametrize("name", WRITERS)
def test_everybody_writes_whole_files(tmp_path, monkeypatch, failing, name):
    """Nothing is lost or left behind where the first write fails."""
    for file, text in (("README.md", readme.START + readme.END), ("a.ipynb", "old"), ("page.md", "old"), ("readme.png", "old")):
        (tmp_path / file).write_text(text)
    for module in (readme, written):  # the stored ledger is the same for all
        monkeypatch.setattr(module, "read_ledger", ledger)
        monkeypatch.setattr(module, "read_questions", questions)
    monkeypatch.setattr(readme, "ROOT", tmp_path)
    monkeypatch.setattr(readme, "FIGURE", tmp_path / "readme.png")
    before = below(tmp_path)
    with pytest.raises(failing):
        WRITERS[name](tmp_path)
    assert below(tmp_path) == before

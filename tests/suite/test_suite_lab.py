"""What is saved in JupyterLab is stored as `refresh` stores it, and the command line works on the checkout that it is called in."""

import nbformat
import pytest

from trackhelpers.suite import NOTEBOOKS, ROOT, __main__, form, lab, notebooks
from trackhelpers.suite.kernel import ENVIRONMENT, strict_kernels


def test_saving_a_notebook_that_an_editor_has_marked_stores_the_same_bytes():
    path = notebooks()[1]
    text = path.read_text(encoding="utf-8")
    opened = nbformat.reads(text, as_version=4)
    opened.metadata["widgets"] = {"state": {}}
    for cell in opened.cells:
        cell.metadata["vscode"] = {"languageId": "python"}
        cell.metadata.setdefault("jupyter", {})["source_hidden"] = False
        if cell.cell_type == "code":
            cell.execution_count = 99
            cell.outputs = [nbformat.v4.new_output("display_data", {form.WIDGET: {"model_id": "a"}, "text/plain": "0 %"}), *cell.outputs]
    model = {"type": "notebook", "content": opened}
    lab.before_save(model=model, path="x.ipynb", contents_manager=None)
    assert form.dumps(model["content"]) == text


@pytest.mark.parametrize("model", [{"type": "file", "content": "x = 1"}, {"type": "notebook", "content": None}])
def test_other_files_are_saved_as_they_are(model):
    before = dict(model)
    lab.before_save(model=model)
    assert model == before


def test_jupyterlab_is_told_to_use_the_hook_and_listens_on_this_machine_alone(monkeypatch):
    calls = []
    monkeypatch.setattr(lab.subprocess, "call", lambda command: calls.append(command) or 0)
    assert lab.serve(["--no-browser"]) == 0
    (command,) = calls
    assert "--ContentsManager.pre_save_hook=trackhelpers.suite.lab.before_save" in command and command[-1] == "--no-browser"
    assert f"--notebook-dir={NOTEBOOKS}" in command and not [option for option in command if "token" in option or "ip=" in option]


def test_a_live_kernel_differs_in_warnings_and_progress_alone(monkeypatch):
    import json
    import os
    from pathlib import Path

    for live in (True, False):
        with strict_kernels(live=live):
            folder = Path(os.environ["JUPYTER_PATH"].split(os.pathsep)[0])
            env = json.loads((folder / "kernels" / "python3" / "kernel.json").read_text(encoding="utf-8"))["env"]
            assert ENVIRONMENT.items() <= env.items() and ("TQDM_DISABLE" in env) is not live
            assert bool(list((folder / "ipython").rglob("*warnings.py"))) is not live


def test_the_suite_works_on_the_checkout_that_it_is_called_in(tmp_path, capsys):
    __main__.check_checkout(NOTEBOOKS / "1_thesis")
    __main__.check_checkout(tmp_path)  # from elsewhere: on the package's own
    assert capsys.readouterr().out.count(f"Working on {ROOT}") == 2
    (tmp_path / "trackhelpers" / "suite").mkdir(parents=True)
    (tmp_path / "notebooks").mkdir()
    with pytest.raises(FileNotFoundError, match="package comes from"):
        __main__.check_checkout(tmp_path / "notebooks")


def test_installed_without_the_notebooks_the_suite_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr(__main__, "NOTEBOOKS", tmp_path / "notebooks")
    with pytest.raises(FileNotFoundError, match="without the notebooks"):
        __main__.check_checkout(tmp_path)


def test_checkpoints_are_no_second_figure(store):
    from trackhelpers.suite import readme

    picture = nbformat.v4.new_output("display_data", {"image/png": "AAAA"})
    cell = nbformat.v4.new_code_cell("x", metadata={"tags": [readme.FIGURE_TAG]}, outputs=[picture])
    path = store("a.ipynb")
    (path.parent / ".ipynb_checkpoints").mkdir()
    for place in (path, path.parent / ".ipynb_checkpoints" / "a-checkpoint.ipynb"):
        nbformat.write(nbformat.v4.new_notebook(cells=[cell]), place)
    assert readme.tagged_figure(path.parent) == bytes(3)

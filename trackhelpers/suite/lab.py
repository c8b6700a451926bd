"""JupyterLab on the notebooks, in which reading does not change them: what is saved is stored in the project's form, as `refresh` stores it."""

import os
import subprocess
import sys

import nbformat

from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, form
from trackhelpers.suite.kernel import strict_kernels

HOOK = f"{__name__}.before_save"


def before_save(model, **_):
    """Bring a notebook that is about to be saved into its stored form; JupyterLab's ``ContentsManager.pre_save_hook``."""
    if model["type"] == "notebook" and model["content"] is not None:
        model["content"] = form.normalise(nbformat.from_dict(model["content"]))


def serve(options=()):
    """Open the start page in JupyterLab, on this machine alone, and return JupyterLab's exit status.

    Parameters
    ----------
    options : sequence of str
        JupyterLab's own, ``--no-browser`` for one.
    """
    command = [sys.executable, "-m", "jupyterlab", f"--notebook-dir={NOTEBOOKS}", f"--ContentsManager.pre_save_hook={HOOK}"]
    command += [f"--LabApp.default_url=/lab/tree/{FIRST_PAGE}"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        command.append("--allow-root")  # root has no reason to be sent away on a machine of its own
    with strict_kernels(live=True):
        try:
            return subprocess.call([*command, *options])
        except KeyboardInterrupt:
            return 0

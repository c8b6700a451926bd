"""The kernel in which the suite and the tests run notebooks: this interpreter, warnings as errors, nothing of the user's own settings."""

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

from ipykernel.kernelspec import write_kernel_spec

# Runs in the kernel before the first cell, after the kernel's own imports. Other packages' deprecations are theirs to mend, and an
# unclosed file is reported where it happens to be collected, in no cell in particular: both keep Python's own handling.
STARTUP = """\
import warnings

warnings.simplefilter("error")
for category in (DeprecationWarning, PendingDeprecationWarning, ResourceWarning):
    warnings.simplefilter("ignore", category)
for category in (DeprecationWarning, PendingDeprecationWarning):
    warnings.filterwarnings("error", category=category, module=r"(__main__|trackhelpers)\\b")
del warnings, category
"""

# matplotlib reads its settings where it is imported, and before all others a file "matplotlibrc" in the working folder, which is the notebook's.
SETTINGS = """\
import os

here = os.getcwd()
os.chdir({folder!r})
import matplotlib
os.chdir(here)
del os, here, matplotlib
"""

ENVIRONMENT = {
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "OMP_NUM_THREADS": "1",  # two notebooks run at a time; and matrices as small as ours wait for threads more than they gain
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
}
QUIET = {"TQDM_DISABLE": "1"}  # a progress bar in stored output would never repeat

# No history, which two kernels would share, and no remark on talking unencrypted, which stays on this machine.
ARGUMENTS = ["--HistoryManager.enabled=False", "--IPKernelApp.log_level=ERROR"]


@contextmanager
def strict_kernels(results=None, live=False):
    """Make ``python3`` mean the strict kernel wherever this process, or a child of it, starts a kernel.

    Parameters
    ----------
    live : bool
        For somebody who looks on: a warning is no error, and progress is shown; all that decides the outputs is the same.
    results : path or None
        Folder the notebooks' ledgers go to (TRACKHELPERS_RESULTS); None leaves the variable as it is.
    """
    with tempfile.TemporaryDirectory(prefix="trackhelpers-") as folder:
        folder = Path(folder)
        profile = folder / "ipython" / "profile_default" / "startup"
        profile.mkdir(parents=True)
        (profile / "00-settings.py").write_text(SETTINGS.format(folder=str(folder)), encoding="utf-8")
        if not live:
            (profile / "01-warnings.py").write_text(STARTUP, encoding="utf-8")
        (folder / "matplotlibrc").touch()
        env = ENVIRONMENT | ({} if live else QUIET) | {"IPYTHONDIR": str(folder / "ipython"), "MATPLOTLIBRC": str(folder / "matplotlibrc")}
        # argv names sys.executable in full, so no kernel registered elsewhere is taken, and a space in its path does no harm.
        write_kernel_spec(folder / "kernels" / "python3", overrides={"env": env}, extra_arguments=ARGUMENTS)
        changed = {"JUPYTER_PATH": os.pathsep.join(filter(None, [str(folder), os.environ.get("JUPYTER_PATH")]))}
        if results is not None:
            changed["TRACKHELPERS_RESULTS"] = str(Path(results).resolve())
        before = {name: os.environ.get(name) for name in changed}
        os.environ.update(changed)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value

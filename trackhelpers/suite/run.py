"""Runs notebooks, two at a time and the longest first, and stops at the first cell that fails, warns or writes to stderr."""

import asyncio
import re
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from tqdm import tqdm

from trackhelpers.suite import FIRST_PAGE, NOTEBOOKS, form, longest_first, missing_data
from trackhelpers.suite.kernel import strict_kernels

COLOUR = re.compile(r"\x1b\[[0-9;]*m")


class NotebookError(Exception):
    """A notebook could not be run to its end; the message names it and its cell, and holds the traceback."""


def run(paths, destination, *, folder=NOTEBOOKS, results=None, jobs=2, timeout=600):
    """Run notebooks in fresh kernels, each in its own folder, and write them normalised.

    The map of the project reads the ledgers that the others write, so it runs after them. A notebook whose data are out of reach is
    not run and keeps the outputs it has; a line says so.

    Parameters
    ----------
    paths : sequence of paths
        Notebooks below `folder`.
    destination : callable
        Path of a notebook -> path it is written to (the same path: in place).
    results : path or None
        Folder for the ledgers; None: where the ledger puts them by itself.
    jobs, timeout : int
        Kernels at a time; seconds a cell may take.

    Raises
    ------
    NotebookError
        At the first cell that raises (a warning does), writes to stderr, or takes too long. Notebooks then running are dropped.
    """
    todo = []
    for path in longest_first(map(Path, paths), folder):
        notebook = nbformat.read(path, as_version=4)
        reason = missing_data(path, folder)
        if reason:
            print(f"Not run, committed outputs kept: {reason}")
            form.write(notebook, destination(path))
        else:
            todo.append((path, notebook))
    total = sum(cell.cell_type == "code" and bool(cell.source.strip()) for _, notebook in todo for cell in notebook.cells)
    with strict_kernels(results), tqdm(total=total, unit="cell", desc="Notebooks") as bar:
        for phase in ([t for t in todo if t[0].name != FIRST_PAGE], [t for t in todo if t[0].name == FIRST_PAGE]):
            asyncio.run(_run_together(phase, destination, folder, jobs, timeout, bar))


async def _run_together(todo, destination, folder, jobs, timeout, bar):
    free = asyncio.Semaphore(jobs)

    async def one(path, notebook):
        async with free:
            name, start = path.relative_to(folder).as_posix(), time.perf_counter()
            await _execute(notebook, name, path.parent, timeout, bar)
            form.write(form.normalise(notebook), destination(path))
            bar.write(f"  {name}  {time.perf_counter() - start:.0f} s")

    try:
        async with asyncio.TaskGroup() as group:
            for path, notebook in todo:
                group.create_task(one(path, notebook))
    except* NotebookError as failures:
        raise failures.exceptions[0] from None


async def _execute(notebook, name, cwd, timeout, bar):
    now_at = "its kernel's start"

    def started(cell, cell_index):
        nonlocal now_at
        number = sum(c.cell_type == "code" for c in notebook.cells[: cell_index + 1])
        now_at = f"code cell {number} (id {cell.get('id')})"

    def executed(cell, **_):
        bar.update()
        # The reply calls a cell sound whose figure or repr raised only when it was shown, so the outputs decide.
        for output in cell.outputs:
            if output.output_type == "error":
                traceback = COLOUR.sub("", "\n".join(output.traceback))
                raise NotebookError(f"{name}, {now_at}:\n{traceback}")
            if output.output_type == "stream" and output.name == "stderr":
                raise NotebookError(f"{name}, {now_at} writes to stderr:\n{output.text}")

    client = NotebookClient(
        notebook,
        kernel_name="python3",
        timeout=timeout,
        startup_timeout=600,  # nbclient's minute is too short for a machine under load
        record_timing=False,
        store_widget_state=False,
        coalesce_streams=True,
        resources={"metadata": {"path": str(cwd)}},
        on_cell_execute=started,
        on_cell_executed=executed,
    )
    try:
        await client.async_execute()
    except (TimeoutError, RuntimeError) as error:  # a cell too slow; a kernel that died or did not start
        raise NotebookError(f"{name}, {now_at}: {error}") from error

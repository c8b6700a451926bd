"""Runs notebooks, two at a time and the longest first, and stops at the first cell that fails, warns or writes to stderr."""

import asyncio
import re
import signal
import time
from contextlib import contextmanager
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
    KeyboardInterrupt
        At Ctrl-C, within a second or two; notebooks that were finished are stored, the others are as they were.
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
            interrupted = []
            try:
                asyncio.run(_run_together(phase, destination, folder, jobs, timeout, bar, interrupted))
            except (asyncio.CancelledError, NotebookError):  # nbclient takes a cancelled cell for one whose kernel died
                if interrupted:
                    raise KeyboardInterrupt from None
                raise


async def _run_together(todo, destination, folder, jobs, timeout, bar, interrupted):
    free, clients = asyncio.Semaphore(jobs), []

    async def one(path, notebook):
        async with free:
            name, start = path.relative_to(folder).as_posix(), time.perf_counter()
            await _execute(notebook, name, path.parent, timeout, bar, clients)
            form.write(form.normalise(notebook), destination(path))
            bar.write(f"  {name}  {time.perf_counter() - start:.0f} s")

    try:
        with _interrupts_end_it(clients, interrupted):
            async with asyncio.TaskGroup() as group:
                for path, notebook in todo:
                    group.create_task(one(path, notebook))
    except* NotebookError as failures:
        raise failures.exceptions[0] from None


@contextmanager
def _interrupts_end_it(clients, interrupted):
    """At Ctrl-C end the running kernels without waiting for them, and cancel the present task; `interrupted` then holds something.

    Each nbclient would put a handler of its own in the place of this one, which shuts down its own kernel and lets the program go on.
    """
    loop, task = asyncio.get_running_loop(), asyncio.current_task()

    def interrupt():
        interrupted.append(signal.SIGINT)
        for client in clients:
            client.shutdown_kernel = "immediate"
        task.cancel()

    def keep(*_):
        raise RuntimeError("the handler of Ctrl-C is the suite's")

    try:
        loop.add_signal_handler(signal.SIGINT, interrupt)
    except (NotImplementedError, RuntimeError):  # on Windows, or outside the main thread
        yield
        return
    loop.add_signal_handler = loop.remove_signal_handler = keep
    try:
        yield
    finally:
        del loop.add_signal_handler, loop.remove_signal_handler


async def _execute(notebook, name, cwd, timeout, bar, clients):
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
    clients.append(client)
    try:
        await client.async_execute()
    except (TimeoutError, RuntimeError) as error:  # a cell too slow; a kernel that died or did not start
        raise NotebookError(f"{name}, {now_at}: {error}") from error

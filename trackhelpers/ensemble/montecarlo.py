"""Monte Carlo over chunks of runs: on one core, on many cores, on many machines, with the same result."""

import os
import sys
import warnings
from collections import deque
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import closing
from functools import partial
from itertools import islice

import numpy as np
from joblib import Parallel, delayed
from joblib.parallel import get_active_backend
from tqdm.auto import tqdm

from trackhelpers.checks import check_count

_FOLDS = {"sum": np.add, "min": np.minimum, "max": np.maximum}
_REDUCERS = (*_FOLDS, "concat")
_ON_CLUSTER = 256  # chunks that a cluster holds at a time


def standard_normal(rngs, shape):
    """Independent standard normal numbers, one block a run: shape ``(*shape, M)`` for M generators.

    Each run draws its own block from its own generator, so its numbers do not depend on which other runs share the chunk. ValueError for what is no list of generators or no shape.
    """
    if not isinstance(rngs, (list, tuple)) or not all(hasattr(rng, "standard_normal") for rng in rngs):
        raise ValueError(f"rngs: expected a list of generators, one a run, got {rngs!r}")
    if not isinstance(shape, (list, tuple)):
        raise ValueError(f"shape: expected a tuple of whole numbers, got {shape!r}")
    shape = tuple(check_count(axis, "shape", 0) for axis in shape)
    block = np.empty((*shape, len(rngs)))
    for run, rng in enumerate(rngs):
        block[..., run] = rng.standard_normal(shape)
    return block


def monte_carlo(task, runs, seed, n_jobs=1, reduce=None, chunk=1000):
    """Run `task` for `runs` independent Monte Carlo runs and merge what its chunks return.

    Run number r draws from the r-th child of ``SeedSequence(seed)``, whatever the chunks and workers, so methods that are compared under one seed see the
    same runs and the result does not depend on how the work was split (identical for the same `chunk`, to the last bits of a sum otherwise).

    Parameters
    ----------
    task : callable
        ``task(rngs) -> dict`` of name -> array, for ``len(rngs)`` runs, one `numpy.random.Generator` a run. For `n_jobs` other than 1 cloudpickle must be
        able to pickle it: functions of a notebook and closures it can.
    runs : int
        Number of runs, ≥ 1.
    seed : int or numpy.random.SeedSequence
        The root of all random numbers. A sequence is read, not advanced: the same one gives the same runs again.
    n_jobs : int or None
        Processes, as in joblib (−1: all cores; None: what ``joblib.parallel_config`` says). Within ``joblib.parallel_config(backend="dask")`` the chunks go
        to the cluster, whatever `n_jobs`.
    reduce : dict, optional
        name -> "sum" (default), "min", "max", or "concat" (arrays whose last axis is the run are joined in the order of the runs).
    chunk : int
        Runs a call of `task`, ≥ 1: the memory a worker needs, and the size of a parcel of work, which pays from about 0.1 s on.

    Returns
    -------
    dict of str -> numpy.ndarray

    Raises
    ------
    ValueError
        Arguments out of range, an unknown reducer, a task that returns no dict, chunks that return different names or shapes, a "concat" that does not hold
        one entry a run.
    RuntimeError
        A worker that died, never a silently smaller sample. (A cluster of Dask first tries the chunk on other workers.)

    Notes
    -----
    An exception of the task arrives with its own type. Ctrl-C ends joblib's workers; on a cluster it takes back the chunks that have not begun.
    """
    root = _checked(task, runs, seed, n_jobs, chunk)
    if reduce is not None and not isinstance(reduce, dict):
        raise ValueError(f"reduce: expected a dict of name -> one of {sorted(_REDUCERS)}, got {reduce!r}")
    merge = _Merge(reduce or {})
    starts = range(0, runs, chunk)
    silent = len(starts) == 1 or os.environ.get("TQDM_DISABLE", "") not in ("", "0")
    with closing(_chunks(task, root, starts, runs, n_jobs)) as chunks, tqdm(total=len(starts), unit="chunk", disable=silent) as bar:
        try:
            for first, part in zip(starts, chunks, strict=True):
                merge.take(part, min(chunk, runs - first))
                bar.update()
        except BrokenExecutor as error:
            raise RuntimeError(f"monte_carlo: a worker died after {merge.taken} of {len(starts)} chunks; no result is returned") from error
    return merge.result()


def _checked(task, runs, seed, n_jobs, chunk):
    """The root SeedSequence; ValueError for arguments out of range."""
    if not callable(task):
        raise ValueError(f"task: expected a function of a list of generators, got {task!r}")
    check_count(runs, "runs")
    check_count(chunk, "chunk")
    if n_jobs is not None and (isinstance(n_jobs, bool) or not isinstance(n_jobs, (int, np.integer)) or not 0 < abs(n_jobs) < sys.maxsize):
        raise ValueError(f"n_jobs: expected a whole number other than 0, or None, got {n_jobs!r}")
    if isinstance(seed, np.random.SeedSequence):
        return seed
    if isinstance(seed, (bool, np.timedelta64)) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise ValueError(f"seed: expected a whole number ≥ 0 or a SeedSequence, got {seed!r}")
    return np.random.SeedSequence(int(seed))


class _Merge:
    """Takes in the chunks' results one by one; what is folded needs no memory that grows with the runs."""

    def __init__(self, reduce):
        for name, how in reduce.items():
            if how not in _REDUCERS:
                raise ValueError(f"reduce: expected one of {sorted(_REDUCERS)} for {name!r}, got {how!r}")
        self.reduce = dict(reduce)
        self.taken = 0
        self._folded, self._joined, self._shapes = {}, {}, None

    def take(self, part, runs):
        """Take in one chunk's result, of `runs` runs."""
        if not isinstance(part, dict):
            raise ValueError(f"task: expected a dict of name -> array, got {type(part).__name__}")
        part = {name: np.asarray(value) for name, value in part.items()}
        shapes = {name: self._shape(name, value, runs) for name, value in part.items()}
        if self._shapes is None:
            self._shapes = shapes
            if set(self.reduce) - set(part):
                raise ValueError(f"reduce: the task returns {sorted(part)}, not {sorted(set(self.reduce) - set(part))}")
        elif shapes != self._shapes:
            raise ValueError(f"task: expected the same names and shapes from every chunk, got {self._shapes} and {shapes}")
        for name, value in part.items():
            if self._how(name) == "concat":
                own = value if value.base is None else value.copy()  # a view would keep the whole array of its chunk alive
                self._joined.setdefault(name, []).append(own)
            else:
                so_far = [self._folded[name]] if name in self._folded else []
                self._folded[name] = _FOLDS[self._how(name)].reduce([*so_far, value])
        self.taken += 1

    def result(self):
        """The merged dict, names in the order of the task's."""
        joined = {name: np.concatenate(values, axis=-1) for name, values in self._joined.items()}
        return {name: joined[name] if name in joined else self._folded[name] for name in self._shapes}

    def _how(self, name):
        return self.reduce.get(name, "sum")

    def _shape(self, name, value, runs):
        """The part of the shape that every chunk must share."""
        if self._how(name) != "concat":
            return value.shape
        if value.shape[-1:] != (runs,):
            raise ValueError(f"task: {name!r} is to be joined by run, expected a last axis of {runs}, got shape {value.shape}")
        return value.shape[:-1]


def _run_chunk(task, root, first, last):
    # children are made where they are needed, by number, as root.spawn would make them
    key = root.spawn_key
    children = (np.random.SeedSequence(root.entropy, spawn_key=(*key, run), pool_size=root.pool_size) for run in range(first, last))
    return task([np.random.default_rng(child) for child in children])


def _chunks(task, root, starts, runs, n_jobs):
    """What `task` returns for each chunk, in order, by whatever joblib is configured to; BrokenExecutor when a worker died."""
    parcels = ((first, min(first + starts.step, runs)) for first in starts)
    backend, _ = get_active_backend()
    if hasattr(backend, "client"):
        backend.effective_n_jobs(n_jobs)  # waits for the first worker, and says so if there is none
        yield from _chunks_of_dask(backend.client, task, root, parcels)
        return
    stream = Parallel(n_jobs=n_jobs, return_as="generator")(delayed(_run_chunk)(task, root, first, last) for first, last in parcels)
    try:
        for part in stream:  # noqa: UP028  `yield from` would close the stream before the warning is silenced
            yield part
    finally:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # joblib's remark on chunks that an error left unread
            stream.close()


def _chunks_of_dask(client, task, root, parcels):
    # joblib's own dask backend (1.6) waits for ever for a chunk whose worker was killed; the cluster's futures tell
    from distributed import KilledWorker

    submitted = (client.submit(partial(_run_chunk, task, root), *parcel, pure=False) for parcel in parcels)
    waiting = deque(islice(submitted, _ON_CLUSTER))
    try:
        while waiting:
            part = waiting[0].result()
            waiting.popleft()  # forgotten here, the cluster forgets it, too
            waiting.extend(islice(submitted, 1))
            yield part
    except (KilledWorker, CancelledError) as error:
        raise BrokenExecutor(str(error)) from error
    finally:
        client.cancel(list(waiting))

"""Monte Carlo over chunks of runs: on one core, on many cores, on many machines, with the same result."""

import os

import numpy as np
from joblib import Parallel, delayed
from tqdm.auto import tqdm

_REDUCERS = {
    "sum": lambda parts: np.sum(parts, axis=0),
    "min": lambda parts: np.min(parts, axis=0),
    "max": lambda parts: np.max(parts, axis=0),
    "concat": lambda parts: np.concatenate(parts, axis=-1),
}


def standard_normal(rngs, shape):
    """Independent standard normal numbers, one block a run: shape (*shape, M) for M generators.

    Each run draws its own block from its own generator, so its numbers do not depend on which other runs share the chunk.
    """
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
        ``task(rngs) -> dict`` of name -> array, for ``len(rngs)`` runs, one `numpy.random.Generator` a run. For `n_jobs` other than 1 it must be picklable
        (joblib's loky takes functions of a notebook, too).
    runs : int
        Number of runs, ≥ 1.
    seed : int or numpy.random.SeedSequence
        The root of all random numbers.
    n_jobs : int
        Processes, as in joblib (−1: all cores). Within ``joblib.parallel_config(backend="dask")`` the chunks go to the cluster.
    reduce : dict, optional
        name -> "sum" (default), "min", "max", or "concat" (arrays whose last axis is the run are joined in the order of the runs).
    chunk : int
        Runs a call of `task`, ≥ 1: the memory a worker needs, and the size of a parcel of work.

    Returns
    -------
    dict of str -> numpy.ndarray

    Raises
    ------
    ValueError
        Arguments out of range, an unknown reducer, chunks that return different names, a "concat" that does not hold one entry a run.
    RuntimeError
        A worker that died; never a silently smaller sample.
    """
    for name, value in (("runs", runs), ("chunk", chunk)):
        if not isinstance(value, (int, np.integer)) or value < 1:
            raise ValueError(f"{name}: expected a whole number ≥ 1, got {value!r}")
    reduce = dict(reduce or {})
    for name, how in reduce.items():
        if how not in _REDUCERS:
            raise ValueError(f"reduce: expected one of {sorted(_REDUCERS)} for {name!r}, got {how!r}")
    root = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    # a fresh sequence of the same entropy: a second call with the same object must not spawn other children
    entropy, key = root.entropy, root.spawn_key
    parcels = [(first, min(first + chunk, runs)) for first in range(0, runs, chunk)]
    silent = bool(os.environ.get("TQDM_DISABLE")) or len(parcels) == 1
    work = (delayed(_run_chunk)(task, entropy, key, first, last) for first, last in parcels)
    parts = []
    try:
        stream = Parallel(n_jobs=n_jobs, return_as="generator")(work)
        for part in tqdm(stream, total=len(parcels), unit="chunk", disable=silent):
            parts.append(part)
    except Exception as error:
        if type(error).__name__ in ("TerminatedWorkerError", "BrokenProcessPool", "KilledWorker"):
            raise RuntimeError(f"monte_carlo: a worker died after {len(parts)} of {len(parcels)} chunks; no result is returned") from error
        raise
    return _merged(parts, parcels, reduce)


def _run_chunk(task, entropy, key, first, last):
    children = (np.random.SeedSequence(entropy, spawn_key=(*key, run)) for run in range(first, last))
    return task([np.random.default_rng(child) for child in children])


def _merged(parts, parcels, reduce):
    names = set(parts[0])
    for part, (first, last) in zip(parts, parcels, strict=True):
        if set(part) != names:
            raise ValueError(f"task: expected the same names from every chunk, got {sorted(names)} and {sorted(part)}")
        for name in names:
            if reduce.get(name) == "concat" and np.shape(part[name])[-1:] != (last - first,):
                raise ValueError(
                    f"task: {name!r} is to be joined by run, expected a last axis of {last - first}, got {np.shape(part[name])}"
                )
    unknown = set(reduce) - names
    if unknown:
        raise ValueError(f"reduce: the task returns {sorted(names)}, not {sorted(unknown)}")
    return {name: _REDUCERS[reduce.get(name, "sum")]([np.asarray(part[name]) for part in parts]) for name in parts[0]}

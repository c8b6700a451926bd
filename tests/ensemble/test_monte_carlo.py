"""The Monte Carlo runner: the same result for any split of the work, and never a smaller sample without a word."""

import os
import signal
import subprocess
import sys
import time
import tracemalloc
from contextlib import contextmanager, suppress

import joblib
import numpy as np
import psutil
import pytest

from trackhelpers.ensemble import monte_carlo, standard_normal

SEED, RUNS = 7, 95
REDUCE = {"least": "min", "most": "max", "by run": "concat"}

pytestmark = pytest.mark.timeout(3600)  # for what hangs for ever; a slow machine is no error


def moments(rngs):
    """One block of noise a run, merged in all four ways."""
    noise = standard_normal(rngs, (3, 4))
    return {"total": noise.sum(axis=-1), "count": len(rngs), "least": noise.min(axis=-1), "most": noise.max(axis=-1), "by run": noise[0]}


@pytest.fixture(scope="module")
def expected():
    """The same by hand, from the children that the seed spawns."""
    noise = np.stack([np.random.default_rng(child).standard_normal((3, 4)) for child in np.random.SeedSequence(SEED).spawn(RUNS)], axis=-1)
    return {"total": noise.sum(axis=-1), "count": RUNS, "least": noise.min(axis=-1), "most": noise.max(axis=-1), "by run": noise[0]}


def assert_same(result, expected, exactly=False):
    assert list(result) == list(expected)
    for name, value in expected.items():
        if exactly or name != "total":
            np.testing.assert_array_equal(result[name], value, err_msg=name)
        else:
            np.testing.assert_allclose(result[name], value, rtol=1e-12, atol=1e-12, err_msg=name)


# --- one result, however the work is split


@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize("chunk", [1, 10, 94, 95, 1000])
def test_any_chunks_and_workers_merge_to_the_runs_of_the_spawned_children(expected, chunk, n_jobs):
    result = monte_carlo(moments, RUNS, SEED, n_jobs=n_jobs, reduce=REDUCE, chunk=chunk)
    assert_same(result, expected)
    assert_same(result, monte_carlo(moments, RUNS, SEED, reduce=REDUCE, chunk=chunk), exactly=True)


def test_run_r_draws_from_child_r_whatever_the_number_of_runs():
    few, many = (monte_carlo(moments, runs, SEED, reduce=REDUCE, chunk=7)["by run"] for runs in (10, 50))
    np.testing.assert_array_equal(few, many[:, :10])
    assert not np.array_equal(few, monte_carlo(moments, 10, SEED + 1, reduce=REDUCE)["by run"])


def test_a_seed_sequence_is_read_and_not_advanced():
    root = np.random.SeedSequence(SEED, spawn_key=(3,), pool_size=8)
    first, second = (monte_carlo(moments, 5, root, reduce=REDUCE)["by run"] for _ in range(2))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first[:, 4], np.random.default_rng(root.spawn(5)[4]).standard_normal((3, 4))[0])


def test_booleans_and_small_integers_are_counted():
    result = monte_carlo(lambda rngs: {"yes": np.True_, "some": np.int8(100)}, 300, SEED, chunk=1)
    assert result == {"yes": 300, "some": 30000}


def test_nan_is_not_lost_in_a_minimum():
    def task(rngs):
        return {"least": np.nan if rngs[0].random() > 0.8 else 1.0}

    assert np.isnan(monte_carlo(task, 50, SEED, reduce={"least": "min"}, chunk=1)["least"])


# --- processes


def test_closures_go_to_other_processes():
    scale, home = 3.0, os.getpid()

    def task(rngs):
        return {"scaled": scale * standard_normal(rngs, ()), "elsewhere": os.getpid() != home}

    here, there = (monte_carlo(task, 20, SEED, n_jobs=n_jobs, reduce={"scaled": "concat"}, chunk=5) for n_jobs in (1, 2))
    np.testing.assert_array_equal(here["scaled"], there["scaled"])
    assert (here["elsewhere"], there["elsewhere"]) == (0, 4)


@contextmanager
def run_script(text, path, **options):
    """A Python process in a session of its own, none of which outlives a test that fails."""
    path.write_text(text, encoding="utf-8")
    command = [sys.executable, "-W", "error", path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True, **options) as process:
        try:
            yield process
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise


def test_functions_of_main_go_to_other_processes(tmp_path):
    script = (
        "from trackhelpers.ensemble import monte_carlo\n"
        "def task(rngs):\n"
        "    return {'runs': len(rngs)}\n"
        "print(monte_carlo(task, 10, 0, n_jobs=2, chunk=1)['runs'])\n"
    )
    with run_script(script, tmp_path / "script.py", env=os.environ | {"TQDM_DISABLE": "1"}, stderr=subprocess.STDOUT) as process:
        assert process.communicate()[0] == "10\n"
    assert process.returncode == 0


INTERRUPTED = """\
import os
import signal
import time
from contextlib import suppress

import psutil
from trackhelpers.ensemble import monte_carlo

# a shell that starts the tests in the background has its children ignore interrupts
signal.signal(signal.SIGINT, signal.default_int_handler)

def task(rngs):
    os.write(1, b"working\\n")  # in one piece, whoever else writes
    time.sleep(1e6)

def workers():
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            if "resource_tracker" not in " ".join(process.cmdline()):  # these two end with the session
                yield process

try:
    monte_carlo(task, 10, 0, n_jobs=2, chunk=1)
except KeyboardInterrupt:
    while list(workers()):
        time.sleep(0.05)
    print("no worker is left")
"""


def is_worker(process):
    try:
        return "popen_loky" in " ".join(process.cmdline())
    except psutil.NoSuchProcess:
        return False


def has_ended(process):
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["to the process", "to its whole group, as a terminal does"])
def test_an_interrupt_leaves_no_process_behind(tmp_path, send):
    with run_script(INTERRUPTED, tmp_path / "script.py", stderr=subprocess.DEVNULL) as process:
        assert process.stdout.readline() == process.stdout.readline() == "working\n"
        started = psutil.Process(process.pid).children(recursive=True)
        assert len(started) >= 2
        send(process.pid, signal.SIGINT)
        *begun, last = process.communicate()[0].splitlines()  # a worker may have begun another chunk before it was ended
        assert last == "no worker is left" and set(begun) <= {"working"}  # while the session lives on,
    assert process.returncode == 0
    while not all(map(has_ended, started)):  # and nothing at all after it
        time.sleep(0.05)


def test_a_killed_worker_is_an_error_that_counts_the_chunks():
    def task(rngs):
        if rngs[0].bit_generator.seed_seq.spawn_key == (6,):
            time.sleep(0.5)  # the chunks before are done by now
            os.kill(os.getpid(), signal.SIGKILL)
        return {"runs": len(rngs)}

    with pytest.raises(RuntimeError, match=r"a worker died after \d+ of 20 chunks"):
        monte_carlo(task, 20, SEED, n_jobs=2, chunk=1)
    assert monte_carlo(moments, 20, SEED, n_jobs=2, chunk=1)["count"] == 20  # the next call has new workers


class OwnError(Exception):
    pass


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_an_exception_of_the_task_arrives_with_its_type(n_jobs):
    def task(rngs):
        raise OwnError("run 0 went wrong")

    with pytest.raises(OwnError, match="run 0 went wrong"):
        monte_carlo(task, 20, SEED, n_jobs=n_jobs, chunk=1)


# --- a cluster


@pytest.fixture(scope="module")
def processes():
    dask, distributed = pytest.importorskip("dask"), pytest.importorskip("distributed")
    # a worker that was killed is called for as long as the connection may take to be made: patience there is time lost
    settings = {"distributed.scheduler.allowed-failures": 1, "distributed.comm.timeouts.connect": "60s"}
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            processes=True, n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", memory_limit=0
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.fixture
def cluster(processes):
    with joblib.parallel_config(backend="dask"):
        yield processes


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_cluster_gives_the_result_of_one_process(cluster, expected, n_jobs):
    home = os.getpid()
    result = monte_carlo(moments, RUNS, SEED, n_jobs=n_jobs, reduce=REDUCE, chunk=10)
    assert_same(result, expected)
    with joblib.parallel_config(backend="loky"):
        assert_same(result, monte_carlo(moments, RUNS, SEED, reduce=REDUCE, chunk=10), exactly=True)
    assert monte_carlo(lambda rngs: {"elsewhere": os.getpid() != home}, 9, SEED, n_jobs=n_jobs, chunk=1)["elsewhere"] == 9


def test_more_chunks_than_a_cluster_holds_at_a_time_are_all_run(cluster, expected, monkeypatch):
    monkeypatch.setattr("trackhelpers.ensemble.montecarlo._ON_CLUSTER", 3)
    assert_same(monte_carlo(moments, RUNS, SEED, reduce=REDUCE, chunk=10), expected)


def test_an_exception_on_a_cluster_arrives_with_its_type(cluster):
    def task(rngs):
        raise ZeroDivisionError("run 0 went wrong")

    with pytest.raises(ZeroDivisionError, match="run 0 went wrong"):
        monte_carlo(task, 20, SEED, chunk=1)


def test_a_cluster_gives_a_killed_workers_chunk_to_another(cluster, expected, tmp_path):
    import dask

    mark = tmp_path / "killed once"

    def task(rngs):
        if rngs[0].bit_generator.seed_seq.spawn_key == (30,) and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return moments(rngs)

    with dask.config.set({"distributed.comm.timeouts.connect": "3s"}):  # the dead worker is called for as long
        assert_same(monte_carlo(task, RUNS, SEED, reduce=REDUCE, chunk=10), expected)
    assert mark.exists()


def test_a_chunk_that_kills_every_worker_of_a_cluster_is_an_error_that_counts_the_chunks(cluster):
    def task(rngs):
        if rngs[0].bit_generator.seed_seq.spawn_key == (5,):
            os.kill(os.getpid(), signal.SIGKILL)
        return {"runs": len(rngs)}

    with pytest.raises(RuntimeError, match=r"a worker died after [0-5] of 20 chunks"):
        monte_carlo(task, 20, SEED, chunk=1)
    assert monte_carlo(moments, 20, SEED, chunk=1)["count"] == 20


# --- memory and progress


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_seeds_and_parcels_are_made_as_they_are_needed(n_jobs):
    assert_little_memory_before_the_first_chunk(n_jobs)


def test_parcels_go_to_a_cluster_as_they_are_needed(cluster):
    assert_little_memory_before_the_first_chunk(n_jobs=1)


def assert_little_memory_before_the_first_chunk(n_jobs):
    def task(rngs):
        raise OwnError

    tracemalloc.start()
    try:
        with pytest.raises(OwnError):
            monte_carlo(task, 10**12, SEED, n_jobs=n_jobs, chunk=10)  # a list of 10¹¹ parcels would not end well
        assert tracemalloc.get_traced_memory()[1] < 50e6
    finally:
        tracemalloc.stop()


def test_sums_are_streamed():
    size = 250_000  # 2 MB a chunk
    tracemalloc.start()
    try:
        result = monte_carlo(lambda rngs: {"ones": np.ones(size)}, 60, SEED, chunk=1)
        assert tracemalloc.get_traced_memory()[1] < 10 * 8 * size
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(result["ones"], np.full(size, 60.0))


def test_a_part_of_an_array_that_is_joined_does_not_keep_the_rest():
    size = 250_000  # 2 MB a chunk, of which one number is kept
    tracemalloc.start()
    try:
        result = monte_carlo(lambda rngs: {"first": np.ones((size, 1))[0]}, 60, SEED, reduce={"first": "concat"}, chunk=1)
        assert tracemalloc.get_traced_memory()[1] < 10 * 8 * size
    finally:
        tracemalloc.stop()
    np.testing.assert_array_equal(result["first"], np.ones(60))


@pytest.mark.parametrize(("disable", "chunk", "shown"), [(None, 5, True), ("0", 5, True), ("1", 5, False), (None, 20, False)])
def test_progress_shows_unless_it_is_switched_off_or_there_is_one_chunk(monkeypatch, capsys, disable, chunk, shown):
    monkeypatch.delenv("TQDM_DISABLE", raising=False)
    if disable is not None:
        monkeypatch.setenv("TQDM_DISABLE", disable)
    monte_carlo(moments, 20, SEED, chunk=chunk)
    out, err = capsys.readouterr()
    assert out == "" and ("4/4" in err if shown else err == "")


# --- bad arguments


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"task": 3}, "task"),
        ({"runs": 0}, "runs"),
        ({"runs": 2.5}, "runs"),
        ({"chunk": 0}, "chunk"),
        ({"chunk": "all"}, "chunk"),
        ({"seed": -1}, "seed"),
        ({"seed": None}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"n_jobs": 0}, "n_jobs"),
        ({"n_jobs": 1.5}, "n_jobs"),
        ({"reduce": {"count": "mean"}}, "reduce.*'mean'"),
        ({"reduce": {"unheard": "sum"}}, "reduce.*'unheard'"),
        ({"reduce": {"count": "concat"}}, "task.*'count' is to be joined by run"),
        ({"reduce": {"total": "concat"}}, "task.*'total' is to be joined by run"),
        ({"task": lambda rngs: len(rngs)}, "task: expected a dict"),
        ({"task": lambda rngs: {str(rngs[0].random()): 1}}, "the same names and shapes"),
        ({"task": lambda rngs: {"by run": standard_normal(rngs, ())}}, "the same names and shapes"),  # the sum of unequal chunks
    ],
    ids=lambda value: value if isinstance(value, str) else "-".join(value),
)
def test_bad_arguments_are_named(change, name):
    arguments = {"task": moments, "runs": 21, "seed": SEED, "chunk": 5} | change
    with pytest.raises(ValueError, match=name):
        monte_carlo(**arguments)


def test_a_bad_chunk_among_many_stops_the_workers_without_another_word():
    def task(rngs):
        time.sleep(0.05)
        return {"count": len(rngs)}

    with pytest.raises(ValueError, match="is to be joined by run"):  # joblib would warn, and a warning is an error here
        monte_carlo(task, 200, SEED, n_jobs=2, reduce={"count": "concat"}, chunk=1)
    while any(map(is_worker, psutil.Process().children())):
        time.sleep(0.05)

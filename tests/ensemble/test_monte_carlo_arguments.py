"""What the Monte Carlo runner takes and refuses, and how it merges, on a few runs of one process."""

import inspect
import sys

import numpy as np
import pytest

from trackhelpers.ensemble import monte_carlo, montecarlo, standard_normal


def normals(rngs):
    return {"x": standard_normal(rngs, (2,)), "runs": len(rngs)}


def test_numbers_of_a_run_are_its_own_generators():
    rngs = [np.random.default_rng(k) for k in range(3)]
    block = standard_normal(rngs, [2, 3])
    assert block.shape == (2, 3, 3) and standard_normal(tuple(rngs), ()).shape == (3,) and standard_normal(rngs, (0, 2)).shape == (0, 2, 3)
    for k in range(3):
        np.testing.assert_array_equal(block[..., k], np.random.default_rng(k).standard_normal((2, 3)))
    for wrong in (rngs[0], [1, 2], [*rngs, None], iter(rngs)):
        with pytest.raises(ValueError, match=r"^rngs: expected a list of generators"):
            standard_normal(wrong, ())
    for shape, words in ((3, "a tuple of whole numbers"), ("23", "a tuple"), ((-1,), "a whole number ≥ 0"), ((2.0,), "a whole number ≥ 0")):
        with pytest.raises(ValueError, match=f"^shape: expected {words}"):
            standard_normal(rngs, shape)


@pytest.mark.parametrize("seed", [0, np.int64(5), np.random.SeedSequence(5)])
def test_a_seed_is_a_whole_number_or_a_sequence(seed):
    root = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(int(seed))
    expected = [np.random.default_rng(child).standard_normal(2) for child in np.random.SeedSequence(root.entropy).spawn(4)]
    np.testing.assert_array_equal(monte_carlo(normals, 4, seed, reduce={"x": "concat"}, chunk=3)["x"].T, expected)


@pytest.mark.parametrize("seed", [True, -1, "1", 2.0, np.timedelta64(3)])
def test_other_seeds_are_refused(seed):
    with pytest.raises(ValueError, match=r"^seed: expected a whole number ≥ 0 or a SeedSequence"):
        monte_carlo(normals, 1, seed)


@pytest.mark.parametrize("n_jobs", [0, True, False, 1.0, "1", sys.maxsize, -sys.maxsize])
def test_a_number_of_processes_is_a_whole_number_other_than_nought(n_jobs):
    with pytest.raises(ValueError, match=r"^n_jobs: expected a whole number other than 0, or None"):
        monte_carlo(normals, 1, 0, n_jobs=n_jobs)


@pytest.mark.parametrize("n_jobs", [1, np.int64(1), None])
def test_one_process_is_enough(n_jobs):
    assert monte_carlo(normals, 5, 0, n_jobs=n_jobs, reduce={"x": "concat"}, chunk=2)["runs"] == 5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"task": "normals"}, "task: expected a function"),
        ({"runs": 0}, "runs: expected a whole number ≥ 1"),
        ({"chunk": 0}, "chunk: expected a whole number ≥ 1"),
        ({"reduce": ["x"]}, "reduce: expected a dict"),
        ({"reduce": {"x": "mean"}}, "reduce: expected one of .* for 'x', got 'mean'"),
        ({"reduce": {"y": "sum"}}, r"reduce: the task returns \['runs', 'x'\], not \['y'\]"),
        ({"task": lambda rngs: [1]}, "task: expected a dict of name -> array, got list"),
        ({"reduce": {"runs": "concat"}}, "task: 'runs' is to be joined by run, expected a last axis of 2"),
        ({"task": lambda rngs: {"x": np.zeros(len(rngs))}}, "task: expected the same names and shapes"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    with pytest.raises(ValueError, match=f"^{words}"):
        monte_carlo(**{"task": normals, "runs": 5, "seed": 0, "chunk": 2} | change)


def test_chunks_are_folded_and_joined_in_their_order():
    calls = []

    def task(rngs):
        calls.append(len(rngs))
        k = float(len(calls))
        return {"join": np.full((2, len(rngs)), k), "sum": k, "least": [k, -k], "most": [k, -k]}

    found = monte_carlo(task, 7, 0, reduce={"join": "concat", "least": "min", "most": "max"}, chunk=3)
    assert calls == [3, 3, 1] and list(found) == ["join", "sum", "least", "most"]
    assert found["join"].tolist() == [[1, 1, 1, 2, 2, 2, 3]] * 2 and found["sum"] == 6
    assert found["least"].tolist() == [1, -3] and found["most"].tolist() == [3, -1]


def test_what_is_not_named_is_one_process_chunks_of_a_thousand_and_a_sum():
    defaults = {name: each.default for name, each in inspect.signature(monte_carlo).parameters.items() if each.default is not each.empty}
    assert defaults == {"n_jobs": 1, "reduce": None, "chunk": 1000}
    sizes = []
    monte_carlo(lambda rngs: sizes.append(len(rngs)) or {"runs": len(rngs)}, 1001, 0)
    assert sizes == [1000, 1]


def test_a_part_that_is_joined_is_a_copy_where_it_is_a_view():
    merge = montecarlo._Merge({"view": "concat", "own": "concat"})
    whole = np.zeros((2, 3))
    merge.take({"view": whole[0], "own": np.zeros(3)}, 3)
    whole[0] = 1.0
    assert merge.taken == 1 and merge.result()["view"].tolist() == [0, 0, 0]
    merge.take({"view": whole[0], "own": np.ones(3)}, 3)
    assert merge.taken == 2 and merge.result()["own"].tolist() == [0, 0, 0, 1, 1, 1]


@pytest.mark.parametrize(("disable", "chunk", "shown"), [(None, 2, True), ("", 2, True), ("0", 2, True), ("1", 2, False), (None, 4, False)])
def test_progress_is_shown_of_several_chunks_unless_it_is_switched_off(monkeypatch, capsys, disable, chunk, shown):
    monkeypatch.delenv("TQDM_DISABLE", raising=False)
    if disable is not None:
        monkeypatch.setenv("TQDM_DISABLE", disable)
    monte_carlo(normals, 4, 0, chunk=chunk)
    assert ("2/2" in capsys.readouterr().err) is shown

"""What notebook 3 counts: the kinds of motion, settling, the worst segment, and the curves of whole families."""

import numpy as np
import pytest

from trackhelpers.scenarios.augmented_bias import contenders as c
from trackhelpers.scenarios.augmented_bias import runs, target
from trackhelpers.scenarios.augmented_bias import simulation as sim

TRACK = target.truth()


def test_each_of_table_1s_cells_has_a_rule_that_the_track_meets_and_another_track_does_not():
    cells = sim.kinds_of_motion(TRACK)
    assert [(segment.first, axis) for segment, axis, *_ in cells] == [(s.first, axis) for s in target.SEGMENTS for axis in "xy"]
    holds = {"<= 1e-9": lambda v: v <= 1e-9, "> 0": lambda v: v > 0, "< 0": lambda v: v < 0}
    assert all(holds[rule](value) for *_, rule, value in cells)
    other = TRACK.copy()
    other[[1, 3]] = -(np.cumsum(np.abs(other[[0, 2]]), axis=1) ** 2)  # nothing of it is uniform, accelerated or a sinusoid
    met = [
        words for segment, axis, _, rule, value in sim.kinds_of_motion(other) if holds[rule](value) for words in [getattr(segment, axis)]
    ]
    assert set(met) <= {"decelerated", "exponentially correlated, mean −a"}


def test_the_distance_from_a_straight_line_is_that_of_elementary_geometry():
    line = np.zeros((4, 11))
    line[0], line[2], line[1], line[3] = np.arange(11), np.arange(11), 1, 1
    assert sim.off_the_line(line, 10) == pytest.approx(0, abs=1e-12)
    line[2, 7] += 1
    assert sim.off_the_line(line, 10) == pytest.approx(np.sqrt(0.5))
    assert sim.off_the_line(line, 6) == pytest.approx(0, abs=1e-12)


def test_settling_is_counted_only_where_a_steady_motion_begins():
    known = np.isfinite(sim.settling(c.augmented(), TRACK))
    assert known.tolist() == [[True] * 4] * 3 + [[False] * 4] * 2 + [[True, True, False, False]]
    fast, slow = (sim.settling(c.augmented(q), TRACK)[:3] for q in ("0.1, 0.01", "0.001, 0.001"))
    assert np.all(fast < slow)


def test_the_two_ways_to_a_familys_curve_agree():
    exact = sim.trade_off(lambda _: c.plain(), [0], TRACK)
    sampled = sim.sampled_trade_off([c.plain()], 150, 1)
    assert exact.shape == sampled.shape == (1, len(sim.TRADE), 2)
    np.testing.assert_allclose(sampled[:, 1:], exact[:, 1:], rtol=0.01)
    np.testing.assert_allclose(sampled[:, 0], exact[:, 0], rtol=0.1)


def test_the_worst_segment_is_the_largest_distance():
    scores = runs.score([c.plain()], 40, 1)
    value, segment = sim.worst(scores, "SKF")
    assert segment in (1, 2) and value == pytest.approx(np.sqrt(2) * 29.24, rel=0.01)


def test_one_run_is_one_of_the_many():
    rng_errors = sim.one_run([c.plain(), c.strong_tracking()], seed=3)
    x0, z = target.simulate([np.random.default_rng(3)], TRACK)
    last = list(c.plain().follow(x0, z))[-1][0]
    np.testing.assert_array_equal(rng_errors["SKF"][:, -1], (last - TRACK[:, -1:])[:, 0])
    assert rng_errors["SKF"].shape == (4, 1301)


def test_the_table_holds_seven_segments_of_four_components():
    scores = runs.score([c.plain()], 40, 1)
    values = sim.table(scores, "settled")["SKF"]
    np.testing.assert_allclose(values[4:8], scores["SKF"].rmse(target.SEGMENTS[1].settled))
    assert values.shape == (28,)


def test_the_claims_over_a_are_the_same_numbers_as_for_one_a():
    three = [c.plain(), c.strong_tracking(4.0), c.augmented()]
    by_a = {a: runs.score(three, 60, 1, a=a) for a in (1.0, 2.0)}
    table = sim.claims_by_acceleration(by_a)
    assert list(table.index) == list(sim.CLAIMS) and list(table.columns) == [1.0, 2.0]
    ratio = runs.compared(by_a[2.0][sim.PAPERS[2]], by_a[2.0][sim.PAPERS[1]], 4, ["y"])[0]
    assert table.loc["c: y at 701–900 s, ABMA / STKF", 2.0] == ratio
    linear = table.loc["a: ABMA − SKF at rest, RMSE of x over the SKF's lag"]
    assert linear[1.0] == pytest.approx(2 * linear[2.0], rel=0.02)  # the lag is proportional to a, the noise at rest is not
    assert table.loc["e: longest settling time of ABMA (s)", 2.0] == np.nanmax(sim.settling(c.augmented(), TRACK))

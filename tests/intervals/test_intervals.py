"""Intervals hold what they promise."""

import numpy as np
import pytest

from trackhelpers.intervals import mean_interval, ratio_interval


def test_mean_interval_covers_the_mean_in_95_of_100_experiments():
    rng = np.random.default_rng(5)
    hits = [low < 0.5 < high for _, low, high in (mean_interval(rng.random(200)) for _ in range(2000))]
    assert np.mean(hits) == pytest.approx(0.95, abs=0.015)


def test_mean_interval_is_196_standard_errors():
    mean, low, high = mean_interval([1.0, 2.0, 3.0, 4.0])
    assert mean == 2.5
    assert high - mean == pytest.approx(1.959964 * np.sqrt(5 / 3) / 2)
    assert mean - low == pytest.approx(high - mean)


def test_ratio_of_proportional_samples_has_no_width():
    samples = np.random.default_rng(6).random(50) + 0.5
    np.testing.assert_allclose(ratio_interval(3 * samples, samples), 3.0, rtol=1e-12)


def test_ratio_interval_covers_the_ratio_in_95_of_100_experiments():
    rng = np.random.default_rng(7)
    hits = []
    for _ in range(2000):
        common, own = rng.exponential(size=(2, 200))
        _, low, high = ratio_interval(2 * common + own, common + 1)
        hits.append(low < 1.5 < high)
    assert np.mean(hits) == pytest.approx(0.95, abs=0.015)


def test_interval_prints_itself():
    assert str(ratio_interval([1.0, 3.0], [1.0, 1.0])) == "2.000 [0.04004, 3.960]"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mean_interval([1.0]), "samples: .*two or more"),
        (lambda: mean_interval([1.0, np.nan]), "samples: .*finite"),
        (lambda: ratio_interval([1.0, 2.0], [1.0, 2.0, 3.0]), "denominator: .*2 runs.*3"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()

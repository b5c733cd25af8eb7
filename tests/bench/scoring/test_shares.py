"""Intervals are those of the textbook, and endless values stay at their end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigsight_bench.scoring.shares import Share, mean_interval, median, median_interval, quantile


def test_the_wilson_interval_of_nine_in_ten() -> None:
    # Wilson (1927): centre and width for 9 of 10 at 95 %.
    assert Share(9, 10).interval == pytest.approx((0.5958, 0.9821), abs=1e-4)
    assert Share(0, 0).interval == (0.0, 1.0)


def test_the_interval_of_a_median_holds_it_in_95_percent() -> None:
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(400):
        low, high = median_interval(rng.lognormal(size=25).tolist())
        assert low is not None
        assert high is not None
        inside += low <= 1.0 <= high
    # Three standard deviations of 400 draws; the interval from order alone is on the safe side.
    assert inside / 400 >= 0.92
    assert inside < 400


def test_the_interval_of_a_mean_shrinks_with_the_root_of_the_trials() -> None:
    widths = [np.ptp(mean_interval([0.4, 0.6] * n)) for n in (50, 200)]
    assert widths[0] / widths[1] == pytest.approx(2.0, rel=0.02)
    assert mean_interval([0.9]) == (None, None)


def test_a_minority_of_endless_values_leaves_the_median_and_a_majority_takes_it() -> None:
    assert median([1.0, 2.0, math.inf]) == 2.0
    assert median([1.0, math.inf, math.inf]) is None
    assert median([1.0, math.inf]) is None
    assert median([]) is None


def test_a_quantile_is_a_value_that_was_seen() -> None:
    assert quantile([1.0, 2.0, 3.0, math.inf], 0.5) == 2.0
    assert quantile([1.0, 2.0, 3.0, math.inf], 0.95) is None


def test_few_values_leave_an_open_interval() -> None:
    assert median_interval([1.0, 2.0]) == (None, None)

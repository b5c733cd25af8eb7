from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.location.trace import effect_shares, gap_intervals


def test_the_interval_holds_the_gap_as_often_as_it_says() -> None:
    """The rig moves in the same way in each experiment; what the simulation leaves is drawn anew."""
    rng = np.random.default_rng(0)
    measured = np.sin(0.3 * np.arange(4000))
    truth, holds = 0.1 / np.sqrt(0.5), 0
    for _ in range(200):
        low, high = gap_intervals({"before": [0.1 * rng.standard_normal(4000)]}, [measured], 0.0, rng)[
            "before"
        ]
        holds += low <= truth <= high
    assert 0.88 <= holds / 200 <= 0.99


def test_a_gap_in_one_stretch_is_less_sure_than_one_everywhere() -> None:
    rng = np.random.default_rng(1)
    measured = rng.standard_normal(4000)
    everywhere = 0.1 * rng.standard_normal(4000)
    once = np.where(np.arange(4000) < 400, np.sqrt(10.0) * everywhere, 0.0)
    limits = gap_intervals({"before": [everywhere], "after": [once]}, [measured], 0.0, rng)
    assert np.diff(limits["after"]) > 3.0 * np.diff(limits["before"])


def test_the_closed_share_is_one_where_the_floor_is_reached() -> None:
    rng = np.random.default_rng(2)
    measured = np.sin(0.3 * np.arange(4000))
    noise = 0.01 * rng.standard_normal(4000)
    gap = noise + 0.5 * measured
    low, high = gap_intervals({"before": [gap], "after": [noise]}, [measured], 0.01 / np.sqrt(0.5), rng)[
        "closed"
    ]
    assert 0.99 < low <= 1.0 <= high + 2e-3


def test_a_residual_that_is_not_finite_has_no_interval() -> None:
    limits = gap_intervals(
        {"before": [np.full(400, np.inf)]}, [np.arange(400.0)], 0.0, np.random.default_rng(3)
    )
    assert np.all(np.isnan(limits["before"]))


LEFT = {
    frozenset(): {"x": 1.0},
    frozenset({"a"}): {"x": 0.4},
    frozenset({"b"}): {"x": 0.8},
    frozenset({"a", "b"}): {"x": 0.1},
}


def test_the_shares_of_two_effects_add_up_to_the_closed_gap() -> None:
    shares = effect_shares(["a", "b"], LEFT)
    assert shares["a"]["x"] == pytest.approx((0.6 + 0.7) / 2 / 0.9)
    assert shares["a"]["x"] + shares["b"]["x"] == pytest.approx(1.0)


def test_effects_that_stand_for_each_other_share_alike() -> None:
    left = {**LEFT, frozenset({"a"}): {"x": 0.1}, frozenset({"b"}): {"x": 0.1}}
    shares = effect_shares(["a", "b"], left)
    assert shares["a"]["x"] == shares["b"]["x"] == pytest.approx(0.5)


def test_no_share_without_the_model_that_lacks_the_other() -> None:
    assert effect_shares(["a", "b"], {k: v for k, v in LEFT.items() if k != frozenset({"b"})}) == {}
    assert effect_shares(["a"], LEFT) == {}


def test_effects_that_close_nothing_have_no_share() -> None:
    left = {key: {"x": 0.5} for key in LEFT}
    assert np.isnan(effect_shares(["a", "b"], left)["a"]["x"])

"""Scores of probabilities: honest ones are best, overconfidence shows in slope and offset, sets count with their size."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigsight_bench.scoring.probability_scores import (
    LEAST_PROBABILITY,
    log_score,
    probability_scores,
    reliability_offset,
    reliability_slope,
    scores_of,
)


def test_a_truth_without_any_probability_costs_no_more_than_a_thousandth() -> None:
    assert log_score(0.0) == pytest.approx(-math.log(LEAST_PROBABILITY))
    assert log_score(1.0) == 0.0


def test_stating_one_everywhere_is_no_better_than_being_honest(outcome_like, wrong_outcome) -> None:
    def scored(stated: float) -> dict:
        right = [outcome_like(stated=stated, probability=stated) for _ in range(18)]
        wrong = [wrong_outcome(stated=stated, probability=1.0 - stated) for _ in range(2)]
        return scores_of([*right, *wrong])

    honest, overconfident = scored(0.9), scored(1.0)
    assert honest["log_score"] < overconfident["log_score"]
    assert honest["brier"] < overconfident["brier"]


@pytest.mark.parametrize(("sharpened", "slope"), [(1.0, 1.0), (2.0, 0.5), (0.5, 2.0)])
def test_the_slope_tells_overconfident_and_underconfident_statements(sharpened: float, slope: float) -> None:
    rng = np.random.default_rng(3)
    log_odds = rng.normal(1.0, 1.5, 5000)
    true = rng.random(5000) < 1.0 / (1.0 + np.exp(-log_odds))
    stated = 1.0 / (1.0 + np.exp(-sharpened * log_odds))
    found, error = reliability_slope(stated, true)
    assert abs(found - slope) < 3.0 * error
    assert error < 0.1


@pytest.mark.parametrize(
    ("stated", "true"),
    [
        ([0.9, 0.8], [True, True]),
        ([0.9, 0.9], [True, False]),
        ([0.9, 0.9, 0.1, 0.1], [True, True, False, False]),
    ],
)
def test_without_misses_or_different_statements_there_is_no_slope(stated, true) -> None:
    assert reliability_slope(np.array(stated), np.array(true)) is None


def test_sets_are_counted_where_there_are_any(outcome_like, wrong_outcome) -> None:
    scores = scores_of(
        [
            outcome_like(set_size=1),
            outcome_like(set_size=2),
            wrong_outcome(set_size=3),
            outcome_like(in_set=None, set_size=None),
        ]
    )
    assert (scores["covered"]["count"], scores["covered"]["total"]) == (2, 3)
    assert scores["set_size"] == pytest.approx(2.0)


def test_strata_are_verdicts_kinds_designs_and_rigs_with_several_places(outcome_like, wrong_outcome) -> None:
    scores = probability_scores(
        [
            outcome_like(),
            outcome_like(kind="pair", several_places=True),
            wrong_outcome(verdict="failed", named=()),
        ]
    )
    assert list(scores) == [
        "all",
        "design: standard",
        "kind: pair",
        "kind: single",
        "one place",
        "several places",
        "verdict: one effect",
    ]
    assert (scores["all"]["count"], scores["all"]["failed"]) == (3, 1)


def test_a_failed_diagnosis_costs_the_most_and_states_nothing(outcome_like, wrong_outcome) -> None:
    failed = wrong_outcome(verdict="failed", named=(), probability=0.0, stated=0.0)
    with_it, without = scores_of([outcome_like(), failed]), scores_of([outcome_like()])
    assert with_it["log_score"] == pytest.approx((without["log_score"] - math.log(LEAST_PROBABILITY)) / 2.0)
    assert with_it["brier"] == without["brier"]
    assert with_it["true"] == without["true"]


def test_the_offset_tells_who_states_too_much(outcome_like) -> None:
    rng = np.random.default_rng(4)
    log_odds = rng.normal(1.0, 1.5, 5000)
    true = rng.random(5000) < 1.0 / (1.0 + np.exp(-log_odds))
    stated = 1.0 / (1.0 + np.exp(-(log_odds + 1.0)))
    slope, slope_error = reliability_slope(stated, true)
    offset, error = reliability_offset(stated, true)
    assert abs(slope - 1.0) < 3.0 * slope_error, "the slope alone does not show it"
    assert abs(offset + 1.0) < 3.0 * error
    assert error < 0.1


@pytest.mark.parametrize(
    ("verdict", "named", "stratum"),
    [
        ("effect", ("backlash",), "one effect"),
        ("effect", ("backlash", "coulomb_friction"), "several effects"),
        ("unknown", (), "unknown"),
        ("none", (), "none or parameters"),
        ("parameters", (), "none or parameters"),
    ],
)
def test_the_stratum_of_a_verdict_is_known_without_the_key(
    outcome_like, verdict: str, named: tuple[str, ...], stratum: str
) -> None:
    assert f"verdict: {stratum}" in probability_scores([outcome_like(verdict=verdict, named=named)])

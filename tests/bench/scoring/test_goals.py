"""Goals are for gaps that can be seen; what was not tried is neither reached nor missed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigsight_bench.scoring import Outcome, WithheldError
from rigsight_bench.scoring.goals import GOALS, LABORATORY_GOALS, figures, targets

Like = Callable[..., Outcome]


def target(outcomes: list[Outcome], name: str) -> dict[str, Any]:
    return next(row for row in targets(figures(outcomes)) if row["name"] == name)


def test_a_faint_gap_counts_beside_the_goals(outcome_like: Like, wrong_outcome: Like) -> None:
    found = figures([outcome_like(), wrong_outcome(gap=2.0, tier="faint")])
    assert (found["singles_right"]["count"], found["singles_right"]["total"]) == (1, 1)
    assert (found["faint_right"]["count"], found["faint_right"]["total"]) == (0, 1)


def test_a_gap_that_nobody_measured_counts_as_large(wrong_outcome: Like) -> None:
    failed = wrong_outcome(gap=None, tier="not measured", verdict="failed", named=())
    assert figures([failed])["singles_right"]["total"] == 1


def test_every_goal_stands_beside_a_figure(outcome_like: Like) -> None:
    assert [row["name"] for row in targets(figures([outcome_like()]))] == list(GOALS)


def test_a_laboratory_has_goals_of_its_own(outcome_like: Like, wrong_outcome: Like) -> None:
    sure = {"verdict": "unknown", "named": (), "condition": "drift"}
    taken = [
        outcome_like(condition="clean"),
        wrong_outcome(condition="clean"),
        wrong_outcome(stated=0.95, **sure),
        wrong_outcome(stated=0.85, **sure),
    ]
    rows = {row["name"]: row for row in targets(figures(taken))}
    assert list(rows) == list(LABORATORY_GOALS)
    assert [rows[name]["value"] for name in LABORATORY_GOALS] == [0.25, 0.25, 0.25]
    assert not any(row["reached"] for row in rows.values())
    both = targets(figures([*taken, outcome_like()]))
    assert [row["name"] for row in both] == [*GOALS, *LABORATORY_GOALS]
    assert next(row for row in both if row["name"] == "singles_right")["total"] == 1


def test_what_was_not_tried_is_neither_reached_nor_missed(outcome_like: Like) -> None:
    row = target([outcome_like()], "pairs_right")
    assert (row["reached"], row["decided"], row["total"]) == (None, False, 0)


def test_few_trials_reach_a_goal_without_deciding_it(outcome_like: Like) -> None:
    few = target([outcome_like() for _ in range(5)], "singles_right")
    many = target([outcome_like() for _ in range(500)], "singles_right")
    assert (few["reached"], few["decided"]) == (True, False)
    assert (many["reached"], many["decided"]) == (True, True)


def test_a_clear_miss_is_decided(wrong_outcome: Like) -> None:
    row = target([wrong_outcome() for _ in range(20)], "singles_right")
    assert (row["reached"], row["decided"]) == (False, True)


@pytest.mark.parametrize(("n_broken", "reached"), [(4, True), (6, False)])
def test_a_model_that_cannot_be_simulated_is_endlessly_far(
    outcome_like: Like, n_broken: int, reached: bool
) -> None:
    broken = outcome_like(held_out=None, withheld=(WithheldError("w", "step", 1.0, 100, None),))
    row = target([outcome_like()] * (10 - n_broken) + [broken] * n_broken, "held_out_median")
    assert row["reached"] is reached
    assert row["total"] == 10


def test_a_trial_without_withheld_records_says_nothing_about_them(outcome_like: Like) -> None:
    row = target([outcome_like(held_out=None, withheld=())], "held_out_median")
    assert (row["reached"], row["total"]) == (None, 0)

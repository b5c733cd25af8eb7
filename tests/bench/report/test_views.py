"""Words and rows of a score: goals with their intervals, confusion without losing a trial, figures without false digits."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rigsight_bench.report import views
from rigsight_bench.scoring import Outcome, WithheldError

from .blind_content import content_of

Like = Callable[..., Outcome]


def test_the_verdict_names_every_goal_that_is_missed(outcome_like: Like, wrong_outcome: Like) -> None:
    content = content_of([outcome_like(trial="000"), wrong_outcome(trial="001")])
    text = views.verdict_text(content).replace("\u00a0", " ")
    assert text.startswith("2 of 4 goals are reached.")
    assert "single effects named (50 % instead of 98 %)" in text
    assert "3 of the goals could not be tested" in text
    assert not views.all_reached(content)


def test_a_bench_that_reaches_all_it_tried_says_so(outcome_like: Like) -> None:
    content = content_of([outcome_like(probability=0.99)])
    assert views.verdict_text(content).startswith("All of the 4 goals are reached.")
    assert views.all_reached(content)
    assert views.verdict_text(content_of([])) == "No trial counts towards a goal."
    assert not views.all_reached(content_of([]))


def test_a_goal_within_the_interval_is_said_to_be(outcome_like: Like) -> None:
    rows = {row.figure: row for row in views.goal_rows(content_of([outcome_like()] * 5))}
    single = rows["Single effects named"]
    assert (single.goal, single.found, single.trials) == ("98 %", "100 %", "5 of 5")
    assert single.interval == "57 to 100 %"
    assert single.reached == "yes, but the interval contains the goal"
    assert rows["Pairs, both effects named"].reached == "not tried"
    assert rows["Pairs, both effects named"].interval == ""


def test_a_median_that_is_endless_says_so(wrong_outcome: Like) -> None:
    broken = wrong_outcome(held_out=None, withheld=(WithheldError("w", "step", 1.0, 100, None),))
    row = views.goal_rows(content_of([broken] * 10))[-1]
    assert row.found == "endless"
    assert row.interval.endswith("to endless")


def test_groups_are_in_the_order_of_their_gaps(outcome_like: Like) -> None:
    tiers = ("strong", "faint", "below", "", "clear", "not measured")
    content = content_of([outcome_like(tier=tier) for tier in tiers])
    gap = next(view for view in views.group_views(content) if view.title == "Gap")
    assert [name.partition(" noise")[0] for name in gap.rows] == [
        "below 1.5", "1.5 to 5", "5 to 20", "20", "not measured", "no effect",
    ]  # fmt: skip
    assert all(len(cells) == len(views.GROUP_HEADS) for cells in gap.rows.values())


@pytest.mark.parametrize(
    ("benches", "words"),
    [
        ([("standard", 1)], "1 of design standard, seed 1"),
        ([("external", 0)], "1 campaign from an external source"),
    ],
)
def test_it_is_said_which_benches_were_scored(
    outcome_like: Like, benches: list[tuple[str, int]], words: str
) -> None:
    outcomes = [outcome_like(design=design, seed=seed) for design, seed in benches]
    assert views.bench_text(content_of(outcomes)) == words

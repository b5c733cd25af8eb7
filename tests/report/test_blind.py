"""A terminal shows the score of a blind bench, and the trials that went wrong."""

from __future__ import annotations

import io

from rich.console import Console

from rigsight.blind import Outcome, summary
from rigsight.report.blind import BlindSummary


def found(trial: int, right: bool) -> Outcome:
    return Outcome(
        trial=trial, kind="single", effects=("backlash",), rig="axis", noise="low", gap=12.0, tier="clear",
        verdict="effect", named=("backlash",) if right else ("free_play",), right=right, right_within_set=right,
        place_right=True, probability=0.9 if right else 0.2, stated=0.9 if right else 0.75, held_out=1.02, seconds=20.0,
    )  # fmt: skip


def shown(outcomes: list[Outcome]) -> str:
    content = {
        "n_trials": len(outcomes), "design": "small", "seed": 1, **summary(outcomes),
        "trials": [o.to_json() for o in outcomes],
    }  # fmt: skip
    console = Console(width=120, file=io.StringIO())
    console.print(BlindSummary(content))
    return str(console.file.getvalue())  # type: ignore[attr-defined]


def test_shares_come_with_counts_and_intervals() -> None:
    text = shown([found(0, True), found(1, True), found(2, True), found(17, False)])
    line = next(line for line in text.splitlines() if line.startswith("single effects right"))
    assert "75%" in line
    assert "3 of 4" in line
    assert "(30% to 95%)" in line
    assert "stated 0.75" in text


def test_wrong_trials_are_listed_with_what_was_named_instead() -> None:
    text = shown([found(0, True), found(17, False)])
    line = next(line for line in text.splitlines() if line.startswith("017"))
    assert "backlash" in line
    assert "-> free_play" in line
    assert "Wrong trials" not in shown([found(0, True)])


def test_nothing_tried_is_no_share() -> None:
    text = shown([found(0, True)])
    line = next(line for line in text.splitlines() if line.startswith("controls right"))
    assert line.split()[-1] == "-"

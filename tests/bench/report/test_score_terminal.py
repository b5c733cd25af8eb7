"""A terminal shows the score of a blind bench, and the trials that went wrong."""

from __future__ import annotations

import io
from collections.abc import Callable

from rich.console import Console

from rigsight_bench.report.terminal import BlindSummary
from rigsight_bench.scoring import Outcome

from .blind_content import content_of

Like = Callable[..., Outcome]


def shown(outcomes: list[Outcome]) -> str:
    console = Console(width=120, file=io.StringIO())
    console.print(BlindSummary(content_of(outcomes)))
    return str(console.file.getvalue())  # type: ignore[attr-defined]


def test_shares_come_with_counts_and_intervals(outcome_like: Like, wrong_outcome: Like) -> None:
    text = shown([*(outcome_like(trial=f"{n:03d}") for n in range(3)), wrong_outcome(trial="017")])
    line = next(line for line in text.splitlines() if line.startswith("single effects right"))
    assert "75 %" in line
    assert "3 of 4" in line
    assert "(30 % to 95 %)" in line
    assert "stated 0.75" in text


def test_nearly_all_is_not_shown_as_all(outcome_like: Like, wrong_outcome: Like) -> None:
    text = shown([*(outcome_like(trial=f"{n:03d}") for n in range(299)), wrong_outcome(trial="999")])
    line = next(line for line in text.splitlines() if line.startswith("single effects right"))
    assert "99.7 %" in line
    assert "100 %" not in line


def test_wrong_trials_are_listed_with_what_was_named_instead(outcome_like: Like, wrong_outcome: Like) -> None:
    text = shown([outcome_like(), wrong_outcome(trial="017")])
    line = next(line for line in text.splitlines() if line.startswith("017"))
    assert "backlash" in line
    assert "-> free play" in line
    assert "Wrong trials" not in shown([outcome_like()])


def test_trials_of_several_benches_go_with_their_seed(wrong_outcome: Like) -> None:
    text = shown([wrong_outcome(trial="017"), wrong_outcome(trial="017", seed=2)])
    assert [line.split()[0] for line in text.splitlines() if "free play" in line] == ["1/017", "2/017"]
    assert "1 of design standard, seed 1 and 1 of design standard, seed 2" in text


def test_a_laboratory_is_shown_by_condition(outcome_like: Like, wrong_outcome: Like) -> None:
    unknown = wrong_outcome(condition="free_decay", verdict="unknown", named=(), stated=0.93)
    text = shown([outcome_like(condition="clean"), unknown])
    line = next(line for line in text.splitlines() if line.startswith("Free decay"))
    assert line.split()[2:6] == ["1", "0", "0", "1"]
    assert "0.93" in line
    assert "single effects right" not in text
    assert "By condition" not in shown([outcome_like()])


def test_nothing_tried_is_no_share(outcome_like: Like) -> None:
    text = shown([outcome_like()])
    line = next(line for line in text.splitlines() if line.startswith("controls right"))
    assert line.split()[-1] == "-"

"""The text of a score holds the figures of the run, with date, version and command, in tables that stay tables."""

from __future__ import annotations

from collections.abc import Callable

from rigsight_bench.report.markdown import blind_markdown
from rigsight_bench.scoring import Outcome

from .blind_content import content_of

Like = Callable[..., Outcome]


def tables(text: str) -> list[list[str]]:
    return [
        [line.replace("\\|", "") for line in part.splitlines()]
        for part in text.split("\n\n")
        if part.startswith("| ")
    ]


def test_every_row_of_a_table_has_the_columns_of_its_head(outcome_like: Like, wrong_outcome: Like) -> None:
    odd = wrong_outcome(trial="017", verdict="failed", named=(), message="one | two\nthree")
    pair = ("backlash", "input_delay")
    both = outcome_like(trial="018", kind="pair", effects=pair, named=pair)
    text = blind_markdown(content_of([outcome_like(), odd, both]))
    assert len(tables(text)) == 13
    for rows in tables(text):
        assert len({row.count("|") for row in rows}) == 1


def test_a_laboratory_has_a_table_by_condition(outcome_like: Like, wrong_outcome: Like) -> None:
    text = blind_markdown(content_of([outcome_like(condition="clean"), wrong_outcome(condition="drift")]))
    heads = (
        "| Condition | Trials | Right | Wrong name | Unknown | Neither | Largest stated | Seconds, median |"
    )
    rows = next(rows for rows in tables(text) if rows[0] == heads)
    assert [row.split(" | ")[0].strip("| ") for row in rows[2:]] == ["Clean", "Drift", "All"]
    assert rows[2].startswith("| Clean | 1 | 1 | 0 | 0 | 0 | - |")
    assert "## By condition" not in blind_markdown(content_of([outcome_like()]))


def test_date_version_command_and_intervals_are_there(outcome_like: Like, wrong_outcome: Like) -> None:
    text = blind_markdown(content_of([outcome_like()] * 3 + [wrong_outcome(trial="017")]))
    assert "- Date: 2026-11-21 18:30:00 UTC" in text
    assert "- Command: `rigsight blind --design standard --seed 1`" in text
    assert "rigsight 1.0, numpy 2.0" in text
    assert "| Single effects named | 98 % | 75 % | 3 of 4 | 30 to 95 % | no |" in text
    assert "| backlash | 4 | 3 | free play (1) |" in text
    assert "`rigsight blind --trial 017`" in text


def test_a_bench_without_a_mistake_says_so(outcome_like: Like) -> None:
    assert blind_markdown(content_of([outcome_like()])).endswith("## Wrong trials\n\nNone.\n")


def test_many_wrong_trials_are_counted_and_the_first_shown(wrong_outcome: Like) -> None:
    text = blind_markdown(content_of([wrong_outcome(trial=f"{n:03d}") for n in range(120)]))
    assert "And 20 more in blind.json." in text

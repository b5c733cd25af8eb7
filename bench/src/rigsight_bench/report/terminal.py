"""The score of a blind bench in one screen of a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

from rigsight.report.labels import percent
from rigsight_bench.report.conditions import (
    CONDITION_HEADS,
    condition_rows,
    screen_numbers,
    screen_shares,
)
from rigsight_bench.report.views import (
    FAMILY_HEADS,
    bench_text,
    family_rows,
    number,
)
from rigsight_bench.report.wrong_trials import hidden_text, named_text, trial_text

_MOST_WRONG = 15


@dataclass(frozen=True)
class BlindSummary:
    """A rich renderable of ``blind.json``."""

    content: Mapping[str, Any]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the figures, the reliability and the wrong trials."""
        content = self.content
        yield Text(
            f"Blind bench: {content['n_trials']} trial{'' if content['n_trials'] == 1 else 's'} ({bench_text(content)})",
            "bold",
        )
        table = Table.grid(padding=(0, 2))
        for name, words in screen_shares(content).items():
            share = content["goals"][name]
            table.add_row(Text(words), *map(Text, _share_cells(share)))
        for name, words in screen_numbers(content).items():
            table.add_row(Text(words), Text(number(content["goals"][name])), Text(""), Text(""))
        yield table
        yield from _conditions(content)
        yield from _families(content)
        yield Text("\nStated probability against share of right verdicts", "bold")
        bins = Table.grid(padding=(0, 2))
        for row in content["reliability"]:
            if row["right"]["total"]:
                bins.add_row(Text(f"stated {row['stated']:.2f}"), *map(Text, _share_cells(row["right"])))
        yield bins
        yield from _wrong(content)


def _share_cells(share: Mapping[str, Any]) -> tuple[str, str, str]:
    if not share["total"]:
        return "-", "", ""
    low, high = share["interval"]
    return (
        percent(share["share"]),
        f"{share['count']} of {share['total']}",
        f"({percent(low)} to {percent(high)})",
    )


def _conditions(content: Mapping[str, Any]) -> RenderResult:
    rows = condition_rows(content)
    if not rows:
        return
    yield Text("\nBy condition of the laboratory", "bold")
    table = Table.grid(padding=(0, 2))
    for row in (CONDITION_HEADS, *rows):
        table.add_row(*(Text(cell, justify="right" if i else "left") for i, cell in enumerate(row)))
    yield table


def _families(content: Mapping[str, Any]) -> RenderResult:
    rows = family_rows(content)
    if not rows:
        return
    yield Text("\nKnown causes in measured records", "bold")
    table = Table.grid(padding=(0, 2))
    for row in (FAMILY_HEADS, *rows):
        table.add_row(*map(Text, row))
    yield table


def _wrong(content: Mapping[str, Any]) -> RenderResult:
    trials = content["wrong"]
    if not trials:
        return
    yield Text("\nWrong trials", "bold")
    table = Table.grid(padding=(0, 2))
    for trial in trials[:_MOST_WRONG]:
        table.add_row(
            Text(trial_text(content, trial)),
            Text(f"{number(trial['gap'])} x"),
            Text(hidden_text(trial)),
            Text(f"-> {named_text(trial)}{' (truth in the set)' if trial['right_within_set'] else ''}"),
        )
    yield table
    if len(trials) > _MOST_WRONG:
        yield Text(f"and {len(trials) - _MOST_WRONG} more in blind.json")

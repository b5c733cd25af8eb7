"""The score of a blind bench in one screen of a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

_SHARES = {
    "singles_right": "single effects right, gap of 5 x floor and more",
    "singles_right_within_set": "  or among those named alike",
    "singles_place_right": "  place right",
    "pairs_right": "pairs, both right, gap of 5 x floor and more",
    "pairs_right_within_set": "  or among those named alike",
    "controls_right": "controls right (none, parameters)",
    "outside_unknown": "outside the catalogue, called unknown",
    "outside_unknown_large_gap": "  gap of 5 x floor and more",
    "outside_named_above_half": "  an effect named with more than 0.5",
    "faint_right": "faint single effects right, 1.5 to 5 x floor",
    "faint_right_within_set": "  or among those named alike",
}
_NUMBERS = {
    "mean_probability": "mean probability on the truth",
    "log_score": "mean log score (0 is perfect)",
    "held_out_median": "error on withheld records, median, x floor",
    "seconds_median": "seconds per diagnosis, median",
}
_MOST_WRONG = 15


@dataclass(frozen=True)
class BlindSummary:
    """A rich renderable of ``blind.json``."""

    content: Mapping[str, Any]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the figures, the reliability and the wrong trials."""
        content = self.content
        yield Text(
            f"Blind bench: {content['n_trials']} trials, design {content['design']}, seed {content['seed']}",
            "bold",
        )
        table = Table.grid(padding=(0, 2))
        for name, words in _SHARES.items():
            share = content["goals"][name]
            table.add_row(Text(words), *map(Text, _share_cells(share)))
        for name, words in _NUMBERS.items():
            value = content["goals"][name]
            table.add_row(Text(words), Text("-" if value is None else f"{value:.3g}"), Text(""), Text(""))
        yield table
        yield Text("\nStated probability against what was right", "bold")
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
    return f"{share['share']:.0%}", f"{share['count']} of {share['total']}", f"({low:.0%} to {high:.0%})"


def _wrong(content: Mapping[str, Any]) -> RenderResult:
    trials = [t for t in content["trials"] if not t["right"]]
    if not trials:
        return
    yield Text("\nWrong trials", "bold")
    table = Table.grid(padding=(0, 2))
    for trial in trials[:_MOST_WRONG]:
        truth = " + ".join(trial["effects"]) or trial["kind"]
        named = " + ".join(trial["named"]) or trial["verdict"]
        table.add_row(
            Text(f"{trial['trial']:03d}"),
            Text(f"{trial['gap']:.1f} x"),
            Text(truth),
            Text(f"-> {named}{' (truth in the set)' if trial['right_within_set'] else ''}"),
        )
    yield table
    if len(trials) > _MOST_WRONG:
        yield Text(f"and {len(trials) - _MOST_WRONG} more in blind.json")

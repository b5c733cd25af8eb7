"""Words of the trials of a blind bench that went wrong, shared by page, terminal and text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rigsight.report.labels import effect_label
from rigsight_bench.report.confusion import OUTSIDE
from rigsight_bench.report.views import number


@dataclass(frozen=True)
class WrongRow:
    """One wrong trial."""

    trial: str
    hidden: str
    named: str
    gap: str
    stated: str
    on_truth: str
    held_out: str
    report: str | None
    again: str
    remark: str


def wrong_rows(content: Mapping[str, Any], most: int) -> list[WrongRow]:
    """Return the wrong trials, at most so many."""
    return [_wrong_row(trial, trial_text(content, trial)) for trial in content["wrong"][:most]]


def trial_text(content: Mapping[str, Any], trial: Mapping[str, Any]) -> str:
    """Return a trial's number or name, with its seed where several benches were scored."""
    alone = len(content["benches"]) == 1 or trial["design"] == "external"
    return str(trial["trial"]) if alone else f"{trial['seed']}/{trial['trial']}"


def hidden_text(trial: Mapping[str, Any]) -> str:
    """Return what a trial hid."""
    prefix = OUTSIDE if trial["kind"] == "outside" else ""
    return prefix + (_at_places(trial["effects"], trial["places"]) or trial["kind"])


def named_text(trial: Mapping[str, Any]) -> str:
    """Return what the diagnosis said."""
    return _at_places(trial["named"], trial["named_places"]) or trial["verdict"]


def _at_places(effects: Sequence[str], where: Sequence[str]) -> str:
    """Return effects with their places, where these are known effect by effect."""
    places = where if len(where) == len(effects) else [""] * len(effects)
    return " + ".join(
        f"{effect_label(name)} at {place}" if place else effect_label(name)
        for name, place in zip(effects, places, strict=True)
    )


def _wrong_row(trial: Mapping[str, Any], name: str) -> WrongRow:
    remark = "truth among causes that cannot be distinguished" if trial["right_within_set"] else ""
    return WrongRow(
        trial=name,
        hidden=hidden_text(trial),
        named=named_text(trial),
        gap=number(trial["gap"], 2),
        stated=number(trial["stated"], 2),
        on_truth=number(trial["probability"], 2),
        held_out=number(trial["held_out"], 3),
        report=trial["report"],
        again=trial["again"],
        remark=trial["message"] or remark,
    )

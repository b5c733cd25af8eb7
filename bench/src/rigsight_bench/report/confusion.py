"""Confusion matrix of hidden and named effects for single effects and controls, and the outcome for several effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rigsight.report.labels import effect_label

OUTSIDE = "outside: "
"""What stands before an effect from outside the catalogue."""
_SEVERAL = "several effects"
_WRONG_PLACE = "wrong place"
_LAST = (_WRONG_PLACE, "none", "parameters", "unknown", _SEVERAL, "failed")


@dataclass(frozen=True)
class Cell:
    """A count of the confusion matrix, its share of the row, and whether it counts as right."""

    count: int
    share: float
    right: bool


@dataclass(frozen=True)
class Confusion:
    """What was hidden against what was named: labels of the columns, and cells by label of the row."""

    heads: list[str]
    rows: dict[str, list[Cell]]


def confusion(content: Mapping[str, Any]) -> Confusion:
    """Return the confusion matrix of all truths but pairs and triples; sets of several effects share one column."""
    table = {truth: counts for truth, counts in content["confusion"].items() if not _are_several(truth)}
    folded: dict[str, dict[str, int]] = {}
    for truth, counts in table.items():
        row: dict[str, int] = {}
        for named, count in counts.items():
            column = _SEVERAL if " + " in named else named
            row[column] = row.get(column, 0) + count
        folded[truth] = row
    used = {named for row in folded.values() for named in row}
    effects = sorted(used - set(_LAST))
    heads = [*effects, *(name for name in _LAST if name in used)]
    order = sorted(folded, key=lambda truth: (truth.startswith(OUTSIDE), truth in _LAST, truth))
    return Confusion(
        [effect_label(name) for name in heads],
        {effect_label(truth): [_cell(truth, name, folded[truth]) for name in heads] for truth in order},
    )


def _are_several(truth: str) -> bool:
    return " + " in truth and not truth.startswith(OUTSIDE)


def _cell(truth: str, named: str, row: Mapping[str, int]) -> Cell:
    count = row.get(named, 0)
    expected = "unknown" if truth.startswith(OUTSIDE) else truth
    return Cell(count, count / sum(row.values()), named == expected)


def rows_of_several(content: Mapping[str, Any]) -> dict[str, list[tuple[str, int]]]:
    """Return what became of pairs and of triples, and how often; empty where none were tried."""
    words = {
        "both": "both named",
        "all": "all three named",
        _WRONG_PLACE: "all named, at least one at a wrong place",
        "both and another": "both named, and another effect",
        "all and another": "all three named, and another effect",
        "one alone": "one of them named alone",
        "some alone": "one or two of them named",
        "one with another": "one of them named, with another effect",
        "some with another": "one or two of them named, with another effect",
        "others": "other effects named",
        "unknown": "called unknown",
        "none": "no gap seen",
        "parameters": "wrong parameters blamed",
        "failed": "diagnosis failed",
    }
    found = {title: content[kind] for title, kind in (("Pairs", "pairs"), ("Triples", "triples"))}
    return {
        title: [(words[name], counts[name]) for name in words if name in counts]
        for title, counts in found.items()
        if counts
    }

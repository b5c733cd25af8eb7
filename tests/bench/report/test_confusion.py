"""No trial is lost between matrix and pairs, and what is right is marked."""

from __future__ import annotations

from collections.abc import Callable

from rigsight_bench.report.confusion import confusion, rows_of_several
from rigsight_bench.scoring import Outcome

from .blind_content import content_of

Like = Callable[..., Outcome]


def test_every_trial_but_pairs_is_in_one_cell(outcome_like: Like, wrong_outcome: Like) -> None:
    pair = ("backlash", "input_delay")
    outcomes = [
        outcome_like(),
        wrong_outcome(),
        wrong_outcome(named=pair),
        wrong_outcome(verdict="failed", named=()),
        outcome_like(kind="pair", effects=pair, named=pair),
        outcome_like(kind="outside", effects=("fading_drive",), verdict="unknown", named=()),
        outcome_like(kind="none", effects=(), verdict="none", named=()),
    ]
    found = confusion(content_of(outcomes))
    assert found.heads == ["backlash", "free play", "none", "unknown", "several effects", "failed"]
    assert list(found.rows) == ["backlash", "none", "outside: fading drive"]
    assert sum(cell.count for row in found.rows.values() for cell in row) == len(outcomes) - 1
    right = {
        (truth, found.heads[i]) for truth, row in found.rows.items() for i, c in enumerate(row) if c.right
    }
    assert right == {("backlash", "backlash"), ("none", "none"), ("outside: fading drive", "unknown")}
    assert found.rows["backlash"][0].share == 0.25
    assert rows_of_several(content_of(outcomes)) == {"Pairs": [("both named", 1)]}


def test_triples_have_a_table_of_their_own(outcome_like: Like, wrong_outcome: Like) -> None:
    triple = ("backlash", "input_delay", "sensor_lag")
    outcomes = [
        outcome_like(kind="triple", effects=triple, named=triple),
        wrong_outcome(kind="triple", effects=triple, named=triple[:2]),
        wrong_outcome(kind="triple", effects=triple, verdict="unknown", named=()),
    ]
    assert rows_of_several(content_of(outcomes)) == {
        "Triples": [("all three named", 1), ("one or two of them named", 1), ("called unknown", 1)]
    }
    assert not confusion(content_of(outcomes)).rows

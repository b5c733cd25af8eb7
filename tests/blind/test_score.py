"""A verdict is right if it is the truth; what is counted beside that says so."""

from __future__ import annotations

from typing import Any

import pytest

from rigsight.blind import outcome, summary
from rigsight.blind.score import Outcome, Share, confusion, goals, reliability


def key(
    kind: str, *effects: str, gap: float = 10.0, where: tuple[str, ...] = ("yaw_dynamics",)
) -> dict[str, Any]:
    return {
        "trial": 3, "kind": kind, "effects": list(effects), "where": list(where) if effects else [],
        "rig": "running_gear", "noise": "low", "gap": gap,
    }  # fmt: skip


def diagnosis(
    verdict: str, *effects: str, p: float = 0.9, alike: tuple[tuple[str, ...], ...] = ()
) -> dict[str, Any]:
    return {
        "verdict": verdict,
        "effects": list(effects),
        "where": ["yaw_dynamics"] if effects else [],
        "ambiguous_with": [list(names) for names in alike],
        "candidates": [
            {"effects": list(effects), "probability": p},
            *({"effects": list(names), "probability": (1.0 - p) / len(alike)} for names in alike),
        ],
    }


def held(truth: dict[str, Any], found: dict[str, Any] | None, **more: Any) -> Outcome:
    return outcome(truth, found, more.get("held_out", 1.0), 10.0, more.get("message", ""))


@pytest.mark.parametrize(
    ("truth", "found", "right"),
    [
        (key("single", "backlash"), diagnosis("effect", "backlash"), True),
        (key("single", "backlash"), diagnosis("effect", "free_play"), False),
        (key("single", "backlash"), diagnosis("effect", "backlash", "free_play"), False),
        (key("pair", "backlash", "input_delay"), diagnosis("effect", "input_delay", "backlash"), True),
        (key("pair", "backlash", "input_delay"), diagnosis("effect", "backlash"), False),
        (key("none"), diagnosis("none"), True),
        (key("none"), diagnosis("parameters"), False),
        (key("parameters"), diagnosis("parameters"), True),
        (key("outside", "drifting_sensor"), diagnosis("unknown"), True),
        (key("outside", "drifting_sensor"), diagnosis("effect", "sensor_lag"), False),
        (key("single", "backlash"), None, False),
    ],
)
def test_only_the_truth_is_right(truth: dict[str, Any], found: dict[str, Any] | None, right: bool) -> None:
    assert held(truth, found, message="" if found else "it failed").right is right


def test_a_rival_that_is_named_alike_covers_the_truth_and_is_not_right() -> None:
    found = held(key("single", "backlash"), diagnosis("effect", "free_play", p=0.6, alike=(("backlash",),)))
    assert not found.right
    assert found.right_within_set
    assert found.probability == pytest.approx(0.4)
    assert found.stated == pytest.approx(0.6)


def test_what_no_candidate_gets_is_the_probability_of_the_unknown() -> None:
    found = held(key("outside", "drifting_sensor"), diagnosis("unknown", p=0.3))
    assert found.probability == found.stated == pytest.approx(0.7)


def test_small_gaps_are_a_tier_of_their_own() -> None:
    tiers = [held(key("single", "backlash", gap=gap), None).tier for gap in (1.2, 1.6, 5.0, 30.0)]
    assert tiers == ["below", "faint", "clear", "strong"]
    assert goals([held(key("single", "backlash", gap=2.0), None)])["singles_right"]["total"] == 0


def test_the_wilson_interval_of_nine_in_ten() -> None:
    # Wilson (1927): centre and width for 9 of 10 at 95 %.
    assert Share(9, 10).interval == pytest.approx((0.5958, 0.9821), abs=1e-4)
    assert Share(0, 0).interval == (0.0, 1.0)


def test_many_outcomes_are_counted_by_truth_and_by_stated_probability() -> None:
    outcomes = [
        held(key("single", "backlash"), diagnosis("effect", "backlash", p=0.99), held_out=1.1),
        held(key("single", "backlash"), diagnosis("effect", "free_play", p=0.7), held_out=3.0),
        held(key("none"), diagnosis("none", p=0.97), held_out=1.0),
        held(key("outside", "drifting_sensor"), diagnosis("effect", "sensor_lag", p=0.7), held_out=9.0),
    ]
    assert confusion(outcomes)["backlash"] == {"backlash": 1, "free_play": 1}
    assert confusion(outcomes)["outside: drifting_sensor"] == {"sensor_lag": 1}
    bins = {row["to"]: row["right"] for row in reliability(outcomes)}
    assert (bins[1.0]["count"], bins[1.0]["total"]) == (2, 2)
    assert (bins[0.8]["count"], bins[0.8]["total"]) == (0, 2)
    found = summary(outcomes)
    assert found["goals"]["singles_right"]["share"] == 0.5
    assert found["goals"]["outside_named_above_half"]["count"] == 1
    assert found["goals"]["held_out_median"] == pytest.approx(2.05)
    assert found["by"]["kind"]["none"]["right"]["count"] == 1

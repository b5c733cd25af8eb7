"""A diagnosed trial teaches the calibration where its true cause stands among the models tried."""

from __future__ import annotations

import pytest

from rigsight_bench.scoring.training_trial import training_trial


def candidate(share: float | None, left: float, *effects: str) -> dict:
    return {
        "effects": list(effects),
        "where": ["dynamics"] * len(effects),
        "probability": 0.1,
        "error_over_noise": left,
        "ranking_share": share,
    }


def diagnosis(verdict: str = "effect", *named: str) -> dict:
    return {
        "verdict": verdict,
        "effects": list(named),
        "where": ["dynamics"] * len(named),
        "adequate": True,
        "noise_floor": {"x": {"lower_bound": False}},
        "gap_by_place": [],
        "candidates": [
            candidate(0.6, 1.02, "coulomb_friction"),
            candidate(0.3, 1.04, "stribeck_friction"),
            candidate(0.1, 1.05, "backlash"),
            candidate(None, 20.0),
        ],
    }


def key(kind: str = "single", *effects: str) -> dict:
    return {
        "schema_version": 2,
        "design": "standard",
        "seed": 1,
        "trial": "003",
        "kind": kind,
        "effects": list(effects),
        "where": ["dynamics"] * len(effects),
    }


def test_the_named_cause_is_first() -> None:
    found = training_trial(key("single", "coulomb_friction"), diagnosis("effect", "coulomb_friction"))
    assert (found.cause, found.share_of_cause) == ("first", 0.0)
    assert (found.situation.first_share, found.situation.remainder, found.situation.gap) == (0.6, 1.02, 20.0)


def test_a_rival_that_is_the_cause_has_its_part_of_what_is_behind_the_first() -> None:
    found = training_trial(key("single", "stribeck_friction"), diagnosis("effect", "coulomb_friction"))
    assert found.cause == "listed"
    assert found.share_of_cause == pytest.approx(0.3 / 0.4)


@pytest.mark.parametrize("kind", ["single", "outside"])
def test_a_cause_that_was_not_tried_is_outside(kind: str) -> None:
    found = training_trial(key(kind, "free_play"), diagnosis("effect", "coulomb_friction"), left_out=True)
    assert (found.cause, found.left_out) == ("outside", True)


def test_of_an_unknown_cause_the_first_is_the_nearest() -> None:
    found = training_trial(key("single", "coulomb_friction"), diagnosis("unknown"))
    assert found.cause == "first"
    assert found.situation.n_effects == 1


@pytest.mark.parametrize(("verdict", "cause"), [("none", "first"), ("parameters", "outside")])
def test_of_a_control_the_verdict_alone_is_first(verdict: str, cause: str) -> None:
    found = training_trial(key("none"), diagnosis(verdict))
    assert found.cause == cause
    assert found.situation.remainder == 20.0


def test_the_named_cause_stands_first_even_where_another_has_a_larger_share() -> None:
    found = training_trial(key("single", "stribeck_friction"), diagnosis("effect", "stribeck_friction"))
    assert found.cause == "first"
    assert found.situation.first_share == pytest.approx(0.3)

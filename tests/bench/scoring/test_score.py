"""A verdict is right if it is the truth; what is counted beside that says so."""

from __future__ import annotations

from typing import Any

import pytest

from rigsight.effects import family_of
from rigsight_bench.scoring import Outcome, ParameterError, WithheldError, outcome


def key(
    kind: str, *effects: str, gap: float | None = 10.0, where: tuple[str, ...] = ("yaw_dynamics",)
) -> dict[str, Any]:
    return {
        "design": "standard", "seed": 1, "trial": "003",
        "kind": kind, "effects": list(effects), "where": list(where) if effects else [],
        "rig": "running_gear", "noise": "low", "gap": gap, "values": {"g": 1e-3, "k_c": 80.0},
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
            {"effects": list(effects), "probability": p, "parameters": ESTIMATES},
            *(
                {"effects": list(names), "probability": (1.0 - p) / len(alike), "parameters": {}}
                for names in alike
            ),
        ],
    }


def placed_key(*effects: tuple[str, str]) -> dict[str, Any]:
    names, places = [name for name, _ in effects], tuple(place for _, place in effects)
    truth = key("pair" if len(effects) > 1 else "single", *names, where=places)
    return truth | {"schema_version": 2, "rig": "drive_train", "values": {"load_bearing.T_c": 1e-3}}


def placed_diagnosis(*effects: tuple[str, str], looked_at: tuple[str, ...] = ("shaft",)) -> dict[str, Any]:
    names, places = [name for name, _ in effects], [place for _, place in effects]
    return diagnosis("effect", *names) | {
        "where": places,
        "candidates": [{"effects": names, "where": places, "probability": 0.9, "parameters": {}}],
        "gap_by_place": [
            {"place": place, "share": 0.5, "looked_at": place in looked_at}
            for place in ("shaft", "load_bearing", "motor", "load_angle")
        ],
        "families": [
            {"family": family_of(name), "where": place, "probability": 0.9, "share": {"value": 0.5}}
            for name, place in effects
        ],
    }


ESTIMATES = {
    "g": {"value": 1.2e-3, "std": 1e-4, "unit": "rad"},
    "k_c": {"value": 79.0, "std": 2.0, "unit": "N m/rad"},
    "k_d": {"value": 2.0, "std": None, "unit": "N m s/rad"},
}
"""The last is not determined by the records, and its truth is not in the key."""
SEEN = (
    WithheldError("withheld_1", "multisine", 0.7, 8000, 1.0),
    WithheldError("withheld_2", "step", 0.85, 2000, 2.0),
)


def held(truth: dict[str, Any], found: dict[str, Any] | None, **more: Any) -> Outcome:
    return outcome(truth, found, more.get("withheld", SEEN), 10.0, "1.0", more.get("message", ""))


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


def test_a_failed_diagnosis_states_nothing() -> None:
    found = held(key("outside", "drifting_sensor"), None, message="it failed")
    assert (found.verdict, found.probability, found.stated) == ("failed", 0.0, 0.0)


@pytest.mark.parametrize(
    ("gap", "tier"),
    [(1.2, "below"), (1.6, "faint"), (5.0, "clear"), (30.0, "strong"), (None, "not measured")],
)
def test_small_gaps_are_a_tier_of_their_own(gap: float | None, tier: str) -> None:
    assert held(key("single", "backlash", gap=gap), None).tier == tier


def test_a_key_that_does_not_say_where_scores_no_place() -> None:
    assert held(key("outside", "drifting_sensor"), diagnosis("unknown")).place_right is False
    silent = key("outside", "drifting_sensor") | {"where": None}
    assert held(silent, diagnosis("unknown")).place_right is None


def test_the_error_on_all_withheld_records_weighs_samples() -> None:
    found = held(key("single", "backlash"), diagnosis("effect", "backlash"))
    assert found.held_out == pytest.approx((0.8 * 1.0**2 + 0.2 * 2.0**2) ** 0.5)


def test_one_record_that_cannot_be_simulated_leaves_no_error_of_all() -> None:
    broken = (SEEN[0], WithheldError("withheld_2", "step", 0.85, 2000, None))
    assert held(key("single", "backlash"), diagnosis("effect", "backlash"), withheld=broken).held_out is None


def test_numbers_are_held_against_the_truth_in_standard_errors_where_the_verdict_is_right() -> None:
    errors = held(key("single", "backlash"), diagnosis("effect", "backlash")).parameters
    assert [(e.name, e.of) for e in errors] == [("g", "backlash"), ("k_c", "rig")]
    assert [e.error for e in errors] == pytest.approx([2.0, -0.5])
    assert held(key("single", "free_play"), diagnosis("effect", "backlash")).parameters == ()


def test_the_numbers_of_a_control_are_the_rigs() -> None:
    errors = held(key("none"), diagnosis("none")).parameters
    assert all(isinstance(e, ParameterError) and e.of == "rig" for e in errors)
    assert len(errors) == 2


FRICTION, AT_THE_MOTOR = ("coulomb_friction", "load_bearing"), ("coulomb_friction", "motor_bearing")
PLAY = ("backlash", "shaft")


@pytest.mark.parametrize(
    ("truth", "found", "right", "effect_right", "place_right"),
    [
        ((FRICTION,), (FRICTION,), True, True, True),
        ((FRICTION,), (AT_THE_MOTOR,), False, True, False),
        ((FRICTION,), (("stribeck_friction", "load_bearing"),), False, False, True),
        ((FRICTION, PLAY), (PLAY, FRICTION), True, True, True),
        ((FRICTION, PLAY), (("coulomb_friction", "shaft"), ("backlash", "load_bearing")), False, True, True),
        ((FRICTION, AT_THE_MOTOR), (FRICTION,), False, False, False),
    ],
)
def test_an_effect_is_right_at_its_own_place_alone(
    truth: tuple[tuple[str, str], ...],
    found: tuple[tuple[str, str], ...],
    right: bool,
    effect_right: bool,
    place_right: bool,
) -> None:
    got = held(placed_key(*truth), placed_diagnosis(*found))
    assert (got.right, got.effect_right, got.place_right) == (right, effect_right, place_right)
    assert got.probability == pytest.approx(0.9 if right else 0.1), "0.1 is what no model was given"
    assert sorted(zip(got.effects, got.places, strict=True)) == sorted(truth)


THIRD = ("input_delay", "motor")


@pytest.mark.parametrize(
    ("found", "right", "effect_right", "place_right"),
    [
        ((FRICTION,), True, True, True),
        ((FRICTION, PLAY), True, True, True),
        ((FRICTION, PLAY, THIRD), True, True, True),
        ((AT_THE_MOTOR,), False, True, False),
        ((PLAY,), False, False, False),
        ((PLAY, THIRD), False, False, False),
        ((FRICTION, ("free_play", "shaft")), False, False, True),
        ((), False, False, False),
    ],
)
def test_of_several_effects_the_main_one_must_be_named_and_none_that_is_not_there(
    found: tuple[tuple[str, str], ...], right: bool, effect_right: bool, place_right: bool
) -> None:
    truth = placed_key(FRICTION, PLAY, THIRD) | {"kind": "several", "condition": "three_effects"}
    said = placed_diagnosis(*found) if found else diagnosis("unknown") | {"candidates": []}
    got = held(truth, said)
    assert (got.right, got.effect_right, got.place_right) == (right, effect_right, place_right)
    assert got.probability == pytest.approx(0.9 if right else 0.1 if found else 1.0)
    assert got.condition == "three_effects"


def test_unknown_is_true_if_no_model_tried_is_the_cause_and_still_not_right() -> None:
    said = placed_diagnosis(FRICTION) | {"verdict": "unknown", "effects": [], "where": []}
    got = held(placed_key(FRICTION, PLAY), said | {"likely_causes": {"effects": [], "outside": True}})
    assert (got.right, got.stated_is_true, got.in_set) == (False, True, True)
    assert got.probability == got.stated
    tried = placed_diagnosis(FRICTION, PLAY) | {"verdict": "unknown", "effects": [], "where": []}
    got = held(placed_key(FRICTION, PLAY), tried | {"likely_causes": {"effects": [], "outside": True}})
    assert (got.right, got.stated_is_true, got.in_set) == (False, False, False)


@pytest.mark.parametrize(("hidden", "verdict"), [("none", "parameters"), ("parameters", "none")])
def test_right_and_wrong_parameters_are_told_apart_though_their_candidate_is_the_same(
    hidden: str, verdict: str
) -> None:
    likely = {"likely_causes": {"effects": [[]], "outside": False}}
    right, wrong = (held(key(hidden), diagnosis(said) | likely) for said in (hidden, verdict))
    assert (right.right, right.stated_is_true, right.in_set) == (True, True, True)
    assert (wrong.right, wrong.stated_is_true, wrong.in_set) == (False, False, False)
    assert wrong.probability == pytest.approx(1.0 - right.probability)


def test_a_gap_below_the_floor_is_none_that_was_measured() -> None:
    assert held(key("single", "backlash") | {"gap": 0.02}, diagnosis("effect", "backlash")).gap is None
    assert held(key("none") | {"gap": 0.98}, diagnosis("none")).gap == 0.98


def test_several_effects_are_in_the_set_with_their_main_one() -> None:
    truth = placed_key(FRICTION, PLAY, THIRD) | {"kind": "several"}
    found = placed_diagnosis(AT_THE_MOTOR)
    inside = found | {"ambiguous_with": [["coulomb_friction@load_bearing", "backlash@shaft"]]}
    without = found | {"ambiguous_with": [["backlash@shaft"]]}
    assert held(truth, inside).right_within_set
    assert not held(truth, without).right_within_set


def test_the_true_place_was_looked_at_if_it_was_chosen_or_tried_in_the_end() -> None:
    chosen = held(placed_key(FRICTION), placed_diagnosis(PLAY, looked_at=("load_bearing",)))
    tried = held(placed_key(FRICTION), placed_diagnosis(FRICTION, looked_at=("shaft",)))
    missed = held(placed_key(FRICTION), placed_diagnosis(PLAY, looked_at=("shaft",)))
    assert (chosen.looked_at, tried.looked_at, missed.looked_at) == (True, True, False)


def test_where_there_was_nothing_to_choose_no_place_counts_as_looked_at() -> None:
    assert held(key("single", "backlash"), diagnosis("effect", "backlash")).looked_at is None


def test_the_truth_among_what_cannot_be_told_apart_is_at_its_place() -> None:
    found = placed_diagnosis(AT_THE_MOTOR)
    alike = found | {"ambiguous_with": [["coulomb_friction@load_bearing"]]}
    elsewhere = found | {"ambiguous_with": [["coulomb_friction@shaft"]]}
    assert held(placed_key(FRICTION), alike).right_within_set
    assert not held(placed_key(FRICTION), elsewhere).right_within_set


def test_a_hysteresis_that_the_diagnosis_calls_dry_friction_is_of_that_family() -> None:
    truth, found = placed_key(("coulomb_friction", "shaft")), placed_diagnosis(("iwan_hysteresis", "shaft"))
    assert held(truth, found).family_right is False
    found["families"][0]["family"] = "dry_friction"
    assert held(truth, found).family_right is True


def test_a_relative_at_its_place_is_of_the_right_family() -> None:
    truth = placed_key(("coulomb_friction", "shaft"))
    relative = held(truth, placed_diagnosis(("stribeck_friction", "shaft")))
    elsewhere = held(truth, placed_diagnosis(("coulomb_friction", "load_bearing")))
    with_another = held(truth, placed_diagnosis(("presliding_friction", "shaft"), ("backlash", "shaft")))
    assert relative.families == ("dry_friction",)
    assert (relative.right, relative.family_right, relative.family_probability) == (False, True, 0.9)
    assert (elsewhere.family_right, elsewhere.family_probability) == (False, 0.0)
    assert (with_another.right, with_another.family_right) == (False, True)


def test_nothing_hidden_has_no_family() -> None:
    found = held(key("none"), diagnosis("none"))
    assert (found.families, found.family_right, found.family_probability) == ((), None, None)

"""Each effect is a candidate at every place at which it makes sense, and at no other."""

from __future__ import annotations

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named, placed
from rigsight.rigs import AXIS, RIGS

TRAIN = RIGS["drive_train"]


def names(*effects: str) -> list[str]:
    return [effect.name for effect in candidates_on(TRAIN, [effect_named(name) for name in effects])]


def test_friction_may_be_at_every_joint() -> None:
    assert names("coulomb_friction") == [
        f"coulomb_friction@{joint}" for joint in ("shaft", "motor_bearing", "load_bearing")
    ]


def test_play_needs_a_spring_behind_it() -> None:
    assert names("backlash") == ["backlash@shaft", "backlash@load_bearing"]


def test_drives_and_sensors_have_theirs() -> None:
    assert names("input_saturation", "sensor_lag") == [
        "input_saturation@motor", "sensor_lag@motor_angle", "sensor_lag@load_angle",
    ]  # fmt: skip


def test_on_one_mass_an_effect_keeps_its_plain_name() -> None:
    assert [effect.name for effect in candidates_on(AXIS, CATALOGUE)] == [
        effect.name for effect in CATALOGUE if AXIS.offers(effect)
    ]


def test_what_the_simulation_has_already_is_no_candidate_there_but_elsewhere() -> None:
    friction = effect_named("coulomb_friction")
    found = candidates_on(TRAIN, [friction], [placed(friction, "shaft")])
    assert [effect.at for effect in found] == ["motor_bearing", "load_bearing"]


def test_a_place_that_is_given_stays() -> None:
    friction = placed(effect_named("coulomb_friction"), "load_bearing")
    assert candidates_on(TRAIN, [friction]) == [friction]

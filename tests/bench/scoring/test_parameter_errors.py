"""An error is counted in standard errors, and belongs to the effect whose symbol it is."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rigsight.effects import effect_named
from rigsight.rigs import AXIS, RIGS, RUNNING_GEAR
from rigsight.simulate import compose
from rigsight_bench.scoring.parameter_errors import parameter_errors


def estimate(value: float, std: float | None) -> dict[str, Any]:
    return {"value": value, "std": std, "unit": "1"}


def test_two_effects_with_a_symbol_of_one_name_keep_their_own() -> None:
    # Bouc-Wen's exponent and the others' symbols are qualified where two effects share one.
    pair = ["free_play", "backlash"]
    structure = compose(RUNNING_GEAR, [effect_named(name) for name in pair])
    names = {name: structure.parameter_name(effect_named(name), "g") for name in pair}
    assert len(set(names.values())) == 2
    found = parameter_errors(
        RUNNING_GEAR,
        [(name, "") for name in pair],
        {names["free_play"]: estimate(3.0, 1.0), names["backlash"]: estimate(1.0, 0.5)},
        {names["free_play"]: 1.0, names["backlash"]: 2.0},
    )
    assert {e.of: e.error for e in found} == pytest.approx({"free_play": 2.0, "backlash": -2.0})


def test_one_effect_at_two_places_has_two_numbers_of_its_own() -> None:
    there = [("coulomb_friction", "load_bearing"), ("coulomb_friction", "motor_bearing")]
    found = parameter_errors(
        RIGS["drive_train"],
        there,
        {f"{name}@{place}.T_c": estimate(3.0, 1.0) for name, place in there} | {"k_s": estimate(2.0, 1.0)},
        {"coulomb_friction@load_bearing.T_c": 1.0, "coulomb_friction@motor_bearing.T_c": 2.0, "k_s": 2.0},
    )
    assert [(e.of, e.error) for e in found] == [
        ("coulomb_friction", 2.0),
        ("coulomb_friction", 1.0),
        ("rig", 0.0),
    ]


@pytest.mark.parametrize("std", [None, 0.0, math.inf, math.nan])
def test_a_number_that_the_records_do_not_determine_has_no_error(std: float | None) -> None:
    assert parameter_errors(AXIS, [], {"k": estimate(1.0, std)}, {"k": 1.0}) == ()

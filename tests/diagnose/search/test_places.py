"""The place of a hidden effect is found before any effect is fitted, and the diagnosis names effect and place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import FitContext, candidates_on
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.worth_fitting import Search, search_places
from rigsight.effects import Effect, effect_named, placed
from rigsight.identify import characteristic_scales
from rigsight.rigs import RIGS

TRAIN = RIGS["drive_train"]

EFFECTS = [
    effect_named(n) for n in ("quadratic_damping", "cubic_stiffness", "input_saturation", "sensor_lag")
]
HIDDEN = [
    ("quadratic_damping", "load_bearing", {"c_2": 2e-4}),
    ("cubic_stiffness", "shaft", {"k_3": 5.0}),
    ("input_saturation", "motor", {"u_max": 0.5}),
    ("sensor_lag", "load_angle", {"T_m": 0.02}),
]


@pytest.mark.parametrize(("name", "place", "values"), HIDDEN, ids=[f"{n}@{p}" for n, p, _ in HIDDEN])
def test_the_place_comes_first(train: Any, name: str, place: str, values: dict[str, float]) -> None:
    effects = candidates_on(TRAIN, EFFECTS)
    search = searched(train, name, place, values, effects)
    assert search.places[0].name == place
    assert all(effect in search.effects for effect in effects if effect.at == place)
    assert len(search.effects) + len(search.others) == len(effects)


def test_what_is_late_is_looked_for_at_every_place(train: Any) -> None:
    """A late drive makes all readings late: a place is left out for another kind of effect only."""
    offered = [effect_named(n) for n in ("input_delay", "actuator_lag", "sensor_delay", "input_saturation")]
    effects = candidates_on(TRAIN, offered)
    search = searched(train, "sensor_delay", "load_angle", {"T_s": 0.02}, effects)
    assert {e.name for e in effects} - {e.name for e in search.effects} <= {"input_saturation@motor"}


def searched(
    train: Any, name: str, place: str, values: dict[str, float], effects: tuple[Effect, ...]
) -> Search:
    records = train.records([placed(effect_named(name), place)], values)
    fitted = tuple(record for record in records if record.role == "estimation")
    noise = {signal.name: train.noise for signal in TRAIN.outputs}
    scales = characteristic_scales(TRAIN, fitted, train.values)
    context = FitContext(TRAIN, fitted, fitted, fitted, scales, noise, frozenset(), train.values)
    return search_places(context, reidentify(context, train.values), effects)


@pytest.mark.slow
def test_effect_and_place_are_named(train: Any) -> None:
    records = train.records([placed(effect_named("quadratic_damping"), "load_bearing")], {"c_2": 2e-4})
    found = diagnose(Campaign("train", TRAIN, {"k_t": 0.05}, {}, records), EFFECTS[:2])
    assert (found.verdict, found.effects) == ("effect", ("quadratic_damping@load_bearing",))
    reported = found.to_json()
    assert (reported["effects"], reported["where"]) == (["quadratic_damping"], ["load_bearing"])
    assert set(reported["gap"]) == {"motor_angle", "load_angle"}
    assert reported["gap_by_place"][0]["place"] == "load_bearing"
    c_2 = next(c for c in found.candidates if c.effects == found.effects).parameters["c_2"]
    assert abs(c_2.value - 2e-4) < 5.0 * c_2.std


@pytest.mark.slow
def test_a_record_may_lack_a_sensor(train: Any) -> None:
    records = replace(train, n_samples=300).records()
    partial = replace(records[1], signals={n: s for n, s in records[1].signals.items() if n != "motor_angle"})
    found = diagnose(
        Campaign("train", TRAIN, {"k_t": 0.05}, {}, (records[0], partial, records[2])), EFFECTS[:1]
    )
    assert found.verdict == "none"
    assert np.isfinite(found.gap["motor_angle"].after)


@pytest.mark.slow
def test_a_sensor_may_stand_still_in_the_validation_record(train: Any) -> None:
    """Relative to a motion of nothing no error has a size."""
    records = replace(train, n_samples=300).records()
    still = records[2].with_signals(load_angle=np.zeros(records[2].n_samples))
    found = diagnose(Campaign("train", TRAIN, {"k_t": 0.05}, {}, (*records[:2], still)), EFFECTS[:1])
    assert found.gap["load_angle"].noise_floor == np.inf
    assert found.to_json()["gap"]["load_angle"]["noise_floor"] is None

"""On a rig of several inputs and sensors each path is asked whether its frequency response changes with the amplitude."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.diagnose.data.amplitude_response import amplitude_dependences
from rigsight.diagnose.data.finding import DataQuality
from rigsight.effects import Effect, effect_named, placed
from rigsight.records.record import Record
from rigsight.rigs import ELEMENT, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

TWO_MASSES = """
name = "two_masses"
summary = "Two carts, each with a motor, and a spring between them."
[inputs.f_1]
unit = "N"
[inputs.f_2]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.c]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[coordinates.x_1]
unit = "m"
[coordinates.x_2]
unit = "m"
[energy]
kinetic = "m*d(x_1)^2/2 + m*d(x_2)^2"
[joints.first]
motion = "x_1"
stiffness = "k"
damping = "d"
[joints.between]
motion = "x_1 - x_2"
stiffness = "c"
damping = "d"
[joints.second]
motion = "x_2"
stiffness = "k"
damping = "d"
[drives.motor_1]
signal = "f_1"
force = "motor_1"
along = "x_1"
[drives.motor_2]
signal = "f_2"
force = "motor_2"
along = "x_2"
[sensors.first_place]
reads = "x_1"
unit = "m"
[sensors.second_place]
reads = "x_2"
unit = "m"
"""
VALUES = {"m": 1.0, "k": 40.0, "c": 20.0, "d": 1.0}
DT = 0.02
T = DT * np.arange(6000)
PATHS = {f"f_{i} -> {place}_place" for i in (1, 2) for place in ("first", "second")}
Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of_text(TWO_MASSES)


def noise_like(seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0.0, 2.0 * np.pi, 200)
    lines = 2.0 * np.pi * np.arange(1, 201) / T[-1] * 1.7
    return np.asarray(np.sum(np.sin(np.outer(T, lines) + phases), axis=1) / np.sqrt(100.0))


def runs(
    rig: Rig,
    amplitudes: Mapping[str, tuple[float, float]],
    effect: tuple[Effect, dict[str, float]] | None = None,
) -> list[Record]:
    """Return a record for each amplitude of every input."""
    structure = compose(rig, [] if effect is None else [effect[0]])
    values = VALUES | ({} if effect is None else effect[1])
    rng = np.random.default_rng(5)
    records = []
    for index, name in enumerate(("small", "large")):
        drives = {n: own[index] * noise_like(seed) for seed, (n, own) in enumerate(amplitudes.items())}
        shown = simulate(structure, values, Record(name, DT, drives, {}, hold="foh"))
        noisy = {s.name: shown[s.name] + 1e-5 * rng.standard_normal(T.size) for s in rig.outputs}
        records.append(shown.with_signals(**noisy))
    return records


def answers(rig: Rig, records: list[Record]) -> dict[str, str]:
    return {found.path: found.answer for found in amplitude_dependences(rig, records)}


BOTH = {"f_1": (1.0, 3.0), "f_2": (1.0, 3.0)}


def test_a_linear_rig_has_linear_paths_where_its_motors_move_at_once(rig: Rig) -> None:
    assert answers(rig, runs(rig, BOTH)) == dict.fromkeys(PATHS, "no")


def test_a_bent_spring_between_the_masses_bends_every_path(rig: Rig) -> None:
    spring = placed(effect_named("cubic_stiffness"), "between"), {"k_3": 4e4}
    assert answers(rig, runs(rig, BOTH, spring)) == dict.fromkeys(PATHS, "yes")


def test_a_saturated_motor_bends_its_own_paths_alone(rig: Rig) -> None:
    """What the other motor does passes through linear equations."""
    motor = placed(effect_named("input_saturation"), "motor_2"), {"u_max": 2.0}
    alone = runs(rig, {"f_2": (1.0, 3.0), "f_1": (0.0, 0.0)}, motor)
    moved = runs(rig, {"f_1": (1.0, 3.0), "f_2": (0.0, 0.0)}, motor)
    found = answers(rig, [*alone, *moved])
    assert {path for path, answer in found.items() if answer == "yes"} == {
        "f_2 -> first_place", "f_2 -> second_place",
    }  # fmt: skip
    assert {path for path, answer in found.items() if answer == "no"} == {
        "f_1 -> first_place", "f_1 -> second_place",
    }  # fmt: skip


def test_a_path_without_another_amplitude_says_so_by_name(rig: Rig) -> None:
    records = runs(rig, {"f_1": (1.0, 3.0), "f_2": (1.0, 1.0)})
    told = {found.path: found for found in amplitude_dependences(rig, records)}
    assert {path for path, found in told.items() if found.answer == "cannot tell"} == {
        "f_2 -> first_place", "f_2 -> second_place",
    }  # fmt: skip
    assert "one amplitude of f_2" in told["f_2 -> first_place"].sentence
    content = json.loads(json.dumps(DataQuality((), tuple(told.values())).to_json()))
    assert {entry["path"] for entry in content} == PATHS


def test_a_reading_at_fault_is_left_out_of_its_own_paths(rig: Rig) -> None:
    records = runs(rig, BOTH)
    found = amplitude_dependences(rig, records, {("large", "first_place")})
    assert {own.path for own in found if own.answer == "no"} == {"f_1 -> second_place", "f_2 -> second_place"}


def test_a_rig_without_an_input_has_no_response(rig: Rig) -> None:
    (found,) = amplitude_dependences(ELEMENT, [])
    assert found.answer == "cannot tell"

"""On a rig of several inputs and sensors each path is asked whether its frequency response changes with the amplitude."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.data_quality.amplitude_response import amplitude_dependences
from rigsight.diagnose.data_quality.finding import DataQuality
from rigsight.effects import Effect, effect_named, placed
from rigsight.records.record import Record
from rigsight.rigs import ELEMENT, Rig
from rigsight.simulate import compose, simulate

VALUES = {"m": 1.0, "k": 40.0, "c": 20.0, "d": 1.0}
DT = 0.02
T = DT * np.arange(6000)
PATHS = {f"f_{i} -> {place}_place" for i in (1, 2) for place in ("first", "second")}
Floats = NDArray[np.float64]


def noise_like(seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0.0, 2.0 * np.pi, 200)
    lines = 2.0 * np.pi * np.arange(1, 201) / T[-1] * 1.7
    return np.asarray(np.sum(np.sin(np.outer(T, lines) + phases), axis=1) / np.sqrt(100.0))


def runs(
    two_masses: Rig,
    amplitudes: Mapping[str, tuple[float, float]],
    effect: tuple[Effect, dict[str, float]] | None = None,
) -> list[Record]:
    """Return a record for each amplitude of every input."""
    structure = compose(two_masses, [] if effect is None else [effect[0]])
    values = VALUES | ({} if effect is None else effect[1])
    rng = np.random.default_rng(5)
    records = []
    for index, name in enumerate(("small", "large")):
        drives = {n: own[index] * noise_like(seed) for seed, (n, own) in enumerate(amplitudes.items())}
        shown = simulate(structure, values, Record(name, DT, drives, {}, hold="foh"))
        noisy = {s.name: shown[s.name] + 1e-5 * rng.standard_normal(T.size) for s in two_masses.outputs}
        records.append(shown.with_signals(**noisy))
    return records


def responses(two_masses: Rig, records: list[Record]) -> dict[str, str]:
    return {found.path: found.response for found in amplitude_dependences(two_masses, records)}


BOTH = {"f_1": (1.0, 3.0), "f_2": (1.0, 3.0)}


def test_a_linear_rig_has_linear_paths_where_its_motors_move_at_once(two_masses: Rig) -> None:
    assert responses(two_masses, runs(two_masses, BOTH)) == dict.fromkeys(PATHS, "no")


def test_a_bent_spring_between_the_masses_bends_every_path(two_masses: Rig) -> None:
    spring = placed(effect_named("cubic_stiffness"), "between"), {"k_3": 4e4}
    assert responses(two_masses, runs(two_masses, BOTH, spring)) == dict.fromkeys(PATHS, "yes")


def test_a_saturated_motor_bends_its_own_paths_alone(two_masses: Rig) -> None:
    """What the other motor does passes through linear equations."""
    motor = placed(effect_named("input_saturation"), "motor_2"), {"u_max": 2.0}
    alone = runs(two_masses, {"f_2": (1.0, 3.0), "f_1": (0.0, 0.0)}, motor)
    moved = runs(two_masses, {"f_1": (1.0, 3.0), "f_2": (0.0, 0.0)}, motor)
    found = responses(two_masses, [*alone, *moved])
    assert {path for path, response in found.items() if response == "yes"} == {
        "f_2 -> first_place", "f_2 -> second_place",
    }  # fmt: skip
    assert {path for path, response in found.items() if response == "no"} == {
        "f_1 -> first_place", "f_1 -> second_place",
    }  # fmt: skip


def test_a_path_without_another_amplitude_says_so_by_name(two_masses: Rig) -> None:
    records = runs(two_masses, {"f_1": (1.0, 3.0), "f_2": (1.0, 1.0)})
    reported = {found.path: found for found in amplitude_dependences(two_masses, records)}
    assert {path for path, found in reported.items() if found.response == "cannot tell"} == {
        "f_2 -> first_place", "f_2 -> second_place",
    }  # fmt: skip
    assert "one amplitude of f_2" in reported["f_2 -> first_place"].sentence
    content = json.loads(json.dumps(DataQuality((), tuple(reported.values())).to_json()))
    assert {entry["path"] for entry in content} == PATHS


def test_a_reading_at_fault_is_left_out_of_its_own_paths(two_masses: Rig) -> None:
    records = runs(two_masses, BOTH)
    found = amplitude_dependences(two_masses, records, {("large", "first_place")})
    assert {own.path for own in found if own.response == "no"} == {
        "f_1 -> second_place",
        "f_2 -> second_place",
    }


def test_a_rig_without_an_input_has_no_response(two_masses: Rig) -> None:
    (found,) = amplitude_dependences(ELEMENT, [])
    assert found.response == "cannot tell"

"""Does the measured motion show what the controller of a servo does beyond its law?"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, Place, effect_named
from rigsight.inverse.controller_output import ControllerSignals, changed_output
from rigsight.inverse.equation_fit import record_motions
from rigsight.inverse.joint_force import joint_motion
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig, read_rig_file
from rigsight.simulate import compose, simulate

from .test_proposal import DT, T, campaign, proposed

POSITION_DRIVE: Rig = read_rig_file(Path(__file__).parents[1] / "rigs" / "files" / "position_drive.toml")
DRIVE_VALUES = {"m_l": 0.6, "m": 0.4, "d": 1.0, "k_p": 100.0, "k_v": 3.0}
SERVO: Rig = RIGS["servo"]
SERVO_VALUES = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.01, "k_v": 3.0, "d": 0.5, "angle_off": 0.0}
RIVALS = tuple(
    effect
    for effect in CATALOGUE
    if effect.place in (Place.ACTUATOR, Place.CONTROLLER, Place.SENSOR) or effect.name == "coulomb_friction"
)
HIDDEN: Mapping[str, Mapping[str, float]] = {
    "integral_action": {"r_i": 2.0},
    "speed_loop_integral": {"r_v": 3.0},
    "velocity_feedforward": {"T_w": 0.03, "T_f": 0.004},
    "controller_dead_band": {"e_0": 0.03},
    "controller_saturation": {"o_max": 0.05},
    "command_rate_limit": {"w_c": 2.0, "T_f": 0.004},
    "command_delay": {"T_m": 0.03},
}


@pytest.mark.parametrize("name", HIDDEN)
def test_the_family_is_named_along_the_motion(name: str) -> None:
    effect, own = effect_named(name), HIDDEN[name]
    rig, values = (SERVO, SERVO_VALUES) if name == "command_delay" else (POSITION_DRIVE, DRIVE_VALUES)
    found = proposed(campaign(rig, {**values, **own}, [effect], (0.3, 0.5)), RIVALS)
    first = found.taken[0]
    assert (first.family, first.where) == (effect.family, "motor")
    assert first.share > 0.9
    size = next(iter(own))
    assert found.starts[f"{name}@motor"].own[size] == pytest.approx(own[size], rel=0.3)


def test_an_output_with_an_effect_is_that_of_the_simulation() -> None:
    """All effects of a controller: what a spring that follows its output does, which is the output itself."""
    goal = 0.5 * np.sin(2.0 * np.pi * (0.3 * T + 0.2 * T**2))
    record = Record("goal", DT, {"goal": goal}, {}, hold="foh")
    still = simulate(compose(POSITION_DRIVE), DRIVE_VALUES, record)
    error = goal - still["x"]
    signals = ControllerSignals(error - 0.03 * np.gradient(still["x"], DT), error, goal)
    for effect in (e for e in CATALOGUE if e.place is Place.CONTROLLER):
        null = effect.null_values()
        own = {p.name: null.get(p.name, 0.01) for p in effect.parameters}
        own = {name: 1e-6 if name.startswith("T_") and value == 0.0 else value for name, value in own.items()}
        changed = changed_output(effect, own, signals, DT)
        assert changed == pytest.approx(signals.output, abs=1e-3), effect.name


def test_the_load_behind_a_control_law_follows_from_recorded_readings() -> None:
    own = campaign(SERVO, SERVO_VALUES, [], (0.2,))
    (motion,) = record_motions(SERVO, own.records, SERVO_VALUES)
    (joint,) = SERVO.mechanism.joints
    record = own.records[0]
    duty = np.clip(SERVO_VALUES["k_p"] * (record["goal"] - record["angle"]), -1.0, 1.0)
    weight = SERVO_VALUES["m"] * 9.81 * SERVO_VALUES["l"] * np.sin(record["angle"])
    load = SERVO_VALUES["k_v"] * duty + weight
    inside = slice(500, -500)
    error = joint_motion(motion, joint, SERVO_VALUES).load - load
    assert np.std(error[inside]) < 0.05 * np.std(load)

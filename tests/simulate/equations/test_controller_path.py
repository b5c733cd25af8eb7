"""Effects in a control law: what stands outside of it, and the order in which they act."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

TEXT = """
name = "servo"
summary = "A mass follows its goal."
[inputs.goal]
unit = "m"
[constants.full]
unit = "N"
default = 1.0
[parameters.m]
unit = "kg"
lower = 1e-6
[parameters.k_p]
unit = "1/m"
lower = 0.0
[parameters.d]
unit = "N s/m"
lower = 0.0
[coordinates.q]
unit = "m"
[energy]
kinetic = "m*d(q)^2/2"
[joints.guide]
motion = "q"
damping = "d"
[drives.motor]
signal = "LAW"
force = "full*motor"
along = "q"
[sensors.x]
reads = "q"
unit = "m"
"""
VALUES = {"m": 0.5, "k_p": 40.0, "d": 3.0, "full": 1.0}
DT = 0.005
T = DT * np.arange(1200)
GOAL = 0.3 * np.sin(2.0 * np.pi * 0.4 * T) * np.clip(T, 0.0, 1.0)


LIMIT = '[constants.u_max]\nunit = "1"\ndefault = 2.0\n'


def servo(law: str = "k_p*(goal - x)") -> Rig:
    limit = LIMIT if "u_max" in law else ""
    return rig_of_text(
        TEXT.replace("LAW", law).replace("[parameters.m]", limit + "[parameters.m]"), "servo.toml"
    )


def moved(rig: Rig, goal: np.ndarray = GOAL, **own: dict[str, float]) -> np.ndarray:
    effects = [effect_named(f"{name}@motor") for name in own]
    structure = compose(rig, effects)
    values = {**VALUES, **({"u_max": 2.0} if "u_max" in structure.names else {})}
    for effect in structure.effects:
        name = effect.name.partition("@")[0]
        values |= {structure.parameter_name(effect, key): value for key, value in own[name].items()}
    return simulate(structure, values, Record("goal", DT, {"goal": goal}, {}, hold="foh"), accuracy=1e-7)["x"]


def test_limits_that_are_numbers_of_the_rig_stay_around_the_changed_law() -> None:
    named = moved(servo("clip(k_p*(goal - x), -u_max, u_max)"), integral_action={"r_i": 3.0})
    written = moved(servo("clip(k_p*(goal - x), -2, 2)"), integral_action={"r_i": 3.0})
    free = moved(servo(), integral_action={"r_i": 3.0})
    assert named == pytest.approx(written, abs=1e-7)
    assert np.std(free - named) > 1e-3


def test_a_late_command_is_a_late_goal() -> None:
    late = np.interp(T - 0.05, T, GOAL, left=0.0)
    assert moved(servo(), command_delay={"T_m": 0.05}) == pytest.approx(moved(servo(), late), abs=1e-5)


def test_what_changes_the_command_reaches_what_integrates_the_error() -> None:
    """A filter before a PI controller is a PI controller under the filtered goal."""
    both = moved(servo(), command_filter={"T_c": 0.2}, integral_action={"r_i": 3.0})
    filtered = np.zeros_like(GOAL)
    kept = np.exp(-DT / 0.2)
    slope = np.diff(GOAL) / DT
    for k in range(GOAL.size - 1):
        # Of a goal that is linear between samples.
        lag = filtered[k] - GOAL[k] + 0.2 * slope[k]
        filtered[k + 1] = GOAL[k + 1] - 0.2 * slope[k] + lag * kept
    assert both == pytest.approx(moved(servo(), filtered, integral_action={"r_i": 3.0}), abs=2e-4)

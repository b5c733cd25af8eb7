"""Which drives have a controller, what its law is made of, and which effects make sense at it."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp

from rigsight.effects import CATALOGUE, Place, placed
from rigsight.rigs import RIGS, Rig, read_rig_file
from rigsight.rigs.reading.rig_file import rig_of_text

POSITION_DRIVE = read_rig_file(Path(__file__).parent / "files" / "position_drive.toml")
SERVO = RIGS["servo"]
CASCADE = """
name = "cascade"
summary = "A law that reads angle and speed, by named signals."
[inputs.goal]
unit = "rad"
[constants.k_p]
unit = "N m/rad"
default = 2.0
[constants.k_v]
unit = "N m s/rad"
default = 0.1
[parameters.J]
unit = "kg m^2"
lower = 1e-9
[coordinates.q]
unit = "rad"
[energy]
kinetic = "J*d(q)^2/2"
[joints.shaft]
motion = "q"
[signals]
off = "goal - angle"
[drives.motor]
signal = "k_p*off - k_v*speed"
force = "motor"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
[sensors.speed]
reads = "d(q)"
unit = "rad/s"
"""


def controls(rig: Rig) -> set[str]:
    (drive,) = rig.mechanism.drives
    at_drive = (placed(e, drive.name) for e in CATALOGUE if e.place is Place.CONTROLLER)
    return {effect.name.partition("@")[0] for effect in at_drive if rig.offers(effect)}


@pytest.mark.parametrize("name", ["axis", "running_gear", "drive_train", "two_link_arm", "quarter_car"])
def test_a_drive_that_reads_no_motion_has_no_controller(name: str) -> None:
    assert RIGS[name].controllers == {}
    assert RIGS[name].places(Place.CONTROLLER) == ()


def test_a_law_is_found_inside_its_limits() -> None:
    law = SERVO.controllers["motor"]
    assert not law.in_force
    assert law.output == law.error == sp.sympify("k_p*(goal - a)", _real("k_p", "goal", a="reading of angle"))
    (drive,) = SERVO.mechanism.drives
    assert law.limited(law.output) == drive.signal


def test_the_law_of_a_position_drive_is_in_units_of_its_goal() -> None:
    law = POSITION_DRIVE.controllers["motor"]
    names = _real("motor", "q", "k_p", "k_v", v="d(q)")
    assert law.in_force
    assert sp.expand(law.output - sp.sympify("motor - q - k_v*v/k_p", names)) == 0
    assert law.error == sp.sympify("motor - q", names)
    assert law.command == names["motor"]


def test_an_error_is_the_law_at_standstill() -> None:
    law = rig_of_text(CASCADE, "cascade.toml").controllers["motor"]
    names = _real("k_p", "k_v", "goal", a="reading of angle", v="reading of speed")
    assert sp.expand(law.output - sp.sympify("k_p*(goal - a) - k_v*v", names)) == 0
    assert sp.expand(law.error - sp.sympify("k_p*(goal - a)", names)) == 0


def test_what_another_effect_does_already_is_not_offered() -> None:
    """A delay of the goal of a position drive is one of the drive; a dead zone of a signal made of the error is its dead band."""
    always = {"integral_action", "derivative_action", "pid_action", "velocity_feedforward"}
    always |= {"friction_compensation", "command_rate_limit"}
    assert controls(SERVO) == always | {"command_filter", "command_delay"}
    of_parts = {"speed_loop_integral", "controller_dead_band"}
    assert controls(POSITION_DRIVE) == always | of_parts | {"controller_saturation"}
    cascade = rig_of_text(CASCADE, "cascade.toml")
    assert controls(cascade) == always | of_parts | {"command_filter", "command_delay"}


def _real(*names: str, **others: str) -> dict[str, sp.Symbol]:
    return {
        key: sp.Symbol(name, real=True)
        for key, name in {**dict(zip(names, names, strict=True)), **others}.items()
    }

"""The drives of a rig file: the law of each MuJoCo actuator, with its numbers as constants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.robots.drafting.declared_numbers import DeclaredNumbers, Field, Names
from rigsight.robots.drafting.joint_tables import force_unit, way_unit
from rigsight.robots.reading.actuators import TreeActuator
from rigsight.robots.reading.tree import TreeJoint


@dataclass(frozen=True)
class DriveTables:
    """A drive with what belongs to it."""

    # ``[drives.NAME]``.
    name: str
    table: Mapping[str, Any]
    # ``[inputs.NAME]``, its command.
    reported: str
    control: Mapping[str, Any]
    # Numbers of the actuator and of its control; -1 for a drive that was added.
    index: int = -1
    control_index: int = -1
    states: Mapping[str, Any] = field(default_factory=dict)  # ``[states.NAME]`` by name


def plain_drive(joint: TreeJoint, coordinate: str, names: Names) -> DriveTables:
    """Return a force or torque at a joint."""
    name = names.free(f"{coordinate}_motor")
    reported = names.free(f"{coordinate}_{'force' if joint.slides else 'torque'}")
    return DriveTables(
        name,
        {"signal": reported, "force": name, "along": coordinate},
        reported,
        {"unit": force_unit(joint), "about": f"drives {coordinate}"},
    )


def drive_of(
    actuator: TreeActuator, joint: TreeJoint, coordinate: str, names: Names, numbers: DeclaredNumbers
) -> DriveTables:
    """Return the drive of an actuator.

    Its signal is the control, as MuJoCo delays and limits that: effects of the actuator act in front of the position or velocity
    controller.
    """
    # Actuators are mostly called as their joints are.
    wished = f"{coordinate}_motor" if actuator.name in ("", coordinate) else actuator.name
    name = names.free(wished, "actuator")
    reported = names.free(f"{name}_ctrl")

    def own(attribute: str, entry: int = 0, sign: float = 1.0) -> Field:
        return Field("actuator", actuator.index, attribute, entry, sign)

    gear = numbers.factor(f"{name}_gear", actuator.gear, f"gear of {name}", own("gear"))
    unit, terms = _law(actuator, joint, name, f"{gear}{coordinate}", f"{gear}d({coordinate})", numbers)
    signal = reported
    if actuator.control_range is not None:
        low, high = (
            numbers.constant(f"{name}_{what}", end, unit, f"{what} control of {name}", own("ctrlrange", i))
            for i, (what, end) in enumerate(zip(("lowest", "highest"), actuator.control_range, strict=True))
        )
        signal = f"clip({reported}, {low}, {high})"
    states: dict[str, Any] = {}
    acting = name
    if actuator.time_constant > 0.0:
        acting = names.free(f"{name}_filtered")
        constant = numbers.constant(
            f"{name}_time_constant",
            actuator.time_constant,
            "s",
            f"time constant of the filter of {name}",
            own("dynprm"),
        )
        states[acting] = {"unit": unit, "rate": f"({name} - {acting})/{constant}"}
    force = "".join(terms).format(acting)
    if actuator.force_range is not None:
        weak, strong = (
            numbers.constant(
                f"{name}_{what}", end, force_unit(joint), f"{what} force of {name}", own("forcerange", i)
            )
            for i, (what, end) in enumerate(zip(("weakest", "strongest"), actuator.force_range, strict=True))
        )
        force = f"clip({force}, {weak}, {strong})"
    geared = f"{gear}({force})" if gear and not force.isidentifier() else f"{gear}{force}"
    table = {"signal": signal, "force": geared, "along": coordinate}
    control = {"unit": unit, "about": f"control of {name}"}
    return DriveTables(name, table, reported, control, actuator.index, actuator.control, states)


def _law(
    actuator: TreeActuator, joint: TreeJoint, name: str, length: str, speed: str, numbers: DeclaredNumbers
) -> tuple[str, list[str]]:
    """Return the unit of an actuator's control and the terms of its force, with a blank for the control."""
    way, force = way_unit(joint), force_unit(joint)
    gain = Field("actuator", actuator.index, "gainprm")

    def bias(entry: int, sign: float = 1.0) -> Field:
        return Field("actuator", actuator.index, "biasprm", entry, sign)

    if actuator.holds_position:
        kp = numbers.constant(
            f"{name}_kp", actuator.gain, f"{force}/{way}", f"position gain of {name}", gain, bias(1, -1.0)
        )
        kv = numbers.constant(
            f"{name}_kv", -actuator.bias[2], f"{force} s/{way}", f"damping of {name}", bias(2, -1.0)
        )
        return way, [f"{kp}*({{}} - {length})", *([f" - {kv}*{speed}"] if kv != 0 else [])]
    if actuator.holds_velocity:
        kv = numbers.constant(
            f"{name}_kv", actuator.gain, f"{force} s/{way}", f"velocity gain of {name}", gain, bias(2, -1.0)
        )
        return f"{way}/s", [f"{kv}*({{}} - {speed})"]
    terms = [f"{numbers.factor(f'{name}_gain', actuator.gain, f'gain of {name}', gain)}{{}}"]
    units = (force, f"{force}/{way}", f"{force} s/{way}")
    for i, (value, unit, beside) in enumerate(
        zip(actuator.bias, units, ("", f"*{length}", f"*{speed}"), strict=True)
    ):
        own = numbers.constant(f"{name}_bias_{i}", value, unit, f"bias of {name}", bias(i))
        if own != 0:
            terms.append(f" + {own}{beside}")
    return force, terms

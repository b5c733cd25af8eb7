"""Joints, compliant gears and drives of a rig file, from the fields of a MuJoCo model.

With a gear, rotor and load are separate, with a spring between them: the first joint keeps the actuator, the armature, damping
and friction; a second one at its place lies between rotor and body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import sympy as sp

from rigsight.errors import InputError, nearest
from rigsight.robots.declared_numbers import DeclaredNumbers, Field, Names
from rigsight.robots.parts import TreeActuator
from rigsight.robots.tree import TreeBody, TreeJoint

if TYPE_CHECKING:
    import mujoco


_DAMPING_RATIO = 0.1
"""Of the rotor on the spring of its gear, if the damping is unknown (**assumption**): steel is less damped, grease more."""


def way_unit(joint: TreeJoint) -> str:
    """Return the unit of a joint's coordinate."""
    return "m" if joint.slides else "rad"


def force_unit(joint: TreeJoint) -> str:
    """Return the unit of a force along a joint's coordinate."""
    return "N" if joint.slides else "N m"


def joint_table(
    model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers
) -> dict[str, Any]:
    """Return ``[joints.NAME]``, with its numbers declared as parameters.

    The inertia that moves with it is that of the model as it is drawn. Effects that read one, a flexible mode, take it for
    constant.
    """
    way, force = way_unit(joint), force_unit(joint)
    table: dict[str, Any] = {"motion": name}
    moved = 1.0 / float(model.dof_invweight0[joint.dof])
    inertia = numbers.constant(
        f"{name}_inertia",
        moved,
        "kg" if joint.slides else "kg m^2",
        f"inertia moved by {name} in the reference pose of the model",
    )
    table["inertia"] = str(inertia)
    table["damping"] = numbers.parameter(
        f"{name}_damping",
        float(model.dof_damping[joint.dof]),
        f"{force} s/{way}",
        f"damping of {name}",
        Field("joint", joint.index, "damping"),
    )
    forces = []
    loss = float(model.dof_frictionloss[joint.dof])
    if loss > 0.0:
        own = numbers.parameter(
            f"{name}_frictionloss",
            loss,
            force,
            f"dry friction of {name}",
            Field("joint", joint.index, "frictionloss"),
        )
        forces.append(f"{own}*sign(d({name}))")
    for power, law in ((2, f"d({name})*abs(d({name}))"), (3, f"d({name})^3")):
        value = float(model.dof_dampingpoly[joint.dof, power - 2])
        if value:
            own = numbers.parameter(
                f"{name}_damping_{power}",
                value,
                f"{force} s^{power}/{way}^{power}",
                f"damping of {name} with power {power} of the speed",
                Field("joint", joint.index, "damping", power - 1),
                lower=None,
            )
            forces.append(f"{own}*{law}")
    spring, beside = _spring(model, joint, name, numbers)
    if forces or beside:
        table["force"] = " + ".join([*forces, *beside])
    return {**table, **spring}


def _spring(
    model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers
) -> tuple[dict[str, Any], list[str]]:
    """Return what the spring of a joint adds to its table, and what its force has beside the linear part."""
    index, way, force = joint.index, way_unit(joint), force_unit(joint)
    linear, *higher = float(model.jnt_stiffness[index]), *map(float, model.jnt_stiffnesspoly[index])
    if linear == 0.0 and not any(higher):
        return {}, []
    at_rest = numbers.constant(
        f"{name}_springref",
        float(model.qpos_spring[int(model.jnt_qposadr[index])]),
        way,
        f"rest of the spring of {name}",
        Field("joint", index, "springref"),
    )
    table: dict[str, Any] = {}
    if linear:
        table["stiffness"] = numbers.parameter(
            f"{name}_stiffness",
            linear,
            f"{force}/{way}",
            f"stiffness of {name}",
            Field("joint", index, "stiffness"),
            lower=0.0 if linear > 0.0 else None,
        )
        if at_rest != 0:
            table["rest"] = str(at_rest)
    stretched = name if at_rest == 0 else f"({name} - {at_rest})"
    forces = []
    for power, value in enumerate(higher, start=2):
        if value:
            own = numbers.parameter(
                f"{name}_stiffness_{power}",
                value,
                f"{force}/{way}^{power}",
                f"stiffness of {name} with power {power} of the deflection",
                Field("joint", index, "stiffness", power - 1),
                lower=None,
            )
            forces.append(f"{own}*{stretched}^{power}")
    return table, forces


def armature(model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers) -> sp.Expr:
    """Return the kinetic energy of a joint's rotor; zero where it has none."""
    value = float(model.dof_armature[joint.dof])
    if value == 0.0:
        return sp.S.Zero
    own = numbers.parameter(
        f"{name}_armature",
        value,
        "kg" if joint.slides else "kg m^2",
        f"inertia of the rotor at {name}",
        Field("joint", joint.index, "armature"),
    )
    return sp.Symbol(own, real=True) * sp.Symbol(f"d({name})", real=True) ** 2 / 2


def split_joints(
    model: mujoco.MjModel, bodies: Sequence[TreeBody], gears: Mapping[str, float]
) -> tuple[tuple[TreeBody, ...], dict[int, TreeJoint]]:
    """Return the bodies with a second joint behind each that has a gear, and these by the number of the first."""
    joints = {joint.name: joint for body in bodies for joint in body.joints}
    for name, stiffness in gears.items():
        if name not in joints:
            raise InputError(
                f"--gear: there is no joint '{name}'.{nearest(name, joints)} Joints: {', '.join(joints)}."
            )
        if not (math.isfinite(stiffness) and stiffness > 0.0):
            raise InputError(f"--gear: the stiffness of '{name}' must be positive, got {stiffness:g}.")
        if model.dof_armature[joints[name].dof] == 0.0:
            raise InputError(
                f"--gear: joint '{name}' has no armature. With a gear its rotor turns separately and needs an inertia: give the "
                f"joint an armature in the model."
            )
    added: dict[int, TreeJoint] = {}
    found = []
    for body in bodies:
        own: list[TreeJoint] = []
        for joint in body.joints:
            own.append(joint)
            if joint.name in gears:
                second = replace(
                    joint, index=model.njnt + len(added), dof=-1, name=f"{joint.name}_play", reference=0.0
                )
                added[joint.index] = second
                own.append(second)
        found.append(replace(body, joints=tuple(own)))
    return tuple(found), added


def gear_table(
    model: mujoco.MjModel, joint: TreeJoint, name: str, play: str, stiffness: float, numbers: DeclaredNumbers
) -> dict[str, Any]:
    """Return ``[joints.NAME_gear]``, with its stiffness and damping declared as parameters."""
    force, way = force_unit(joint), way_unit(joint)
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * float(model.dof_armature[joint.dof]))
    return {
        "motion": play,
        "stiffness": numbers.parameter(
            f"{name}_gear_stiffness",
            stiffness,
            f"{force}/{way}",
            f"stiffness of the gear of {name}",
            Field("gear", joint.index, "stiffness"),
        ),
        # Teeth that do not touch damp nothing.
        "damps_spring": True,
        "damping": numbers.parameter(
            f"{name}_gear_damping",
            damping,
            f"{force} s/{way}",
            f"damping of the gear of {name}",
            Field("gear", joint.index, "damping"),
        ),
        "about": f"between the rotor of {name} and the moved body",
    }


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

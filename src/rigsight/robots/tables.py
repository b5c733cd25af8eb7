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


@dataclass(frozen=True)
class _Joint:
    """Declares the numbers of one joint, which are called after its coordinate."""

    joint: TreeJoint
    name: str
    numbers: DeclaredNumbers

    def unit(self, form: str) -> str:
        """Return a unit in which way, force and inertia are those of the joint."""
        inertia = "kg" if self.joint.slides else "kg m^2"
        return form.format(way=way_unit(self.joint), force=force_unit(self.joint), inertia=inertia)

    def parameter(
        self,
        what: str,
        value: float,
        unit: str,
        about: str,
        at: str,
        entry: int = 0,
        lower: float | None = 0.0,
    ) -> str:
        """Declare a parameter, given the element and attribute of its field, and return its name."""
        element, _, attribute = at.partition(" ")
        field = Field(element, self.joint.index, attribute, entry)
        name = f"{self.name}_{what}"
        return self.numbers.parameter(name, value, self.unit(unit), about, field, lower=lower)

    def higher(self, what: str, power: int, value: float, unit: str, about: str) -> str:
        """Declare the number in front of a power in a law, and return its name."""
        about = f"{what} of {self.name} {about}"
        return self.parameter(f"{what}_{power}", value, unit, about, f"joint {what}", power - 1, lower=None)


def joint_table(
    model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers
) -> dict[str, Any]:
    """Return ``[joints.NAME]``, with its numbers declared as parameters."""
    # The inertia that moves with it is that of the model as it is drawn. Effects that read one, a flexible mode, take it for
    # constant.
    own, moved = _Joint(joint, name, numbers), 1.0 / float(model.dof_invweight0[joint.dof])
    about = f"inertia moved by {name} in the reference pose of the model"
    inertia = numbers.constant(f"{name}_inertia", moved, own.unit("{inertia}"), about)
    damping = float(model.dof_damping[joint.dof])
    table: dict[str, Any] = {
        "motion": name,
        "inertia": str(inertia),
        "damping": own.parameter(
            "damping", damping, "{force} s/{way}", f"damping of {name}", "joint damping"
        ),
    }
    forces = []
    loss = float(model.dof_frictionloss[joint.dof])
    if loss > 0.0:
        dry = own.parameter("frictionloss", loss, "{force}", f"dry friction of {name}", "joint frictionloss")
        forces.append(f"{dry}*sign(d({name}))")
    for power, law in ((2, f"d({name})*abs(d({name}))"), (3, f"d({name})^3")):
        value = float(model.dof_dampingpoly[joint.dof, power - 2])
        if value:
            unit, about = f"{{force}} s^{power}/{{way}}^{power}", f"with power {power} of the speed"
            forces.append(f"{own.higher('damping', power, value, unit, about)}*{law}")
    spring, beside = _spring(model, own)
    if forces or beside:
        table["force"] = " + ".join([*forces, *beside])
    return {**table, **spring}


def _spring(model: mujoco.MjModel, own: _Joint) -> tuple[dict[str, Any], list[str]]:
    """Return what the spring of a joint adds to its table, and what its force has beside the linear part."""
    index, name = own.joint.index, own.name
    linear, *higher = float(model.jnt_stiffness[index]), *map(float, model.jnt_stiffnesspoly[index])
    if linear == 0.0 and not any(higher):
        return {}, []
    place, field = float(model.qpos_spring[int(model.jnt_qposadr[index])]), Field("joint", index, "springref")
    about = f"rest of the spring of {name}"
    at_rest = own.numbers.constant(f"{name}_springref", place, own.unit("{way}"), about, field)
    table: dict[str, Any] = {}
    if linear:
        least, about = 0.0 if linear > 0.0 else None, f"stiffness of {name}"
        table["stiffness"] = own.parameter(
            "stiffness", linear, "{force}/{way}", about, "joint stiffness", lower=least
        )
        if at_rest != 0:
            table["rest"] = str(at_rest)
    stretched = name if at_rest == 0 else f"({name} - {at_rest})"
    forces = []
    for power, value in enumerate(higher, start=2):
        if value:
            unit, about = f"{{force}}/{{way}}^{power}", f"with power {power} of the deflection"
            forces.append(f"{own.higher('stiffness', power, value, unit, about)}*{stretched}^{power}")
    return table, forces


def armature(model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers) -> sp.Expr:
    """Return the kinetic energy of a joint's rotor; zero where it has none."""
    value = float(model.dof_armature[joint.dof])
    if value == 0.0:
        return sp.S.Zero
    about = f"inertia of the rotor at {name}"
    own = _Joint(joint, name, numbers).parameter("armature", value, "{inertia}", about, "joint armature")
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
    own = _Joint(joint, f"{name}_gear", numbers)
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * float(model.dof_armature[joint.dof]))
    about = f"of the gear of {name}"
    return {
        "motion": play,
        "stiffness": own.parameter(
            "stiffness", stiffness, "{force}/{way}", f"stiffness {about}", "gear stiffness"
        ),
        # Teeth that do not touch damp nothing.
        "damps_spring": True,
        "damping": own.parameter("damping", damping, "{force} s/{way}", f"damping {about}", "gear damping"),
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
    """Return the drive of an actuator."""
    # Its signal is the control, as MuJoCo delays and limits that: effects of the actuator act in front of the position or
    # velocity controller.
    # Actuators are mostly called as their joints are.
    wished = f"{coordinate}_motor" if actuator.name in ("", coordinate) else actuator.name
    name = names.free(wished, "actuator")
    reported = names.free(f"{name}_ctrl")

    def own(attribute: str, entry: int = 0, sign: float = 1.0) -> Field:
        return Field("actuator", actuator.index, attribute, entry, sign)

    gear = numbers.factor(f"{name}_gear", actuator.gear, f"gear of {name}", own("gear"))
    unit, terms = _law(actuator, joint, name, f"{gear}{coordinate}", f"{gear}d({coordinate})", numbers)

    def clipped(
        inner: str, ends: tuple[float, float], called: Sequence[str], what: str, unit: str, at: str
    ) -> str:
        low, high = (
            numbers.constant(f"{name}_{which}", end, unit, f"{which} {what} of {name}", own(at, i))
            for i, (which, end) in enumerate(zip(called, ends, strict=True))
        )
        return f"clip({inner}, {low}, {high})"

    signal = reported
    if actuator.control_range is not None:
        called = ("lowest", "highest")
        signal = clipped(reported, actuator.control_range, called, "control", unit, "ctrlrange")
    states: dict[str, Any] = {}
    acting = name
    if actuator.time_constant > 0.0:
        acting = names.free(f"{name}_filtered")
        about = f"time constant of the filter of {name}"
        constant = numbers.constant(
            f"{name}_time_constant", actuator.time_constant, "s", about, own("dynprm")
        )
        states[acting] = {"unit": unit, "rate": f"({name} - {acting})/{constant}"}
    force = "".join(terms).format(acting)
    if actuator.force_range is not None:
        called = ("weakest", "strongest")
        force = clipped(force, actuator.force_range, called, "force", force_unit(joint), "forcerange")
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

"""Joints, compliant gears and drives of a rig file and their numbers, from the fields of a MuJoCo model.

With a gear, rotor and load are separate, with a spring between them: the first joint keeps the actuator, the armature, damping
and friction; a second one at its place lies between rotor and body.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import sympy as sp

from rigsight.errors import InputError, nearest
from rigsight.rigs.reading.expressions import FUNCTIONS
from rigsight.robots.parts import TreeActuator
from rigsight.robots.tree import TreeBody, TreeJoint

if TYPE_CHECKING:
    import mujoco


_LONGEST = 40
"""Characters of a part's name; what is made of it has more."""
_RANGES = {"control": ("lowest", "highest", "ctrlrange"), "force": ("weakest", "strongest", "forcerange")}
"""What the ends of each range of an actuator are called, and its field."""
_DAMPING_RATIO = 0.1
"""Of the rotor on the spring of its gear, if the damping is unknown (**assumption**): steel is less damped, grease more."""


@dataclass(frozen=True)
class Field:
    """A number of a MuJoCo model: attribute of an element, and which of several numbers it is."""

    element: str  # ``"joint"``, ``"actuator"`` or ``"body"``
    index: int  # its number in the model
    attribute: str  # as MuJoCo's XML calls it
    entry: int = 0  # which number of an attribute of several
    sign: float = 1.0  # -1 where a rig file and MuJoCo count it the other way


class DeclaredNumbers:
    """Constants and parameters, each declared once, and the numbers of the model that each stands for."""

    def __init__(self, names: Names) -> None:
        self._names = names
        self._constants: dict[str, tuple[str, dict[str, Any]]] = {}
        self.parameters: dict[str, dict[str, Any]] = {}
        self.fields: dict[str, tuple[Field, ...]] = {}

    @property
    def constants(self) -> Mapping[str, dict[str, Any]]:
        """Their tables, by name."""
        return dict(self._constants.values())

    @property
    def values(self) -> dict[str, float]:
        """Parameters as the model has them."""
        return {name: float(table["default"]) for name, table in self.parameters.items()}

    def constant(self, wished: str, value: float, unit: str, about: str, *fields: Field) -> sp.Expr:
        """Return the symbol of a constant; zero for one that is zero."""
        return sp.S.Zero if value == 0.0 else self.symbol_of_constant(wished, value, unit, about, *fields)

    def symbol_of_constant(
        self, wished: str, value: float, unit: str, about: str, *fields: Field
    ) -> sp.Symbol:
        """Return the symbol of a constant, also of one that is zero."""
        if wished not in self._constants:
            name = self._names.free(wished)
            self._constants[wished] = name, {"unit": unit, "default": value, "about": about}
            if fields:
                self.fields[name] = fields
        return sp.Symbol(self._constants[wished][0], real=True)

    def factor(self, wished: str, value: float, about: str, *fields: Field) -> str:
        """Return a factor in front of an expression, ``"NAME*"``; nothing for 1."""
        return "" if value == 1.0 else f"{self.constant(wished, value, '1', about, *fields)}*"

    def parameter(
        self, wished: str, value: float, unit: str, about: str, *fields: Field, lower: float | None = 0.0
    ) -> str:
        """Return the name of a parameter."""
        name = self._names.free(wished)
        table: dict[str, Any] = {"unit": unit, "default": value, "about": about}
        self.parameters[name] = table if lower is None else {**table, "lower": lower}
        self.fields[name] = fields
        return name


class Names:
    """Gives names that no other part has."""

    def __init__(self) -> None:
        self._taken = {*FUNCTIONS, "t", "d", "force"}

    def free(self, wished: str, otherwise: str = "part") -> str:
        """Return the requested name if it is valid and free, or a similar one."""
        name = re.sub(r"\W+", "_", wished, flags=re.ASCII).strip("_")[:_LONGEST] or otherwise
        name = name if not name[0].isdigit() else f"{otherwise}_{name}"
        found, count = name, 1
        while found in self._taken:
            count += 1
            found = f"{name}_{count}"
        self._taken.add(found)
        return found


@dataclass(frozen=True)
class _Joint:
    """Declares the numbers of one joint, which are called after its coordinate."""

    joint: TreeJoint
    name: str
    numbers: DeclaredNumbers

    def unit(self, form: str) -> str:
        """Return a unit in which way, force and inertia are those of the joint."""
        inertia = "kg" if self.joint.slides else "kg m^2"
        return form.format(way=self.joint.way_unit, force=self.joint.force_unit, inertia=inertia)

    def parameter(
        self, what: str, value: float, unit: str, about: str = "", *, power: int = 1,
        lower: float | None = 0.0, element: str = "joint",
    ) -> str:  # fmt: skip
        """Declare a parameter, the number in front of a power in a law, and return its name; the field is called as it is."""
        field = Field(element, self.joint.index, what, power - 1)
        name, about = f"{self.name}_{what}", about or f"{what} of {self.name}"
        name = name if power == 1 else f"{name}_{power}"
        return self.numbers.parameter(name, value, self.unit(unit), about, field, lower=lower)


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
        "damping": own.parameter("damping", damping, "{force} s/{way}"),
    }
    forces = []
    loss = float(model.dof_frictionloss[joint.dof])
    if loss > 0.0:
        dry = own.parameter("frictionloss", loss, "{force}", f"dry friction of {name}")
        forces.append(f"{dry}*sign(d({name}))")
    for power, law in ((2, f"d({name})*abs(d({name}))"), (3, f"d({name})^3")):
        value = float(model.dof_dampingpoly[joint.dof, power - 2])
        if value:
            unit, about = (
                f"{{force}} s^{power}/{{way}}^{power}",
                f"damping of {name} with power {power} of the speed",
            )
            forces.append(f"{own.parameter('damping', value, unit, about, power=power, lower=None)}*{law}")
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
        least = 0.0 if linear > 0.0 else None
        table["stiffness"] = own.parameter("stiffness", linear, "{force}/{way}", lower=least)
        if at_rest != 0:
            table["rest"] = str(at_rest)
    stretched = name if at_rest == 0 else f"({name} - {at_rest})"
    forces = []
    for power, value in enumerate(higher, start=2):
        if value:
            unit, about = (
                f"{{force}}/{{way}}^{power}",
                f"stiffness of {name} with power {power} of the deflection",
            )
            number = own.parameter("stiffness", value, unit, about, power=power, lower=None)
            forces.append(f"{number}*{stretched}^{power}")
    return table, forces


def armature(model: mujoco.MjModel, joint: TreeJoint, name: str, numbers: DeclaredNumbers) -> sp.Expr:
    """Return the kinetic energy of a joint's rotor; zero where it has none."""
    value = float(model.dof_armature[joint.dof])
    if value == 0.0:
        return sp.S.Zero
    about = f"inertia of the rotor at {name}"
    own = _Joint(joint, name, numbers).parameter("armature", value, "{inertia}", about)
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
            "stiffness", stiffness, "{force}/{way}", f"stiffness {about}", element="gear"
        ),
        # Teeth that do not touch damp nothing.
        "damps_spring": True,
        "damping": own.parameter("damping", damping, "{force} s/{way}", f"damping {about}", element="gear"),
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
        {"unit": joint.force_unit, "about": f"drives {coordinate}"},
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

    def clipped(inner: str, ends: tuple[float, float] | None, what: str, unit: str) -> str:
        if ends is None:
            return inner
        *called, at = _RANGES[what]
        low, high = (
            numbers.constant(f"{name}_{which}", end, unit, f"{which} {what} of {name}", own(at, i))
            for i, (which, end) in enumerate(zip(called, ends, strict=True))
        )
        return f"clip({inner}, {low}, {high})"

    signal = clipped(reported, actuator.control_range, "control", unit)
    states: dict[str, Any] = {}
    acting = name
    if actuator.time_constant > 0.0:
        acting = names.free(f"{name}_filtered")
        about = f"time constant of the filter of {name}"
        constant = numbers.constant(
            f"{name}_time_constant", actuator.time_constant, "s", about, own("dynprm")
        )
        states[acting] = {"unit": unit, "rate": f"({name} - {acting})/{constant}"}
    force = clipped("".join(terms).format(acting), actuator.force_range, "force", joint.force_unit)
    geared = f"{gear}({force})" if gear and not force.isidentifier() else f"{gear}{force}"
    table = {"signal": signal, "force": geared, "along": coordinate}
    control = {"unit": unit, "about": f"control of {name}"}
    return DriveTables(name, table, reported, control, actuator.index, actuator.control, states)


def _law(
    actuator: TreeActuator, joint: TreeJoint, name: str, length: str, speed: str, numbers: DeclaredNumbers
) -> tuple[str, list[str]]:
    """Return the unit of an actuator's control and the terms of its force, with a blank for the control."""
    way, force = joint.way_unit, joint.force_unit
    gain = Field("actuator", actuator.index, "gainprm")

    units = (force, f"{force}/{way}", f"{force} s/{way}")

    def constant(what: str, value: float, power: int, about: str, *fields: Field) -> sp.Expr:
        return numbers.constant(f"{name}_{what}", value, units[power], f"{about} of {name}", *fields)

    def bias(entry: int, sign: float = 1.0) -> Field:
        return Field("actuator", actuator.index, "biasprm", entry, sign)

    if actuator.holds_position:
        kp = constant("kp", actuator.gain, 1, "position gain", gain, bias(1, -1.0))
        kv = constant("kv", -actuator.bias[2], 2, "damping", bias(2, -1.0))
        return way, [f"{kp}*({{}} - {length})", *([f" - {kv}*{speed}"] if kv != 0 else [])]
    if actuator.holds_velocity:
        kv = constant("kv", actuator.gain, 2, "velocity gain", gain, bias(2, -1.0))
        return f"{way}/s", [f"{kv}*({{}} - {speed})"]
    terms = [f"{numbers.factor(f'{name}_gain', actuator.gain, f'gain of {name}', gain)}{{}}"]
    for i, beside in enumerate(("", f"*{length}", f"*{speed}")):
        own = constant(f"bias_{i}", actuator.bias[i], i, "bias", bias(i))
        if own != 0:
            terms.append(f" + {own}{beside}")
    return force, terms

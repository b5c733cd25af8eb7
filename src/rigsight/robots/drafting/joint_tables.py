"""The joints of a rig file: their resistance, from the fields of a MuJoCo joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp

from rigsight.robots.drafting.declared_numbers import DeclaredNumbers, Field
from rigsight.robots.reading.tree import TreeJoint

if TYPE_CHECKING:
    import mujoco


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

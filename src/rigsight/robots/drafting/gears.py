"""A joint with a compliant gear: rotor and load are separate, with a spring between them.

The first joint keeps the actuator, the armature, damping and friction; a second one at its place lies between rotor and body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError, nearest
from rigsight.robots.drafting.declared_numbers import DeclaredNumbers, Field
from rigsight.robots.drafting.joint_tables import force_unit, way_unit
from rigsight.robots.reading.tree import TreeBody, TreeJoint

if TYPE_CHECKING:
    import mujoco

_DAMPING_RATIO = 0.1
"""Of the rotor on the spring of its gear, if the damping is unknown (**assumption**): steel is less damped, grease more."""


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

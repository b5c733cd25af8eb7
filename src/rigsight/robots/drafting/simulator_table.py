"""``[simulator]`` of a rig file whose bodies stay in MuJoCo: its model, and what joints and numbers are called there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError
from rigsight.robots.drafting.declared_numbers import Field
from rigsight.robots.reading.tree import TreeJoint
from rigsight.simulators import has_constraints

if TYPE_CHECKING:
    import mujoco


def simulator_table(
    model: mujoco.MjModel,
    file: str,
    joints: Sequence[tuple[TreeJoint, str]],
    fields: Mapping[str, tuple[Field, ...]],
) -> dict[str, Any]:
    """Return the table."""
    for joint, _ in joints:
        if not joint.name:
            raise InputError(
                f"joint number {joint.index} has no name, which is needed to access it in MuJoCo; give it one"
            )
    names = {joint.index: joint.name for joint, _ in joints}
    parameters = {
        name: f"dof_armature {names[own[0].index]}"
        for name, own in fields.items()
        if own[0].attribute == "armature" and has_constraints(model)
    }
    rotors = any(own[0].attribute == "armature" for own in fields.values())
    coordinates = {q: joint.name for joint, q in joints if joint.name != q}
    return {
        "kind": "mujoco",
        "file": file,
        **({"without_armature": True} if rotors and not parameters else {}),
        **({"coordinates": coordinates} if coordinates else {}),
        **({"parameters": parameters} if parameters else {}),
    }

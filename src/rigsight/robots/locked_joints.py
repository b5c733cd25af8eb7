"""Joints that a brake or a controller holds: constants of the rig, which a record may set, and as good as locked in MuJoCo."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigsight.errors import InputError, nearest
from rigsight.robots.tree import TreeJoint

if TYPE_CHECKING:
    import mujoco

_HEAVY = 1e12
"""Inertia [kg m^2] (mass [kg]) of a rotor that no torque of a robot moves: MuJoCo has no switch that locks a joint."""


@dataclass(frozen=True)
class LockedJoint:
    """Where a joint is held."""

    joint: int  # number of the joint in the model
    position: float  # its coordinate [rad] or [m]


def check_locked(
    joints: Sequence[TreeJoint], locked: Mapping[str, float], gears: Mapping[str, float]
) -> None:
    """Refuse what cannot be locked."""
    known = {joint.name: joint for joint in joints}
    for name, position in locked.items():
        if name not in known:
            raise InputError(
                f"--lock: there is no joint '{name}'.{nearest(name, known)} Joints: {', '.join(known)}."
            )
        if not math.isfinite(position):
            raise InputError(f"--lock: the position of '{name}' must be finite, got {position:g}.")
        if name in gears:
            raise InputError(
                f"--lock: joint '{name}' has a gear, which turns; leave out --gear or --lock of it."
            )
    if locked and len(locked) == len(joints):
        raise InputError("--lock: all joints are locked, so nothing moves; leave one free.")


def lock(model: mujoco.MjModel, data: mujoco.MjData, positions: Mapping[int, float]) -> None:
    """Put joints of a model where they are held, by their numbers, and make them too heavy to move."""
    for joint, position in positions.items():
        data.qpos[model.jnt_qposadr[joint]] = position
        model.dof_armature[model.jnt_dofadr[joint]] = _HEAVY

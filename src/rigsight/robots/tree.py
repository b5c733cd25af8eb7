"""Bodies of a compiled MuJoCo model in order, each with its joints, and joints that a brake or a controller holds."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigsight.errors import InputError, nearest, needing
from rigsight.records.formats.known import file_size
from rigsight.records.record import Floats

if TYPE_CHECKING:
    import mujoco


LARGEST_FILE = 20_000_000
_ROUNDING = 1e-9
"""Share of the largest component below which another one is rounding of the quaternions that a model is stored with."""
_HEAVY = 1e12
"""Inertia [kg m^2] (mass [kg]) of a rotor that no torque of a robot moves: MuJoCo has no switch that locks a joint."""


@dataclass(frozen=True)
class TreeJoint:
    """A hinge or slide joint."""

    # Its numbers in the model, and that of its degree of freedom.
    index: int
    dof: int
    name: str  # as MuJoCo calls it; empty without a name
    slides: bool  # true for a slide, False for a hinge
    # In the frame of its body, shape (3,) each.
    axis: Floats
    anchor: Floats
    reference: float  # coordinate at which the body stands as the model draws it

    @property
    def way_unit(self) -> str:
        """Unit of its coordinate."""
        return "m" if self.slides else "rad"

    @property
    def force_unit(self) -> str:
        """Unit of a force along its coordinate."""
        return "N" if self.slides else "N m"


@dataclass(frozen=True)
class TreeBody:
    """A body and how it hangs on its parent."""

    # Its number in the model, and that of its parent; 0 is the world.
    index: int
    parent: int
    name: str  # as MuJoCo calls it; empty without a name
    # Of its frame in that of its parent, shapes (3,) and (3, 3).
    position: Floats
    rotation: Floats
    mass: float  # mass [kg]
    weight: float  # part of it that gravity acts on: less where the model compensates gravity
    center: Floats  # center of mass in its own frame, shape (3,)
    inertia: Floats  # about its center, along the axes of its own frame, shape (3, 3)
    joints: tuple[TreeJoint, ...]  # in the order in which they move it


def bodies_of(model: mujoco.MjModel, *, only_scalar: bool = True) -> tuple[TreeBody, ...]:
    """Return the bodies of a model behind their parents, without the world; joints are hinges and slides if `only_scalar`."""
    import mujoco

    kinds = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
    for j in range(model.njnt):
        kind = kinds.get(int(model.jnt_type[j]))
        if kind is not None and only_scalar:
            body = model.body(int(model.jnt_bodyid[j])).name or f"number {int(model.jnt_bodyid[j])}"
            raise InputError(
                f"Body '{body}' has a {kind} joint. Equations are derived for hinge and slide joints: leave the bodies to MuJoCo "
                "with --as-it-is, fix the body to the world, or write its motion as hinges and slides."
            )
    if model.njnt == 0:
        raise InputError("The model has no joint, so nothing in it moves.")
    scalar = [j for j in range(model.njnt) if int(model.jnt_type[j]) not in kinds]
    return tuple(_body(model, index, scalar) for index in range(1, model.nbody))


def gravity_of(model: mujoco.MjModel) -> Floats:
    """Return the acceleration of gravity in the frame of the world [m/s^2], shape (3,); zero where an option switches it off."""
    import mujoco

    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        return np.zeros(3)
    return cleaned(model.opt.gravity)


def _body(model: mujoco.MjModel, index: int, scalar: Sequence[int]) -> TreeBody:
    axes = _matrix(model.body_iquat[index])
    mass = float(model.body_mass[index])
    return TreeBody(
        index,
        int(model.body_parentid[index]),
        model.body(index).name,
        cleaned(model.body_pos[index]),
        cleaned(_matrix(model.body_quat[index])),
        mass,
        mass * (1.0 - float(model.body_gravcomp[index])),
        cleaned(model.body_ipos[index]),
        cleaned(axes @ np.diag(model.body_inertia[index]) @ axes.T),
        tuple(_joint(model, j) for j in scalar if int(model.jnt_bodyid[j]) == index),
    )


def _joint(model: mujoco.MjModel, index: int) -> TreeJoint:
    import mujoco

    return TreeJoint(
        index,
        int(model.jnt_dofadr[index]),
        model.joint(index).name,
        int(model.jnt_type[index]) == int(mujoco.mjtJoint.mjJNT_SLIDE),
        cleaned(model.jnt_axis[index]),
        cleaned(model.jnt_pos[index]),
        float(model.qpos0[int(model.jnt_qposadr[index])]),
    )


def cleaned(numbers: Sequence[float] | Floats) -> Floats:
    """Return numbers with what is rounding beside the largest of them as zero."""
    array = np.array(numbers, dtype=np.float64)
    array[np.abs(array) <= _ROUNDING * np.max(np.abs(array), initial=0.0)] = 0.0
    return array


def _matrix(quaternion: Floats) -> Floats:
    import mujoco

    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def load_model(path: Path) -> mujoco.MjModel:
    """Return the model of an MJCF or URDF file."""
    return load_spec(path).compile()


def load_spec(path: Path) -> mujoco.MjSpec:
    """Return the content of an MJCF or URDF file as a specification that can be changed and compiled.

    Where a mesh is missing, shapes are left out of bodies that have an inertia of their own: only what moves is taken over.
    """
    with needing("Reading MJCF and URDF", "MuJoCo", "mujoco"):
        import mujoco
    if file_size(path, "the model file") > LARGEST_FILE:
        raise InputError(f"{path}: is larger than {LARGEST_FILE / 1e6:g} MB, the limit for a model file.")
    try:
        spec = mujoco.MjSpec.from_file(os.fspath(path))
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {_one_line(error)}.") from None
    try:
        spec.compile()
        return spec
    except ValueError:
        # What failed to compile is no longer whole.
        without = _without_shapes(mujoco.MjSpec.from_file(os.fspath(path)))
    try:
        without.compile()
        return without
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot compile it: {_one_line(error)}.") from None


def _without_shapes(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    for body in spec.bodies:
        if body.explicitinertial:
            for geom in list(body.geoms):
                spec.delete(geom)
    used = {geom.meshname for body in spec.bodies for geom in body.geoms}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
    return spec


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()).removeprefix("Error: ").rstrip(".")


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

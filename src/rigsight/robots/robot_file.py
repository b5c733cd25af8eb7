"""Read the model file of a robot: the model, in a form that can be changed and compiled, and its rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rigsight.errors import InputError
from rigsight.robots.drafting.draft import RigDraft, draft_rig
from rigsight.robots.reading.tree import load_spec

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A robot's model with its rig."""

    spec: mujoco.MjSpec  # what the file says; may be changed
    model: mujoco.MjModel  # compiled
    draft: RigDraft  # its rig file


def read_robot(path: Path, gears: Mapping[str, float] | None = None, *, as_it_is: bool = False) -> RobotFile:
    """Read an MJCF or URDF file; a URDF, which has no actuators, gets a force or torque at every joint."""
    spec = load_spec(path)
    model = spec.compile()
    try:
        draft = draft_rig(
            model,
            path.stem,
            with_drives=path.suffix.lower() == ".urdf",
            gears=gears,
            as_it_is=path.resolve().as_posix() if as_it_is else None,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return RobotFile(spec, model, draft)

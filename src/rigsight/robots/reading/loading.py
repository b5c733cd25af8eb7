"""Load an MJCF or URDF file as a compiled MuJoCo model; errors become one message."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from rigsight.errors import InputError
from rigsight.records.formats.ordinary_file import file_size

if TYPE_CHECKING:
    import mujoco

LARGEST_FILE = 20_000_000


def load_model(path: Path) -> mujoco.MjModel:
    """Return the model of an MJCF or URDF file."""
    return load_spec(path).compile()


def load_spec(path: Path) -> mujoco.MjSpec:
    """Return the content of an MJCF or URDF file as a specification that can be changed and compiled.

    Where a mesh is missing, shapes are left out of bodies that have an inertia of their own: only what moves is taken over.
    """
    try:
        import mujoco
    except ImportError:
        raise InputError(
            "Reading MJCF and URDF needs MuJoCo, which is not installed: pip install 'rigsight[mujoco]'."
        ) from None
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

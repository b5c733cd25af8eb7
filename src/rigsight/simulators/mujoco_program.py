"""Bodies of a MuJoCo model, with its contacts, limits, equalities and tendons; joints and actuators are the rig's own."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest
from rigsight.libraries.templates import filled, template
from rigsight.simulators.bodies import Bodies, Program

if TYPE_CHECKING:
    import mujoco

Floats = NDArray[np.float64]

_FUNCTIONS = (
    "mj_copyModel", "mj_makeData", "mj_setConst", "mj_kinematics", "mj_comPos", "mj_makeM", "mj_fullM",
    "mj_fwdPosition", "mj_fwdVelocity", "mj_fwdActuation", "mj_fwdAcceleration", "mj_fwdConstraint",
    "mj_comVel", "mj_passive", "mj_rne",
)  # fmt: skip
"""What the C text calls, in the order of its table."""
_PARTS = {0: (3, 6), 1: (0, 3), 2: (1, 1), 3: (1, 1)}
"""Places and rates of a free, ball, slide and hinge joint, by MuJoCo's numbers for these."""
_QUATERNION = 4
_OBJECTS = ("body", "jnt", "dof", "geom", "tendon", "eq", "pair")
"""Beginnings of the fields of a model whose rows have names."""


class MujocoProgram(Program):
    """An open MuJoCo model."""

    def __init__(self, bodies: Bodies) -> None:
        self._bodies = bodies
        self._model = bodies_alone(opened(Path(bodies.file)), without_armature=bodies.without_armature)
        # Not before: `opened` says what to do where it is missing.
        import mujoco

        self._places = [self._coordinate(name) for name in bodies.coordinates]
        if len(self._places) != self._model.nv:
            others = [self._model.joint(i).name for i in range(self._model.njnt)]
            raise InputError(
                f"{bodies.file} has {self._model.nv} coordinates, but the rig names only {len(self._places)} of them. "
                f"Joints: {', '.join(others)}."
            )
        self._quaternions = [self._state(name) for name in bodies.states]
        if len(self._quaternions) != self._model.nq - sum(place >= 0 for place, _ in self._places):
            raise InputError(
                f"{bodies.file}: name the four states of the quaternion of each free and ball joint, 'JOINT 0' to 'JOINT 3', in "
                "[simulator.states]."
            )
        self._fields = [self._field(name) for name in bodies.parameters]
        self.reads_forces = has_constraints(self._model)
        self._kept: list[Any] = []
        model = self._model
        is_plain = not (self.reads_forces or model.ntendon or model.nflex or model.nplugin)
        flags = {"STATES": len(bodies.states), "CONSTRAINED": int(self.reads_forces), "PLAIN": int(is_plain)}
        text = template("simulators", "mujoco.c.txt")
        self.c_text = filled(text, {"VERSION": mujoco.__version__, **flags})
        self.include_folders = ((Path(mujoco.__file__).parent / "include").as_posix(),)

    def _coordinate(self, name: str) -> tuple[int, int]:
        """Return the place of a coordinate in ``qpos``, -1 for an angle about an axis of a body, and that of its rate."""
        index, part = self._part(name)
        n_places, n_rates = _PARTS[int(self._model.jnt_type[index])]
        if not 0 <= part < n_rates:
            raise InputError(
                f"{self._bodies.file}: '{name}' is no motion of a joint. Write the name of a hinge or slide; 'JOINT 0' to "
                "'JOINT 5' of a free joint (three places, three turns); 'JOINT 0' to 'JOINT 2' of a ball joint."
            )
        position = int(self._model.jnt_qposadr[index]) + part if part < n_places else -1
        return position, int(self._model.jnt_dofadr[index]) + part

    def _state(self, name: str) -> int:
        """Return the place of a number of a quaternion in ``qpos``."""
        index, part = self._part(name)
        n_places, n_rates = _PARTS[int(self._model.jnt_type[index])]
        if n_rates == 1 or not 0 <= part < _QUATERNION:
            raise InputError(
                f"{self._bodies.file}: '{name}' is no number of a quaternion: write 'JOINT 0' to 'JOINT 3' of a free or ball one."
            )
        return int(self._model.jnt_qposadr[index]) + n_places + part

    def _part(self, name: str) -> tuple[int, int]:
        """Return the number of a joint and that of its part: 0 for the only one of a hinge or slide, -1 if none is named."""
        import mujoco

        known = [self._model.joint(i).name for i in range(self._model.njnt)]
        joint, _, part = name.rpartition(" ")
        if name in known or joint not in known or not part.isdecimal():
            joint, part = name, ""
        index = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        if index < 0:
            raise InputError(
                f"{self._bodies.file} has no joint '{name}'.{nearest(name, known)} Joints: {', '.join(known)}."
            )
        is_scalar = _PARTS[int(self._model.jnt_type[index])][1] == 1
        return index, int(part) if part else (0 if is_scalar else -1)

    def _field(self, name: str) -> tuple[Floats, tuple[int, ...]]:
        """Return the array of a field, and the place in it: of ``body_ipos hand 2`` the row of the body, and 2."""
        wanted = (
            f"{self._bodies.file}: '{name}' is not a number of the model. Write a field, the name of its element and, for a "
            f"vector, the index of the entry from 0: 'body_mass hand', 'body_ipos hand 2'."
        )
        words = name.split()
        if len(words) < 2 or not re.fullmatch(rf"({'|'.join(_OBJECTS)})_\w+", words[0]):
            raise InputError(wanted)
        field, kind = getattr(self._model, words[0], None), words[0].partition("_")[0]
        if not isinstance(field, np.ndarray) or field.dtype != np.float64:
            raise InputError(wanted)
        accessor = getattr(self._model, {"eq": "equality", "jnt": "joint", "dof": "joint"}.get(kind, kind))
        try:
            own = accessor(words[1])
            row = int(own.dofadr[0]) if kind == "dof" else int(own.id)
            place = (row, *map(int, words[2:]))
            if np.ndim(field[place]) != 0 or min(place) < 0:
                raise InputError(wanted)
        except (KeyError, IndexError, ValueError) as error:
            raise InputError(f"{wanted} MuJoCo: {error}") from None
        if not self._is_kept(field, place):
            raise InputError(
                f"{self._bodies.file}: '{name}' is derived from other numbers of the model or does not affect its bodies. "
                f"Declare dry friction at a joint of the rig file."
            )
        return field, place

    def _is_kept(self, field: Floats, place: tuple[int, ...]) -> bool:
        """Return True for a number that can be set and affects the bodies."""
        import mujoco

        if np.shares_memory(field, self._model.dof_frictionloss):
            return False
        before, other = float(field[place]), 1.25 * float(field[place]) + 0.5
        kept = False
        for value in (other, before):
            field[place] = value
            mujoco.mj_setConst(self._model, mujoco.MjData(self._model))
            kept = kept or float(field[place]) == other
        return kept

    def connect(self, library: ctypes.CDLL) -> None:
        """See `Program.connect`."""
        mujoco_library = ctypes.CDLL(_library())
        functions = [ctypes.cast(getattr(mujoco_library, name), ctypes.c_void_p).value for name in _FUNCTIONS]
        origin = self._model.qpos0.ctypes.data
        offsets = [_address(field, place) - origin for field, place in self._fields]
        table = (ctypes.c_void_p * len(_FUNCTIONS))(*functions)
        numbers = [*(i for place in self._places for i in place), *self._quaternions]
        places = (ctypes.c_int * len(numbers))(*numbers)
        moved = (ctypes.c_longlong * max(1, len(offsets)))(*offsets)
        library.connect.restype = None
        library.connect(table, ctypes.c_void_p(self._model._address), places, moved)
        # The library keeps the addresses.
        self._kept.append((table, places, moved, mujoco_library))


def opened(path: Path) -> mujoco.MjModel:
    """Return a model."""
    try:
        import mujoco
    except ImportError:
        raise InputError("Simulations by MuJoCo need the package: pip install 'rigsight[mujoco]'.") from None
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {error}") from None


def compiled_model(path: Path) -> bytes:
    """Return a model as MuJoCo compiles it."""
    model = opened(path)
    import mujoco

    content = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, content)
    return content.tobytes()


def bodies_alone(model: mujoco.MjModel, *, without_armature: bool) -> mujoco.MjModel:
    """Return a model without what the rig declares itself: dampers, springs and dry friction of joints, and actuators."""
    import mujoco

    joints, dofs = of_the_rig(model)
    model.dof_damping[dofs] = 0.0
    if without_armature:
        model.dof_armature[dofs] = 0.0
    model.dof_frictionloss[dofs] = 0.0
    model.jnt_stiffness[joints] = 0.0
    for name, own in (("dof_dampingpoly", dofs), ("jnt_stiffnesspoly", joints)):
        if hasattr(model, name):
            getattr(model, name)[own] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    return model


def of_the_rig(model: mujoco.MjModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which joints, and which degrees of freedom, are hinges and slides: what resists at others stays in MuJoCo."""
    joints = np.array([_PARTS[int(kind)][1] == 1 for kind in model.jnt_type])
    return joints, joints[model.dof_jntid]


def has_constraints(model: mujoco.MjModel) -> bool:
    """Return True for a model in which bodies can touch, or joints, tendons and equalities are bound."""
    import mujoco

    off = mujoco.mjtDisableBit
    flags = int(model.opt.disableflags)
    if flags & int(off.mjDSBL_CONSTRAINT):
        return False
    touches = bool(np.any(model.geom_contype) and np.any(model.geom_conaffinity)) or model.npair > 0
    return bool(
        (touches and not flags & int(off.mjDSBL_CONTACT))
        or ((np.any(model.jnt_limited) or np.any(model.tendon_limited)) and not flags & int(off.mjDSBL_LIMIT))
        or np.any(model.tendon_frictionloss)
        or np.any(model.dof_frictionloss[~of_the_rig(model)[1]])
        or (model.neq > 0 and not flags & int(off.mjDSBL_EQUALITY))
    )


def _address(field: Floats, place: tuple[int, ...]) -> int:
    return int(field.ctypes.data) + sum(int(s) * i for s, i in zip(field.strides, place, strict=True))


def _library() -> str:
    import mujoco

    folder = Path(mujoco.__file__).parent
    found = sorted(p for pattern in ("libmujoco*", "mujoco.dll") for p in folder.glob(pattern))
    if not found:
        raise InputError(f"The library of MuJoCo was not found in {folder}.")
    return str(found[0])

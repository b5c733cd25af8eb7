"""Free and ball joints of a MuJoCo model that is simulated as it is: their motion in a rig file, without places for effects.

The rates are MuJoCo's own: a free joint's velocity in the frame of the world, and the angular velocity in that of its body. No
coordinates have the latter as rates, so the attitude is a quaternion of four states, beside three angles that nothing reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rigsight.robots.tables import DeclaredNumbers, Names
from rigsight.robots.tree import TreeJoint

if TYPE_CHECKING:
    import mujoco

_AXES = "xyz"
_RATES = (
    "-({x}*d({a}) + {y}*d({b}) + {z}*d({c}))/2",
    "({w}*d({a}) + {y}*d({c}) - {z}*d({b}))/2",
    "({w}*d({b}) + {z}*d({a}) - {x}*d({c}))/2",
    "({w}*d({c}) + {x}*d({b}) - {y}*d({a}))/2",
)
"""Of a quaternion, half its product with the angular velocity in the frame of the body."""


@dataclass(frozen=True)
class FreeJoint:
    """A free or ball joint."""

    name: str  # as MuJoCo calls it
    index: int  # its number in the model
    position: int  # where its numbers begin in ``qpos``, and in ``qvel``
    dof: int
    # What its parts are called in the rig; a ball joint has no places.
    places: tuple[str, ...]
    turns: tuple[str, ...]
    quaternion: tuple[str, ...]

    @property
    def positions(self) -> dict[str, int]:
        """Coordinate or state of the rig -> its number in ``qpos``."""
        return {name: self.position + i for i, name in enumerate((*self.places, *self.quaternion))}

    @property
    def rates(self) -> dict[str, int]:
        """Coordinate of the rig -> the number of its rate in ``qvel``."""
        return {name: self.dof + i for i, name in enumerate((*self.places, *self.turns))}

    @property
    def coordinates(self) -> dict[str, Any]:
        """``[coordinates.NAME]`` by name."""
        turns = {
            name: {"unit": "rad", "about": f"its rate is the angular velocity about the body's own {axis}"}
            for name, axis in zip(self.turns, _AXES, strict=True)
        }
        return {**{name: {"unit": "m"} for name in self.places}, **turns}

    @property
    def states(self) -> dict[str, Any]:
        """``[states.NAME]`` by name."""
        names = dict(zip("wxyzabc", (*self.quaternion, *self.turns), strict=True))
        return {
            own: {"unit": "1", "rate": rate.format(**names)}
            for own, rate in zip(self.quaternion, _RATES, strict=True)
        }


def start_of(
    model: mujoco.MjModel,
    scalar: Mapping[str, TreeJoint],
    free_joints: Sequence[FreeJoint],
    numbers: DeclaredNumbers,
) -> dict[str, str]:
    """Return ``[initial]`` of a model with free or ball joints, of constants that a record may set; empty for other models."""
    # Nothing holds a free joint, so its model does not start in an equilibrium but as its first keyframe, or as it is drawn.
    if not free_joints:
        return {}
    at = model.key_qpos[0] if model.nkey else model.qpos0
    places = {q: (int(model.jnt_qposadr[joint.index]), joint.way_unit) for q, joint in scalar.items()}
    for own in free_joints:
        places |= {name: (place, "m" if name in own.places else "1") for name, place in own.positions.items()}
    initial = {
        name: str(numbers.symbol_of_constant(f"{name}_start", float(at[place]), unit, f"start of {name}"))
        for name, (place, unit) in places.items()
    }
    return initial | dict.fromkeys((turn for own in free_joints for turn in own.turns), "0")


def names_in_simulator(free_joints: Sequence[FreeJoint]) -> tuple[dict[str, str], dict[str, str]]:
    """Return what coordinates and states are called in ``[simulator]``."""
    moving: dict[str, str] = {}
    turned: dict[str, str] = {}
    for joint in free_joints:
        moving |= {own: f"{joint.name} {i}" for i, own in enumerate((*joint.places, *joint.turns))}
        turned |= {own: f"{joint.name} {i}" for i, own in enumerate(joint.quaternion)}
    return moving, turned


def sensors_of_free_joints(
    model: mujoco.MjModel, free_joints: Sequence[FreeJoint]
) -> dict[int, dict[str, str]]:
    """Return the sensors that show the place or attitude of a joint: number -> what each component is called, and reads."""
    import mujoco

    sort, bodies = mujoco.mjtSensor, int(mujoco.mjtObj.mjOBJ_XBODY)
    found = {}
    for index in range(model.nsensor):
        kind, target = int(model.sensor_type[index]), int(model.sensor_objid[index])
        of_body = int(model.sensor_objtype[index]) == bodies and int(model.sensor_refid[index]) < 0
        for own in free_joints:
            is_its_body = of_body and bool(own.places) and target == int(model.jnt_bodyid[own.index])
            if kind == int(sort.mjSENS_FRAMEPOS) and is_its_body:
                parts = own.places
            elif (kind == int(sort.mjSENS_FRAMEQUAT) and is_its_body) or (
                kind == int(sort.mjSENS_BALLQUAT) and target == own.index
            ):
                parts = own.quaternion
            else:
                continue
            called = model.sensor(index).name
            found[index] = {f"{called}_{part[-1]}" if called else part: part for part in parts}
    return found


def sensor_tables(
    sensors: Mapping[int, Mapping[str, str]], free_joints: Sequence[FreeJoint], names: Names
) -> dict[str, dict[str, str]]:
    """Return ``[sensors.NAME]`` by name, one for each component."""
    lengths = {name for own in free_joints for name in own.places}
    return {
        names.free(name if name != reads else f"{name}_reading"): {
            "reads": reads,
            "unit": "m" if reads in lengths else "1",
        }
        for components in sensors.values()
        for name, reads in components.items()
    }


def free_joints_of(model: mujoco.MjModel, names: Names) -> tuple[FreeJoint, ...]:
    """Return the free and ball joints of a model."""
    import mujoco

    free, ball = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
    found = []
    for index in range(model.njnt):
        if int(model.jnt_type[index]) not in (free, ball):
            continue
        own, places = model.joint(index).name, _AXES if int(model.jnt_type[index]) == free else ""
        called = names.free(own or f"joint_{index + 1}", "joint")
        moving = tuple(names.free(f"{called}_{axis}") for axis in places)
        turns = tuple(names.free(f"{called}_turn_{axis}") for axis in _AXES)
        quaternion = tuple(names.free(f"{called}_quat_{part}") for part in f"w{_AXES}")
        position, dof = int(model.jnt_qposadr[index]), int(model.jnt_dofadr[index])
        found.append(FreeJoint(own, index, position, dof, moving, turns, quaternion))
    return tuple(found)

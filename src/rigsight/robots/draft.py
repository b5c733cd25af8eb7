"""A MuJoCo model -> the tables of a rig file, with the origin of each part, so that parameters can be written back."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import sympy as sp

from rigsight.errors import InputError, needing
from rigsight.rigs import Rig, rig_of_tables
from rigsight.robots.energies import Energies, energies_of
from rigsight.robots.free_joints import (
    FreeJoint,
    free_joints_of,
    names_in_simulator,
    sensor_tables,
    sensors_of_free_joints,
    start_of,
)
from rigsight.robots.parts import TreeSensor, actuators_of, left_out_of, sensors_of
from rigsight.robots.tables import (
    DeclaredNumbers,
    Field,
    Names,
    armature,
    drive_of,
    gear_table,
    joint_table,
    plain_drive,
    split_joints,
)
from rigsight.robots.tree import LockedJoint, TreeJoint, bodies_of, check_locked, gravity_of, load_spec
from rigsight.simulators import has_constraints

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Gear:
    """The gear between the rotor of a joint and the moved body."""

    joint: int  # number of the joint in the model
    coordinate: str  # deflection of the gear


@dataclass(frozen=True)
class RigDraft:
    """A rig file equivalent to a MuJoCo model."""

    tables: Mapping[str, Any]  # the rig file
    # Place of the rig -> number of the joint, actuator or sensor in the model; -1 for what was added.
    joints: Mapping[str, int]
    gears: Mapping[str, Gear]  # place between a rotor and what it moves -> its joint
    drives: Mapping[str, int]
    # Input of a drive -> index of the control in the model; -1 for what was added.
    controls: Mapping[str, int]
    sensors: Mapping[str, int]
    # Parameter or constant of the rig -> the fields of the model that it represents.
    fields: Mapping[str, tuple[Field, ...]]
    values: Mapping[str, float]  # parameters as the model has them
    left_out: tuple[str, ...]  # descriptions of the parts of the model that are not in the rig file
    notes: tuple[str, ...]  # descriptions of what was added
    locked: Mapping[str, LockedJoint]  # constant of the rig -> the joint that is held there
    free_joints: tuple[FreeJoint, ...] = ()  # of a model that is simulated as it is

    def index_with_gears(self, joint: int) -> int:
        """Return the number of a joint once each with a gear has its second joint behind it."""
        return joint + sum(gear.joint < joint for gear in self.gears.values())

    def joint_of_coordinates(self) -> dict[str, int]:
        """Return the number of the joint of each coordinate, once each joint with a gear has its second one behind it."""
        joints = {name: self.index_with_gears(index) for name, index in self.joints.items()}
        behind = {gear.coordinate: self.index_with_gears(gear.joint) + 1 for gear in self.gears.values()}
        return joints | behind

    def positions(self, model: mujoco.MjModel) -> dict[str, int]:
        """Return the place in ``qpos`` of each coordinate and of each state that is part of an attitude."""
        own = {name: int(model.jnt_qposadr[joint]) for name, joint in self.joint_of_coordinates().items()}
        return own | {name: place for joint in self.free_joints for name, place in joint.positions.items()}

    def rates(self, model: mujoco.MjModel) -> dict[str, int]:
        """Return the place of the rate of each coordinate in ``qvel``."""
        own = {name: int(model.jnt_dofadr[joint]) for name, joint in self.joint_of_coordinates().items()}
        return own | {name: place for joint in self.free_joints for name, place in joint.rates.items()}

    def held(self, values: Mapping[str, float]) -> dict[int, float]:
        """Return the positions of locked joints by their numbers, once each joint with a gear has its second one behind it."""
        return {
            self.index_with_gears(own.joint): values.get(name, own.position)
            for name, own in self.locked.items()
        }

    @property
    def is_as_it_is(self) -> bool:
        """True if bodies are left to MuJoCo."""
        return "simulator" in self.tables

    @property
    def rig(self) -> Rig:
        """The rig."""
        return rig_of_tables(self.tables, "the rig of the model")


def draft_rig(
    model: mujoco.MjModel,
    name: str,
    *,
    with_drives: bool = False,
    gears: Mapping[str, float] | None = None,
    locked: Mapping[str, float] | None = None,
    as_it_is: str | None = None,
) -> RigDraft:
    """Return the rig file of a MuJoCo model.

    Damping, dry friction, stiffness and armature of joints are parameters, masses, lengths and gains constants. Bodies that are
    simulated in MuJoCo have no masses and lengths in the rig file, and all their constraints are kept.
    """
    names, notes = Names(), []
    numbers = DeclaredNumbers(names)
    rig_name = names.free(name, "rig")
    gears, locked = gears or {}, locked or {}
    if locked and as_it_is is not None:
        raise InputError(
            "--lock does not apply to a model that is simulated as it is; weld the joint in the file"
        )
    if gears and as_it_is is not None:
        raise InputError(
            "a gear splits a joint in two, which is impossible if the model is simulated as it is; omit one of the two options"
        )
    bodies, plays = split_joints(model, bodies_of(model, only_scalar=as_it_is is None), gears)
    actuators, drives_left_out = actuators_of(model)
    free_joints = free_joints_of(model, names)
    of_free_joints = sensors_of_free_joints(model, free_joints)
    sensors, sensors_left_out = sensors_of(model, actuators, of_free_joints)
    joints = {joint.index: joint for body in bodies for joint in body.joints}
    joints = dict(sorted(joints.items()))
    check_locked([joint for index, joint in joints.items() if index < model.njnt], locked, gears)
    coordinates = {
        index: names.free(joint.name or f"joint_{index + 1}", "joint") for index, joint in joints.items()
    }
    held: dict[int, sp.Symbol] = {}
    for index, joint in joints.items():
        if joint.name in locked:
            q, position = coordinates[index], locked[joint.name]
            about = f"position in which {q} is locked"
            held[index] = numbers.symbol_of_constant(f"{q}_held", position, joint.way_unit, about)
            notes.append(
                f"Joint {q} is locked; a record may hold it elsewhere: constants = {{ {held[index].name} = ... }}."
            )
    for kind, parts, left_out in (
        ("actuator", actuators, drives_left_out),
        ("sensor", sensors, sensors_left_out),
    ):
        left_out += [f"{kind} '{p.name or p.index}': its joint is locked" for p in parts if p.joint in held]
    actuators = [actuator for actuator in actuators if actuator.joint not in held]
    sensors = [sensor for sensor in sensors if sensor.joint not in held]
    moving = [(joint, coordinates[index]) for index, joint in joints.items() if index not in held]
    own = [(joint, q) for joint, q in moving if joint.index < model.njnt]
    drives = [drive_of(one, joints[one.joint], coordinates[one.joint], names, numbers) for one in actuators]
    if not drives and with_drives:
        notes.append("The model has no actuators: a force or torque drives every joint.")
        drives = [plain_drive(joint, q, names) for joint, q in own]
    if not sensors and not of_free_joints:
        notes.append("No sensor reads a joint that moves: the rig reads the position of every one.")
        sensors = [TreeSensor(-1, joint.index, "", 1.0, False) for joint, _ in own]
        of_free_joints = {-1 - i: {name: name for name in own.positions} for i, own in enumerate(free_joints)}
    joint_tables = {q: joint_table(model, joint, q, numbers) for joint, q in own}
    geared: dict[str, Gear] = {}
    for joint, q in own:
        if joint.index in plays:
            play = coordinates[plays[joint.index].index]
            joint_tables[f"{q}_gear"] = gear_table(model, joint, q, play, gears[joint.name], numbers)
            geared[f"{q}_gear"] = Gear(joint.index, play)
    rotors = [armature(model, joint, q, numbers) for joint, q in own]
    if as_it_is is not None and has_constraints(model):
        # What binds bodies goes with all that they move, rotors too, so they stay in MuJoCo.
        rotors = []
    energies = Energies()
    if as_it_is is None:
        called = [names.free(body.name or f"body_{body.index}", "body") for body in bodies]
        symbols = [held.get(index, sp.Symbol(q, real=True)) for index, q in coordinates.items()]
        energies = energies_of(bodies, called, symbols, gravity_of(model), numbers, frozenset(held.values()))
    shown = _sensor_tables(sensors, joints, coordinates, names, numbers)
    beside = sensor_tables(of_free_joints, free_joints, names)
    tables: dict[str, Any] = {
        "name": rig_name,
        "summary": "From a MuJoCo model.",
        "inputs": {drive.reported: drive.control for drive in drives},
        "constants": {},
        "parameters": numbers.parameters,
        "coordinates": {q: {"unit": joint.way_unit} for joint, q in moving}
        | {name: table for joint in free_joints for name, table in joint.coordinates.items()},
        "energy": {"kinetic": _sum(*energies.kinetic, *rotors), "potential": _sum(*energies.potential)},
        "simulator": {}
        if as_it_is is None
        else simulator_table(model, as_it_is, own, free_joints, numbers.fields),
        "signals": {signal: _sum(value) for signal, value in energies.signals.items()},
        "states": {name: state for drive in drives for name, state in drive.states.items()}
        | {name: state for joint in free_joints for name, state in joint.states.items()},
        "initial": start_of(model, {q: joint for joint, q in own}, free_joints, numbers),
        "joints": joint_tables,
        "drives": {drive.name: drive.table for drive in drives},
        "sensors": {name: table for name, _, table in shown} | beside,
    }
    return RigDraft(
        with_known_constants(tables, numbers.constants),
        {q: joint.index for joint, q in own},
        geared,
        {drive.name: drive.index for drive in drives},
        {drive.reported: drive.control_index for drive in drives},
        {name: sensor.index for name, sensor, _ in shown} | dict.fromkeys(beside, -1),
        numbers.fields,
        numbers.values,
        (*left_out_of(model, as_it_is=as_it_is is not None), *drives_left_out, *sensors_left_out),
        tuple(notes),
        {symbol.name: LockedJoint(index, locked[joints[index].name]) for index, symbol in held.items()},
        free_joints,
    )


def with_known_constants(tables: Mapping[str, Any], constants: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a rig with those constants that they read, and without tables that are empty."""
    read = set(_words(value for key, value in tables.items() if key != "constants"))
    known = {name: table for name, table in constants.items() if name in read}
    return {key: value for key, value in {**tables, "constants": known}.items() if value != {}}


def _words(values: Iterable[Any]) -> Iterable[str]:
    for value in values:
        if isinstance(value, Mapping):
            yield from _words(value.values())
        elif isinstance(value, str):
            yield from re.findall(r"\w+", value)


def _sensor_tables(
    sensors: Sequence[TreeSensor],
    joints: Mapping[int, TreeJoint],
    coordinates: Mapping[int, str],
    names: Names,
    numbers: DeclaredNumbers,
) -> list[tuple[str, TreeSensor, dict[str, Any]]]:
    found = []
    for sensor in sensors:
        q, unit = coordinates[sensor.joint], joints[sensor.joint].way_unit
        what = ("position", "velocity") if joints[sensor.joint].slides else ("angle", "speed")
        name = names.free(sensor.name or f"{q}_{what[sensor.is_rate]}", "sensor")
        factor = numbers.factor(f"{name}_factor", sensor.factor, f"reading of {name} per motion of the joint")
        reads, own = (f"d({q})", f"{unit}/s") if sensor.is_rate else (q, unit)
        found.append((name, sensor, {"reads": f"{factor}{reads}", "unit": own}))
    return found


def _sum(*terms: sp.Expr) -> str:
    """Return a sum as an expression of a rig file."""
    return str(sp.Add(*terms)).replace("**", "^")


def rig_text(draft: RigDraft, source: str, folder: Path) -> str:
    """Return the text of a rig file."""
    with needing("Writing a rig file", "tomli-w", "mujoco"):
        import tomli_w
    lines = [f"Written by rigsight init from {source}.", *draft.notes]
    if draft.left_out:
        lines += ["Not taken over:", *(f"- {what}" for what in draft.left_out)]
    head = "\n".join(f"# {line}" for line in "\n".join(lines).split("\n"))
    tables = dict(draft.tables)
    if draft.is_as_it_is:
        beside = Path(os.path.relpath(tables["simulator"]["file"], folder.resolve())).as_posix()
        tables["simulator"] = {**tables["simulator"], "file": beside}
    # TOML forbids some signs in comments.
    plain = "".join(sign if sign in "\n\t" or sign.isprintable() else " " for sign in head)
    return f"{plain}\n\n{tomli_w.dumps(tables)}"


def simulator_table(
    model: mujoco.MjModel,
    file: str,
    joints: Sequence[tuple[TreeJoint, str]],
    free_joints: Sequence[FreeJoint],
    fields: Mapping[str, tuple[Field, ...]],
) -> dict[str, Any]:
    """Return the table."""
    called = {joint.index: joint.name for joint, _ in joints} | {own.index: own.name for own in free_joints}
    nameless = next((index for index, name in called.items() if not name), None)
    if nameless is not None:
        raise InputError(
            f"joint number {nameless} has no name, which is needed to access it in MuJoCo; give it one"
        )
    rotors = {name: own[0].index for name, own in fields.items() if own[0].attribute == "armature"}
    constrained = has_constraints(model)
    moving, turned = names_in_simulator(free_joints)
    table = {
        "kind": "mujoco",
        "file": file,
        "without_armature": bool(rotors) and not constrained,
        "coordinates": {q: joint.name for joint, q in joints if joint.name != q} | moving,
        "states": turned,
        "parameters": {name: f"dof_armature {called[i]}" for name, i in rotors.items() if constrained},
    }
    return {key: value for key, value in table.items() if value}


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A robot's model with its rig."""

    spec: mujoco.MjSpec  # what the file says; may be changed
    model: mujoco.MjModel  # compiled
    draft: RigDraft  # its rig file


def read_robot(
    path: Path,
    gears: Mapping[str, float] | None = None,
    locked: Mapping[str, float] | None = None,
    *,
    as_it_is: bool = False,
) -> RobotFile:
    """Read an MJCF or URDF file; a URDF, which has no actuators, gets a force or torque at every joint."""
    spec = load_spec(path)
    model = spec.compile()
    try:
        draft = draft_rig(
            model,
            path.stem,
            with_drives=path.suffix.lower() == ".urdf",
            gears=gears,
            locked=locked,
            as_it_is=path.resolve().as_posix() if as_it_is else None,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return RobotFile(spec, model, draft)

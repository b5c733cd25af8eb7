"""Parameters and effects of a model -> the original MuJoCo model, as far as MuJoCo has fields for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.effects import Effect, kind_of
from rigsight.errors import InputError
from rigsight.robots.draft import Gear, RigDraft, RobotFile, read_robot
from rigsight.robots.effect_fields import EFFECT_FIELDS
from rigsight.robots.tables import Field
from rigsight.simulate.model import Model

if TYPE_CHECKING:
    import mujoco


_IMPEDANCE = 0.01
"""Of the limit of a joint: with MuJoCo's own, 0.9 to 0.95, what moves would seem ten to twenty times as heavy at the limit."""


_SAME = 1e-12
"""Relative difference below which a number is the one that the file has."""


@dataclass(frozen=True)
class WrittenBack:
    """A MuJoCo model with the parameter values and effects of another model."""

    text: str  # MJCF
    written: tuple[str, ...]  # descriptions of the changed fields
    without_field: tuple[str, ...]  # descriptions of what MuJoCo has no field for


@dataclass(frozen=True)
class WrittenModel(WrittenBack):
    """A MuJoCo model that was written, ready to run."""

    model: mujoco.MjModel  # compiled
    draft: RigDraft  # how its parts are called in the rig


def write_back(model: Model, source: Path) -> WrittenModel:
    """Return the MuJoCo model of a file with the numbers and effects of a rig that was made from it."""
    robot = read_for(model, source)
    structure = model.structure
    own = frozenset(structure.parameter_name(e, p.name) for e in structure.effects for p in e.parameters)
    writer = _Writer(robot, own)
    for place, gear in robot.draft.gears.items():
        writer.write_gear(place, gear, model)
    for name, value in model.values.items():
        writer.write_number(name, value)
    for effect in model.effects:
        writer.write_effect(effect, model)
    return writer.finished(source)


def read_for(model: Model, source: Path) -> RobotFile:
    """Return the robot of a file with the gears that a rig which was made from it has."""
    if model.structure.rig.mechanism.bodies is not None:
        return _checked(model, read_robot(source, as_it_is=True), source)
    robot = read_robot(source)
    places = {joint.name for joint in model.structure.rig.mechanism.joints}
    gears = {
        robot.model.joint(index).name: model.values[f"{place}_gear_stiffness"]
        for place, index in robot.draft.joints.items()
        if f"{place}_gear" in places and f"{place}_gear_stiffness" in model.values
    }
    # A joint that is no place of the rig may be a constant of it.
    absent = {robot.model.joint(i).name: 0.0 for q, i in robot.draft.joints.items() if q not in places}
    locked: dict[str, float] = {}
    if 0 < len(absent) < len(robot.draft.joints):
        locks = read_robot(source, gears, absent).draft.locked
        locked = {
            robot.model.joint(own.joint).name: model.values[name]
            for name, own in locks.items()
            if name in model.values
        }
    if gears or locked:
        robot = read_robot(source, gears, locked)
    return _checked(model, robot, source)


def _checked(model: Model, robot: RobotFile, source: Path) -> RobotFile:
    """Return the robot if it has all that the rig of a model has."""
    mechanism, draft = model.structure.rig.mechanism, robot.draft
    for what, parts, known in (
        ("joint", mechanism.joints, {**draft.joints, **draft.gears}),
        ("drive", mechanism.drives, draft.drives),
        ("sensor", mechanism.sensors, draft.sensors),
    ):
        missing = [part.name for part in parts if part.name not in known]
        if missing:
            raise InputError(
                f"The model's rig has a {what} '{missing[0]}', but {source} has none of that name "
                f"({', '.join(known) or 'none at all'}). Give the file from which rigsight init --mjcf made the rig."
            )
    return robot


class _Writer:
    def __init__(self, robot: RobotFile, of_effects: frozenset[str]) -> None:
        spec, self._compiled, self._draft = robot.spec, robot.model, robot.draft
        self._spec = spec
        kinds = {
            "joint": spec.joints,
            "actuator": spec.actuators,
            "sensor": spec.sensors,
            "body": spec.bodies,
        }
        self._elements: Mapping[str, Mapping[int, Any]] = {
            kind: {element.id: element for element in elements} for kind, elements in kinds.items()
        }
        tables = {**robot.draft.tables.get("constants", {}), **robot.draft.tables["parameters"]}
        self._defaults = {name: float(table["default"]) for name, table in tables.items()}
        self._of_effects = of_effects
        self._written: list[str] = []
        self._without_field: list[str] = []

    def write_number(self, name: str, value: float) -> None:
        """Write a parameter or constant that differs from the file's, or say that it has no field: a length, an inertia."""
        fields, before = self._draft.fields.get(name, ()), self._defaults.get(name)
        if name in self._of_effects or (fields and fields[0].element == "gear"):
            return
        if before is not None and math.isclose(before, value, rel_tol=_SAME, abs_tol=0.0):
            return
        if not fields:
            was = "" if before is None else f", {before:g} in the file"
            self._without_field.append(f"{name} = {value:g}{was}")
            return
        for field in fields:
            self._set(field, value)
        first = fields[0]
        self._written.append(
            f"{self._called(first.element, first.index)} {first.attribute}: {before:g} -> {value:g}"
        )

    def _set(self, field: Field, value: float) -> None:
        element = self._elements[field.element][field.index]
        number = field.sign * value
        if field.element == "body":
            self._set_mass(element, field.index, number)
        elif field.attribute == "springref" and self._in_degrees(field.index):
            element.springref = math.degrees(number)
        elif isinstance(getattr(element, field.attribute), float):
            setattr(element, field.attribute, number)
        else:
            getattr(element, field.attribute)[field.entry] = number

    def _in_degrees(self, joint: int) -> bool:
        import mujoco

        hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
        return bool(self._spec.compiler.degree) and int(self._compiled.jnt_type[joint]) == hinge

    def _set_mass(self, body: Any, index: int, mass: float) -> None:
        """Give a body a mass, with center and inertia as they were: its shapes no longer say them."""
        body.explicitinertial = True
        body.mass = mass
        body.ipos[:], body.iquat[:] = self._compiled.body_ipos[index], self._compiled.body_iquat[index]
        body.inertia[:] = self._compiled.body_inertia[index]
        body.fullinertia[:] = [math.nan, 0.0, 0.0, 0.0, 0.0, 0.0]

    def write_gear(self, place: str, gear: Gear, model: Model) -> None:
        first = self._elements["joint"][gear.joint]
        at_places = (in_words(effect, model) for effect in model.effects)
        play = next((own["g"] for kind, at, own, _ in at_places if (kind, at) == ("free_play", place)), 0.0)
        added = add_second_joint(self._spec, first, place, model.values, play)
        reported = f", range +-{play:.4g} (free_play at {place})" if play > 0.0 else ""
        self._written.append(f"{added}{reported}")

    def write_effect(self, effect: Effect, model: Model) -> None:
        kind, place, values, reported = in_words(effect, model)
        if kind == "free_play" and place in self._draft.gears:
            return
        field = EFFECT_FIELDS.get(kind)
        places = {"joint": self._draft.joints, "actuator": self._draft.drives, "sensor": self._draft.sensors}
        index = -1 if field is None else places[field.element].get(place, -1)
        if field is None or index < 0:
            self._without_field.append(reported)
            return
        refused = field.write(self._elements[field.element][index], values, self._spec)
        if refused is None:
            self._written.append(f"{self._called(field.element, index)} {field.attribute}: {reported}")
        else:
            self._without_field.append(f"{reported}: {refused}")

    def _called(self, element: str, index: int) -> str:
        return f"{element} '{self._elements[element][index].name or index}'"

    def finished(self, source: Path) -> WrittenModel:
        try:
            model = self._spec.compile()
            text = self._spec.to_xml()
        except ValueError as error:
            raise InputError(f"{source}: MuJoCo rejects it with the new values: {error}") from None
        written, without_field = tuple(self._written), tuple(self._without_field)
        lines = [f"Written by rigsight export from {source.name}.", *written]
        lines += [f"MuJoCo has no field for {line}" for line in without_field]
        # An XML comment must not contain two hyphens in a row.
        comment = "\n".join(lines).replace("--", "- -")
        return WrittenModel(f"<!-- {comment} -->\n{text}", written, without_field, model, self._draft)


def in_words(effect: Effect, model: Model) -> tuple[str, str, dict[str, float], str]:
    """Return the kind of an effect of a model, its place and values, and all of these in words."""
    place, kind = model.structure.rig.acts_at(effect), kind_of(effect.name)
    values = model.structure.values_of(effect, model.values)
    numbers = ", ".join(f"{own} = {value:.4g}" for own, value in values.items())
    return kind, place, values, f"{kind} at {place} ({numbers})"


def with_gears(spec: mujoco.MjSpec, draft: RigDraft) -> mujoco.MjModel:
    """Return the compiled model with the second joint of each gear, as a spring."""
    joints = {joint.id: joint for joint in spec.joints}
    for place, gear in draft.gears.items():
        add_second_joint(spec, joints[gear.joint], place, draft.values, 0.0)
    return spec.compile()


def add_second_joint(
    spec: mujoco.MjSpec, first: Any, place: str, values: Mapping[str, float], play: float
) -> str:
    """Add what lies between a rotor and its body to a MuJoCo model, and return it in words."""
    # Without play it is a spring. With play the spring acts beyond a range, as the limit of the joint, whose stiffness MuJoCo
    # counts by the inertia that it moves.
    import mujoco

    name = f"{first.name}_play"
    stiffness, damping = (values[f"{place}_{what}"] for what in ("stiffness", "damping"))
    added = f"joint '{name}' behind '{first.name}': stiffness {stiffness:.4g}, damping {damping:.4g}"
    second = first.parent.add_joint(name=name, type=first.type, axis=list(first.axis), pos=list(first.pos))
    if play <= 0.0:
        second.stiffness[0], second.damping[0] = stiffness, damping
        return added
    in_degrees = bool(spec.compiler.degree) and first.type == mujoco.mjtJoint.mjJNT_HINGE
    half = math.degrees(play) if in_degrees else play
    second.range[:] = (-half, half)
    second.limited = 1
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    mass = np.zeros((compiled.nv, compiled.nv))
    mujoco.mj_fullM(compiled, data, mass)
    dof = int(compiled.jnt_dofadr[compiled.joint(name).id])
    moved = 1.0 / float(np.linalg.inv(mass)[dof, dof])
    # An acceleration is (1 - d) times what it is without the limit, less what the limit pulls: a spring for a small impedance d.
    free = 1.0 - _IMPEDANCE
    second.solimp_limit[:2] = (_IMPEDANCE, _IMPEDANCE)
    second.solref_limit[:] = (-stiffness * free / moved, -damping * free / moved)
    return added

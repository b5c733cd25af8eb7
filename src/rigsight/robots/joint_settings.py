"""Parameter values and effects of a model -> what a simulator of robots can set of each joint and its controller.

The settings of Isaac Lab are its actuators, a group for each joint, as of Isaac Lab 3.0 (`isaaclab.actuators.ActuatorBaseCfg`,
`DelayedPDActuatorCfg`). Friction of joints is there since Isaac Sim 5.0; 2.x calls ``actuator_effort_limit`` ``effort_limit``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigsight.effects import Effect
from rigsight.errors import check_in_range, needing
from rigsight.robots.draft import RobotFile
from rigsight.robots.tables import Field
from rigsight.robots.writing_back import WrittenBack, in_words, read_for
from rigsight.simulate.model import Model

_FIELDS: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("joint", "damping"): ("viscous_friction",),
    ("joint", "frictionloss"): ("friction", "dynamic_friction"),
    ("joint", "armature"): ("armature",),
}
"""Element and attribute of MuJoCo -> the settings that say the same."""
_FORCE_RANGE = ("actuator", "forcerange")
_NO_FIELD = Field("", -1, "")
_STEPS = (1e-6, 1.0)
"""Shortest and longest step of the physics [s]."""


@dataclass(frozen=True)
class SettingsOfJoint:
    """What is set of one joint."""

    name: str  # as the robot's file calls it
    slides: bool  # true for a slide, false for a hinge
    # In SI, at the joint: gains ``stiffness``, ``damping`` and ``integral_gain`` of a position controller, its ``delay`` and
    # ``effort_limit``; ``viscous_friction``, ``friction`` (at rest), ``dynamic_friction`` and ``armature``.
    values: Mapping[str, float]


@dataclass(frozen=True)
class JointSettings:
    """What is set of all joints of a robot."""

    joints: tuple[SettingsOfJoint, ...]
    written: tuple[str, ...]  # descriptions of what is in the settings
    without_field: tuple[str, ...]  # descriptions of what no setting says
    step: float  # of the physics [s]


def joint_settings(
    model: Model, source: Path, step: float | None = None, *, has_integral_gain: bool = False
) -> JointSettings:
    """Return the settings for a model that was made from an MJCF or URDF file; the step of the physics is the file's."""
    import mujoco

    if step is not None:
        check_in_range("--step", step, *_STEPS, "s")
    robot = read_for(model, source)
    settings = _Settings(model, robot)
    settings.add_gains()
    settings.add_numbers()
    settings.add_force_limits()
    for effect in model.effects:
        settings.add_effect(effect, has_integral_gain)
    slides = robot.model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE)
    joints = tuple(
        SettingsOfJoint(
            robot.model.joint(index).name or place, bool(slides[index]), settings.of_joints[index]
        )
        for place, index in robot.draft.joints.items()
    )
    step = float(robot.model.opt.timestep) if step is None else step
    return JointSettings(joints, tuple(settings.written), tuple(settings.without_field), step)


class _Settings:
    """Settings of each joint, by its number, as they are found."""

    def __init__(self, model: Model, robot: RobotFile) -> None:
        self._model, self._draft, self._compiled = model, robot.draft, robot.model
        self.of_joints: dict[int, dict[str, float]] = {index: {} for index in robot.draft.joints.values()}
        self.written: list[str] = []
        self.without_field: list[str] = []
        joints, gears = robot.model.actuator_trnid[:, 0], robot.model.actuator_gear[:, 0]
        drives = {drive: index for drive, index in robot.draft.drives.items() if index >= 0}
        self._gains: set[str] = set()
        """Names of what `add_gains` added."""
        self._drives = {drive: (int(joints[i]), float(gears[i]), i) for drive, i in drives.items()}

    def _add(self, joint: int, setting: str, value: float) -> None:
        group = self.of_joints[joint]
        group[setting] = group.get(setting, 0.0) + value

    def add_gains(self) -> None:
        """Add the gains of position controllers, at the joint: behind a gear they count by its square."""
        for drive, (joint, gear, _) in self._drives.items():
            for name, setting in ((f"{drive}_kp", "stiffness"), (f"{drive}_kv", "damping")):
                if name in self._model.values:
                    self.of_joints[joint][setting] = gear**2 * self._model.values[name]
                    self.written.append(f"{setting} of {drive}")
                    self._gains.add(name)

    def add_numbers(self) -> None:
        known = self._draft.tables.get("constants", {})
        for name, value in self._model.values.items():
            field = self._draft.fields.get(name, (_NO_FIELD,))[0]
            at = (field.element, field.attribute)
            if at == _FORCE_RANGE or name in self._gains:
                continue
            if at in _FIELDS and not field.entry:
                for setting in _FIELDS[at]:
                    self._add(field.index, setting, value)
                self.written.append(f"{name} = {value:.4g}")
            elif name in self._draft.values or (name in known and value != known[name]["default"]):
                self.without_field.append(f"{name} = {value:.4g}")

    def add_force_limits(self) -> None:
        """Add the upper end of each drive's range of forces: the setting is the same limit in both directions."""
        for drive, (joint, gear, index) in self._drives.items():
            if not self._compiled.actuator_forcelimited[index]:
                continue
            # An end at zero is no constant of the rig.
            ends = dict(enumerate(map(float, self._compiled.actuator_forcerange[index])))
            names = {0: f"lower limit of {drive}", 1: f"upper limit of {drive}"}
            for name, value in self._model.values.items():
                field = self._draft.fields.get(name, (_NO_FIELD,))[0]
                if (field.element, field.attribute) == _FORCE_RANGE and field.index == index:
                    ends[field.entry], names[field.entry] = value, name
            weakest, strongest = (f"{names[end]} = {ends[end]:.4g}" for end in (0, 1))
            if ends[1] > 0.0:
                self.of_joints[joint]["effort_limit"] = abs(gear) * ends[1]
            (self.written if ends[1] > 0.0 else self.without_field).append(strongest)
            if ends[0] != -ends[1]:
                self.without_field.append(f"{weakest}, unlike the upper end")

    def add_effect(self, effect: Effect, has_integral_gain: bool) -> None:
        kind, place, values, reported = in_words(effect, self._model)
        driven, gear, _ = self._drives.get(place, (-1, 1.0, -1))
        joint, kp = self._draft.joints.get(place, driven), self._model.values.get(f"{place}_kp", 0.0)
        match kind:
            case "coulomb_friction" if joint >= 0:
                self._add(joint, "friction", values["T_c"])
                self._add(joint, "dynamic_friction", values["T_c"])
            case "stribeck_friction" if joint >= 0:
                self._add(joint, "friction", values["T_s"])
                self._add(joint, "dynamic_friction", values["T_c"])
                self.without_field.append(f"w_s = {values['w_s']:.4g} of {kind} at {place}")
            case "input_delay" if joint >= 0:
                self._add(joint, "delay", values["T_d"])
            case "integral_action" if driven >= 0 and kp > 0.0 and has_integral_gain:
                self._add(joint, "integral_gain", gear**2 * kp * values["r_i"])
            case _:
                self.without_field.append(reported)
                return
        self.written.append(reported)


def isaac_settings(model: Model, source: Path, step: float | None = None) -> WrittenBack:
    """Return the YAML of Isaac Lab's actuators for a model that was made from an MJCF or URDF file."""
    with needing("Writing for Isaac Lab", "PyYAML", "mujoco"):
        import yaml
    settings = joint_settings(model, source, step)
    groups: dict[str, dict[str, Any]] = {}
    for joint in settings.joints:
        groups[joint.name] = {"joint_names_expr": [joint.name]}
        for name, value in joint.values.items():
            if name == "delay":
                steps = round(value / settings.step)
                groups[joint.name] |= {"min_delay": steps, "max_delay": steps}
            else:
                own = "actuator_effort_limit" if name == "effort_limit" else name
                groups[joint.name][own] = value
    head = [
        f"Written by rigsight export from {source.name}, for Isaac Lab 3.0.",
        f"Delays are steps of the physics of {settings.step:g} s each.",
        *(f"Isaac Lab has no setting for {what}" for what in settings.without_field),
    ]
    text = "".join(f"# {line}\n" for line in head) + yaml.safe_dump({"actuators": groups}, sort_keys=False)
    return WrittenBack(text, settings.written, settings.without_field)

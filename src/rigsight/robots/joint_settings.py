"""Parameter values and effects of a model -> what a simulator of robots can set of each joint and its controller.

The settings of Isaac Lab are its actuators, a group for each joint, as of Isaac Lab 3.0 (`isaaclab.actuators.ActuatorBaseCfg`,
`DelayedPDActuatorCfg`). Friction of joints is there since Isaac Sim 5.0; 2.x calls ``actuator_effort_limit`` ``effort_limit``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigsight.effects import kind_of
from rigsight.errors import InputError, check_in_range
from rigsight.robots.declared_numbers import Field
from rigsight.robots.draft import RigDraft
from rigsight.robots.writing_back import WrittenBack, read_for
from rigsight.simulate.model import Model

_FIELDS: Mapping[tuple[str, str], tuple[str, ...]] = {
    ("joint", "damping"): ("viscous_friction",),
    ("joint", "frictionloss"): ("friction", "dynamic_friction"),
    ("joint", "armature"): ("armature",),
}
"""Element and attribute of MuJoCo -> the settings that say the same."""
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


@dataclass
class _Settings:
    """Settings of each joint as they are found."""

    by_joint: dict[int, dict[str, float]]
    written: list[str]
    without_field: list[str]

    def add(self, joint: int, setting: str, value: float) -> None:
        group = self.by_joint[joint]
        group[setting] = group.get(setting, 0.0) + value


def joint_settings(
    model: Model, source: Path, step: float | None = None, *, has_integral_gain: bool = False
) -> JointSettings:
    """Return the settings for a model that was made from an MJCF or URDF file; the step of the physics is the file's."""
    import mujoco

    if step is not None:
        check_in_range("--step", step, *_STEPS, "s")
    robot = read_for(model, source)
    compiled, draft = robot.model, robot.draft
    settings = _Settings({index: {} for index in draft.joints.values()}, [], [])
    drives = {
        drive: (int(compiled.actuator_trnid[index, 0]), float(compiled.actuator_gear[index, 0]))
        for drive, index in draft.drives.items()
        if index >= 0
    }
    for drive, (joint, gear) in drives.items():
        _gains(model, drive, joint, gear, settings)
    _numbers(model, draft, settings)
    _force_limits(model, draft, compiled, settings)
    _effects(model, draft, drives, settings, has_integral_gain)
    slides = compiled.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE)
    joints = tuple(
        SettingsOfJoint(compiled.joint(index).name or place, bool(slides[index]), settings.by_joint[index])
        for place, index in draft.joints.items()
    )
    step = float(compiled.opt.timestep) if step is None else step
    return JointSettings(joints, tuple(settings.written), tuple(settings.without_field), step)


def _gains(model: Model, drive: str, joint: int, gear: float, settings: _Settings) -> None:
    """Add the gains of a position controller, at the joint: behind a gear they count by its square."""
    for name, setting in ((f"{drive}_kp", "stiffness"), (f"{drive}_kv", "damping")):
        if name in model.values:
            settings.by_joint[joint][setting] = gear**2 * model.values[name]
            settings.written.append(f"{setting} of {drive}")


def _force_limits(model: Model, draft: RigDraft, compiled: Any, settings: _Settings) -> None:
    """Add the upper end of each drive's range of forces: the setting is the same limit in both directions."""
    for drive, index in draft.drives.items():
        if index < 0 or not compiled.actuator_forcelimited[index]:
            continue
        # An end at zero is no constant of the rig.
        ends = dict(enumerate(map(float, compiled.actuator_forcerange[index])))
        names = {0: f"lower limit of {drive}", 1: f"upper limit of {drive}"}
        for name, value in model.values.items():
            field = draft.fields.get(name, (None,))[0]
            if field is not None and _limits_force(field) and field.index == index:
                ends[field.entry], names[field.entry] = value, name
        weakest, strongest = (f"{names[end]} = {ends[end]:.4g}" for end in (0, 1))
        if ends[1] > 0.0:
            gear = abs(float(compiled.actuator_gear[index, 0]))
            joint = int(compiled.actuator_trnid[index, 0])
            settings.by_joint[joint]["effort_limit"] = gear * ends[1]
            settings.written.append(strongest)
        else:
            settings.without_field.append(strongest)
        if ends[0] != -ends[1]:
            settings.without_field.append(f"{weakest}, unlike the upper end")


def _limits_force(field: Field) -> bool:
    return (field.element, field.attribute) == ("actuator", "forcerange")


def _numbers(model: Model, draft: RigDraft, settings: _Settings) -> None:
    known = draft.tables.get("constants", {})
    for name, value in model.values.items():
        field = draft.fields.get(name, (None,))[0]
        setting = None if field is None or field.entry else _FIELDS.get((field.element, field.attribute))
        if field is not None and _limits_force(field):
            continue
        if setting is not None and field is not None:
            for one in setting:
                settings.add(field.index, one, value)
            settings.written.append(f"{name} = {value:.4g}")
        elif name in draft.values or (name in known and value != known[name]["default"]):
            settings.without_field.append(f"{name} = {value:.4g}")


def _effects(
    model: Model,
    draft: RigDraft,
    drives: Mapping[str, tuple[int, float]],
    settings: _Settings,
    has_integral_gain: bool,
) -> None:
    structure = model.structure
    for effect in model.effects:
        place, kind = structure.rig.acts_at(effect), kind_of(effect.name)
        values = structure.values_of(effect, model.values)
        reported = f"{kind} at {place} ({', '.join(f'{own} = {value:.4g}' for own, value in values.items())})"
        driven, gear = drives.get(place, (-1, 1.0))
        joint, kp = draft.joints.get(place, driven), model.values.get(f"{place}_kp", 0.0)
        match kind:
            case "coulomb_friction" if joint >= 0:
                for own in ("friction", "dynamic_friction"):
                    settings.add(joint, own, values["T_c"])
            case "stribeck_friction" if joint >= 0:
                settings.add(joint, "friction", values["T_s"])
                settings.add(joint, "dynamic_friction", values["T_c"])
                settings.without_field.append(f"w_s = {values['w_s']:.4g} of {kind} at {place}")
            case "input_delay" if joint >= 0:
                settings.add(joint, "delay", values["T_d"])
            case "integral_action" if driven >= 0 and kp > 0.0 and has_integral_gain:
                settings.add(joint, "integral_gain", gear**2 * kp * values["r_i"])
            case _:
                settings.without_field.append(reported)
                continue
        settings.written.append(reported)


def isaac_settings(model: Model, source: Path, step: float | None = None) -> WrittenBack:
    """Return the YAML of Isaac Lab's actuators for a model that was made from an MJCF or URDF file."""
    try:
        import yaml
    except ImportError:
        raise InputError(
            "Writing for Isaac Lab needs PyYAML, which is not installed: pip install 'rigsight[mujoco]'."
        ) from None
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

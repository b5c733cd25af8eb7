"""Parameter values and effects of a model -> a layer of USD that overrides a robot's joints and their drives.

Attributes are those of UsdPhysics (`PhysicsDriveAPI`), of Newton (`newton-usd-schemas` 0.6: `NewtonJointAPI`, `NewtonActuator`)
and of PhysX (`PhysxJointAxisAPI`). All but those of Newton's actuators are per degree at hinges, and in the units of the stage.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigsight.errors import InputError, nearest, needing
from rigsight.records.formats.known import file_size
from rigsight.robots.joint_settings import JointSettings, SettingsOfJoint, joint_settings
from rigsight.robots.writing_back import WrittenBack
from rigsight.simulate.model import Model

_JOINTS = "/Robot/joints"
"""Where joints lie if no stage says where."""
_NEWTON = {"armature": "armature", "viscous_friction": "damping", "dynamic_friction": "friction"}
_PHYSX = {
    "armature": "armature",
    "viscous_friction": "viscousFrictionCoefficient",
    "friction": "staticFrictionEffort",
    "dynamic_friction": "dynamicFrictionEffort",
}
_DRIVE = {"stiffness": "stiffness", "damping": "damping", "effort_limit": "maxForce"}
_ACTUATOR = {"stiffness": "kp", "damping": "kd", "integral_gain": "ki", "effort_limit": "maxEffort"}
"""Settings -> the attributes of each schema that say the same."""
_TARGETS = {"NewtonActuator": "newton:targets", "MjcActuator": "mjc:target"}
"""Types of prims that move joints -> the relationship that names them."""
_PER_MOTION = ("stiffness", "damping", "viscous_friction")
"""Settings that are a force or torque per motion."""


@dataclass(frozen=True)
class _Units:
    """Units of a stage."""

    length: float  # [m]
    mass: float  # [kg]

    def of_joint(self, joint: SettingsOfJoint, setting: str) -> float:
        """Return a setting in the units of the stage."""
        value = joint.values[setting]
        if not joint.slides:
            # Inertias, torques and torques per angle: each goes with mass and the square of length.
            per_degree = math.radians(1.0) if setting in _PER_MOTION else 1.0
            return value * per_degree / (self.mass * self.length**2)
        is_per_length = setting in _PER_MOTION or setting == "armature"
        return value / (self.mass * (1.0 if is_per_length else self.length))


def usd_layer(
    model: Model, source: Path, out: Path, robot: Path | None = None, step: float | None = None
) -> WrittenBack:
    """Return the text of a layer for a model that was made from an MJCF or URDF file.

    Above a stage of the robot the layer has it as its sublayer: it is opened instead of the stage.
    """
    with needing("Writing USD", "usd-core", "usd"):
        from pxr import Sdf, Usd, UsdGeom, UsdPhysics
    settings = joint_settings(model, source, step, has_integral_gain=True)
    layer = Sdf.Layer.CreateAnonymous(".usda") if robot is None else _layer_above(robot)
    stage = Usd.Stage.Open(layer)
    prims = _new(stage, settings) if robot is None else _found(stage, robot, settings)
    units = _Units(UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage))
    for joint in settings.joints:
        _write(prims[joint.name], joint, units, settings.step)
    written = Sdf.Layer.CreateAnonymous(".usda")
    written.TransferContent(layer)
    written.comment = "\n".join(
        [
            f"Written by rigsight export from {source.name}: an override of the joints of a robot.",
            f"Delays are steps of the physics of {settings.step:g} s each.",
            *(f"USD has no attribute for {what}" for what in settings.without_field),
        ]
    )
    if robot is not None:
        beside = Path(os.path.relpath(robot.resolve(), out.resolve().parent)).as_posix()
        written.subLayerPaths[0] = beside if beside.startswith(".") else f"./{beside}"
    return WrittenBack(written.ExportToString(), settings.written, settings.without_field)


def _layer_above(robot: Path) -> Any:
    """Return an empty layer with the units and the default prim of a file, which is its sublayer."""
    from pxr import Sdf, Tf, UsdUtils

    file_size(robot, "the USD file")
    try:
        below = Sdf.Layer.FindOrOpen(str(robot))
    except Tf.ErrorException as error:
        said = "; ".join(" ".join(one.commentary.split()) for one in error.args)
        raise InputError(f"{robot}: USD cannot read it: {said}.") from None
    if below is None:
        raise InputError(f"{robot} is no USD file: name one that ends in .usda, .usdc, .usd or .usdz.")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    UsdUtils.CopyLayerMetadata(below, layer, skipSublayers=True)
    layer.subLayerPaths.append(robot.resolve().as_posix())
    return layer


def _new(stage: Any, settings: JointSettings) -> dict[str, Any]:
    """Return overrides of joints that lie nowhere yet."""
    from pxr import Tf, UsdGeom, UsdPhysics

    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    names = [joint.name for joint in settings.joints]
    prims = {name: stage.OverridePrim(f"{_JOINTS}/{Tf.MakeValidIdentifier(name)}") for name in names}
    stage.SetDefaultPrim(stage.GetPrimAtPath(_JOINTS).GetParent())
    return prims


def _found(stage: Any, robot: Path, settings: JointSettings) -> dict[str, Any]:
    """Return the joints of a stage by the names of the robot's file: of the prim, or as it is displayed."""
    from pxr import Tf, UsdPhysics

    found = {}
    for joint in settings.joints:
        schema = UsdPhysics.PrismaticJoint if joint.slides else UsdPhysics.RevoluteJoint
        known = [prim for prim in stage.Traverse() if prim.IsA(schema)]
        own = (joint.name, Tf.MakeValidIdentifier(joint.name))
        fitting = [p for p in known if p.GetName() in own or p.GetDisplayName() == joint.name]
        if len(fitting) != 1:
            kind = "prismatic" if joint.slides else "revolute"
            names = [prim.GetName() for prim in known]
            said = (
                f"{len(fitting)} {kind} joints '{joint.name}' ({', '.join(str(p.GetPath()) for p in fitting)})"
                if fitting
                else f"no {kind} joint '{joint.name}'.{nearest(joint.name, names)} It has: {', '.join(names) or 'none'}"
            )
            raise InputError(f"{robot} has {said}. Name a USD file of this robot alone, with all its joints.")
        found[joint.name] = fitting[0]
    return found


def _write(prim: Any, joint: SettingsOfJoint, units: _Units, step: float) -> None:
    from pxr import UsdPhysics

    axis = "linear" if joint.slides else "angular"
    shown = {setting: units.of_joint(joint, setting) for setting in joint.values}
    _set(prim, "NewtonJointAPI", "newton", _NEWTON, shown)
    _set(prim, f"PhysxJointAxisAPI:{axis}", f"physxJointAxis:{axis}", _PHYSX, shown)
    if not joint.values.keys() & {*_DRIVE, *_ACTUATOR, "delay"}:
        return
    actuator = _actuator_of(prim)
    if actuator is None and joint.values.keys() & {"delay", "integral_gain"}:
        path = prim.GetPath()
        actuator = prim.GetStage().DefinePrim(path.ReplaceName(f"{path.name}_actuator"), "NewtonActuator")
        actuator.CreateRelationship("newton:targets", custom=False).SetTargets([path])
    if actuator is not None:
        _write_actuator(actuator, joint, step)
        # One of the two moves the joint.
        shown |= {"stiffness": 0.0, "damping": 0.0}
    _set(prim, f"PhysicsDriveAPI:{axis}", f"drive:{axis}:physics", _DRIVE, shown)
    UsdPhysics.DriveAPI(prim, axis).CreateTypeAttr("force")


def _actuator_of(joint: Any) -> Any:
    """Return the actuator of Newton that a stage has at a joint already, or None; one of MuJoCo is refused."""
    for prim in joint.GetStage().Traverse():
        targets = _TARGETS.get(str(prim.GetTypeName()))
        if targets is None or joint.GetPath() not in prim.GetRelationship(targets).GetTargets():
            continue
        if prim.GetTypeName() == "MjcActuator":
            raise InputError(
                f"The USD file has an actuator of MuJoCo at joint '{joint.GetName()}', {prim.GetPath()}, which a drive would "
                "double. Write the model with --to mjcf, and convert what is written to USD."
            )
        return prim
    return None


def _write_actuator(prim: Any, joint: SettingsOfJoint, step: float) -> None:
    """Write an actuator, whose units are SI."""
    from pxr import Sdf

    values = joint.values
    applied = prim.GetPrimTypeInfo().GetAppliedAPISchemas()
    law = "NewtonPIDControlAPI"
    if "integral_gain" not in values and law not in applied:
        law = "NewtonPDControlAPI"
    for other in applied:
        if other.endswith("ControlAPI") and other != law:
            prim.RemoveAppliedSchema(other)
    gains = {own: name for own, name in _ACTUATOR.items() if own != "effort_limit"}
    _set(prim, law, "newton", gains, {"stiffness": 0.0, "damping": 0.0, **values})
    limit = {"effort_limit": _ACTUATOR["effort_limit"]}
    _set(prim, "NewtonMaxEffortClampingAPI", "newton", limit, values)
    if "delay" in values:
        prim.AddAppliedSchema("NewtonActuatorDelayAPI")
        steps = prim.CreateAttribute("newton:delaySteps", Sdf.ValueTypeNames.Int, custom=False)
        steps.Set(round(values["delay"] / step))


def _set(
    prim: Any, schema: str, namespace: str, names: Mapping[str, str], values: Mapping[str, float]
) -> None:
    """Write those settings that a schema has attributes for."""
    from pxr import Sdf

    own = {name: values[setting] for setting, name in names.items() if setting in values}
    if own:
        prim.AddAppliedSchema(schema)
    for name, value in own.items():
        prim.CreateAttribute(f"{namespace}:{name}", Sdf.ValueTypeNames.Float, custom=False).Set(value)

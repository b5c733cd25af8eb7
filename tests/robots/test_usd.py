"""A layer of USD overrides the joints of a robot with the numbers and effects of a model, in the units of its stage."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdPhysics

from rigsight.effects import effect_named, placed
from rigsight.errors import InputError
from rigsight.robots import load_model, usd_layer
from rigsight.robots.draft import draft_rig
from rigsight.simulate import compose
from rigsight.simulate.model import Model

MODELS = Path(__file__).parent / "models"
ARM, CART = MODELS / "two_link_arm.xml", MODELS / "cart_pole.xml"


def model_of(
    robot: Path, values: Mapping[str, float], effects: Mapping[str, Mapping[str, float]] | None = None
) -> Model:
    draft = draft_rig(load_model(robot), robot.stem)
    own = effects or {}
    at_places = [placed(effect_named(name.partition("@")[0]), name.partition("@")[2]) for name in own]
    structure = compose(draft.rig, at_places)
    of_effects = {
        structure.parameter_name(e, name): value for e in at_places for name, value in own[e.name].items()
    }
    defaults = {p.name: p.default for p in (*draft.rig.constants, *draft.rig.parameters)}
    return Model(structure, {**defaults, **values, **of_effects}, "zoh")


def stage_of(
    folder: Path, joints: Mapping[str, type], *, meters: float = 1.0, kilograms: float = 1.0
) -> Path:
    """Write a stage with joints deep in it and gains of its own, which are to be overridden."""
    file = folder / "robot.usda"
    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageMetersPerUnit(stage, meters)
    UsdPhysics.SetStageKilogramsPerUnit(stage, kilograms)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    for name, kind in joints.items():
        joint = kind.Define(stage, f"/World/robot/{name}")
        drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular")
        drive.CreateStiffnessAttr(7.0)
        drive.CreateTargetPositionAttr(3.0)
    stage.Save()
    return file


def written(model: Model, robot: Path, out: Path, stage: Path | None = None, **options: Any) -> Usd.Stage:
    out.write_text(usd_layer(model, robot, out, stage, **options).text, encoding="utf-8")
    opened = Usd.Stage.Open(str(out))
    assert opened.GetCompositionErrors() == []
    return opened


def numbers(prim: Usd.Prim, beginning: str) -> dict[str, float]:
    found = {one.GetName(): one.Get() for one in prim.GetAuthoredAttributes()}
    return {
        name.rpartition(":")[2]: value
        for name, value in found.items()
        if name.startswith(f"{beginning}:") and isinstance(value, float)
    }


REVOLUTE = {"shoulder": UsdPhysics.RevoluteJoint, "elbow": UsdPhysics.RevoluteJoint}


def test_numbers_of_hinges_are_per_degree(tmp_path: Path) -> None:
    model = model_of(ARM, {"shoulder_armature": 0.03}, {"coulomb_friction@elbow": {"T_c": 0.12}})
    stage = written(model, ARM, tmp_path / "out.usda", stage_of(tmp_path, REVOLUTE))
    shoulder, elbow = (stage.GetPrimAtPath(f"/World/robot/{name}") for name in REVOLUTE)
    # 25 N m/rad and 0.5 N m s/rad of the controller, 0.3 N m s/rad of the joint.
    drive = numbers(shoulder, "drive:angular:physics")
    assert drive["stiffness"] == pytest.approx(0.4363323, rel=1e-6)
    assert drive["damping"] == pytest.approx(0.008726646, rel=1e-6)
    assert (drive["maxForce"], drive["targetPosition"]) == (40.0, 3.0)
    assert numbers(shoulder, "newton") == pytest.approx({"armature": 0.03, "damping": 0.005235988}, rel=1e-6)
    assert numbers(elbow, "newton")["friction"] == pytest.approx(0.12, rel=1e-6)
    friction = numbers(elbow, "physxJointAxis:angular")
    assert friction["staticFrictionEffort"] == friction["dynamicFrictionEffort"] == pytest.approx(0.12)
    assert friction["viscousFrictionCoefficient"] * 180.0 / math.pi == pytest.approx(0.15, rel=1e-6)
    assert {"NewtonJointAPI", "PhysxJointAxisAPI:angular"} <= set(
        elbow.GetPrimTypeInfo().GetAppliedAPISchemas()
    )
    # The elbow's motor has no gains: what the stage has stays.
    assert numbers(elbow, "drive:angular:physics")["stiffness"] == 7.0
    assert stage.GetDefaultPrim().GetPath() == Sdf.Path("/World")
    assert stage.GetRootLayer().subLayerPaths[0] == "./robot.usda"


def test_what_has_no_attribute_is_listed_as_for_other_simulators(tmp_path: Path) -> None:
    found = usd_layer(model_of(ARM, {}, {"cubic_stiffness@elbow": {"k_3": 0.4}}), ARM, tmp_path / "out.usda")
    assert "cubic_stiffness at elbow (k_3 = 0.4)" in found.without_field
    assert all(
        f"USD has no attribute for {one}\n" in f"{found.text}\n".replace('"', "\n")
        for one in found.without_field
    )


def test_numbers_are_in_the_units_of_the_stage(tmp_path: Path) -> None:
    """A stage in centimeters and grams: a hinge and a slide."""
    joints = {"slider": UsdPhysics.PrismaticJoint, "hinge": UsdPhysics.RevoluteJoint}
    model = model_of(CART, {}, {"coulomb_friction@hinge": {"T_c": 0.02}})
    stage = written(
        model, CART, tmp_path / "out.usda", stage_of(tmp_path, joints, meters=0.01, kilograms=0.001)
    )
    slider, hinge = (numbers(stage.GetPrimAtPath(f"/World/robot/{name}"), "newton") for name in joints)
    # 0.2 N are 2e4 g cm/s^2 and 0.5 N s/m are 500 g/s; 0.02 N m are 2e5 g cm^2/s^2.
    assert (slider["friction"], slider["damping"]) == pytest.approx((2e4, 500.0), rel=1e-6)
    assert hinge["friction"] == pytest.approx(2e5, rel=1e-6)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01


@pytest.mark.parametrize("has_actuator", [False, True])
def test_a_delay_makes_an_actuator_of_newton_that_alone_moves_the_joint(
    tmp_path: Path, has_actuator: bool
) -> None:
    file = stage_of(tmp_path, REVOLUTE)
    path = "/World/robot/shoulder_actuator"
    if has_actuator:
        stage = Usd.Stage.Open(str(file))
        path = "/World/servo"
        servo = stage.DefinePrim(path, "NewtonActuator")
        servo.AddAppliedSchema("NewtonPDControlAPI")
        servo.CreateRelationship("newton:targets").SetTargets(["/World/robot/shoulder"])
        stage.Save()
    effects = {"input_delay@shoulder_motor": {"T_d": 0.0125}, "integral_action@shoulder_motor": {"r_i": 3.0}}
    stage = written(model_of(ARM, {}, effects), ARM, tmp_path / "out.usda", file, step=0.005)
    servos = [prim for prim in stage.Traverse() if prim.GetTypeName() == "NewtonActuator"]
    assert [str(prim.GetPath()) for prim in servos] == [path]
    # Actuators of Newton are in SI.
    assert numbers(servos[0], "newton") == pytest.approx(
        {"kp": 25.0, "kd": 0.5, "ki": 75.0, "maxEffort": 40.0}
    )
    assert servos[0].GetAttribute("newton:delaySteps").Get() == 2
    assert [
        one for one in servos[0].GetPrimTypeInfo().GetAppliedAPISchemas() if one.endswith("ControlAPI")
    ] == ["NewtonPIDControlAPI"]
    assert servos[0].GetRelationship("newton:targets").GetTargets() == [Sdf.Path("/World/robot/shoulder")]
    drive = numbers(stage.GetPrimAtPath("/World/robot/shoulder"), "drive:angular:physics")
    assert (drive["stiffness"], drive["damping"]) == (0.0, 0.0)


def test_without_a_stage_joints_are_overridden_by_name(tmp_path: Path) -> None:
    stage = written(model_of(ARM, {}), ARM, tmp_path / "out.usda")
    assert {str(p.GetPath()) for p in stage.GetPrimAtPath("/Robot/joints").GetAllChildren()} == {
        "/Robot/joints/shoulder",
        "/Robot/joints/elbow",
    }
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        ({"shoulder": UsdPhysics.RevoluteJoint}, "no revolute joint 'elbow'"),
        ({**REVOLUTE, "elbow": UsdPhysics.PrismaticJoint}, "no revolute joint 'elbow'"),
        ({**REVOLUTE, "left/elbow": UsdPhysics.RevoluteJoint}, "2 revolute joints 'elbow'"),
    ],
)
def test_joints_that_the_stage_lacks_or_has_twice_are_one_message(
    tmp_path: Path, joints: Mapping[str, type], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        usd_layer(model_of(ARM, {}), ARM, tmp_path / "out.usda", stage_of(tmp_path, joints))


def test_a_drive_beside_an_actuator_of_mujoco_is_refused(tmp_path: Path) -> None:
    file = stage_of(tmp_path, REVOLUTE)
    stage = Usd.Stage.Open(str(file))
    servo = stage.DefinePrim("/World/Physics/servo", "MjcActuator")
    servo.CreateRelationship("mjc:target").SetTargets(["/World/robot/shoulder"])
    stage.Save()
    with pytest.raises(InputError, match="/World/Physics/servo"):
        usd_layer(model_of(ARM, {}), ARM, tmp_path / "out.usda", file)


@pytest.mark.parametrize("name", ["robot.usda", "robot.txt"])
def test_a_file_that_is_no_usd_is_refused(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.write_text("nothing", encoding="utf-8")
    with pytest.raises(InputError, match=f"{name}: USD cannot read it"):
        usd_layer(model_of(ARM, {}), ARM, tmp_path / "out.usda", file)

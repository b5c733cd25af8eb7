"""A model with free and ball joints runs as it is: by the equations of the rig it moves as MuJoCo moves it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.identify.rig_equations import equations_of
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_tables
from rigsight.robots import RobotFile, free_run, read_robot, write_back
from rigsight.robots.runs import gap_of_written
from rigsight.simulate import compose, parameter_vector, simulate
from rigsight.simulate.model import Model

FLOATING = Path(__file__).parent / "models" / "floating_leg.xml"
DT, N = 0.002, 200

BODY = '<geom type="capsule" fromto="0 0 0 {to}" size="0.01" mass="0.3" contype="0" conaffinity="0"/>'
MIMIC = f"""
<mujoco><worldbody>
  <body><joint name="lead" axis="0 0 1" damping="0.02"/>{BODY.format(to="0.1 0 0")}</body>
  <body><joint name="follow" axis="0 0 1" damping="0.02"/>{BODY.format(to="0.1 0 0")}</body>
</worldbody><equality><joint joint1="follow" joint2="lead" polycoef="0 -1 0 0 0"/></equality></mujoco>"""
FOUR_BAR = f"""
<mujoco><worldbody>
  <body><joint name="crank" axis="0 1 0" damping="0.05"/>{BODY.format(to="0 0 0.2")}
    <body name="coupler" pos="0 0 0.2"><joint name="pin" axis="0 1 0" damping="0.01"/>{BODY.format(to="0.4 0 0")}</body></body>
  <body name="rocker" pos="0.4 0 0"><joint name="rocker" axis="0 1 0" damping="0.02"/>{BODY.format(to="0 0 0.2")}</body>
</worldbody><equality><connect body1="coupler" body2="rocker" anchor="0.4 0 0"/></equality>
<actuator><motor name="drive" joint="crank"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def robot() -> RobotFile:
    return read_robot(FLOATING, as_it_is=True)


def controls() -> np.ndarray:
    t = DT * np.arange(N)
    return 0.3 + 0.5 * np.sin(2 * np.pi * (1.0 + 2.0 * t) * t)


def record(**signals: np.ndarray) -> Record:
    return Record(
        "swing", DT, {"hip_drive_ctrl": controls(), **signals}, {"hip_drive_ctrl": "rad"}, hold="zoh"
    )


def model_of(robot: RobotFile, **values: float) -> Model:
    rig = robot.draft.rig
    defaults = {p.name: p.default for p in (*rig.constants, *rig.parameters)}
    return Model(compose(rig), {**defaults, **values}, "zoh")


def test_it_moves_as_mujoco_does_from_its_first_keyframe(robot: RobotFile) -> None:
    own = model_of(robot)
    ours = simulate(own.structure, own.values, record(), accuracy=1e-10)
    data = mujoco.MjData(robot.model)
    mujoco.mj_resetDataKeyframe(robot.model, data, 0)
    theirs = np.empty((N, 12))
    for row, control in zip(theirs, controls(), strict=True):
        data.ctrl[0] = control
        mujoco.mj_forward(robot.model, data)
        row[:] = data.sensordata[:12]
        mujoco.mj_step(robot.model, data, round(DT / robot.model.opt.timestep))
    quaternions = [f"{name}_{part}" for name in ("torso", "tip") for part in "wxyz"]
    names = ["hip_angle", "at_x", "at_y", "at_z", *quaternions]
    assert [signal.name for signal in own.structure.rig.outputs] == names
    for name, shown in zip(names, theirs.T, strict=True):
        assert np.ptp(shown) > 1e-3
        np.testing.assert_allclose(ours[name], shown, rtol=0.0, atol=1e-9)
    assert any("sensor 'rates'" in what for what in robot.draft.left_out)


def test_accelerations_of_many_joints_are_those_of_mujoco(robot: RobotFile) -> None:
    own, draft = model_of(robot), robot.draft
    equations = equations_of(own.structure.rig)
    data, rng = mujoco.MjData(robot.model), np.random.default_rng(0)
    data.qpos[:], data.qvel[:] = (
        rng.uniform(-1.0, 1.0, data.qpos.size),
        rng.uniform(-1.0, 1.0, data.qvel.size),
    )
    state = {name: data.qpos[place] for name, place in draft.positions(robot.model).items()}
    state |= {f"d({name})": data.qvel[place] for name, place in draft.rates(robot.model).items()}
    z = np.array([[state.get(name, 0.0)] for name in own.structure.state_names])
    mujoco.mj_forward(robot.model, data)
    found = equations.accelerations(z, np.zeros((3, 1)), parameter_vector(own.structure, own.values))[:, 0]
    places = draft.rates(robot.model)
    wanted = [data.qacc[places[c.name]] for c in own.structure.rig.mechanism.free]
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_numbers_go_back_into_the_model(robot: RobotFile) -> None:
    changed = model_of(robot, hip_damping=0.5)
    back = write_back(changed, FLOATING)
    assert back.without_field == ()
    assert back.model.dof_damping[robot.model.jnt_dofadr[robot.model.joint("hip").id]] == 0.5
    start = np.array(
        [changed.values.get(f"{name}_start", 0.0) for name in changed.structure.state_names], dtype=np.float64
    )
    moved = simulate(changed.structure, changed.values, record(), start)
    measured = record(**{s.name: moved[s.name] for s in changed.structure.rig.outputs})
    for gap in gap_of_written(changed, FLOATING, [measured], [start]):
        assert gap.in_mujoco < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", [MIMIC, FOUR_BAR], ids=["equality of joints, no actuator", "four-bar linkage"]
)
def test_what_binds_joints_stays_in_mujoco(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bound.xml"
    path.write_text(text, encoding="utf-8")
    bound = read_robot(path, as_it_is=True)
    assert free_run(bound.model, bound.draft).worst < 1e-8


def test_a_joint_without_a_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "unnamed.xml"
    path.write_text(FLOATING.read_text("utf-8").replace('<freejoint name="base"/>', "<freejoint/>"), "utf-8")
    with pytest.raises(InputError, match="joint number 0 has no name"):
        read_robot(path, as_it_is=True)


def test_without_as_it_is_the_message_says_what_to_do() -> None:
    with pytest.raises(InputError, match=r"'torso' has a free joint.*--as-it-is"):
        read_robot(FLOATING)


@pytest.mark.parametrize(
    ("key", "name", "there", "said"),
    [
        ("coordinates", "base_x", "base 6", "no motion of a joint"),
        ("coordinates", "base_x", "base", "no motion of a joint"),
        ("coordinates", "base_x", "bas 0", "has no joint 'bas 0'"),
        ("states", "base_quat_w", "base 4", "no number of a quaternion"),
        ("states", "base_quat_w", "hip 0", "no number of a quaternion"),
        ("states", "base_quat_v", "base 0", "there is no state 'base_quat_v'"),
    ],
)
def test_parts_that_a_joint_does_not_have_are_refused(
    robot: RobotFile, key: str, name: str, there: str, said: str
) -> None:
    own = robot.draft.tables["simulator"]
    tables = {**robot.draft.tables, "simulator": {**own, key: {**own[key], name: there}}}
    with pytest.raises(InputError, match=said):
        rig_of_tables(tables, "other")


def test_a_quaternion_of_three_states_is_refused(robot: RobotFile) -> None:
    own = robot.draft.tables["simulator"]
    states = {name: there for name, there in own["states"].items() if name != "tip_w" and there != "wrist 3"}
    with pytest.raises(InputError, match="four states of the quaternion"):
        rig_of_tables({**robot.draft.tables, "simulator": {**own, "states": states}}, "other")

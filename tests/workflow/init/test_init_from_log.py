"""A campaign proposed from the log of a robot: its channels, and its motions as records."""

from __future__ import annotations

import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.records.channel_table import read_columns
from rigsight.records.formats.channel import Channel, TimeAxis
from rigsight.robots.draft import draft_rig
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.campaign.signal_guesses import guess_file
from rigsight.workflow.init import run_init, run_init_from_mjcf

from ...records.formats.robot_logs import START, bag, joint_state

ARM = """
<mujoco model="arm">
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping="0.3"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.8" contype="0" conaffinity="0"/>
      <body name="forearm" pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" damping="0.15"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.25" size="0.015" mass="0.4" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="first" joint="shoulder" kp="25" kv="0.5" ctrlrange="-2 2"/>
    <{elbow} name="second" joint="elbow"/>
  </actuator>
  <sensor><jointpos name="angle_1" joint="shoulder"/><jointpos name="angle_2" joint="elbow"/></sensor>
</mujoco>"""
RATE, MOTION, PAUSE = 50, 4.0, 3.0
NOISE = 2e-4
JOINTS = ("shoulder", "elbow")


def write_log(folder: Path, goals: NDArray[np.float64]) -> None:
    """Write the joint states of both joints in another order than the drives, and the commands without names."""
    angles = goals + np.random.default_rng(0).normal(scale=NOISE, size=goals.shape)

    def messages(built: Any) -> Any:
        layout = built("std_msgs/msg/MultiArrayLayout", {"dim": [], "data_offset": 0})
        for i, (goal, (shoulder, elbow)) in enumerate(zip(goals, angles, strict=True)):
            time = START + i * (1_000_000_000 // RATE)
            command = {"layout": layout, "data": goal}
            yield "/position_controller/commands", "std_msgs/msg/Float64MultiArray", time, command
            state = joint_state(built, time + 100_000, ["elbow", "shoulder"], [elbow, shoulder])
            yield "/joint_states", "sensor_msgs/msg/JointState", time + 100_000, state

    folder.mkdir()
    bag(folder.parent / "log", messages).rename(folder / "log.mcap")


def moving(n_motions: int) -> NDArray[np.float64]:
    """Return goals of motions between pauses, shape (n_samples, 2); the last pause ends the log."""
    t = np.arange(round(MOTION * RATE)) / RATE
    motion = np.column_stack([np.sin(2 * np.pi * t / 2.0), np.sin(2 * np.pi * t)])
    rest = np.zeros((round(PAUSE * RATE), 2))
    return np.vstack([rest, *[part for _ in range(n_motions) for part in (motion, rest)]])


def records_of(folder: Path) -> list[dict[str, Any]]:
    model = folder.parent / "robot.xml"
    model.write_text(ARM.format(elbow="position"), encoding="utf-8")
    run_init_from_mjcf(folder, model)
    table = tomllib.loads((folder / "campaign.toml").read_text("utf-8"))
    found: list[dict[str, Any]] = table["records"]
    return found


def test_each_motion_between_pauses_is_a_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Path] = []

    def counted(path: Path, *asked: Any, **options: Any) -> Any:
        opened.append(path)
        return read_columns(path, *asked, **options)

    # The package has a function of the name of this module.
    monkeypatch.setattr(import_module("rigsight.records.channel_table"), "read_columns", counted)
    write_log(tmp_path / "arm", moving(3))
    records = records_of(tmp_path / "arm")
    assert [record["role"] for record in records] == ["estimation", "estimation", "validation"]
    for i, record in enumerate(records):
        begin = PAUSE + i * (MOTION + PAUSE)
        assert begin - PAUSE / 2.0 <= record["start"] < begin - 0.5
        assert begin + MOTION + 0.5 < record["end"] <= begin + MOTION + PAUSE / 2.0
    read = read_campaign(tmp_path / "arm").records
    assert len(opened) == 1
    assert [record.duration for record in read] == pytest.approx([MOTION + 2.0] * 3, abs=0.3)


def test_commands_without_names_are_those_of_the_drives_in_order(tmp_path: Path) -> None:
    write_log(tmp_path / "arm", moving(1))
    (record,) = records_of(tmp_path / "arm")
    assert record["columns"] == {
        "first_ctrl": "position_controller/commands/data/0",
        "second_ctrl": "position_controller/commands/data/1",
        "angle_1": "joint_states/position/shoulder",
        "angle_2": "joint_states/position/elbow",
    }
    assert "in the order of the drives; check" in (tmp_path / "arm" / "campaign.toml").read_text("utf-8")


def test_slow_motion_without_a_pause_is_one_record(tmp_path: Path) -> None:
    t = np.arange(20 * RATE) / RATE
    write_log(
        tmp_path / "arm", np.column_stack([np.sin(2 * np.pi * 0.05 * t), 0.5 * np.sin(2 * np.pi * 0.1 * t)])
    )
    (record,) = records_of(tmp_path / "arm")
    assert "start" not in record


def test_a_group_of_a_laboratory_is_no_word_of_a_log(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    t = 0.01 * np.arange(600)
    drive = np.sin(2 * np.pi * (1.0 + 2.0 * t) * t)
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(
            [
                nptdms.ChannelObject("Measured", name, samples, properties={"wf_increment": 0.01})
                for name, samples in (("Drive Force", drive), ("Position", 0.02 * drive), ("Room", t))
            ]
        )
    draft = run_init(tmp_path, model="axis")
    assert draft.n_blanks == 0


STATES = [f"joint_states/{what}/{joint}" for what in ("position", "velocity", "effort") for joint in JOINTS]
LISTS = [f"{kind}_controller/commands/data/{i}" for kind in ("position", "effort") for i in "01"]
CONTROLLER = [
    f"controller_state/{part}/{what}/{joint}"
    for part in ("reference", "feedback", "error", "output")
    for what in ("positions", "velocities")
    for joint in JOINTS
]


@pytest.mark.parametrize(
    ("elbow", "channels", "commands", "readings"),
    [
        (
            "position",
            [f"{part}/{joint}.pos" for part in ("action", "observation.state") for joint in JOINTS],
            ["action/shoulder.pos", "action/elbow.pos"],
            ["observation.state/shoulder.pos", "observation.state/elbow.pos"],
        ),
        ("position", CONTROLLER, CONTROLLER[0:2], CONTROLLER[4:6]),
        ("position", [*STATES, *LISTS[:2]], LISTS[:2], STATES[:2]),
        ("position", [*STATES, *LISTS], LISTS[:2], STATES[:2]),
        # No effort is the goal of a position controller.
        ("motor", STATES, [None, "joint_states/effort/elbow"], STATES[:2]),
    ],
    ids=["LeRobot", "controller", "list", "two lists", "states"],
)
def test_channels_are_found_by_joint_and_quantity(
    elbow: str, channels: list[str], commands: list[str | None], readings: list[str]
) -> None:
    of_file = [Channel(name, 10, lambda: np.zeros(10), axis=TimeAxis(10, 0.01)) for name in channels]
    rig = draft_rig(mujoco.MjModel.from_xml_string(ARM.format(elbow=elbow)), "robot").rig
    found = [guess.channel for guess in guess_file(of_file, [rig], is_log=True).signals]
    assert [None if channel is None else channel.name for channel in found] == [*commands, *readings]


@pytest.mark.parametrize("effort", [0.0, np.nan])
@pytest.mark.parametrize("commands", [LISTS[2:], [f"action/effort/{joint}" for joint in JOINTS]])
def test_what_never_changes_is_no_command_beside_one_that_moves(effort: float, commands: list[str]) -> None:
    wave = np.sin(np.arange(10.0))

    def channel(name: str) -> Channel:
        samples = np.full(10, effort) if name.startswith("joint_states/effort") else wave
        return Channel(name, 10, lambda: samples, axis=TimeAxis(10, 0.01))

    rig = draft_rig(
        mujoco.MjModel.from_xml_string(
            ARM.format(elbow="motor").replace("position name", "motor name").replace('kp="25" kv="0.5"', "")
        ),
        "robot",
    ).rig
    guess = guess_file([channel(name) for name in (*STATES, *commands)], [rig], is_log=True)
    assert [one.channel and one.channel.name for one in guess.signals[:2]] == commands

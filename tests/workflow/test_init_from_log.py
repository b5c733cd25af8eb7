"""A campaign proposed from the log of a robot: its channels, and its motions as records."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.init import run_init_from_mjcf

from ..records.robot_logs import START, bag, joint_state

ARM = Path(__file__).parent.parent / "robots" / "models" / "two_link_arm.xml"
RATE, MOTION, PAUSE = 50, 4.0, 3.0
NOISE = 2e-4


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
    model = Path(shutil.copy(ARM, folder.parent / "robot.xml"))
    run_init_from_mjcf(folder, model)
    table = tomllib.loads((folder / "campaign.toml").read_text("utf-8"))
    found: list[dict[str, Any]] = table["records"]
    return found


def test_each_motion_between_pauses_is_a_record(tmp_path: Path) -> None:
    write_log(tmp_path / "arm", moving(3))
    records = records_of(tmp_path / "arm")
    assert [record["role"] for record in records] == ["estimation", "estimation", "validation"]
    for i, record in enumerate(records):
        begin = PAUSE + i * (MOTION + PAUSE)
        assert begin - 1.0 < record["start"] < begin
        assert begin + MOTION < record["end"] < begin + MOTION + 1.0
    read = read_campaign(tmp_path / "arm").records
    assert [record.duration for record in read] == pytest.approx([MOTION + 1.0] * 3, abs=0.3)


def test_commands_without_names_are_those_of_the_drives_in_order(tmp_path: Path) -> None:
    write_log(tmp_path / "arm", moving(1))
    (record,) = records_of(tmp_path / "arm")
    assert record["columns"] == {
        "shoulder_motor_ctrl": "position_controller/commands/data/0",
        "elbow_drive_ctrl": "position_controller/commands/data/1",
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

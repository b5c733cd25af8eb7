"""Logs of robots: bags on which publishers take turns, messages without definition, episodes in one file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions
from rigsight.records.channel_names import closeness
from rigsight.records.channel_table import read_columns
from rigsight.records.formats.channel_file import open_channels
from rigsight.records.read_record import read_stretches
from rigsight.rigs import RIGS
from rigsight.workflow.campaign.signal_guesses import guess_file

from .robot_logs import START, bag, joint_state


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


def test_publishers_of_different_joints_take_turns_on_one_topic(tmp_path: Path) -> None:
    def messages(built: Any) -> Any:
        for i in range(40):
            time = START + i * 10_000_000
            yield (
                "/joint_states",
                "sensor_msgs/msg/JointState",
                time,
                joint_state(built, time, ["arm"], [0.1 * i]),
            )
            if i % 2 == 0:
                grip = joint_state(built, time + 1_000_000, ["grip"], [-0.1 * i])
                yield "/joint_states", "sensor_msgs/msg/JointState", time + 1_000_000, grip

    with open_channels(bag(tmp_path / "turns", messages)) as file:
        arm, grip = file.channels
        assert (arm.name, grip.name) == ("joint_states/position/arm", "joint_states/position/grip")
        np.testing.assert_allclose(arm.load(), 0.1 * np.arange(40))
        np.testing.assert_allclose(grip.load(), -0.1 * np.arange(0, 40, 2))
        assert arm.axis is not None
        assert grip.axis is not None
        np.testing.assert_allclose(arm.axis.stamps(), 0.01 * np.arange(40))
        np.testing.assert_allclose(grip.axis.stamps(), 0.001 + 0.02 * np.arange(20))


@pytest.mark.parametrize("first", [1, 90])
def test_a_channel_has_samples_only_where_messages_hold_it(tmp_path: Path, first: int) -> None:
    def messages(built: Any) -> Any:
        for i in range(100):
            time = START + i * 10_000_000
            arm = joint_state(built, time, ["arm"], [np.nan if i == 50 else 0.1 * i])
            yield "/joint_states", "sensor_msgs/msg/JointState", time, arm
            if i >= first:
                grip = joint_state(built, time + 1_000_000, ["grip"], [-0.1 * i])
                yield "/joint_states", "sensor_msgs/msg/JointState", time + 1_000_000, grip

    with open_channels(bag(tmp_path / "late", messages)) as file:
        arm, grip = file.channels
        assert grip.name == "joint_states/position/grip"
        # A reading that is no number is one that the robot sent.
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(arm.load())), [50])
        np.testing.assert_allclose(grip.load(), -0.1 * np.arange(first, 100))
        assert arm.n_samples == 100
        assert grip.axis is not None
        np.testing.assert_allclose(grip.axis.stamps(), 0.001 + 0.01 * np.arange(first, 100))


def test_a_simulated_clock_is_the_time(tmp_path: Path) -> None:
    def messages(built: Any) -> Any:
        for i in range(10):
            simulated = joint_state(built, 5_000_000_000 + i * 1_000_000, ["arm"], [float(i)])
            yield "/joint_states", "sensor_msgs/msg/JointState", START + i * 2_000_000, simulated

    with open_channels(bag(tmp_path / "simulated", messages)) as file:
        (arm,) = file.channels
        assert arm.axis is not None
        np.testing.assert_allclose(arm.axis.stamps(), 0.001 * np.arange(10))


def test_images_beside_the_joints_are_passed_over(tmp_path: Path) -> None:
    def messages(built: Any) -> Any:
        for i in range(4):
            time = START + i * 10_000_000
            head = joint_state(built, time, ["arm"], [float(i)])["header"]
            image = {
                "header": head,
                "height": 8,
                "width": 16,
                "encoding": "mono8",
                "is_bigendian": 0,
                "step": 16,
            }
            yield "/camera", "sensor_msgs/msg/Image", time, {**image, "data": np.zeros(128, dtype=np.uint8)}
            yield (
                "/joint_states",
                "sensor_msgs/msg/JointState",
                time,
                joint_state(built, time, ["arm"], [float(i)]),
            )

    with open_channels(bag(tmp_path / "images", messages)) as file:
        assert [channel.name for channel in file.channels] == ["joint_states/position/arm"]
        (camera,) = file.refused
        assert camera.name == "camera"
        assert "128 numbers in a message" in camera.reason


BUS = {
    "acme_msgs/msg/Bus": "builtin_interfaces/Time stamp\nstring name\nfloat64[3] wrench",
    "acme_msgs/msg/Joint": "float64 angle",
    "acme_msgs/msg/Joints": "string[] name\nacme_msgs/Joint[] joints",
}


def test_names_are_those_of_joints_not_of_points_in_time(tmp_path: Path) -> None:
    def messages(built: Any) -> Any:
        moment, empty = built("builtin_interfaces/msg/Duration", {"sec": 0, "nanosec": 0}), np.zeros(0)
        for i in range(5):
            time = START + i * 10_000_000
            head = joint_state(built, time, [], [])["header"]
            of_point = {
                "velocities": empty,
                "accelerations": empty,
                "effort": empty,
                "time_from_start": moment,
            }
            point = built(
                "trajectory_msgs/msg/JointTrajectoryPoint", {"positions": np.array([1.0, 2.0]), **of_point}
            )
            goal = {"header": head, "joint_names": ["arm", "grip"], "points": [point, point]}
            yield "/goal", "trajectory_msgs/msg/JointTrajectory", time, goal
            bus = {"stamp": head.stamp, "name": "arm", "wrench": np.arange(3.0)}
            yield "/bus", "acme_msgs/msg/Bus", time + 2_000_000 + i * 1_000_000, bus
            joints = [built("acme_msgs/msg/Joint", {"angle": 1.0}) for _ in range(2)]
            yield "/all", "acme_msgs/msg/Joints", time, {"name": ["arm", "grip"], "joints": joints}

    with open_channels(bag(tmp_path / "names", messages, BUS)) as file:
        axes = {c.name: c.axis for c in file.channels if "time_from_start" not in c.name}
        assert list(axes) == [
            *(f"goal/points/{point}/positions/{joint}" for point in (0, 1) for joint in ("arm", "grip")),
            *(f"bus/wrench/{entry}" for entry in range(3)),
            "all/joints/arm/angle",
            "all/joints/grip/angle",
        ]
        of_bus = axes["bus/wrench/0"]
        assert of_bus is not None
        np.testing.assert_allclose(of_bus.stamps(), 0.01 * np.arange(5))


PX4 = {"px4_msgs/msg/Servo": "uint64 timestamp\nfloat32 value"}


def of_autopilot(path: Path, per_second: tuple[float, float], n_topics: int = 2) -> Path:
    """Write topics with a field called timestamp that counts so many units per second, received 0.4 ms later and earlier."""

    def messages(_: Any) -> Any:
        for i in range(200):
            for topic, units, late in zip(("act", "joint"), per_second, (400_000, -400_000), strict=True):
                content = {"timestamp": round(7.0 * units + 0.01 * i * units), "value": np.sin(0.3 * i)}
                time = START + i * 10_000_000 + late * (-1) ** i
                if topic == "act" or n_topics == 2:
                    yield topic, "px4_msgs/msg/Servo", time, content

    return bag(path, messages, PX4)


AS_MAPPED = {"u": ColumnMapping("act/value"), "x": ColumnMapping("joint/value")}


@pytest.mark.parametrize("units", [1e3, 1e6, 1e9])
def test_the_unit_of_a_clock_follows_from_the_stamps_of_the_bag(tmp_path: Path, units: float) -> None:
    file = of_autopilot(tmp_path / "clock", (units, units))
    (record,) = read_stretches(
        file, (Named("u", "A"),), (Named("x", "m"),), ReadingOptions(columns=AS_MAPPED)
    )
    assert record.dt == pytest.approx(0.01, rel=1e-6)
    assert record.n_samples == 200
    np.testing.assert_allclose(record["x"], np.sin(0.3 * np.arange(200)), atol=1e-6)


@pytest.mark.parametrize("per_second", [(30.0, 30.0), (2e6, 2e6), (1e6, 300.0)])
def test_what_is_only_called_like_time_does_not_replace_the_stamps_of_the_bag(
    tmp_path: Path, per_second: tuple[float, float]
) -> None:
    file = of_autopilot(tmp_path / "counter", per_second)
    mapped = read_columns(file, {**AS_MAPPED, "t": ColumnMapping("t")}, time_is_mapped=False)
    assert mapped.clocks == {"u": "its own time axis", "x": "its own time axis"}
    np.testing.assert_allclose(np.ptp(mapped.clock_of("u")), 1.99, atol=1e-3)
    # What the user calls the time is the time.
    named = {**AS_MAPPED, "u": ColumnMapping("act/value", time="act/timestamp"), "t": ColumnMapping("t")}
    with pytest.raises(InputError, match="cannot be compared"):
        read_columns(file, named, time_is_mapped=False)


@pytest.mark.parametrize("n_topics", [1, 2])
def test_a_time_beside_the_stamps_of_a_bag_is_not_written_into_a_campaign(
    tmp_path: Path, n_topics: int
) -> None:
    with open_channels(of_autopilot(tmp_path / "clock", (1e6, 1e6), n_topics)) as file:
        guess = guess_file(file.channels, [RIGS["axis"]], is_log=True)
    assert (guess.time.channel, dict(guess.clocks)) == (None, {})


def episodes(folder: Path, n_episodes: int) -> Path:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    (folder / "meta").mkdir()
    features = {
        "action": {"names": ["pan.pos", "lift.pos"]},
        "observation.state": {"names": {"motors": ["pan", "lift"]}},
    }
    (folder / "meta/info.json").write_text(json.dumps({"fps": 50, "features": features}), encoding="utf-8")
    stamps = np.tile(0.02 * np.arange(100), n_episodes).astype(np.float32)
    moved = np.column_stack([np.sin(3 * stamps), np.cos(2 * stamps)])
    path = folder / "data/chunk-000/file-000.parquet"
    path.parent.mkdir(parents=True)
    lists = arrow.list_(arrow.float32())
    columns = {
        "action": arrow.array(moved.tolist(), lists),
        "observation.state": arrow.array((0.5 * moved).tolist(), lists),
        "timestamp": arrow.array(stamps),
        "episode_index": arrow.array(np.repeat(np.arange(n_episodes), 100)),
    }
    parquet.write_table(arrow.table(columns), path)
    return path


def test_the_episodes_of_a_lerobot_file_are_records(tmp_path: Path) -> None:
    path = episodes(tmp_path, 3)
    with open_channels(path) as file:
        names = [channel.name for channel in file.channels]
    assert names[:4] == [
        "action/pan.pos",
        "action/lift.pos",
        "observation.state/pan",
        "observation.state/lift",
    ]
    columns = {
        "t": ColumnMapping("timestamp"),
        "u": ColumnMapping("action/pan.pos"),
        "x": ColumnMapping("observation.state/pan"),
    }
    records = read_stretches(
        path, (Named("u", "rad"),), (Named("x", "rad"),), ReadingOptions(columns=columns)
    )
    assert [record.n_samples for record in records] == [100, 100, 100]
    assert all(record.dt == pytest.approx(0.02, rel=1e-5) for record in records)
    np.testing.assert_allclose(records[2]["x"], 0.5 * records[2]["u"], atol=1e-6)


@pytest.mark.parametrize(
    ("signal", "channel", "others"),
    [
        ("shoulder_angle", "joint_states/position/shoulder", ("joint_states/effort/shoulder", "joint_states/position/elbow")),
        ("shoulder_motor_ctrl", "joint_states/effort/shoulder", ("joint_states/position/shoulder",)),
        ("pan_angle", "observation.state/pan.pos", ("observation.state/lift.pos",)),
        ("pan_motor_ctrl", "action/pan.pos", ("observation.state/pan.pos",)),
        ("torque", "rig/torque", ("torque test/position",)),
    ],
)  # fmt: skip
def test_the_joints_of_a_log_are_found(signal: str, channel: str, others: tuple[str, ...]) -> None:
    assert closeness(channel, signal) >= 2.0
    assert all(closeness(other, signal) < 2.0 for other in others)


def test_a_sqlite_file_that_is_no_bag_is_one_message(tmp_path: Path) -> None:
    import sqlite3

    pytest.importorskip("rosbags")
    with sqlite3.connect(tmp_path / "other.db3") as data:
        data.execute("create table t (x real)")
    with (
        pytest.raises(InputError, match=r"other\.db3 cannot be read as ROS bag"),
        open_channels(tmp_path / "other.db3"),
    ):
        pass


def test_a_node_that_was_started_again_goes_on_with_its_channels(tmp_path: Path) -> None:
    rosbag1, typesys = pytest.importorskip("rosbags.rosbag1"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/Float64"
    with rosbag1.Writer(tmp_path / "again.bag") as file:
        runs = [file.add_connection("/angle", kind, typestore=store, callerid=node) for node in ("/a", "/b")]
        for i in range(40):
            message = store.types[kind](data=float(i))
            file.write(runs[i // 20], START + i * 10_000_000, store.serialize_ros1(message, kind))
    with open_channels(tmp_path / "again.bag") as file:
        (angle,) = file.channels
        np.testing.assert_array_equal(angle.load(), np.arange(40.0))

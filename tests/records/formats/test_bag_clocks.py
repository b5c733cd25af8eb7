"""Clocks of the topics of a bag: headers of another clock, without headers, simulated time, late and repeated messages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, Record
from rigsight.records.formats.bag_clocks import Nanoseconds, OnOneClock, Stamps, on_one_clock
from rigsight.records.formats.channel_file import open_channels
from rigsight.records.read_record import read_record
from rigsight.records.record import Floats

from .robot_logs import START, bag, joint_state

N_MESSAGES = 2000
TIME = 4e-3 * np.arange(N_MESSAGES)


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


def nanoseconds(seconds: Floats) -> Nanoseconds:
    return START + np.rint(1e9 * seconds).astype(np.int64)


def travel(least: float, spread: float, seed: int) -> Floats:
    return least + spread * np.random.default_rng(seed).exponential(size=N_MESSAGES)


def command(seed: int = 1) -> Stamps:
    """Return messages without headers that are received 1 ms after they were sent."""
    took = travel(5e-4, 5e-4, seed)
    return Stamps("command", nanoseconds(TIME + took), np.zeros(N_MESSAGES, dtype=np.int64))


def reading(shown: Floats, took: Floats | float) -> Stamps:
    return Stamps("reading", nanoseconds(TIME + took), nanoseconds(shown))


def apart(found: list[OnOneClock]) -> Floats:
    """Return how late the first topic is against the second on their clock [s], of messages of the same moments."""
    return np.asarray((found[0].stamps - found[1].stamps) / 1e9)


@pytest.mark.parametrize(
    "shown",
    [TIME + 37.0, TIME + 0.04, TIME - 0.25, 1.0001 * TIME + 3.0, TIME - START / 1e9 + 5.0],
    ids=["TAI", "ahead", "behind", "drift", "boot"],
)
def test_headers_of_another_clock_are_no_delay(shown: Floats) -> None:
    found = on_one_clock([command(), reading(shown, travel(1e-3, 1e-3, 2))])
    late = apart(found)
    assert abs(np.median(late)) < 1e-3
    assert np.ptp(np.diff(found[1].stamps)) < 1000  # The headers stay as even as they are.
    assert "another" in found[0].notes[0] or "clock of the headers" in found[0].notes[0]
    assert found[1].late < 2e-3


def test_headers_of_the_clock_of_the_recorder_stay_and_tell_how_late_others_may_be() -> None:
    stamped = reading(TIME, travel(0.02, 1e-3, 2))
    found = on_one_clock([command(), stamped])
    np.testing.assert_array_equal(found[1].stamps, stamped.stamped)
    np.testing.assert_array_equal(found[0].stamps, command().received)
    assert found[1].late == pytest.approx(0.0207, abs=5e-4)
    assert found[0].late == 0.0


def test_a_slow_pipeline_is_no_other_clock() -> None:
    # Pictures at 25 Hz that take 0.2 s to be evaluated.
    moments = 10.0 * TIME
    stamped = Stamps("pose", nanoseconds(moments + travel(0.2, 5e-3, 3)), nanoseconds(moments))
    (found,) = on_one_clock([stamped])
    np.testing.assert_array_equal(found.stamps, stamped.stamped)
    assert found.late == pytest.approx(0.2, abs=0.01)
    assert not found.notes


def test_two_topics_of_one_strange_clock_keep_their_headers() -> None:
    late = reading(TIME + 37.0, travel(0.03, 1e-3, 4))
    found = on_one_clock([reading(TIME + 37.0, travel(1e-3, 1e-3, 2)), late, command()])
    np.testing.assert_array_equal(found[0].stamps, found[1].stamps)
    assert abs(np.median(found[2].stamps - found[0].stamps)) < 1e6


def test_simulated_time_is_that_of_messages_without_headers_too() -> None:
    # The simulation slows down while it runs, and counts from its own start.
    speed = 0.3 + 0.2 * np.cos(TIME)
    real = np.cumsum(4e-3 / speed)
    received = START + np.rint(1e9 * real).astype(np.int64)
    simulated = np.rint(1e9 * (TIME + 10.0)).astype(np.int64)
    without = Stamps("command", received + 100_000, np.zeros_like(received))
    found = on_one_clock([without, Stamps("reading", received + 300_000, simulated)])
    np.testing.assert_array_equal(found[1].stamps, simulated)
    assert np.abs(apart(found)).max() < 1e-3
    assert found[1].notes


def test_messages_that_are_not_stamped_are_as_late_as_the_others() -> None:
    stamped = reading(TIME, 3e-3)
    stamped.stamped[::100] = 0
    (found,) = on_one_clock([stamped])
    np.testing.assert_allclose((found.stamps - START) / 1e9, TIME, atol=1e-6)
    assert found.notes


def test_without_headers_there_is_nothing_to_report() -> None:
    found = on_one_clock([command(1), command(2)])
    np.testing.assert_array_equal(found[0].stamps, command(1).received)
    assert all(one.late == 0.0 and not one.notes for one in found)


def record_of(tmp_path: Path, shown: Floats, took: Floats, order: Any = slice(None)) -> Record:
    """Return a record of joints whose messages are received in an order, beside commands without headers."""

    def messages(built: Any) -> Any:
        layout = built("std_msgs/msg/MultiArrayLayout", {"dim": [], "data_offset": 0})
        events = []
        for time in TIME[:400]:
            data = {"layout": layout, "data": np.array([np.sin(3.0 * time)])}
            sent = int(nanoseconds(np.array(time)))
            events.append(("/command", "std_msgs/msg/Float64MultiArray", sent, data))
        moments = np.arange(400)[order]
        for k, i in enumerate(moments):
            state = joint_state(built, int(nanoseconds(shown)[i]), ["arm"], [np.sin(3.0 * TIME[i])])
            at = TIME[k] if moments.size == 400 else TIME[i]
            received = int(nanoseconds(np.array(at + took[k])))
            events.append(("/joint_states", "sensor_msgs/msg/JointState", received, state))
        return sorted(events, key=lambda event: event[2])

    columns = {"u": ColumnMapping("command/data/0"), "x": ColumnMapping("joint_states/position/arm")}
    path = bag(tmp_path / "run", messages)
    return read_record(path, (Named("u", "rad"),), (Named("x", "rad"),), ReadingOptions(columns=columns))


@pytest.mark.parametrize("offset", [0.0, 37.0, 0.04, -0.25])
def test_command_and_reading_of_a_bag_are_joined_as_they_happened(tmp_path: Path, offset: float) -> None:
    record = record_of(tmp_path, TIME + offset, np.full(400, 1e-5))
    np.testing.assert_allclose(record["x"], record["u"], atol=1e-3)


def test_the_uncertainty_of_a_delay_is_the_time_that_messages_travel(tmp_path: Path) -> None:
    record = record_of(tmp_path, TIME, np.full(400, 0.03))
    np.testing.assert_allclose(record["x"], record["u"], atol=1e-3)
    assert record.clock_uncertainty == pytest.approx(0.03, abs=1e-3)


def swapped(*places: int) -> list[int]:
    order = list(range(400))
    for place in places:
        order[place : place + 2] = order[place + 1], order[place]
    return order


def test_late_messages_are_sorted(tmp_path: Path) -> None:
    record = record_of(tmp_path, TIME, np.full(400, 0.01), swapped(50, 120, 300))
    assert record.n_samples > 390
    np.testing.assert_allclose(record["x"], record["u"], atol=1e-3)
    assert any("3 of 400 messages" in note for note in record.notes)


def test_repeated_messages_are_read_once(tmp_path: Path) -> None:
    record = record_of(tmp_path, TIME, np.full(801, 1e-5), sorted([*range(400), *range(0, 400, 2)]))
    np.testing.assert_allclose(record["x"], record["u"], atol=1e-3)
    assert any("200 of 600 messages" in note for note in record.notes)


def test_a_clock_that_was_set_back_is_not_sorted(tmp_path: Path) -> None:
    shown = np.where(TIME < 0.8, TIME, TIME - 0.02)
    with pytest.raises(InputError, match="time is not increasing"):
        record_of(tmp_path, shown, np.full(400, 1e-3))


def test_a_swap_in_simulated_time_is_sorted(tmp_path: Path) -> None:
    def messages(built: Any) -> Any:
        for k, i in enumerate(swapped(30, 70)):
            state = joint_state(built, 10**9 + 4_000_000 * i, ["arm"], [float(i)])
            yield "/joint_states", "sensor_msgs/msg/JointState", START + 40_000_000 * k, state

    with open_channels(bag(tmp_path / "run", messages)) as file:
        (arm,) = file.channels
        np.testing.assert_array_equal(arm.load(), np.arange(400.0))

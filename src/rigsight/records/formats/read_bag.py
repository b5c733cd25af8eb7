"""Which channels does a ROS bag hold: MCAP, ROS 2 (SQLite) or ROS 1?

Each number of each topic is a channel named ``topic/field``; a list that has names beside it, as in sensor_msgs/JointState, gives
``topic/field/name``. Times are those of the header of a message, else of its reception, and count from the first of the bag. All
messages are read at once: only then it is known what they hold.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    MOST_COLUMNS,
    Channel,
    ChannelFile,
    Refused,
    TimeAxis,
    check_count,
    check_total,
    listed,
    too_short,
)

_LISTS_OF_NAMES = ("name", "names", "joint_names")
_NO_READINGS = ("header", "layout")
_SUFFIXES = {b"#ROSBAG": ".bag", b"\x89MCAP": ".mcap", b"SQLite": ".db3"}
"""Beginning of a file -> the suffix by which the library tells what it is."""
_OTHER_CLOCK = 3600.0
"""Seconds between header and reception from which the header counts from another moment: a simulated clock, or none."""


class _NoSignalsError(Exception):
    """A message holds a picture or a cloud of points."""


@dataclass(frozen=True)
class _Topic:
    """The messages of one topic and type."""

    reader: Any
    connection: Any

    @property
    def name(self) -> str:
        return str(self.connection.topic).strip("/")

    def messages(self) -> Iterator[tuple[int, dict[str, float]]]:
        """Yield the time [ns] and the numbers of each message."""
        connection = self.connection
        for _, received, raw in self.reader.messages([connection]):
            message = self.reader.deserialize(raw, connection.msgtype)
            yield _stamp(message, received), dict(_flat(message, "", ()))


@dataclass(frozen=True)
class _Numbers:
    """The numbers of a topic: publishers of different joints take turns on one, or begin late."""

    stamps: array[int] = field(default_factory=lambda: array("q"))  # of each message [ns]
    # Name -> the messages that hold it, from 0, and its numbers there.
    held: dict[str, tuple[array[int], array[float]]] = field(default_factory=dict)


def open_bag(path: Path) -> Iterator[ChannelFile]:
    """Yield the numbers of all topics of a bag; messages with images or point clouds are passed over without being kept."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with path.open("rb") as file:
        head = file.read(8)
    suffix = next(own for begin, own in _SUFFIXES.items() if head.startswith(begin))
    if path.suffix.lower() != suffix:
        raise InputError(f"{path.name} is a bag whose name does not end in {suffix}; rename it.")
    # Bags of ROS 2 before Iron have no definitions: the messages of ROS itself are known.
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        yield listed(path.name, _parts(path.name, [_Topic(reader, own) for own in reader.connections]))


def _parts(file: str, topics: Sequence[_Topic]) -> Iterator[Channel | Refused]:
    read: list[tuple[str, _Numbers]] = []
    n_samples = 0
    for topic in topics:
        kind = topic.connection.msgtype
        if reason := too_short(topic.connection.msgcount):
            yield Refused(topic.name, reason)
            continue
        numbers = _Numbers()
        try:
            for number, (stamp, own) in enumerate(topic.messages()):
                numbers.stamps.append(stamp)
                for name, value in own.items():
                    where, values = numbers.held.setdefault(name, (array("q"), array("d")))
                    where.append(number)
                    values.append(value)
                n_samples += len(own)
                check_count(file, len(numbers.held))
                check_total(file, n_samples)
        except _NoSignalsError as error:
            yield Refused(topic.name, f"is of type {kind}, {error}")
        except (InputError, MemoryError):
            raise
        except Exception as error:
            # The library compiles a reader for each type, and raises whatever that meets.
            why = f"its messages of type {kind} cannot be read ({type(error).__name__}: {error})"
            yield Refused(topic.name, why + "; the bag may hold no definition of that type")
        else:
            if numbers.held:
                read.append((topic.name, numbers))
            else:
                yield Refused(topic.name, f"is of type {kind}, without numbers over time")
    zero = min((min(numbers.stamps) for _, numbers in read), default=0)
    for name, numbers in read:
        yield from _channels(name, numbers, zero)


def _channels(topic: str, numbers: _Numbers, zero: int) -> Iterator[Channel | Refused]:
    """Yield the channels of a topic, each with the time of the messages that hold it."""
    stamps = (np.array(numbers.stamps) - zero) / 1e9
    clocks: dict[bytes, TimeAxis] = {}
    for own, (where, values) in numbers.held.items():
        n_samples = len(where)
        if reason := too_short(n_samples):
            yield Refused(f"{topic}/{own}", reason)
            continue
        axis = TimeAxis(
            n_samples, load=partial(np.take, stamps, np.array(where)), origin=np.datetime64(zero, "ns")
        )
        axis = clocks.setdefault(where.tobytes(), axis)
        yield Channel(f"{topic}/{own}", n_samples, partial(np.array, values), axis=axis)


def _stamp(message: Any, received: int) -> int:
    """Return the time of the header, or of the message itself [ns], where it has one on the clock of the reception."""
    stamp: Any = getattr(getattr(message, "header", message), "stamp", None)
    if not _is_moment(stamp):
        return received
    own = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return own if abs(own - received) < 1e9 * _OTHER_CLOCK else received


def _is_moment(value: Any) -> bool:
    return is_dataclass(value) and hasattr(value, "nanosec")


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(own, str) for own in value)


def _flat(value: Any, path: str, names: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a value; lists that are as long as the names of its message are named by them."""
    if is_dataclass(value):
        possible: list[Any] = [getattr(value, key, None) for key in _LISTS_OF_NAMES]
        names = next(filter(_are_names, possible), names)
        for field in fields(value):
            inner, own = f"{path}/{field.name}" if path else field.name, getattr(value, field.name)
            is_its_time = inner == "stamp" and _is_moment(own)
            if field.name not in _NO_READINGS and not field.name.startswith("__") and not is_its_time:
                yield from _flat(own, inner, names)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield path, float(value)
    elif isinstance(value, list | np.ndarray):
        if len(value) > MOST_COLUMNS:
            raise _NoSignalsError(f"with {len(value)} numbers in a message, not signals side by side")
        is_named = len(value) == len(names) and not any(map(_needs_names, value))
        for label, part in zip(names if is_named else range(len(value)), value, strict=True):
            yield from _flat(part, f"{path}/{label}", () if is_named else names)


def _needs_names(part: Any) -> bool:
    """Return True for a message with lists of numbers and no names for them, as a point of a trajectory of joints."""
    held = [getattr(part, field.name) for field in fields(part)] if is_dataclass(part) else []
    return any(isinstance(own, np.ndarray) for own in held) and not any(map(_are_names, held))

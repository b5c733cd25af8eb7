"""Which channels does a ROS bag hold: MCAP, ROS 2 (SQLite) or ROS 1?

Each number of each topic is a channel named ``topic/field``; a list that has names beside it, as in sensor_msgs/JointState, gives
``topic/field/name``. Times are those of the header of a message, else of its reception, and count from the first of the bag.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    MOST_COLUMNS,
    Channel,
    ChannelFile,
    Load,
    Refused,
    TimeAxis,
    kept_last,
    listed,
    too_short,
)

_LISTS_OF_NAMES = ("name", "names", "joint_names")
_NO_READINGS = ("header", "layout")
_FIRST = 20
"""Messages of a topic from which its fields are known: publishers of different joints take turns on one topic."""
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

    def numbers(self, names: list[str], zero: int) -> NDArray[np.float64]:
        """Return the time [s] and the numbers of each message, shape (1 + n_names, n_messages), NaN where it lacks one."""
        rows = [[(t - zero) / 1e9, *(held.get(n, np.nan) for n in names)] for t, held in self.messages()]
        return np.array(rows, dtype=np.float64).T.reshape(1 + len(names), -1)


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
        yield listed(path.name, _parts([_Topic(reader, connection) for connection in reader.connections]))


def _parts(topics: Sequence[_Topic]) -> Iterator[Channel | Refused]:
    firsts: dict[int, list[tuple[int, dict[str, float]]]] = {}
    for number, topic in enumerate(topics):
        kind = topic.connection.msgtype
        if reason := too_short(topic.connection.msgcount):
            yield Refused(topic.name, reason)
            continue
        try:
            messages = list(itertools.islice(topic.messages(), _FIRST))
        except _NoSignalsError as error:
            yield Refused(topic.name, f"is of type {kind}, {error}")
            continue
        except Exception as error:
            # The library compiles a reader for each type, and raises whatever that meets.
            why = f"its messages of type {kind} cannot be read ({type(error).__name__}: {error})"
            yield Refused(topic.name, why + "; the bag may hold no definition of that type")
            continue
        if any(held for _, held in messages):
            firsts[number] = messages
        else:
            yield Refused(topic.name, f"is of type {kind}, without numbers over time")
    zero = min((stamp for messages in firsts.values() for stamp, _ in messages), default=0)
    origin = np.datetime64(zero, "ns")
    kept: dict[str, NDArray[Any]] = {}
    for number, messages in firsts.items():
        topic, n_messages = topics[number], topics[number].connection.msgcount
        names = list(dict.fromkeys(name for _, held in messages for name in held))
        table = kept_last(kept, str(number), partial(topic.numbers, names, zero))
        if any(len(held) < len(names) for _, held in messages):
            yield from _of_several_publishers(topic.name, names, table, origin)
            continue
        axis = TimeAxis(n_messages, load=partial(_row, table, 0), origin=origin)
        for index, own in enumerate(names, start=1):
            yield Channel(f"{topic.name}/{own}", n_messages, partial(_row, table, index), axis=axis)


def _of_several_publishers(
    topic: str, names: list[str], table: Load, origin: np.datetime64
) -> Iterator[Channel | Refused]:
    """Yield the channels of a topic on which messages with different numbers take turns, each with a clock of its own."""
    clocks: dict[bytes, TimeAxis] = {}
    for index, own in enumerate(names, start=1):
        held = ~np.isnan(table()[index])
        n_samples = int(np.count_nonzero(held))
        if reason := too_short(n_samples):
            yield Refused(f"{topic}/{own}", reason)
            continue
        axis = TimeAxis(n_samples, load=partial(_row, table, 0, held), origin=origin)
        axis = clocks.setdefault(held.tobytes(), axis)
        yield Channel(f"{topic}/{own}", n_samples, partial(_row, table, index, held), axis=axis)


def _row(table: Load, index: int, held: NDArray[np.bool_] | slice = slice(None)) -> NDArray[Any]:
    return np.asarray(table()[index][held])


def _stamp(message: Any, received: int) -> int:
    """Return the time of the header [ns] where it has one on the clock of the reception."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None:
        return received
    own = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    return own if abs(own - received) < 1e9 * _OTHER_CLOCK else received


def _flat(value: Any, path: str, names: Sequence[str]) -> Iterator[tuple[str, float]]:
    """Yield the numbers in a value; lists that are as long as the names of its message are named by them."""
    if is_dataclass(value):
        names = next((own for key in _LISTS_OF_NAMES if (own := getattr(value, key, None))), names)
        for field in fields(value):
            if field.name not in _NO_READINGS and not field.name.startswith("__"):
                inner = f"{path}/{field.name}" if path else field.name
                yield from _flat(getattr(value, field.name), inner, names)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield path, float(value)
    elif isinstance(value, list | np.ndarray):
        if len(value) > MOST_COLUMNS:
            raise _NoSignalsError(f"with {len(value)} numbers in a message, not signals side by side")
        labels = names if len(value) == len(names) else range(len(value))
        for label, part in zip(labels, value, strict=True):
            yield from _flat(part, f"{path}/{label}", ())

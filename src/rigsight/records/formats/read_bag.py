"""Which channels does a ROS bag hold: MCAP, ROS 2 (SQLite) or ROS 1?

Each number of each topic is a channel named ``topic/field``; a list that has names beside it, as in sensor_msgs/JointState, gives
``topic/field/name``. Times count from the first of the bag, by the clock that most headers have; late messages are sorted. All
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
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.bag_clocks import Nanoseconds, OnOneClock, Stamps, on_one_clock
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
from rigsight.records.record import Floats

_LISTS_OF_NAMES = ("name", "names", "joint_names")
_NO_READINGS = ("header", "layout")
_MOMENTS = ("stamp", "clock")
_SUFFIXES = {b"#ROSBAG": ".bag", b"\x89MCAP": ".mcap", b"SQLite": ".db3"}
"""Beginning of a file -> the suffix by which the library tells what it is."""
_BESIDE = 20
"""Messages before and behind a late one that show whether the clock was set."""


class _NoSignalsError(Exception):
    """A message holds a picture or a cloud of points."""


@dataclass(frozen=True)
class _Topic:
    """The messages of one topic and type."""

    reader: Any
    # In ROS 1 there is one for each publisher, and another one when that is started again.
    connections: list[Any]

    @property
    def name(self) -> str:
        return str(self.connections[0].topic).strip("/")

    @property
    def kind(self) -> str:
        return str(self.connections[0].msgtype)

    @property
    def n_messages(self) -> int:
        return sum(connection.msgcount for connection in self.connections)

    def messages(self) -> Iterator[tuple[int, int, dict[str, float]]]:
        """Yield times of reception and of the message itself [ns], and the numbers of each message."""
        for _, received, raw in self.reader.messages(self.connections):
            message = self.reader.deserialize(raw, self.kind)
            yield received, _stamp(message), dict(_flat(message, "", ()))


@dataclass(frozen=True)
class _Numbers:
    """The numbers of a topic: publishers of different joints take turns on one, or begin late."""

    # Times of reception and of the message itself [ns]; 0 where it has none.
    received: array[int] = field(default_factory=lambda: array("q"))
    stamped: array[int] = field(default_factory=lambda: array("q"))
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
        topics: dict[tuple[str, str], _Topic] = {}
        for own in reader.connections:
            topics.setdefault((own.topic, own.msgtype), _Topic(reader, [])).connections.append(own)
        yield listed(path.name, _parts(path.name, list(topics.values())))


def _parts(file: str, topics: Sequence[_Topic]) -> Iterator[Channel | Refused]:
    read: list[tuple[str, _Numbers]] = []
    n_samples = 0
    for topic in topics:
        kind = topic.kind
        if reason := too_short(topic.n_messages):
            yield Refused(topic.name, reason)
            continue
        numbers = _Numbers()
        try:
            for number, (received, stamped, own) in enumerate(topic.messages()):
                numbers.received.append(received)
                numbers.stamped.append(stamped)
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
    named = [Stamps(name, np.array(own.received), np.array(own.stamped)) for name, own in read]
    times = on_one_clock(named)
    zero = min((int(own.stamps.min()) for own in times), default=0)
    for (name, numbers), on_clock, stamps in zip(read, times, named, strict=True):
        yield from _channels(file, name, numbers, on_clock, stamps.received, zero)


def _channels(
    file: str, topic: str, numbers: _Numbers, times: OnOneClock, received: Nanoseconds, zero: int
) -> Iterator[Channel | Refused]:
    """Yield the channels of a topic, each with the time of the messages that hold it."""
    alike: dict[bytes, list[str]] = {}
    for own, (messages, _) in numbers.held.items():
        if reason := too_short(len(messages)):
            yield Refused(f"{topic}/{own}", reason)
        else:
            alike.setdefault(messages.tobytes(), []).append(own)
    for names in alike.values():
        where = np.array(numbers.held[names[0]][0])
        values = np.array([numbers.held[own][1] for own in names])
        kept, found = _in_order(times.stamps[where], received[where], values)
        axis = TimeAxis(
            kept.size,
            load=partial(np.divide, times.stamps[where[kept]] - zero, 1e9),
            origin=np.datetime64(zero, "ns"),
            late=times.late,
            notes=tuple(
                f"{file}: {note}." for note in (*times.notes, *(f"'{topic}': {one}" for one in found))
            ),
        )
        for own, samples in zip(names, values, strict=True):
            yield Channel(f"{topic}/{own}", kept.size, partial(np.take, samples, kept), axis=axis)


def _in_order(
    stamps: Nanoseconds, received: Nanoseconds, values: Floats
) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Return the messages in the order of their stamps (of reception where the clock was set back), once, and what was done."""
    # Values have the shape (n_channels, n_messages).
    order, notes, n_messages = np.arange(stamps.size), [], stamps.size
    latest = np.maximum.accumulate(stamps)
    behind = np.flatnonzero(stamps < latest)
    if behind.size and not _is_set_back(stamps, received, behind, latest):
        order = np.argsort(stamps, kind="stable")
        most = float((latest - stamps).max()) / 1e9
        notes.append(
            f"{behind.size} of {n_messages} messages come behind later ones, by up to {most:.3g} s, and are sorted"
        )
    # As bits, so that readings that are no numbers are alike as well.
    moment, found = stamps[order], values[:, order].view(np.int64)
    again = np.append(False, (np.diff(moment) == 0) & (found[:, 1:] == found[:, :-1]).all(axis=0))
    if again.any():
        notes.append(
            f"{np.count_nonzero(again)} of {n_messages} messages repeat one of the same time and are left out"
        )
    return order[~again], tuple(notes)


def _is_set_back(
    stamps: Nanoseconds, received: Nanoseconds, behind: NDArray[np.intp], latest: Nanoseconds
) -> bool:
    """Return True if messages `behind` later ones are not late alone: all that follow a clock that was set are."""
    # Simulated time may run at another speed than the reception.
    speed = (int(stamps[-1]) - int(stamps[0])) / max(1, int(received[-1]) - int(received[0]))
    took = speed * (received - received[0]) - (stamps - stamps[0])
    for i in behind:
        beside = took[max(0, i - _BESIDE) : i], took[i + 1 : i + 1 + _BESIDE]
        if beside[1].size:
            before, after = (np.quantile(own, (0.25, 0.5, 0.75)) for own in beside)
            scatter = max(before[2] - before[0], after[2] - after[0])
            if after[1] - before[1] > max(scatter, 0.5 * (latest[i] - stamps[i])):
                return True
    return False


def _stamp(message: Any) -> int:
    """Return the time of the header, of the message itself, or of a simulated clock [ns]; 0 where it has none."""
    head = getattr(message, "header", message)
    stamp = next(filter(_is_moment, (getattr(head, key, None) for key in _MOMENTS)), None)
    return 0 if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


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

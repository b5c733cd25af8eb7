"""Selection of the channels of a measurement file for the requested signals, with their time axis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest
from rigsight.records.channel_units import UnknownUnitError, factor
from rigsight.records.clocks import (
    Clock,
    increases,
    possible_clocks,
    refuse_one_dt,
    shared_clock,
    with_clocks,
)
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.formats.channel import Channel, ChannelFile, TimeAxis, as_floats, as_stamps
from rigsight.records.formats.channel_file import open_channels

_LISTED = 30
"""Channels that a message lists; a logger may record thousands."""
_OWN_AXIS = "its own time axis"


def read_channels(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    time: str,
    *,
    time_is_mapped: bool,
    optional: Sequence[str] = (),
    dt: float | None = None,
) -> Columns:
    """Read the channels that `columns` asks for, and their time.

    Time is, in this order: `dt`; the channel that a signal's mapping names as its time; the time that the file shows to be the
    signal's own; the channel that was mapped to time, or has its name; the axis of the channel.
    """
    with open_channels(path) as file:
        found = {
            signal: channel
            for signal, mapping in columns.items()
            if signal != time
            and (channel := _find(path, file, signal, mapping.name, signal in optional)) is not None
        }
        values = {
            signal: _finite(path, channel, _quantity(path, channel, columns[signal]))
            for signal, channel in found.items()
        }
        names = tuple(channel.name for channel in file.channels)
        unread: list[str] = []
        if dt is None:
            clocks = _clocks(path, file, found, columns, time, time_is_mapped)
        else:
            unread = [channel.name for channel in _named(file.channels, time)]
            if not unread and any(channel.axis is not None for channel in found.values()):
                unread = [_OWN_AXIS]
            _refuse_other_clocks(path, file, found, columns, time, dt)
            clocks = {
                signal: Clock("dt", dt * np.arange(channel.n_samples, dtype=np.float64))
                for signal, channel in found.items()
            }
        labels = {signal: channel.name for signal, channel in found.items()}
        units = {signal: channel.unit for signal, channel in found.items()}
    table = Columns(
        values,
        labels,
        np.arange(1, max((v.size for v in values.values()), default=0) + 1, dtype=np.int64),
        (*_notes(path, found), *(() if dt is None else unread_time(path, dt, unread))),
        units={signal: unit for signal, unit in units.items() if unit is not None},
        row="sample",
        names=names,
    )
    return with_clocks(path.name, time, table, clocks)


def unread_time(path: Path, dt: float, unread: Sequence[str]) -> tuple[str, ...]:
    """Return a note that a sample time that was given replaces the time in a file, none where it has no time."""
    if not unread:
        return ()
    return (
        f"{path.name}: dt = {dt:g} s was taken as given, and the file's own time ({', '.join(unread[:_LISTED])}) was not read. "
        "Leave dt out to read it.",
    )


def _find(
    path: Path, file: ChannelFile, signal: str, name: str | int, optional: bool = False
) -> Channel | None:
    """Return the channel of a mapping, by full name, by name without group, or by number."""
    channels = file.channels
    if isinstance(name, int):
        if 1 <= name <= len(channels):
            return channels[name - 1]
        raise InputError(
            f"{path.name}: signal '{signal}' is mapped to channel {name}, but there are {len(channels)}: {_listed(file)}."
        )
    matches = _named(channels, name)
    if len(matches) == 1:
        return matches[0]
    if matches:
        listed = ", ".join(f"'{channel.name}'" for channel in matches[:_LISTED])
        raise InputError(
            f"{path.name}: {len(matches)} channels are called '{name}': {listed}; name the one for signal '{signal}' "
            "with its group."
        )
    for refused in file.refused:
        if name in (refused.name, refused.name.rpartition("/")[2]):
            raise InputError(
                f"{path.name}: '{refused.name}', which signal '{signal}' is mapped to, {refused.reason}."
            )
    if optional:
        return None
    hint = nearest(name, [own for channel in channels for own in (channel.name, channel.short_name)])
    raise InputError(
        f"{path.name} has no channel '{name}' for signal '{signal}'.{hint} Its channels: {_listed(file)}. "
        f'Map it under columns: {signal} = "..." (on a command line --column {signal}=...). See rigsight inspect for details.'
    )


def _quantity(path: Path, channel: Channel, mapping: ColumnMapping) -> NDArray[np.float64]:
    """Return the samples; whole numbers beside what may be their conversion are taken only as the campaign says."""
    samples = channel.load()
    if samples.dtype.kind in "iu" and channel.stored.unclear and mapping.scale is None:
        raise InputError(
            f"{path.name}, channel '{channel.name}': whole numbers are stored, beside {', '.join(channel.stored.unclear)}, which "
            "may convert them; files differ in how. Give the conversion under columns, value = scale * stored number + offset; "
            "scale = 1.0 takes the numbers as they are."
        )
    return as_floats(samples)


def _notes(path: Path, found: Mapping[str, Channel]) -> tuple[str, ...]:
    return tuple(
        f"{path.name}, channel '{channel.name}': {note}."
        for channel in found.values()
        for note in (
            channel.stored.note and f"values are {channel.stored.note}",
            channel.stored.unclear
            and f"has {', '.join(channel.stored.unclear)}, which was not applied; give scale and offset under columns if it is a "
            "conversion that is still to be done",
        )
        if note
    )


def _named(channels: Iterable[Channel], name: str) -> list[Channel]:
    channels = list(channels)
    exact = [channel for channel in channels if channel.name == name]
    return exact or [channel for channel in channels if channel.short_name == name]


def _listed(file: ChannelFile) -> str:
    names = [f"'{channel.name}'" for channel in file.channels]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    if not names:
        refused = [f"'{one.name}' {one.reason}" for one in file.refused[:3]]
        return "no channel is a signal over time" + (f" ({'; '.join(refused)})" if refused else "")
    return ", ".join(names[:_LISTED]) + more


def _finite(path: Path, channel: Channel, samples: NDArray[np.float64]) -> NDArray[np.float64]:
    finite = np.isfinite(samples)
    if not finite.all():
        first = int(np.argmin(finite))
        raise InputError(
            f"{path.name}, channel '{channel.name}', sample {first + 1}: {samples[first]} is not a finite number "
            f"({np.count_nonzero(~finite)} such samples). Cut the record there or fill the gap before reading."
        )
    return samples


def _clocks(
    path: Path,
    file: ChannelFile,
    found: Mapping[str, Channel],
    columns: Mapping[str, ColumnMapping],
    time: str,
    time_is_mapped: bool,
) -> dict[str, Clock]:
    """Return the clock of every signal; of a record of nothing but time, that of the time itself."""
    channels = list(file.channels)
    numbers = {signal: channels.index(channel) for signal, channel in found.items()}
    given = {
        signal: channels.index(channel)
        for signal in found
        if (own := columns[signal].time) is not None
        and (channel := _find(path, file, f"{signal}, time", own)) is not None
    }
    names = [channel.name for channel in channels]
    shown = possible_clocks(names, numbers, given, None)
    declared = _declared(path, file, found, shown, columns[time], time, time_is_mapped)
    read: dict[int, Clock] = {}

    def stamps_of(number: int) -> Clock:
        if number not in read:
            channel = channels[number]
            stamps = _finite(path, channel, as_stamps(channel.load()))
            read[number] = Clock(channel.name, stamps, channel.unit, channel.origin)
        return read[number]

    if not found:
        assert declared is not None
        return {time: stamps_of(declared)}
    axes: dict[int, Clock] = {}
    clocks = {}
    for signal, possible in possible_clocks(names, numbers, given, declared).items():
        channel = found[signal]
        foreign = (
            possible == [declared] and signal not in given and not _around(channels[possible[0]], channel)
        )
        if channel.axis is not None and (not possible or foreign):
            if id(channel.axis) not in axes:
                stamps = _finite(path, channel, _in_seconds(path, channel, channel.axis))
                axes[id(channel.axis)] = Clock(_OWN_AXIS, stamps, "s", channel.axis.origin)
            clocks[signal] = axes[id(channel.axis)]
            continue
        tried = [stamps_of(number) for number in possible]
        clocks[signal] = next((clock for clock in tried if increases(clock.stamps)), tried[-1])
        if clocks[signal].stamps.size != channel.n_samples:
            raise InputError(
                f"{path.name}: '{channel.name}' has {channel.n_samples} samples, but the time '{clocks[signal].label}' "
                f"{clocks[signal].stamps.size}. Give it the time that belongs to it: {signal} = "
                f'{{ name = "{channel.name}", time = "..." }}.'
            )
    return clocks


def _declared(
    path: Path,
    file: ChannelFile,
    found: Mapping[str, Channel],
    shown: Mapping[str, list[int]],
    mapping: ColumnMapping,
    time: str,
    time_is_mapped: bool,
) -> int | None:
    """Return the number of the channel that is the time of all signals; None where each has its own."""
    every_one = bool(found) and all(shown[s] or c.axis is not None for s, c in found.items())
    matches = [] if isinstance(mapping.name, int) else _named(file.channels, mapping.name)
    if every_one and len(matches) > 1 and all(shown.values()):
        return None
    if not matches and not time_is_mapped:
        if every_one:
            return None
        lacking = [channel for signal, channel in found.items() if not shown[signal] and channel.axis is None]
        if len(lacking) < len(found):
            raise InputError(
                f"{path.name}: channel '{lacking[0].name}' has no time axis, unlike others. Map time under columns, or "
                f'give it one: {{ name = "{lacking[0].name}", time = "..." }}.'
            )
        raise InputError(
            f"{path.name} has no channel '{time}', and its channels have no time axis. Map time under columns "
            f'({time} = "..."), or give the sample time in seconds with the record: dt = 0.001. '
            f"Its channels: {_listed(file)}."
        )
    channel = _find(path, file, time, mapping.name)
    assert channel is not None
    return list(file.channels).index(channel)


def _around(time: Channel, channel: Channel) -> bool:
    """Return True if a time stands in the group of a channel, or in one around it."""
    return f"{channel.group}/".startswith(f"{time.group}/") or not time.group


def _refuse_other_clocks(
    path: Path,
    file: ChannelFile,
    found: Mapping[str, Channel],
    columns: Mapping[str, ColumnMapping],
    time: str,
    dt: float,
) -> None:
    """Refuse one sample time for signals that the file shows to have clocks of their own that differ, or other lengths."""
    lengths = {channel.n_samples for channel in found.values()}
    clocks: dict[str, Clock] = {}
    shown = possible_clocks(
        [channel.name for channel in file.channels],
        {signal: list(file.channels).index(channel) for signal, channel in found.items()},
        {},
        None,
    )
    if found and all(shown[signal] or channel.axis is not None for signal, channel in found.items()):
        clocks = _clocks(path, file, found, columns, time, False)
    if len(lengths) > 1 or (clocks and shared_clock(clocks.values()) is None):
        refuse_one_dt(path.name, dt, "clocks of their own or other lengths")


def _in_seconds(path: Path, channel: Channel, axis: TimeAxis) -> NDArray[np.float64]:
    try:
        scale = factor(axis.unit, "s")
    except UnknownUnitError as error:
        raise InputError(
            f"{path.name}, channel '{channel.name}': the unit '{axis.unit}' of its time axis {error}. Export it over seconds."
        ) from None
    stamps = axis.stamps()
    return stamps if scale == 1.0 else scale * stamps

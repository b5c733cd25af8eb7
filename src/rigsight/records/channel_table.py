"""Selection of the channels of a measurement file for the requested signals, with their time axis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest
from rigsight.records.channel_units import UnknownUnitError, factor
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

    Time is, in this order: `dt`; the channel that was mapped to it; a channel of its name; the channels' own axes.

    Parameters
    ----------
    path
        A measurement file other than delimited text.
    columns
        Signal name, or `time`, -> its column.
    time
        Name of the time among them.
    time_is_mapped
        True if the user mapped it, so that the column must exist.
    optional
        Signals that may be missing.
    dt
        Sample time [s] where the file has no time.

    Raises
    ------
    InputError
        If a channel cannot be used; the message gives file, channel and the remedy.
    """
    with open_channels(path) as file:
        found = {
            signal: channel
            for signal, mapping in columns.items()
            if signal != time
            and (channel := _find(path, file, signal, mapping, signal in optional)) is not None
        }
        values = {
            signal: _finite(path, channel, _quantity(path, channel, columns[signal]))
            for signal, channel in found.items()
        }
        axes, label = _axes(path, file, found, columns[time], time, time_is_mapped, dt)
        labels = {signal: channel.name for signal, channel in found.items()} | {time: label[0]}
        units = {signal: channel.unit for signal, channel in found.items()} | {time: label[1]}
        names = tuple(channel.name for channel in file.channels)
        unread = [channel.name for channel in _named(file.channels, time)]
        if not unread and any(channel.axis is not None for channel in found.values()):
            unread = [_OWN_AXIS]
    shared = _shared(axes.values())
    if shared is not None:
        values[time] = shared
    n_rows = max((samples.size for samples in values.values()), default=0)
    return Columns(
        values,
        labels,
        np.arange(1, n_rows + 1, dtype=np.int64),
        (*_notes(path, found), *(() if dt is None else unread_time(path, dt, unread))),
        units={signal: unit for signal, unit in units.items() if unit is not None},
        axes={} if shared is not None else axes,
        row="sample",
        names=names,
    )


def unread_time(path: Path, dt: float, unread: Sequence[str]) -> tuple[str, ...]:
    """Return a note that a sample time that was given replaces the time in a file, none where it has no time.

    Parameters
    ----------
    path
        The file.
    dt
        Sample time [s].
    unread
        Columns or channels of time that the file has.
    """
    if not unread:
        return ()
    return (
        f"{path.name}: dt = {dt:g} s was taken as given, and the file's own time ({', '.join(unread[:_LISTED])}) was not read. "
        "Leave dt out to read it.",
    )


def _find(
    path: Path, file: ChannelFile, signal: str, mapping: ColumnMapping, optional: bool
) -> Channel | None:
    """Return the channel of a mapping, by full name, by name without group, or by number."""
    channels = file.channels
    if isinstance(mapping.name, int):
        if 1 <= mapping.name <= len(channels):
            return channels[mapping.name - 1]
        raise InputError(
            f"{path.name}: signal '{signal}' is mapped to channel {mapping.name}, but there are {len(channels)}: {_listed(file)}."
        )
    matches = _named(channels, mapping.name)
    if len(matches) == 1:
        return matches[0]
    if matches:
        listed = ", ".join(f"'{channel.name}'" for channel in matches[:_LISTED])
        raise InputError(
            f"{path.name}: {len(matches)} channels are called '{mapping.name}': {listed}; name the one for signal '{signal}' "
            "with its group."
        )
    for refused in file.refused:
        if mapping.name in (refused.name, refused.name.rpartition("/")[2]):
            raise InputError(
                f"{path.name}: '{refused.name}', which signal '{signal}' is mapped to, {refused.reason}."
            )
    if optional:
        return None
    hint = nearest(
        mapping.name, [name for channel in channels for name in (channel.name, channel.short_name)]
    )
    raise InputError(
        f"{path.name} has no channel '{mapping.name}' for signal '{signal}'.{hint} Its channels: {_listed(file)}. "
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


def _axes(
    path: Path,
    file: ChannelFile,
    found: Mapping[str, Channel],
    mapping: ColumnMapping,
    time: str,
    time_is_mapped: bool,
    dt: float | None,
) -> tuple[dict[str, NDArray[np.float64]], tuple[str, str | None]]:
    """Return the stamps of every signal, and how time is called and in which unit it stands."""
    if dt is not None:
        return {s: dt * np.arange(c.n_samples, dtype=np.float64) for s, c in found.items()}, ("dt", None)
    matches = [] if isinstance(mapping.name, int) else _named(file.channels, mapping.name)
    # Groups that each have a channel of this name: every signal goes by the time of its own group.
    if len(matches) > 1 and {c.group for c in found.values()} <= {m.group for m in matches}:
        by_group = {match.group: match for match in matches}
        chosen = {signal: by_group[channel.group] for signal, channel in found.items()}
    elif matches or time_is_mapped or all(channel.axis is None for channel in found.values()):
        if not matches and not time_is_mapped:
            raise InputError(
                f"{path.name} has no channel '{time}', and its channels have no time axis. Map time under columns "
                f'({time} = "..."), or give the sample time in seconds with the record: dt = 0.001. '
                f"Its channels: {_listed(file)}."
            )
        named = _find(path, file, time, mapping, optional=False)
        assert named is not None
        # Of a record of nothing but time, the time itself.
        chosen = dict.fromkeys(found or [time], named)
    else:
        return _own_axes(path, found), (_OWN_AXIS, None)
    stamps = {
        name: _finite(path, channel, as_stamps(channel.load()))
        for name, channel in {channel.name: channel for channel in chosen.values()}.items()
    }
    for signal, channel in found.items():
        if stamps[chosen[signal].name].size != channel.n_samples:
            raise InputError(
                f"{path.name}: '{channel.name}' has {channel.n_samples} samples, but the time '{chosen[signal].name}' "
                f"{stamps[chosen[signal].name].size}. Map time to the channel that belongs to it."
            )
    units = {channel.unit for channel in chosen.values()}
    if len(units) > 1:
        raise InputError(f"{path.name}: the groups have times in different units; export them in seconds.")
    return {s: stamps[c.name] for s, c in chosen.items()}, (next(iter(chosen.values())).name, units.pop())


def _own_axes(path: Path, found: Mapping[str, Channel]) -> dict[str, NDArray[np.float64]]:
    """Return the stamps [s] of channels that keep their own."""
    read: dict[int, NDArray[np.float64]] = {}
    axes = {}
    for signal, channel in found.items():
        if channel.axis is None:
            raise InputError(
                f"{path.name}: channel '{channel.name}' has no time axis, unlike others. Map time under columns."
            )
        if id(channel.axis) not in read:
            read[id(channel.axis)] = _finite(path, channel, _in_seconds(path, channel, channel.axis))
        axes[signal] = read[id(channel.axis)]
    return axes


def _in_seconds(path: Path, channel: Channel, axis: TimeAxis) -> NDArray[np.float64]:
    try:
        scale = factor(axis.unit, "s")
    except UnknownUnitError as error:
        raise InputError(
            f"{path.name}, channel '{channel.name}': the unit '{axis.unit}' of its time axis {error}. Export it over seconds."
        ) from None
    stamps = axis.stamps()
    return stamps if scale == 1.0 else scale * stamps


def _shared(axes: Iterable[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return the stamps that all signals have, None if they differ."""
    first, *others = axes
    return first if all(other is first or np.array_equal(other, first) for other in others) else None

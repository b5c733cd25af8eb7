"""Selection of the channels of files of any format for the requested signals, with their time axis."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.errors import InputError, nearest
from rigsight.records.clocks import (
    Clock,
    in_seconds,
    increases,
    possible_clocks,
    refuse_one_dt,
    shared_clock,
    side_by_side,
    unit_of_clock,
    with_clocks,
)
from rigsight.records.column_mapping import TIME, ColumnMapping, Columns
from rigsight.records.formats.channel import ChannelFile, TimeAxis, as_floats, as_stamps
from rigsight.records.formats.channel_file import file_format, open_channels
from rigsight.records.formats.text_channels import TextColumns
from rigsight.records.record import Floats

_LISTED = 30
"""Channels that a message lists; a logger may record thousands."""
_OWN_AXIS = "its own time axis"
_last_file: ContextVar[dict[Any, Columns] | None] = ContextVar("last file", default=None)


@contextmanager
def files_read_once() -> Iterator[None]:
    """Keep what was read of the last file inside this context: its next record is often another stretch of it."""
    token = _last_file.set({})
    try:
        yield
    finally:
        _last_file.reset(token)


def columns_of_files(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    optional: Sequence[str],
    dt: float | None,
    dialect: Mapping[str, Any],
    *,
    time_is_mapped: bool,
) -> Columns:
    """Read the columns of a record, see `read_columns`; signals may be in files of their own."""
    files: dict[Path, dict[str, ColumnMapping]] = {path: {}}
    for signal, column in columns.items():
        files.setdefault(column.file or path, {})[signal] = column
    if len(files) > 1 and TIME not in files[path]:
        raise InputError(
            f"{path.name}: {TIME} cannot be in another file; each file has the time of its own signals."
        )
    if len(files) > 1 and dt is not None:
        raise InputError(
            f"{path.name}: dt = {dt:g} cannot hold for signals of several files; each needs its time."
        )
    tables, last = {}, _last_file.get()
    for file, own in files.items():
        asked = {TIME: columns[TIME], **own}
        if len(asked) == 1 and len(files) > 1:
            continue
        key = (file, *asked.items(), *optional, dt, *dialect.values(), time_is_mapped)
        if last is None or key not in last:
            tables[file] = read_columns(
                file, asked, time_is_mapped=time_is_mapped, optional=optional, dt=dt, dialect=dialect
            )
            if last is not None:
                last.clear()
                last[key] = tables[file]
        else:
            tables[file] = last[key]
    return tables[path] if len(files) == 1 else side_by_side(path.name, tables)


def read_columns(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    *,
    time_is_mapped: bool,
    optional: Sequence[str] = (),
    dt: float | None = None,
    dialect: Mapping[str, object] | None = None,
) -> Columns:
    """Read the columns or channels that `columns` asks for, and their time, as they stand there; others may hold anything."""
    # Time is, in this order: `dt`; the channel that a signal's mapping names as its time; the time that the file shows to be the
    # signal's own; the channel that was mapped to time, or has its name; the axis of the channel.
    with _opened(path, columns, dialect or {}) as file:
        selection = _Selection(path, file, columns, optional)
        possible = selection.possible_times(time_is_mapped) if dt is None else selection.shown_times(dt)
        times = {f"time {number}": number for numbers in possible.values() for number in numbers}
        # Signals of other rates end in other rows of a text, and blank cells fill the rest.
        if file.ahead is not None:
            file.ahead({**selection.found, **times}, len(times) > 1)
        values = {signal: selection.quantity(signal) for signal in selection.found}
        clocks = {signal: selection.clock(signal, own, values) for signal, own in possible.items()}
        notes = (*file.notes, *selection.notes())
        if dt is not None:
            unread = [file.channels[number].name for number in selection.named(TIME)]
            if not unread and any(file.channels[i].axis is not None for i in selection.found.values()):
                unread = [_OWN_AXIS]
            if unread:
                told = ", ".join(unread[:_LISTED])
                note = f"{path.name}: dt = {dt:g} s was taken as given, and the file's own time ({told}) was not read. "
                notes = (*notes, f"{note}Leave dt out to read it.")
            lengths = {samples.size for samples in values.values()}
            if len(lengths) > 1 or (clocks and shared_clock(clocks.values()) is None):
                refuse_one_dt(path.name, dt, "clocks of their own or other lengths")
            n_samples = max(lengths, default=max((one.n_samples for one in file.channels), default=0))
            clock = Clock("dt", dt * np.arange(n_samples, dtype=np.float64))
            clocks = dict.fromkeys(selection.found or [TIME], clock)
        values = {signal: samples[: clocks[signal].stamps.size] for signal, samples in values.items()}
        for signal, clock in clocks.items():
            if signal in values:
                selection.check_finite(file.channels[selection.found[signal]].label, values[signal])
            selection.check_finite(clock.label, clock.stamps)
        n_rows = max((samples.size for samples in values.values()), default=0)
        table = Columns(
            values,
            {signal: file.channels[number].label for signal, number in selection.found.items()},
            np.arange(1, n_rows + 1, dtype=np.int64) if file.lines is None else file.lines,
            notes,
            units={
                signal: unit
                for signal, i in selection.found.items()
                if (unit := file.channels[i].unit) is not None
            },
            row=file.row,
            names=tuple(channel.label for channel in file.channels),
        )
    return with_clocks(path.name, table, clocks)


@contextmanager
def _opened(
    path: Path, columns: Mapping[str, ColumnMapping], dialect: Mapping[str, object]
) -> Iterator[ChannelFile]:
    if file_format(path) is None:
        names = {name for mapping in columns.values() for name in (mapping.name, mapping.time)}
        wanted = {name for name in names if isinstance(name, str)}
        yield TextColumns(path, wanted, **dialect).strict()  # type: ignore[arg-type]
        return
    for key, value in dialect.items():
        if value is not None:
            raise InputError(f"{path.name} is not delimited text, so {key} does not apply; remove {key}.")
    with open_channels(path) as file:
        yield file


def open_measurement(path: Path) -> AbstractContextManager[ChannelFile]:
    """Open a file of any format, delimited text included, for a look; its channels can be read inside this context."""
    return nullcontext(TextColumns(path).tolerant()) if file_format(path) is None else open_channels(path)


class _Selection:
    """The channels of an open file for signals, and the times by which they go."""

    def __init__(
        self, path: Path, file: ChannelFile, columns: Mapping[str, ColumnMapping], optional: Sequence[str]
    ) -> None:
        self._path, self._file, self._columns = path, file, columns
        # As the file has them: a number behind a name would hide its unit.
        self._names = [channel.label for channel in file.channels]
        self._axes: dict[TimeAxis, Clock] = {}
        self._units: dict[int, float] = {}
        """Number of a time without a unit -> its unit [s], by the stamps that the file keeps beside it."""
        self.found = {
            signal: number
            for signal, mapping in columns.items()
            if signal != TIME and (number := self._find(signal, mapping.name, signal in optional)) is not None
        }
        """Signal -> number of its channel, from 0."""

    def named(self, name: str) -> list[int]:
        """Return the numbers of the channels of a name: as the file has it, as told apart, or without group."""
        for called in ("label", "name", "short_name"):
            matches = [i for i, one in enumerate(self._file.channels) if getattr(one, called) == name]
            if matches:
                return matches
        return []

    def _find(self, signal: str, name: str | int, optional: bool = False) -> int | None:
        """Return the number of the channel of a mapping, by full name, by name without group, or by number."""
        path, word, count = self._path, self._file.word, len(self._names)
        if isinstance(name, int):
            if 1 <= name <= count:
                return name - 1
            raise InputError(
                f"{path.name}: signal '{signal}' is mapped to {word} {name}, but the {word}s are 1 to {count}: {self._listed()}."
            )
        matches = self.named(name)
        if len(matches) == 1:
            return matches[0]
        if matches:
            listed = ", ".join(f"'{self._file.channels[i].name}'" for i in matches[:_LISTED])
            by = f"with its group: {listed}" if self._file.lines is None else "by its number, counted from 1"
            raise InputError(
                f"{path.name}: {len(matches)} {word}s are called '{name}'; name the one for signal '{signal}' {by}."
            )
        for refused in self._file.refused:
            if name in (refused.name, refused.name.rpartition("/")[2]):
                raise InputError(
                    f"{path.name}: '{refused.name}', which signal '{signal}' is mapped to, {refused.reason}."
                )
        if name.isdecimal() and 1 <= int(name) <= count:
            return int(name) - 1
        if optional:
            return None
        if not self._file.has_names:
            raise InputError(
                f"{path.name} has no header, so there is no column '{name}' for signal '{signal}'; "
                f"name it by its number, 1 to {count}: {signal} = 1, for instance."
            )
        known = [own for channel in self._file.channels for own in (channel.label, channel.short_name)]
        mend = (
            f'Map it under columns: {signal} = "..." (on a command line --column {signal}=...). See rigsight inspect for details.'
            if self._file.lines is None
            else "Map it under columns, or specify the separator if these are not the columns."
        )
        raise InputError(
            f"{path.name} has no {word} '{name}' for signal '{signal}'.{nearest(name, known)} "
            f"Its {word}s: {self._listed()}. {mend}"
        )

    def _listed(self) -> str:
        names = [f"'{channel.label}'" for channel in self._file.channels]
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        if not names:
            refused = [f"'{one.name}' {one.reason}" for one in self._file.refused[:3]]
            return "no channel is a signal over time" + (f" ({'; '.join(refused)})" if refused else "")
        return ", ".join(names[:_LISTED]) + more

    def quantity(self, signal: str) -> Floats:
        """Return the samples; whole numbers beside what may be their conversion are taken only as the campaign says."""
        channel = self._file.channels[self.found[signal]]
        samples = channel.load()
        if samples.dtype.kind in "iu" and channel.stored.unclear and self._columns[signal].scale is None:
            raise InputError(
                f"{self._path.name}, channel '{channel.name}': whole numbers are stored, beside "
                f"{', '.join(channel.stored.unclear)}, which may convert them; files differ in how. Give the conversion under "
                "columns, value = scale * stored number + offset; scale = 1.0 takes the numbers as they are."
            )
        return as_floats(samples)

    def notes(self) -> tuple[str, ...]:
        """Return what the file says of stored numbers and of the stamps beside them."""
        channels = [self._file.channels[number] for number in self.found.values()]
        of_stamps = (note for one in channels if one.axis is not None for note in one.axis.notes)
        return *dict.fromkeys(of_stamps), *(
            f"{self._path.name}, channel '{channel.name}': {note}."
            for channel in channels
            for note in (
                channel.stored.note and f"values are {channel.stored.note}",
                channel.stored.unclear
                and f"has {', '.join(channel.stored.unclear)}, which was not applied; give scale and offset under columns if it "
                "is a conversion that is still to be done",
            )
            if note
        )

    def check_finite(self, label: str, samples: Floats) -> None:
        """Refuse samples, of which some are no numbers."""
        finite = np.isfinite(samples)
        if finite.all():
            return
        first, count, lines = int(np.argmin(finite)), int(np.count_nonzero(~finite)), self._file.lines
        if lines is None:
            where, cell = f"channel '{label}', sample {first + 1}", "sample"
        else:
            where, cell = f"line {lines[first]}, column '{label}'", "cell"
        raise InputError(
            f"{self._path.name}, {where}: {samples[first]} is not a finite number "
            f"({count} such {cell}{'s' if count > 1 else ''}). Cut the record there or fill the gap before reading."
        )

    def shown_times(self, dt: float) -> dict[str, list[int]]:
        """Return the times that the file shows to be those of its signals, if it shows one for each; else none."""
        shown = possible_clocks(self._names, self.found, {}, None)
        if self._file.lines is not None:
            # What the sample time replaces may be dates or other text, and is not read.
            if len({tuple(own) for own in shown.values()}) > 1:
                refuse_one_dt(self._path.name, dt, "clocks of their own")
            return {}
        return shown if self.found and self._every_one(shown) else {}

    def _every_one(self, shown: Mapping[str, list[int]]) -> bool:
        return all(shown[s] or self._file.channels[i].axis is not None for s, i in self.found.items())

    def possible_times(self, time_is_mapped: bool) -> dict[str, list[int]]:
        """Return the numbers of the times by which each signal may go, none for its own axis; of time itself without signals."""
        given = {
            signal: number
            for signal in self.found
            if (own := self._columns[signal].time) is not None
            and (number := self._find(f"{signal}, time", own)) is not None
        }
        declared = self._declared(possible_clocks(self._names, self.found, given, None), time_is_mapped)
        if not self.found:
            assert declared is not None
            return {TIME: [declared]}
        possible = possible_clocks(self._names, self.found, given, declared)
        for signal, numbers in possible.items():
            channel = self._file.channels[self.found[signal]]
            foreign = numbers == [declared] and signal not in given
            # A time in the group of the channel, or in one around it, is its own.
            time = self._file.channels[numbers[0]].group if foreign else ""
            if channel.axis is not None and time and not f"{channel.group}/".startswith(f"{time}/"):
                possible[signal] = []
        self._check_by_axes(possible, {*given.values(), *([declared] if time_is_mapped else [])})
        return possible

    def _check_by_axes(self, possible: dict[str, list[int]], mapped: Set[int | None]) -> None:
        """Leave out what is only called like time: next to stamps of the file, as in a bag, a clock goes as they do."""
        stamped = []
        for signal, numbers in possible.items():
            channel = self._file.channels[self.found[signal]]
            times = {number: self._file.channels[number] for number in numbers}
            dated = any(time.unit is not None or time.origin is not None for time in times.values())
            if channel.axis is None or channel.axis.load is None or dated or mapped & times.keys():
                continue
            stamped.append(signal)
            stamps = in_seconds(self._path, channel, channel.axis)
            units = {number: unit_of_clock(as_stamps(time.load()), stamps) for number, time in times.items()}
            possible[signal] = [number for number in numbers if units[number] is not None]
            self._units |= {number: unit for number, unit in units.items() if unit is not None}
        # The clock of a device and that of the file cannot be compared.
        if not all(possible[signal] for signal in stamped):
            possible |= {signal: [] for signal in stamped}

    def _declared(self, shown: Mapping[str, list[int]], time_is_mapped: bool) -> int | None:
        """Return the number of the channel that is the time of all signals; None where each has its own."""
        path, mapping, is_text = self._path, self._columns[TIME], self._file.lines is not None
        every_one = bool(self.found) and self._every_one(shown)
        matches = [] if isinstance(mapping.name, int) else self.named(mapping.name)
        if every_one and len(matches) > 1 and all(shown.values()):
            return None
        if not matches and not time_is_mapped and every_one:
            return None
        if not matches and not time_is_mapped and not is_text:
            axes = {signal: self._file.channels[number].axis for signal, number in self.found.items()}
            lacking = [signal for signal, axis in axes.items() if not shown[signal] and axis is None]
            if len(lacking) < len(self.found):
                name = self._names[self.found[lacking[0]]]
                raise InputError(
                    f"{path.name}: channel '{name}' has no time axis, unlike others. Map time under columns, or "
                    f'give it one: {{ name = "{name}", time = "..." }}.'
                )
            raise InputError(
                f"{path.name} has no channel '{TIME}', and its channels have no time axis. Map time under columns "
                f'({TIME} = "..."), or give the sample time in seconds with the record: dt = 0.001. '
                f"Its channels: {self._listed()}."
            )
        return self._find(TIME, mapping.name)

    def clock(self, signal: str, possible: Iterable[int], values: Mapping[str, Floats]) -> Clock:
        """Return the clock of a signal: the first of the possible ones that increases, or its own axis."""
        channel = self._file.channels[self.found[signal]] if signal in self.found else None
        tried = [self._clock_of(number, values.get(signal)) for number in possible]
        if not tried:
            assert channel is not None
            assert channel.axis is not None
            if channel.axis not in self._axes:
                stamps = in_seconds(self._path, channel, channel.axis)
                self._axes[channel.axis] = Clock(
                    _OWN_AXIS, stamps, "s", channel.axis.origin, channel.axis.late
                )
            return self._axes[channel.axis]
        chosen = next((clock for clock in tried if increases(clock.stamps)), tried[-1])
        if channel is not None and self._file.lines is None and chosen.stamps.size != channel.n_samples:
            raise InputError(
                f"{self._path.name}: '{channel.name}' has {channel.n_samples} samples, but the time '{chosen.label}' "
                f"{chosen.stamps.size}. Give it the time that belongs to it: {signal} = "
                f'{{ name = "{channel.name}", time = "..." }}.'
            )
        return chosen

    def _clock_of(self, number: int, samples: Floats | None) -> Clock:
        """Return a time, of a text up to the last row in which it or its signal is given."""
        channel = self._file.channels[number]
        stamps = as_stamps(channel.load())
        if self._file.lines is not None:
            given = np.flatnonzero(~(np.isnan(stamps) & np.isnan(stamps if samples is None else samples)))
            stamps = stamps[: int(given[-1]) + 1 if given.size else 0]
        if number in self._units:
            return Clock(channel.name, self._units[number] * stamps, "s")
        return Clock(channel.name, stamps, channel.unit, channel.origin)

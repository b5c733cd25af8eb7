"""Which clock does each signal of a record have: which channel of time is its own, and do signals share one?"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from rigsight.errors import InputError
from rigsight.records.channel_names import NAMES_OF, closeness, plain_words
from rigsight.records.channel_units import UnknownUnitError, factor
from rigsight.records.column_mapping import TIME, Columns
from rigsight.records.formats.channel import Channel, TimeAxis
from rigsight.records.record import Floats
from rigsight.records.stamps import seconds_since

_NAMED = 2.0
_UNITS_OF_TIME = (1.0, 1e-3, 1e-6, 1e-9)
"""In which computers count time [s]."""
_ALIKE = 0.05
"""Relative difference between two clocks of one device: less than any two units of time."""
_WORDS_OF_TIME = tuple(sorted(NAMES_OF[TIME], key=len, reverse=True))


def is_time(name: str) -> bool:
    """Return True if a channel is called like time, whatever its group."""
    return closeness(name, TIME) >= _NAMED


def is_prefixed_time(name: str) -> bool:
    """Return True if a channel is called like time and what it belongs to, as ``t_shoulder``; a temperature may be as well."""
    return _parts(name)[1].startswith("t ")


def own_clocks(names: Sequence[str], further: Sequence[int] = ()) -> Mapping[int, int]:
    """Return the number of each channel -> that of its own time where a file shows it; `further` times need no such name."""
    # A file shows it by names (``Time Force`` beside ``Force``), by groups (a time in the group of a channel, or in the nearest
    # one around it), or by order (columns of time of one name, each in front of its signals). One time alone belongs to no one in
    # particular.
    times = [number for number, name in enumerate(names) if is_time(name) or number in further]
    named = _by_name(names)
    if len(set(times) | set(named.values())) < 2:
        return {}
    clocks = {}
    for number, name in enumerate(names):
        if number in times or number in named.values():
            continue
        own = named.get(number, _nearest(names, times, number, name))
        if own is not None:
            clocks[number] = own
    return clocks


def _by_name(names: Sequence[str]) -> dict[int, int]:
    """Return the times that are called like another channel and a word of time."""
    found: dict[int, int] = {}
    by_words: dict[tuple[str, str], int] = {}
    for number, name in enumerate(names):
        by_words.setdefault(_parts(name), number)
    for number, name in enumerate(names):
        group, words = _parts(name)
        for word in _WORDS_OF_TIME:
            for rest in (words.removeprefix(f"{word} "), words.removesuffix(f" {word}")):
                other = by_words.get((group, rest))
                if rest != words and other is not None and other != number:
                    found.setdefault(other, number)
    return found


def _parts(name: str) -> tuple[str, str]:
    group, _, short = name.rpartition("/")
    return group, plain_words(short)


def _nearest(names: Sequence[str], times: Sequence[int], number: int, name: str) -> int | None:
    """Return the only time in the group of a channel or the nearest around it; of several of one name the one in front."""
    group = name.rpartition("/")[0]
    while True:
        inside = [time for time in times if names[time].rpartition("/")[0] == group]
        if len(inside) == 1:
            return inside[0]
        if inside:
            return _in_front(names, inside, number)
        if not group:
            return None
        group = group.rpartition("/")[0]


def _in_front(names: Sequence[str], times: Sequence[int], number: int) -> int | None:
    called = {
        "t " if is_prefixed_time(names[time]) else _parts(names[time])[1].rstrip("0123456789 ")
        for time in times
    }
    apart = all(after - before > 1 for before, after in zip(times, [*times[1:], len(names)], strict=True))
    if len(called) > 1 or not apart or number < times[0]:
        return None
    return max(time for time in times if time < number)


def possible_clocks(
    names: Sequence[str], signals: Mapping[str, int], given: Mapping[str, int], declared: int | None
) -> dict[str, list[int]]:
    """Return the numbers of the times by which each signal may go, the first that increases is its own."""
    own = own_clocks(names)
    return {
        signal: [given[signal]]
        if signal in given
        else list(dict.fromkeys(one for one in (own.get(number), declared) if one is not None))
        for signal, number in signals.items()
    }


def increases(stamps: Floats) -> bool:
    """Return True if numbers can be the stamps of a clock, shape (n_samples,)."""
    return stamps.size > 1 and bool(np.all(np.diff(stamps) > 0.0))


def in_seconds(path: Path, channel: Channel, axis: TimeAxis) -> Floats:
    """Return the stamps [s] of the own axis of a channel, shape (n_samples,)."""
    try:
        scale = factor(axis.unit, "s")
    except UnknownUnitError as error:
        raise InputError(
            f"{path.name}, channel '{channel.name}': the unit '{axis.unit}' of its time axis {error}. Export it over seconds."
        ) from None
    stamps = axis.stamps()
    return stamps if scale == 1.0 else scale * stamps


def unit_of_clock(clock: Floats, stamps: Floats) -> float | None:
    """Return the unit [s] in which a clock counts, by stamps [s] of the same moments; None where it is no clock."""
    if clock.size != stamps.size or not increases(clock):
        return None
    ratio = np.ptp(stamps) / np.ptp(clock)
    return next((unit for unit in _UNITS_OF_TIME if abs(ratio / unit - 1.0) < _ALIKE), None)


@dataclass(frozen=True, eq=False)
class Clock:
    """The time of a signal."""

    label: str  # how it is called
    stamps: Floats  # time stamps, shape (n_samples,)
    unit: str | None = None  # stated by the file; None where it is that of the campaign
    origin: np.datetime64 | None = None  # moment from which they count; None where the file does not say
    late: float = 0.0  # see `TimeAxis`


def refuse_one_dt(file: str, dt: float, what: str) -> NoReturn:
    """Refuse one sample time for signals that have several."""
    raise InputError(
        f"{file}: dt = {dt:g} cannot hold for signals that have {what}. Leave dt out, and name the time of each where the file "
        'does not show it: { name = "...", time = "..." }.'
    )


def with_clocks(file: str, table: Columns, clocks: Mapping[str, Clock]) -> Columns:
    """Return a table with the time of its signals: one for all where they share it, else the stamps of each."""
    chosen = list(clocks.values())
    # What stamps say of two signals and what their reception says differ by this.
    late = [clock.late for clock in chosen]
    table = replace(table, clock_uncertainty=max(late) - min(late))
    shared = shared_clock(chosen)
    known = {signal: clock.origin for signal, clock in clocks.items() if clock.origin is not None}
    if shared is not None:
        labels = {TIME: shared.label, **table.labels}
        units = table.units if shared.unit is None else {**table.units, TIME: shared.unit}
        lines = table.lines if table.lines.size else np.arange(1, shared.stamps.size + 1, dtype=np.int64)
        values = {TIME: shared.stamps, **table.values}
        return replace(table, values=values, labels=labels, units=units, lines=lines, origins=known)
    if len({clock.unit or "s" for clock in chosen}) > 1:
        raise InputError(f"{file}: its signals have times in different units; export them in seconds.")
    if 0 < len(known) < len(clocks):
        dated = ", ".join(f"{signal} ({clocks[signal].label})" for signal in known)
        raise InputError(
            f"{file}: the clocks of the signals cannot be compared: only the time of {dated} has a date. Export all with a start "
            "time, or all without."
        )
    first = min(known.values(), default=None)
    axes: dict[str, Floats] = {}
    for signal, clock in clocks.items():
        alike = next((s for s in axes if shared_clock([clocks[s], clock])), None)
        if alike is not None:
            axes[signal] = axes[alike]
        elif first is None or clock.origin is None:
            axes[signal] = clock.stamps
        else:
            axes[signal] = clock.stamps + float(seconds_since(np.array([clock.origin]), first)[0])
    unit = next((clock.unit for clock in chosen if clock.unit is not None), None)
    return replace(
        table,
        labels={TIME: chosen[0].label, **table.labels},
        units=table.units if unit is None else {**table.units, TIME: unit},
        axes=axes,
        clocks={signal: clock.label for signal, clock in clocks.items()},
        origins=dict.fromkeys(clocks, first) if first is not None else {},
    )


def side_by_side(file: str, tables: Mapping[Path, Columns]) -> Columns:
    """Return the signals of several files as those of one record, each with the time of its file."""
    values, labels, clocks = {}, {}, {}
    units: dict[str, str] = {}
    for path, table in tables.items():
        units |= {signal: unit for signal, unit in table.units.items() if signal != TIME}
        for signal in (name for name in table.values if name != TIME):
            values[signal] = table.values[signal]
            labels[signal] = f"{table.labels[signal]} of {path.name}"
            label = f"{table.clocks.get(signal, table.labels[TIME])} of {path.name}"
            stamps, origin = table.clock_of(signal), table.origins.get(signal)
            clocks[signal] = Clock(label, stamps, table.units.get(TIME), origin)
    longest = max(tables.values(), key=lambda table: table.lines.size)
    joint = Columns(
        values,
        labels,
        longest.lines,
        tuple(note for table in tables.values() for note in table.notes),
        units,
        row=longest.row,
        names=tuple(name for table in tables.values() for name in table.names),
    )
    return with_clocks(file, joint, clocks)


def shared_clock(clocks: Iterable[Clock]) -> Clock | None:
    """Return the clock that all signals have, None if they differ."""
    first, *others = clocks
    alike = all(
        other is first or (other.origin == first.origin and np.array_equal(other.stamps, first.stamps))
        for other in others
    )
    return first if alike else None

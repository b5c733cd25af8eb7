"""Does a channel show what moves, or signs of its own: codes for no reading, a full turn, a value that is held over several rows?

The one place where these are found, for `inspect`, `init` and every command that reads a record, and where a record is freed of
them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.channel_units import conversion, is_a
from rigsight.records.column_mapping import TIME, ColumnMapping, Columns
from rigsight.records.record import Floats

_CODE_SIZE = 1e30
"""From here on no reading in any unit: 9.9e37 and 9.91e37 (SCPI), 9.97e36 (NetCDF), 9.9e34 (DIAdem), 3.4e38 (end of a type)."""
_NINES = [sign * (10.0**n - 1.0) for n in (3, 4, 5, 6, 7) for sign in (1.0, -1.0)]
_HALVES = [2.0 ** (n - 1) for n in (16, 24, 32)]
_ENDS = [end for half in _HALVES for end in (2.0 * half - 1.0, half - 1.0, 1.0 - half, -half)]
_CODES = np.array([*_NINES, -999.25, *_ENDS])
"""Nines, the code of LAS files, and the ends of whole numbers of 16, 24 and 32 bits."""
_MOST_CODES = 0.5
"""Share of the samples: what is there most of the time is a level of the signal."""
_SPIKE = 3
"""Samples within which interference is over (an assumption)."""
FULL_TURNS = (2.0 * math.pi, 360.0)
_COUNTERS = tuple(2.0**n for n in range(8, 33))
_CLEARLY = 0.25
"""Of a period: a step across its end that is longer, once the period is taken off, may as well be one the other way round."""
_OVER_THE_END = 1e-3
"""Of a period: rounding of its end in the file."""
FEWEST_FRESH = 20
"""Changes, and levels, from which the rows between changes are counted."""
_REGULAR = 0.9
"""Share of the changes that must follow the earlier one after the usual number of rows, one more or one less: two clocks beat."""

_ROWS_LISTED = 6
"""Rows that a message lists."""
_ANGLE = "rad"


@dataclass(frozen=True)
class Code:
    """A number that stands for no reading: its value, and the samples that hold it."""

    value: float
    samples: NDArray[np.intp]


def codes(samples: Floats) -> tuple[Code, ...]:
    """Return the codes for no reading in a signal of shape (n_samples,), all finite."""
    # A code is a usual number for it, rare, and further from all readings than any two of them that follow each other: a signal
    # that reaches such a number by itself passes through what lies between.
    huge = np.abs(samples) >= _CODE_SIZE
    usual = np.isin(samples, _CODES)
    if not huge.any() and not usual.any():
        return ()
    found = []
    for value in np.unique(samples[huge | usual]):
        own = samples == value
        others = ~(own | huge)
        readings = samples[others]
        if np.mean(own) >= _MOST_CODES or readings.size < 2:
            continue
        # A command of two levels steps between them.
        if np.ptp(readings) == 0.0 and abs(value) < _CODE_SIZE:
            continue
        steps = np.abs(np.diff(samples))[others[1:] & others[:-1]]
        if np.min(np.abs(readings - value)) > np.max(steps, initial=0.0):
            found.append(Code(float(value), np.flatnonzero(own)))
    return tuple(found)


def is_wrapped(samples: Floats, period: float) -> bool:
    """Return True if a signal of shape (n_samples,) begins again at the end of a period, as an angle does after a full turn."""
    # It stays within one period, and at each jump it moves on as it does elsewhere if a period is added or taken off.
    if not np.ptp(samples) <= (1.0 + _OVER_THE_END) * period:
        return False
    steps = np.diff(samples)
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * period)
    if jumps.size == 0:
        return False
    on = np.abs(np.abs(steps[jumps]) - period)
    elsewhere = np.delete(steps, jumps)
    # A command that steps by a turn stands still elsewhere.
    return bool(
        np.max(on) <= _CLEARLY * period
        and np.max(on) <= 2.0 * np.max(np.abs(elsewhere), initial=0.0)
        and np.count_nonzero(elsewhere) > jumps.size
    )


def begins_again(samples: Floats) -> bool:
    """Return True if a signal of shape (n_samples,), in any unit, goes on from the other end of its range at each jump."""
    span = float(np.ptp(samples))
    jumps = np.flatnonzero(np.abs(np.diff(samples)) > 0.5 * span)
    apart = np.diff(jumps, prepend=-samples.size, append=2 * samples.size)
    # Interference jumps there and at once back.
    return is_wrapped(samples, span) and bool(np.any(np.minimum(apart[1:], apart[:-1]) > _SPIKE))


def wrapping_counter(samples: Floats) -> float | None:
    """Return the range of a counter of whole numbers that begins again at its end, a power of two; None if it is none."""
    low, high = float(np.min(samples)), float(np.max(samples))
    for period in _COUNTERS:
        inside = (low >= 0.0 and high < period) or (low >= -0.5 * period and high < 0.5 * period)
        # The first that holds the numbers; in a larger one no step is longer than half of it.
        if inside:
            whole = np.array_equal(samples, np.round(samples))
            return period if whole and is_wrapped(samples, period) else None
    return None


@dataclass(frozen=True)
class Held:
    """A reading that stands still between the samples of a slower device."""

    rows: int  # usual number of rows from one reading to the next
    fresh: NDArray[np.intp]  # rows with a reading of their own


def held(samples: Floats) -> Held | None:
    """Return how a signal of shape (n_samples,) is held over several rows; None if it is not."""
    # It then changes after the same number of rows again and again, and never in two rows that follow each other. Rounding and
    # rest hold a signal as well, but for as long as the motion takes.
    changes = np.flatnonzero(np.diff(samples)) + 1
    # What steps between a few levels is a switch or a command.
    if changes.size < FEWEST_FRESH or np.unique(samples).size < FEWEST_FRESH:
        return None
    apart = np.diff(changes)
    rows = int(np.median(apart))
    if np.min(apart) < 2:
        return None
    # Two readings may be equal: of a signal that is rounded, or rests.
    times = np.maximum(np.round(apart / rows), 1.0)
    if np.mean(np.abs(apart - rows * times) <= 1.0) < _REGULAR or np.mean(times == 1.0) < _REGULAR:
        return None
    common = int(np.gcd.reduce(apart))
    if common < 2:
        return Held(rows, changes)
    return Held(common, np.arange(changes[0] % common, samples.size, common))


def refuse_codes(path: Path, table: Columns) -> None:
    """Refuse a signal among whose readings are codes for no reading."""
    for signal, samples in table.values.items():
        reported = []
        for code in codes(samples):
            rows = [str(table.lines[place]) for place in code.samples[:_ROWS_LISTED]]
            more = f" and {code.samples.size - _ROWS_LISTED} more" if code.samples.size > _ROWS_LISTED else ""
            which = f"{table.row}{'s' if code.samples.size > 1 else ''} {', '.join(rows)}{more}"
            reported.append(f"{code.value:.6g} in {which}")
        if reported:
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': {'; '.join(reported)}: such a number stands for a missing or "
                "invalid reading. Cut the record there, or fill the gap before reading if you know what was there."
            )


def unwrapped(
    path: Path, table: Columns, columns: Mapping[str, ColumnMapping], units: Mapping[str, str]
) -> tuple[Columns, tuple[str, ...]]:
    """Return a table in which angles and counters go on at the end of their range, with a note for each."""
    values, notes = dict(table.values), []
    for signal, mapping in columns.items():
        if signal not in values or mapping.unwrap is False:
            continue
        where = f"{path.name}, column '{table.labels[signal]}'"
        period, unit = _period(where, signal, values[signal], mapping, units.get(signal, ""))
        if period is None:
            continue
        before = values[signal]
        values[signal] = np.unwrap(before, period=period)
        count = int(np.count_nonzero(np.diff(np.round((values[signal] - before) / period))))
        if count:
            leave = f'{signal} = {{ name = "{table.labels[signal]}", unwrap = false }} leaves it as it is'
            why = "as asked for" if mapping.unwrap is not None else leave
            notes.append(
                f"{where}: {signal} begins again at the end of {period:.6g}{unit}, {count} time{'s' if count > 1 else ''}; it "
                f"was unwrapped ({why})."
            )
    return replace(table, values=values), tuple(notes)


def _period(
    where: str, signal: str, samples: Floats, mapping: ColumnMapping, si: str
) -> tuple[float | None, str]:
    """Return the period of a signal in the numbers of its column, None where nothing is unwrapped, and its unit in a note."""
    scale = 1.0 if mapping.scale is None else abs(mapping.scale)
    turn = 2.0 * math.pi / (conversion(_ANGLE, si)[0] * scale) if is_a(_ANGLE, si) else None
    if mapping.unwrap is True:
        if turn is None:
            raise InputError(
                f"{where}: unwrap = true needs an angle, but {signal} is in {si or 'no unit'}. Give the numbers after which the "
                "column begins again: unwrap = 65536."
            )
        return turn, " (a full turn)"
    if mapping.unwrap:
        span = float(np.ptp(samples))
        if span > 1.001 * mapping.unwrap:
            raise InputError(
                f"{where}: unwrap = {mapping.unwrap:g}, but its numbers span {span:.6g}. Give the period in its numbers."
            )
        return float(mapping.unwrap), ""
    # Of a signal without a unit of its own, such as a reference, the numbers alone tell.
    for period in (turn,) if turn is not None else FULL_TURNS if not si else ():
        if is_wrapped(samples, period):
            return period, " (a full turn)"
    if turn is not None and not mapping.is_converted and is_wrapped(samples, FULL_TURNS[1]):
        raise InputError(
            f"{where}: {signal} is taken in {si}, but begins again after 360, as an angle in degrees does. Write "
            f'{signal} = {{ name = "...", unit = "deg" }}.'
        )
    return wrapping_counter(samples), " (the range of a counter)"


def between_readings(path: Path, table: Columns, sensors: Collection[str]) -> tuple[Columns, tuple[str, ...]]:
    """Return a table in which a reading that is held over several rows is interpolated between its own rows, with notes."""
    # What the rig did meanwhile is smooth; what stands in the file is the last reading, too late by up to the
    # time between two of them. Rows before the first and behind the last reading are left out.
    found = {s: slow for s in sensors if s in table.values and (slow := held(table.values[s])) is not None}
    if not found:
        return table, ()
    # Slow to load, and every process that reads a file apart would wait for it.
    from scipy.interpolate import CubicSpline

    values = dict(table.values)
    for signal, slow in found.items():
        stamps = table.axes.get(signal, table.values.get(TIME))
        if stamps is None or not np.all(np.diff(stamps) > 0.0):
            stamps = np.arange(values[signal].size, dtype=np.float64)
        inside = np.clip(stamps, stamps[slow.fresh[0]], stamps[slow.fresh[-1]])
        values[signal] = CubicSpline(stamps[slow.fresh], values[signal][slow.fresh])(inside)
    notes = tuple(
        f"Warning: {path.name}, column '{table.labels[signal]}': {signal} changes every {slow.rows} rows only ({slow.fresh.size} "
        f"readings in {table.values[signal].size} rows): its device is slower than the record. It was interpolated between the "
        "rows at which it changes; motion and noise faster than its readings are not seen, a delay of the device remains."
        for signal, slow in found.items()
    )
    mended = replace(table, values=values)
    if table.axes:
        return mended, notes
    start = max(int(slow.fresh[0]) for slow in found.values())
    stop = min(int(slow.fresh[-1]) for slow in found.values()) + 1
    cut = {signal: samples[start:stop] for signal, samples in values.items()}
    return replace(table, values=cut, lines=table.lines[start:stop]), notes

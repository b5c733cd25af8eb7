"""How does what a sensor stored become what it read: no codes among readings, no ends of a turn, none held over rows?"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.channel_units import conversion, is_a
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.sensor_signs import FULL_TURNS, codes, held, is_wrapped, wrapping_counter

_LISTED = 6
"""Rows that a message lists."""
_ANGLE = "rad"


def refuse_codes(path: Path, table: Columns) -> None:
    """Refuse a signal among whose readings are codes for no reading."""
    for signal, samples in table.values.items():
        found = codes(samples)
        if not found:
            continue
        reported = []
        for code in found:
            rows = [str(table.lines[place]) for place in code.samples[:_LISTED]]
            more = f" and {code.samples.size - _LISTED} more" if code.samples.size > _LISTED else ""
            reported.append(
                f"{code.value:.6g} in {table.row}{'s' if code.samples.size > 1 else ''} {', '.join(rows)}{more}"
            )
        raise InputError(
            f"{path.name}, column '{table.labels[signal]}': {'; '.join(reported)}: such a number stands for a missing or invalid "
            "reading. Cut the record there, or fill the gap before reading if you know what was there."
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
    where: str, signal: str, samples: NDArray[np.float64], mapping: ColumnMapping, si: str
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


def between_readings(
    path: Path, time: str, table: Columns, sensors: Collection[str]
) -> tuple[Columns, tuple[str, ...]]:
    """Return a table in which a reading that is held over several rows is interpolated between its own rows, with notes.

    What the rig did meanwhile is smooth; what stands in the file is the last reading, too late by up to the
    time between two of them. Rows before the first and behind the last reading are left out.
    """
    found = {s: slow for s in sensors if s in table.values and (slow := held(table.values[s])) is not None}
    if not found:
        return table, ()
    # Slow to load, and every process that reads a file apart would wait for it.
    from scipy.interpolate import CubicSpline

    values = dict(table.values)
    for signal, slow in found.items():
        stamps = table.axes.get(signal, table.values.get(time))
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

"""Gaps in the time axis of a record, and the stretches between them that become separate records.

The motion in a gap is unknown, so nothing is interpolated: each stretch has its own initial state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.column_mapping import TIME, ColumnMapping, Columns
from rigsight.records.conditioning import (
    COARSEST_STAMPS,
    FEWEST_KEPT,
    FEWEST_SAMPLES,
    LARGEST_ROUNDING,
    missing_behind,
    pauses,
    resolution,
    stamp_text,
)
from rigsight.records.record import Floats
from rigsight.records.signals import is_constant
from rigsight.records.stamps import written_span


@dataclass(frozen=True, eq=False)
class Stretches:
    """A table split at the gaps of its time axis."""

    parts: tuple[Columns, ...]  # the tables of the stretches; the whole table if there is no gap
    notes: tuple[str, ...] = ()  # where it was cut, and what was left out


def between(
    file: str, table: Columns, scale: ColumnMapping, start: float | None, end: float | None
) -> Columns:
    """Return the rows of a table from `start` to `end`."""
    begin, stop = (-np.inf if start is None else start), (np.inf if end is None else end)
    clocks = table.stamps
    seconds = {signal: scale.to_si(stamps) for signal, stamps in clocks.items()}
    first, last = min(float(t.min()) for t in seconds.values()), max(float(t.max()) for t in seconds.values())
    if not begin < stop or begin > last or stop < first:
        asked = f"start = {begin:g}, end = {stop:g}"
        raise InputError(
            f"{file}: {asked} is no stretch of the record, whose time runs from {written_span(first, last)}."
        )
    rows = {id(clocks[s]): np.flatnonzero((t >= begin) & (t <= stop)) for s, t in seconds.items()}
    if not table.axes:
        kept = rows[id(clocks[TIME])]
        return replace(table, values={s: v[kept] for s, v in table.values.items()}, lines=table.lines[kept])
    axes = {id(stamps): stamps[rows[id(stamps)]] for stamps in table.axes.values()}
    return replace(
        table,
        values={signal: v[rows[id(table.axes[signal])]] for signal, v in table.values.items()},
        axes={signal: axes[id(stamps)] for signal, stamps in table.axes.items()},
    )


def stretches(file: str, table: Columns, outputs: Sequence[str] = ()) -> Stretches:
    """Return the stretches of a table between the gaps of its clocks."""
    clocks = table.stamps
    gaps = {signal: found for signal, stamps in clocks.items() if (found := _gaps(stamps)).size}
    if not gaps:
        return Stretches((table,))
    # The clock with the most gaps is the one that is told; all others end there as well.
    worst = max(gaps, key=lambda signal: gaps[signal].size)
    stamps, ends = clocks[worst], gaps[worst]
    pauses_of_all = [(clocks[s][end], clocks[s][end + 1]) for s, found in gaps.items() for end in found]
    edges = sorted({(float(before), float(after)) for before, after in pauses_of_all})
    spans, latest = [], -np.inf
    for before, after in edges:
        spans.append((latest, before))
        latest = max(latest, after)
    spans = [(begin, stop) for begin, stop in [*spans, (latest, np.inf)] if begin < stop]
    parts = [part for begin, stop in spans if (part := _part(table, begin, stop)) is not None]
    long = [part for part in parts if part.lines.size >= FEWEST_SAMPLES]
    moving = [part for part in long if not (outputs and all(is_constant(part.values[o]) for o in outputs))]
    where = _where(stamps, table, ends)
    n_samples = max(stamps.size for stamps in clocks.values())
    kept = sum(part.lines.size for part in moving)
    if kept < FEWEST_KEPT * n_samples:
        raise InputError(
            f"{file}: samples are missing {where}. Only {kept} of {n_samples} samples lie in stretches of {FEWEST_SAMPLES} or "
            "more in which an output changes. Record without dropouts, or fill them before reading if you know what was there."
        )
    dropped = n_samples - kept
    why = "shorter stretches"
    if len(moving) < len(long):
        why = "stretches that are shorter, or in which no output changes,"
    left = f" {dropped} samples in {why} were left out." if dropped > 0 else ""
    note = (
        f"{file}: samples are missing {where}. It was read as {len(moving)} record{'s' if len(moving) > 1 else ''}, each with "
        f"its own initial state; nothing was interpolated.{left}"
    )
    return Stretches(tuple(moving), (note,))


def _gaps(stamps: Floats) -> NDArray[np.intp]:
    """Return the samples after which others are missing, see `pauses`; none where a jump may be rounding."""
    none = np.zeros(0, dtype=np.intp)
    if stamps.size < FEWEST_SAMPLES:
        return none
    found = pauses(stamps)
    return none if found.size == 0 or _may_be_rounding(stamps) else found


def _may_be_rounding(stamps: Floats) -> bool:
    """Return True if the jumps may come from rounding an even time axis to the printed digits."""
    digits = resolution(stamps)
    if np.max(digits) <= COARSEST_STAMPS * float(np.median(np.diff(stamps))):
        return False
    index = np.arange(stamps.size, dtype=np.float64)
    deviation = np.abs(stamps - np.polyval(np.polyfit(index, stamps, 1), index))
    return bool(np.all(deviation <= LARGEST_ROUNDING * digits))


def one_stretch(file: str, found: Stretches) -> Columns:
    """Return the table of a record that is to be one."""
    if len(found.parts) == 1 and not found.notes:
        return found.parts[0]
    reported = found.notes[0].removeprefix(f"{file}: ").partition(".")[0]
    raise InputError(
        f"{file}: {reported}. Split it there into separate files; a campaign reads each stretch as a separate record."
    )


def _where(stamps: Floats, table: Columns, ends: NDArray[np.intp]) -> str:
    """Return the location of the first gap and the number of gaps."""
    first = int(ends[0])
    others = "" if ends.size == 1 else f", and at {ends.size - 1} more place{'s' if ends.size > 2 else ''}"
    return (
        f"between {table.row}s {table.lines[first]} and {table.lines[first + 1]} ({missing_behind(stamps, first)}; the time "
        f"jumps from {stamp_text(stamps, first)} to {stamp_text(stamps, first + 1)}){others}"
    )


def _part(table: Columns, begin: float, stop: float) -> Columns | None:
    """Return the rows with stamps from `begin` to `stop`; None where a clock has none there."""

    def rows(stamps: Floats) -> slice:
        return slice(int(np.searchsorted(stamps, begin)), int(np.searchsorted(stamps, stop, "right")))

    if not table.axes:
        own = rows(table.values[TIME])
        values = {name: v[own] for name, v in table.values.items()}
        return replace(table, values=values, lines=table.lines[own])
    axes = {id(stamps): stamps[rows(stamps)] for stamps in table.axes.values()}
    values = {name: v[rows(table.axes[name])] for name, v in table.values.items()}
    fewest = min(v.size for v in values.values())
    if fewest < 2:
        return None
    longest = max((rows(stamps) for stamps in table.axes.values()), key=lambda own: own.stop - own.start)
    return replace(
        table,
        values=values,
        axes={name: axes[id(stamps)] for name, stamps in table.axes.items()},
        lines=table.lines[longest],
    )

"""Gaps in the time axis of a record, and the stretches between them that become separate records.

The motion in a gap is unknown, so nothing is interpolated: each stretch has its own initial state.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.column_mapping import Columns
from rigsight.records.conditioning import (
    COARSEST_STAMPS,
    FEWEST_SAMPLES,
    LARGEST_ROUNDING,
    missing_behind,
    pauses,
    resolution,
    told_stamp,
)
from rigsight.records.plausibility import is_constant

_FEWEST_KEPT = 0.5
"""Share of the samples that must lie in stretches that are long enough: with fewer the file is no record of anything."""


@dataclass(frozen=True, eq=False)
class Stretches:
    """A table split at the gaps of its time axis.

    Attributes
    ----------
    parts
        The tables of the stretches; the whole table if there is no gap.
    notes
        Where it was cut, and what was left out.
    """

    parts: tuple[Columns, ...]
    notes: tuple[str, ...] = ()


def stretches(file: str, time: str, table: Columns, outputs: Sequence[str] = ()) -> Stretches:
    """Return the stretches of a table between the gaps of its time axis.

    Parameters
    ----------
    file
        Name for messages.
    time
        Name of the time in the table; signals with axes of their own are left as they are.
    table
        What was read.
    outputs
        At least one of these must change in a stretch that becomes a record.

    Raises
    ------
    InputError
        If there is a gap, and too few samples are in stretches that are long enough.
    """
    stamps = table.values.get(time)
    if stamps is None or stamps.size < FEWEST_SAMPLES:
        return Stretches((table,))
    ends = pauses(stamps)
    if ends.size == 0 or _may_be_rounding(stamps):
        return Stretches((table,))
    edges = [0, *(int(end) + 1 for end in ends), stamps.size]
    long = [(start, stop) for start, stop in pairwise(edges) if stop - start >= FEWEST_SAMPLES]
    spans = [(start, stop) for start, stop in long if _moves(table, outputs, start, stop)]
    where = _where(stamps, table, ends)
    kept = sum(stop - start for start, stop in spans)
    if kept < _FEWEST_KEPT * stamps.size:
        raise InputError(
            f"{file}: samples are missing {where}. Only {kept} of {stamps.size} samples lie in stretches of {FEWEST_SAMPLES} or "
            "more in which an output changes. Record without dropouts, or fill them before reading if you know what was there."
        )
    dropped = stamps.size - kept
    why = (
        "shorter stretches"
        if len(spans) == len(long)
        else "stretches that are shorter, or in which no output changes,"
    )
    left = f" {dropped} samples in {why} were left out." if dropped else ""
    note = (
        f"{file}: samples are missing {where}. It was read as {len(spans)} record{'s' if len(spans) > 1 else ''}, each with its "
        f"own initial state; nothing was interpolated.{left}"
    )
    return Stretches(tuple(_part(table, start, stop) for start, stop in spans), (note,))


def _may_be_rounding(stamps: NDArray[np.float64]) -> bool:
    """Return True if the jumps may come from rounding an even time axis to the printed digits."""
    digits = resolution(stamps)
    if np.max(digits) <= COARSEST_STAMPS * float(np.median(np.diff(stamps))):
        return False
    index = np.arange(stamps.size, dtype=np.float64)
    deviation = np.abs(stamps - np.polyval(np.polyfit(index, stamps, 1), index))
    return bool(np.all(deviation <= LARGEST_ROUNDING * digits))


def one_stretch(file: str, found: Stretches) -> Columns:
    """Return the table of a record that is to be one.

    Raises
    ------
    InputError
        If its time axis has gaps.
    """
    if len(found.parts) == 1 and not found.notes:
        return found.parts[0]
    told = found.notes[0].removeprefix(f"{file}: ").partition(".")[0]
    raise InputError(
        f"{file}: {told}. Split it there into separate files; a campaign reads each stretch as a separate record."
    )


def _where(stamps: NDArray[np.float64], table: Columns, ends: NDArray[np.intp]) -> str:
    """Return the location of the first gap and the number of gaps."""
    first = int(ends[0])
    others = "" if ends.size == 1 else f", and at {ends.size - 1} more place{'s' if ends.size > 2 else ''}"
    return (
        f"between {table.row}s {table.lines[first]} and {table.lines[first + 1]} ({missing_behind(stamps, first)}; the time "
        f"jumps from {told_stamp(stamps, first)} to {told_stamp(stamps, first + 1)}){others}"
    )


def _moves(table: Columns, outputs: Sequence[str], start: int, stop: int) -> bool:
    return not outputs or any(not is_constant(table.values[name][start:stop]) for name in outputs)


def _part(table: Columns, start: int, stop: int) -> Columns:
    values: Mapping[str, NDArray[np.float64]] = {name: v[start:stop] for name, v in table.values.items()}
    return replace(table, values=values, lines=table.lines[start:stop])

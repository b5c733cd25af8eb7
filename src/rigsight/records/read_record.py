"""Reading a measured file as a checked `Record` of a rig's signals."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rigsight.errors import InputError, readable
from rigsight.records.channel_table import read_columns
from rigsight.records.channel_units import si_mapping, units_of_columns
from rigsight.records.clocks import side_by_side
from rigsight.records.column_mapping import TIME as TIME
from rigsight.records.column_mapping import ColumnMapping, Columns, checked_columns
from rigsight.records.conditioning import (
    TimeBase,
    between,
    check_long_enough,
    stretches,
    time_base,
)
from rigsight.records.record import Hold, Kind, Record, Role
from rigsight.records.resampling import Resampled, joined
from rigsight.records.sensor_signs import between_readings, refuse_codes, unwrapped
from rigsight.records.sound_signals import (
    NamedSignal,
    alike_notes,
    check_absent,
    clipping_notes,
    listed_columns,
    moving,
    refuse_implausible,
    rest_notes,
)

_DIALECT = ("separator", "decimal", "header", "comment")
"""What may be said of a text."""
_last_file: ContextVar[dict[Any, Columns] | None] = ContextVar("last file", default=None)


@contextmanager
def files_read_once() -> Iterator[None]:
    """Keep what was read of the last file inside this context: its next record is often another stretch of it."""
    token = _last_file.set({})
    try:
        yield
    finally:
        _last_file.reset(token)


@dataclass(frozen=True)
class ReadingOptions:
    """How a record is to be read."""

    columns: Mapping[str, ColumnMapping | str | int] | None = None
    require_outputs: bool = True
    # Of the outputs; None for the first.
    required_outputs: Collection[str] | None = None
    absent_inputs: Collection[str] = ()  # that may have no column
    constant_inputs: Mapping[str, float] | None = None
    moving_inputs: Collection[str] = ()
    name: str | None = None
    role: Role = "estimation"
    kind: Kind = "operation"
    amplitude: float | None = None
    hold: Hold = "foh"
    dt: float | None = None
    resample: float | None = None
    start: float | None = None
    end: float | None = None
    separator: str | None = None
    decimal: str | None = None
    header: bool | int | None = None
    comment: str | None = None
    constants: Mapping[str, float] | None = None
    # Constant with which a drive of another unit is converted.
    gain: str = ""
    beside: Sequence[str] = ()  # signals that are read where they are there
    other_units: Sequence[Mapping[str, str]] = ()  # in which all signals may be instead


def read_record(
    path: Path,
    inputs: Sequence[NamedSignal],
    outputs: Sequence[NamedSignal],
    options: ReadingOptions = ReadingOptions(),
) -> Record:
    """Read, check and repair one record; one whose time axis has gaps is refused."""
    return read_stretches(path, inputs, outputs, options, at_pauses="refuse")[0]


def read_stretches(
    path: Path,
    inputs: Sequence[NamedSignal],
    outputs: Sequence[NamedSignal],
    options: ReadingOptions = ReadingOptions(),
    at_pauses: Literal["split", "refuse"] = "split",
) -> tuple[Record, ...]:
    """Read, check and repair the stretches of a record between gaps in its time axis; usually there is only one."""
    beside, dt, kind, require_outputs = options.beside, options.dt, options.kind, options.require_outputs
    known = [TIME, *(signal.name for signal in (*inputs, *outputs)), *beside]
    columns = checked_columns(path.name, options.columns or {}, known)
    time = columns.get(TIME, ColumnMapping(TIME))
    if time.scale is not None and time.scale < 0.0:
        raise InputError(f"{path.name}: the scale of time must be positive, got {time.scale:g}.")
    if dt is not None and TIME in columns:
        raise InputError(
            f"{path.name}: dt = {dt:g} is given together with a column for time; give one of the two."
        )
    for signal, column in columns.items():
        if column.time is not None and (signal == TIME or dt is not None):
            why = f"dt = {dt:g} is the time of all signals" if dt is not None else f"{TIME} is a time itself"
            raise InputError(
                f"{path.name}: the column of {signal} names a time of its own, but {why}; give one of the two."
            )
    constant_inputs = options.constant_inputs or {}
    recorded = [signal for signal in inputs if signal.name not in constant_inputs]
    names = [*(signal.name for signal in (*recorded, *outputs)), *beside]
    wanted = {name: columns.get(name, ColumnMapping(name)) for name in names}
    needed = options.required_outputs
    if needed is None:
        needed = [signal.name for signal in outputs[:1]]
    free = [output.name for output in outputs if not require_outputs or output.name not in needed]
    # A column that was mapped by hand is meant to be there.
    spare = [signal for signal in (*options.absent_inputs, *free, *beside) if signal not in columns]
    table = _joint_table(path, {TIME: time, **wanted}, spare, options)
    absent = [signal.name for signal in recorded if signal.name not in table.values]
    may_rest = kind == "operation" and options.amplitude is None
    if absent:
        check_absent(path, absent, table, is_free=len(absent) == len(inputs) and may_rest)
    if require_outputs and outputs and not any(signal.name in table.values for signal in outputs):
        listed = ", ".join(signal.name for signal in outputs)
        raise InputError(
            f"{path.name} has none of the outputs {listed}. Its columns: {listed_columns(table)}. Map one at least under columns."
        )
    same = [name for name, label in table.labels.items() if name != TIME and label == table.labels.get(TIME)]
    if dt is None and same:
        raise InputError(
            f"{path.name}: {same[0]} and {TIME} are both read from column '{table.labels[TIME]}'. Give each a column of its own "
            "under columns."
        )
    units = {TIME: "s"} | {signal.name: signal.unit for signal in (*inputs, *outputs)}
    # One that nothing is computed in has the unit that it was said to have.
    units |= {name: wanted[name].unit or "" for name in beside}
    units, unit_notes = units_of_columns(path.name, units, options.other_units, table, {TIME: time, **wanted})
    to_si: dict[str, ColumnMapping] = {}
    for signal, label in table.labels.items():
        mapping = time if signal == TIME else wanted[signal]
        stated = None if signal in beside else table.units.get(signal)
        to_si[signal], notes = si_mapping(
            path.name, signal, units[signal], mapping, label, stated, options.gain
        )
        unit_notes += notes
    if options.start is not None or options.end is not None:
        table = between(path.name, table, to_si[TIME], options.start, options.end)
    raw = {name: table.values[name] for name in names if name in table.values}
    # A few samples at rest are too few before they are a rest.
    check_long_enough(path.name, max(values.size for values in table.values.values()))
    refuse_codes(path, table)
    refuse_implausible(path, raw, table)
    table, found_notes = unwrapped(path, table, {signal: to_si[signal] for signal in raw}, units)
    raw = {name: table.values[name] for name in raw}
    found: list[str] = list(found_notes)
    if require_outputs:
        raw, still = moving(path, raw, table, needed, outputs)
        found += still
        if options.role == "estimation":
            must_move = options.moving_inputs if may_rest else [signal.name for signal in recorded]
            is_step = kind == "step" and not options.moving_inputs
            found += rest_notes(path, raw, table, recorded, must_move, is_step)
    # A command stands at its extremes on purpose.
    found += clipping_notes(path, {name: v for name, v in raw.items() if name not in beside}, table)
    found += [
        f"{path.name}: {name} = {value:g} was taken as given, and the column '{name}' was not read. Leave it out of inputs to "
        "read the column."
        for name, value in constant_inputs.items()
        if name in table.names
    ]
    found += alike_notes(path, [o.name for o in outputs if o.name not in table.values], table)
    if absent:
        found.append(
            f"{path.name}: has no column for {' and '.join(absent)}; taken as 0 throughout, because nothing drives the rig."
        )
    # If nothing drives the rig and nothing was measured, only time gives the number of samples.
    kept = [*raw] or [TIME]
    measured = [output.name for output in outputs if output.name in raw] if require_outputs else []
    parts, cut_notes = stretches(path.name, table, measured)
    if at_pauses == "refuse" and cut_notes:
        reported = cut_notes[0].removeprefix(f"{path.name}: ").partition(".")[0]
        raise InputError(
            f"{path.name}: {reported}. Split it there into separate files; a campaign reads each stretch as a separate record."
        )
    held = {**dict.fromkeys(absent, 0.0), **constant_inputs}
    holds: dict[str, Hold] = {signal.name: options.hold for signal in inputs}
    called, before = options.name or readable(path.stem), (*table.notes, *unit_notes, *cut_notes)
    records = []
    sensors = {signal.name for signal in outputs}.union(options.moving_inputs)
    for number, stretch in enumerate(parts, 1):
        part, slow = between_readings(path, stretch, sensors.intersection(kept))
        on_axis = _on_one_axis(path, part, kept, to_si[TIME], options.resample, holds)
        samples = {signal: to_si[signal].to_si(own) for signal, own in on_axis.samples.items()}
        n_samples = next(iter(samples.values())).size
        samples = {signal: np.full(n_samples, value) for signal, value in held.items()} | samples
        records.append(
            Record(
                name=called if len(parts) == 1 else f"{called} part {number}",
                dt=on_axis.dt,
                signals=samples,
                units={signal: unit for signal, unit in units.items() if signal == TIME or signal in samples},
                t0=on_axis.t0,
                role=options.role,
                kind=kind,
                amplitude=options.amplitude,
                hold="band_limited" if on_axis.is_filtered else options.hold,
                clock_uncertainty=on_axis.clock_uncertainty,
                source=path,
                notes=(*before, *slow, *on_axis.notes, *found) if number == 1 else (*slow, *on_axis.notes),
                constants=options.constants or {},
            )
        )
    return tuple(records)


def _table(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    spare: Sequence[str],
    options: ReadingOptions,
) -> Columns:
    """Return the numbers of a file of any format, as they stand there."""
    time_is_mapped = TIME in (options.columns or {})
    dialect = {key: getattr(options, key) for key in _DIALECT}
    last = _last_file.get()
    asked = (path, *columns.items(), *spare, options.dt, *dialect.values(), time_is_mapped)
    if last is not None and asked in last:
        return last[asked]
    found = read_columns(
        path, columns, time_is_mapped=time_is_mapped, optional=spare, dt=options.dt, dialect=dialect
    )
    if last is not None:
        last.clear()
        last[asked] = found
    return found


def _on_one_axis(
    path: Path,
    table: Columns,
    kept: Sequence[str],
    time: ColumnMapping,
    resample: float | None,
    holds: Mapping[str, Hold],
) -> Resampled:
    """Return the signals that are kept, not yet in SI, on the even axis [s] that they share or are to share."""
    bases: dict[str, TimeBase] = {}
    found: dict[int, TimeBase] = {}
    for signal in kept:
        stamps, where = table.clock_of(signal), f"{path.name}, {signal}" if table.axes else path.name
        if id(stamps) not in found:
            found[id(stamps)] = time_base(stamps, table.lines, where, table.row).in_seconds(time)
        bases[signal] = found[id(stamps)]
    raw = {signal: table.values[signal] for signal in kept}
    return joined(path.name, raw, bases, table.clocks, resample, holds)


def _joint_table(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    spare: Sequence[str],
    options: ReadingOptions,
) -> Columns:
    """Return the numbers of a record, of which signals may be in files of their own."""
    elsewhere: dict[Path, dict[str, ColumnMapping]] = {}
    for signal, column in columns.items():
        if column.file is not None and column.file != path:
            elsewhere.setdefault(column.file, {})[signal] = column
    if not elsewhere:
        return _table(path, columns, spare, options)
    if TIME in {signal for own in elsewhere.values() for signal in own}:
        raise InputError(
            f"{path.name}: {TIME} cannot be in another file; each file has the time of its own signals."
        )
    if options.dt is not None:
        raise InputError(
            f"{path.name}: dt = {options.dt:g} cannot hold for signals of several files; each needs its time."
        )
    files = {path: {s: c for s, c in columns.items() if c.file is None or c.file == path}, **elsewhere}
    tables = {
        file: _table(file, {TIME: columns[TIME], **own}, spare, options)
        for file, own in files.items()
        if len(own) > 1 or file != path
    }
    return side_by_side(path.name, tables)

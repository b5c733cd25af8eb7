"""Reading a measured file as a checked `Record` of a rig's signals."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from rigsight.errors import InputError, nearest, readable
from rigsight.records.channel_names import closeness
from rigsight.records.channel_table import columns_of_files
from rigsight.records.channel_units import si_mapping, units_of_columns
from rigsight.records.column_mapping import TIME as TIME
from rigsight.records.column_mapping import ColumnMapping, Columns, checked_columns
from rigsight.records.conditioning import (
    LARGEST_NUMBER,
    TimeBase,
    between,
    check_long_enough,
    stretches,
    time_base,
)
from rigsight.records.record import Floats, Hold, Kind, Record, Role
from rigsight.records.resampling import Resampled, joined
from rigsight.records.sensor_signs import between_readings, refuse_codes, unwrapped
from rigsight.records.signals import is_constant

_DIALECT = ("separator", "decimal", "header", "comment")
"""What may be said of a text."""
_LISTED = 30
"""Columns that a message lists."""


class NamedSignal(Protocol):
    """A signal that can be read: what a rig declares, seen from below."""

    @property
    def name(self) -> str:
        """Name in equations and files."""

    @property
    def unit(self) -> str:
        """SI unit."""


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
    dialect = {key: getattr(options, key) for key in _DIALECT}
    table = columns_of_files(path, {TIME: time, **wanted}, spare, dt, dialect, time_is_mapped=TIME in columns)
    absent = [signal.name for signal in recorded if signal.name not in table.values]
    may_rest = kind == "operation" and options.amplitude is None
    if absent:
        _check_absent(path, absent, table, is_free=len(absent) == len(inputs) and may_rest)
    if require_outputs and outputs and not any(signal.name in table.values for signal in outputs):
        listed = ", ".join(signal.name for signal in outputs)
        raise InputError(
            f"{path.name} has none of the outputs {listed}. Its columns: {_columns_of(table)}. Map one at least under columns."
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
    _refuse_implausible(path, raw, table)
    table, found_notes = unwrapped(path, table, {signal: to_si[signal] for signal in raw}, units)
    raw = {name: table.values[name] for name in raw}
    found: list[str] = list(found_notes)
    if require_outputs:
        raw, still = _moving(path, raw, table, needed, outputs)
        found += still
        if options.role == "estimation":
            must_move = options.moving_inputs if may_rest else [signal.name for signal in recorded]
            is_step = kind == "step" and not options.moving_inputs
            found += _rest_notes(path, raw, table, recorded, must_move, is_step)
    found += [
        f"{path.name}: {name} = {value:g} was taken as given, and the column '{name}' was not read. Leave it out of inputs to "
        "read the column."
        for name, value in constant_inputs.items()
        if name in table.names
    ]
    found += _alike_notes(path, [o.name for o in outputs if o.name not in table.values], table)
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
                clock_uncertainty=max(on_axis.clock_uncertainty, table.clock_uncertainty),
                source=path,
                notes=(*before, *slow, *on_axis.notes, *found) if number == 1 else (*slow, *on_axis.notes),
                constants=options.constants or {},
            )
        )
    return tuple(records)


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


def _check_absent(path: Path, absent: Sequence[str], table: Columns, *, is_free: bool) -> None:
    """Reject missing inputs if the rig was driven, or if a column may be one of them."""
    names = [name for name in table.names if name not in table.labels.values()]
    is_free = is_free and not all(name.isdecimal() for name in (*names, *table.labels.values()))
    for signal in absent:
        close = [name for name in names if closeness(name, signal) > 0.0]
        hint = f" Is it '{close[0]}'?" if close else nearest(signal, names)
        if not hint and is_free:
            continue
        raise InputError(
            f"{path.name} has no column '{signal}' for signal '{signal}'.{hint} Its columns: {_columns_of(table)}. "
            "Map it under columns; if it was constant and not recorded, give its value with the record: "
            f"inputs = {{ {signal} = 0.0 }}."
        )


def _alike_notes(path: Path, missing: Sequence[str], table: Columns) -> list[str]:
    """Report an unread column whose name is similar to that of a missing output: possibly a typing error."""
    unread = [name for name in table.names if name not in table.labels.values()] if missing else []
    return [
        f"{path.name}: has no column '{signal}', so {signal} counts as not recorded in this file.{hint} Map it under columns if "
        f"it is."
        for signal in missing
        if (hint := nearest(signal, unread))
    ]


def _columns_of(table: Columns) -> str:
    """Return the names of the columns of a file for a message."""
    return ", ".join(f"'{name}'" for name in table.names[:_LISTED]) or "none"


def _refuse_implausible(path: Path, raw: Mapping[str, Floats], table: Columns) -> None:
    """Reject implausibly large numbers, from a wrong data type or a lost decimal point."""
    for signal, samples in raw.items():
        largest = float(np.max(np.abs(samples)))
        if largest > LARGEST_NUMBER:
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': {signal} reaches {largest:.3g}; readings above "
                f"{LARGEST_NUMBER:g} are implausible. Check the column and its type."
            )


def _moving(
    path: Path,
    raw: dict[str, Floats],
    table: Columns,
    needed: Collection[str],
    outputs: Sequence[NamedSignal],
) -> tuple[dict[str, Floats], list[str]]:
    """Return the signals that can be used, with notes on those that cannot."""
    constant = {signal for signal, samples in raw.items() if is_constant(samples)}
    measured = [output.name for output in outputs if output.name in raw]
    for signal in measured:
        if signal in constant and (signal in needed or constant.issuperset(measured)):
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': the output {signal} never changes ({raw[signal][0]:g}). "
                "Check sensor and column, or leave the record out."
            )
    still = sorted(constant.intersection(measured))
    notes = [f"{path.name}: {signal} never changes and counts as not measured." for signal in still]
    return {signal: samples for signal, samples in raw.items() if signal not in still}, notes


def _rest_notes(
    path: Path,
    raw: Mapping[str, Floats],
    table: Columns,
    recorded: Sequence[NamedSignal],
    must_move: Collection[str],
    is_step: bool,
) -> list[str]:
    """Tell that no recorded input changes: the record begins with a step, the rig moves freely, or a column is wrong."""
    held = [signal.name for signal in recorded if signal.name in raw]
    if not held or not all(is_constant(raw[signal]) for signal in held):
        return []
    values = ", ".join(f"{signal} = {raw[signal][0] + 0.0:g}" for signal in held)
    listed = ", ".join(f"'{table.labels[signal]}'" for signal in held)
    where = f"{path.name}, column{'s' if len(held) > 1 else ''} {listed}"
    if is_step and any(raw[signal][0] != 0.0 for signal in held):
        return [
            f"{where}: no input changes ({values}); taken as a step from 0 with which the record begins. Record some time at "
            "rest before the step: it shows the offset, and that the rig was at rest."
        ]
    if set(held) & set(must_move):
        raise InputError(
            f"{where}: no input changes ({values}), so nothing is excited and nothing can be identified. Check the column. "
            'For free motion write kind = "operation" without an amplitude; for a record that is only scored, '
            'role = "validation".'
        )
    return [
        f"{where}: no input changes ({values}); taken as a free motion. Check the column if the rig was driven."
    ]

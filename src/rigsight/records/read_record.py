"""How does a measured file become a checked `Record` of a rig's signals?"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest
from rigsight.records.channel_names import closeness
from rigsight.records.channel_table import read_channels
from rigsight.records.channel_units import si_mapping
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.conditioning import LARGEST_NUMBER, TimeBase, time_base
from rigsight.records.formats.channel_file import file_format
from rigsight.records.formats.csv_channels import open_measurement
from rigsight.records.formats.read_csv import read_csv
from rigsight.records.plausibility import clipping, is_constant
from rigsight.records.record import Hold, Kind, Record, Role
from rigsight.records.resampling import Resampled, in_seconds, refuse_different_axes, resampled

TIME = "t"
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


def read_record(
    path: Path,
    inputs: Sequence[NamedSignal],
    outputs: Sequence[NamedSignal],
    *,
    columns: Mapping[str, ColumnMapping] | None = None,
    require_outputs: bool = True,
    required_outputs: Collection[str] | None = None,
    absent_inputs: Collection[str] = (),
    constant_inputs: Mapping[str, float] | None = None,
    moving_inputs: Collection[str] = (),
    name: str | None = None,
    role: Role = "estimation",
    kind: Kind = "operation",
    amplitude: float | None = None,
    hold: Hold = "foh",
    dt: float | None = None,
    resample: float | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    header: bool | int | None = None,
    comment: str | None = None,
    constants: Mapping[str, float] | None = None,
) -> Record:
    """Read, check and repair one record.

    Parameters
    ----------
    path
        Delimited text, or a measurement file of a format in `channel_file`; its content decides, not its name.
    inputs, outputs
        Signals of the rig. Further outputs than the required ones are read where the file has them.
    columns
        Where signals and time ``t`` stand; by default in columns of their own names.
    require_outputs
        False to simulate a record: its time and inputs suffice, and its inputs may be constant.
    required_outputs
        Names of the outputs that the file must have, by default the first; one output at all it must have in any case.
    absent_inputs
        Names of the inputs that are 0 where the file holds no input at all: a free motion.
    constant_inputs
        Input that the file does not hold -> its value throughout [SI].
    moving_inputs
        Names of the inputs without whose motion nothing can be learned: a motion that is prescribed.
    name
        How results call the record, by default the file's name without its ending.
    role, kind, amplitude, hold
        See `Record`.
    dt
        Sample time [s] of a file without time.
    resample
        Sample time [s] onto which signals are interpolated; without it, signals that do not share one time axis are refused.
    separator, decimal, header, comment
        See `read_csv`; only delimited text has them.
    constants
        See `Record`.

    Raises
    ------
    InputError
        Naming file, line or column, and the mend, for whatever makes the record unusable.
    """
    columns = columns or {}
    time = columns.get(TIME, ColumnMapping(TIME))
    if time.scale is not None and time.scale < 0.0:
        raise InputError(f"{path.name}: the scale of time must be positive, got {time.scale:g}.")
    if dt is not None and TIME in columns:
        raise InputError(f"{path.name}: dt = {dt:g} stands beside a column for time; give one of the two.")
    constant_inputs = constant_inputs or {}
    recorded = [signal for signal in inputs if signal.name not in constant_inputs]
    signals = [*recorded, *outputs]
    wanted = {signal.name: columns.get(signal.name, ColumnMapping(signal.name)) for signal in signals}
    needed = [signal.name for signal in outputs[:1]] if required_outputs is None else required_outputs
    free = [output.name for output in outputs if not require_outputs or output.name not in needed]
    # A column that was mapped by hand is meant to be there.
    spare = [signal for signal in (*absent_inputs, *free) if signal not in columns]
    dialect = _Dialect(separator, decimal, header, comment)
    table = _table(path, {TIME: time, **wanted}, spare, dialect, dt, time_is_mapped=TIME in columns)
    absent = [signal.name for signal in recorded if signal.name not in table.values]
    may_rest = kind == "operation" and amplitude is None
    if absent:
        _check_absent(path, absent, table, is_free=len(absent) == len(inputs) and may_rest)
    if require_outputs and outputs and not any(signal.name in table.values for signal in outputs):
        listed = ", ".join(signal.name for signal in outputs)
        raise InputError(
            f"{path.name} has none of the outputs {listed}. Its columns: {_listed(path)}. Map one at least under columns."
        )
    units = {TIME: "s"} | {signal.name: signal.unit for signal in (*inputs, *outputs)}
    unit_notes: list[str] = []
    to_si: dict[str, ColumnMapping] = {}
    for signal, label in table.labels.items():
        mapping = time if signal == TIME else wanted[signal]
        to_si[signal], notes = si_mapping(
            path.name, signal, units[signal], mapping, label, table.units.get(signal)
        )
        unit_notes += notes
    bases = _bases(path, table)
    raw = {signal.name: table.values[signal.name] for signal in signals if signal.name in table.values}
    _refuse_what_nobody_measures(path, raw, table)
    found: list[str] = []
    if require_outputs:
        raw, found = _moving(path, raw, table, needed, outputs)
        if role == "estimation":
            must_move = moving_inputs if may_rest else [signal.name for signal in recorded]
            found += _rest_notes(path, raw, table, recorded, must_move)
    found += _clipping_notes(path, raw, table)
    found += _alike_notes(path, [o.name for o in outputs if o.name not in table.values], table)
    holds: dict[str, Hold] = {signal.name: hold for signal in inputs}
    # Where nothing drives the rig and nothing was measured, time alone says how many samples there are.
    raw = raw or {TIME: table.values[TIME]}
    on_axis = _on_one_axis(
        path, table, raw, {signal: bases[signal] for signal in raw}, to_si[TIME], resample, holds
    )
    samples = {signal: to_si[signal].to_si(own) for signal, own in on_axis.samples.items()}
    n_samples = next(iter(samples.values())).size
    held = {**dict.fromkeys(absent, 0.0), **constant_inputs}
    samples = {signal: np.full(n_samples, value) for signal, value in held.items()} | samples
    if absent:
        found.append(
            f"{path.name}: has no column for {' and '.join(absent)}; taken as 0 throughout, as nothing drives the rig."
        )
    return Record(
        name=name or path.stem,
        dt=on_axis.dt,
        signals=samples,
        units={signal: unit for signal, unit in units.items() if signal == TIME or signal in samples},
        t0=on_axis.t0,
        role=role,
        kind=kind,
        amplitude=amplitude,
        hold=hold,
        source=path,
        notes=(*table.notes, *unit_notes, *on_axis.notes, *found),
        constants=constants or {},
    )


@dataclass(frozen=True)
class _Dialect:
    """How a text is written, as far as somebody said so."""

    separator: str | None
    decimal: str | None
    header: bool | int | None
    comment: str | None


def _table(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    spare: Sequence[str],
    dialect: _Dialect,
    dt: float | None,
    *,
    time_is_mapped: bool,
) -> Columns:
    """Return the numbers of a file of any format, as they stand there."""
    if file_format(path) is not None:
        _refuse_dialect(path, dialect)
        return read_channels(path, columns, TIME, time_is_mapped=time_is_mapped, optional=spare, dt=dt)
    own = {signal: column for signal, column in columns.items() if dt is None or signal != TIME}
    table = read_csv(path, own, optional=spare, **vars(dialect))
    if dt is None:
        return table
    stamps = dt * np.arange(table.lines.size, dtype=np.float64)
    return replace(table, values={TIME: stamps, **table.values}, labels={TIME: "dt", **table.labels})


def _check_absent(path: Path, absent: Sequence[str], table: Columns, *, is_free: bool) -> None:
    """Refuse inputs that are missing where the rig was driven, or where a column may well be one of them."""
    names = [name for name in _names(path) if name not in table.labels.values()]
    is_free = is_free and not all(name.isdecimal() for name in (*names, *table.labels.values()))
    for signal in absent:
        close = [name for name in names if closeness(name, signal) > 0.0]
        hint = f" Is it '{close[0]}'?" if close else nearest(signal, names)
        if not hint and is_free:
            continue
        raise InputError(
            f"{path.name} has no column '{signal}' for signal '{signal}'.{hint} Its columns: {_listed(path)}. Map it under "
            f"columns; if it was constant and not recorded, give its value with the record: inputs = {{ {signal} = 0.0 }}."
        )


def _alike_notes(path: Path, missing: Sequence[str], table: Columns) -> list[str]:
    """Tell of a column that was not read although it is called nearly like an output that is missing: a slip of the pen."""
    unread = [name for name in _names(path) if name not in table.labels.values()] if missing else []
    return [
        f"{path.name}: has no column '{signal}', so {signal} is taken as not recorded there.{hint} Map it under columns if it is."
        for signal in missing
        if (hint := nearest(signal, unread))
    ]


def _names(path: Path) -> list[str]:
    """Return how a file calls its columns."""
    with open_measurement(path) as file:
        return [channel.name for channel in file.channels]


def _listed(path: Path) -> str:
    return ", ".join(f"'{name}'" for name in _names(path)[:_LISTED]) or "none"


def _refuse_what_nobody_measures(path: Path, raw: Mapping[str, NDArray[np.float64]], table: Columns) -> None:
    for signal, samples in raw.items():
        largest = float(np.max(np.abs(samples)))
        if largest > LARGEST_NUMBER:
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': {signal} is as large as {largest:.3g}, which nobody measures "
                f"(up to {LARGEST_NUMBER:g} is read). Check the column and its type."
            )


def _refuse_dialect(path: Path, dialect: _Dialect) -> None:
    for key, value in vars(dialect).items():
        if value is not None:
            raise InputError(
                f"{path.name} is no delimited text, so {key} means nothing for it; remove {key}."
            )


def _bases(path: Path, table: Columns) -> dict[str, TimeBase]:
    """Return the even grid of every signal, in the unit of the stamps: one for all, or each its own."""
    if not table.axes:
        base = time_base(table.values[TIME], table.lines, path.name, table.row)
        return dict.fromkeys(table.values, base)
    return {
        signal: time_base(stamps, table.lines, f"{path.name}, {signal}", table.row)
        for signal, stamps in table.axes.items()
    }


def _on_one_axis(
    path: Path,
    table: Columns,
    raw: Mapping[str, NDArray[np.float64]],
    bases: Mapping[str, TimeBase],
    time: ColumnMapping,
    resample: float | None,
    holds: Mapping[str, Hold],
) -> Resampled:
    """Return the signals, not yet in SI, on the even axis [s] that they share or are to share."""
    scale = 1.0 if time.scale is None else time.scale
    offset = 0.0 if time.offset is None else time.offset
    mended = tuple(dict.fromkeys(note for base in bases.values() for note in base.notes))
    if resample is None and not table.axes:
        base = next(iter(bases.values()))
        even = {signal: base.resample(samples, holds.get(signal)) for signal, samples in raw.items()}
        return Resampled(base.t0 * scale + offset, base.dt * scale, even, mended)
    timed = {signal: in_seconds(base, scale, offset) for signal, base in bases.items()}
    if resample is None:
        refuse_different_axes(path.name, timed, table.labels)
    on_axis = resampled(path.name, raw, timed, resample, holds)
    return replace(on_axis, notes=(*mended, *on_axis.notes))


def _moving(
    path: Path,
    raw: dict[str, NDArray[np.float64]],
    table: Columns,
    needed: Collection[str],
    outputs: Sequence[NamedSignal],
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
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
    notes = [f"{path.name}: {signal} never changes and is taken as not measured." for signal in still]
    return {signal: samples for signal, samples in raw.items() if signal not in still}, notes


def _rest_notes(
    path: Path,
    raw: Mapping[str, NDArray[np.float64]],
    table: Columns,
    recorded: Sequence[NamedSignal],
    must_move: Collection[str],
) -> list[str]:
    """Tell of recorded inputs none of which changes: the rig moves freely, or a column is the wrong one."""
    held = [signal.name for signal in recorded if signal.name in raw]
    if not held or not all(is_constant(raw[signal]) for signal in held):
        return []
    values = ", ".join(f"{signal} = {raw[signal][0]:g}" for signal in held)
    listed = ", ".join(f"'{table.labels[signal]}'" for signal in held)
    where = f"{path.name}, column{'s' if len(held) > 1 else ''} {listed}"
    if set(held) & set(must_move):
        raise InputError(
            f"{where}: no input changes ({values}), so nothing is excited and nothing can be identified. Check the column. "
            'Of a rig that moves freely write kind = "operation" without an amplitude; a record that is only scored has '
            'role = "validation".'
        )
    return [
        f"{where}: no input changes ({values}); taken as a free motion. Check the column if the rig was driven."
    ]


def _clipping_notes(path: Path, raw: Mapping[str, NDArray[np.float64]], table: Columns) -> list[str]:
    return [
        f"Warning: {path.name}, column '{table.labels[signal]}': {signal} looks clipped, {count} samples stand exactly at "
        f"its extreme {level:g}. Check range and saturation of sensor, amplifier or drive."
        for signal, samples in raw.items()
        for level, count in clipping(samples)
    ]

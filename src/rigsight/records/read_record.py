"""How does a measured file become a checked `Record` of a rig's signals?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.channel_file import file_format
from rigsight.records.channel_table import read_channels
from rigsight.records.channel_units import si_mapping
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.conditioning import LARGEST_NUMBER, TimeBase, time_base
from rigsight.records.plausibility import clipping, is_constant
from rigsight.records.read_csv import read_csv
from rigsight.records.record import Hold, Kind, Record, Role
from rigsight.records.resampling import Resampled, in_seconds, refuse_different_axes, resampled

TIME = "t"


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
    name: str | None = None,
    role: Role = "estimation",
    kind: Kind = "operation",
    amplitude: float | None = None,
    hold: Hold = "foh",
    dt: float | None = None,
    resample: float | None = None,
    separator: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Record:
    """Read, check and repair one record.

    Parameters
    ----------
    path
        Delimited text, or a measurement file of a format in `channel_file`; its content decides, not its name.
    inputs, outputs
        Signals of the rig. All inputs and the first output are required, further outputs are read where the file has them.
    columns
        Where signals and time ``t`` stand; by default in columns of their own names.
    require_outputs
        False to simulate a record: its time and inputs suffice, and its inputs may be constant.
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
    signals = [*inputs, *outputs]
    wanted = {signal.name: columns.get(signal.name, ColumnMapping(signal.name)) for signal in signals}
    # A column that was mapped by hand is meant to be there.
    spare = [output.name for output in outputs[1 if require_outputs else 0 :] if output.name not in columns]
    if file_format(path) is None:
        table = read_csv(
            path,
            wanted if dt is not None else {TIME: time, **wanted},
            optional=spare,
            separator=separator,
            decimal=decimal,
            header=header,
            comment=comment,
        )
        if dt is not None:
            stamps = dt * np.arange(table.lines.size, dtype=np.float64)
            table = replace(table, values={TIME: stamps, **table.values}, labels={TIME: "dt", **table.labels})
    else:
        _refuse_dialect(path, separator=separator, decimal=decimal, header=header, comment=comment)
        table = read_channels(
            path, {TIME: time, **wanted}, TIME, time_is_mapped=TIME in columns, optional=spare, dt=dt
        )
    units = {TIME: "s"} | {signal.name: signal.unit for signal in signals}
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
        raw, found = _moving(path, raw, table, inputs, outputs, role)
    found += _clipping_notes(path, raw, table)
    holds: dict[str, Hold] = {signal.name: hold for signal in inputs}
    on_axis = _on_one_axis(
        path, table, raw, {signal: bases[signal] for signal in raw}, to_si[TIME], resample, holds
    )
    return Record(
        name=name or path.stem,
        dt=on_axis.dt,
        signals={signal: to_si[signal].to_si(samples) for signal, samples in on_axis.samples.items()},
        units={signal: unit for signal, unit in units.items() if signal == TIME or signal in raw},
        t0=on_axis.t0,
        role=role,
        kind=kind,
        amplitude=amplitude,
        hold=hold,
        source=path,
        notes=(*table.notes, *unit_notes, *on_axis.notes, *found),
    )


def _refuse_what_nobody_measures(path: Path, raw: Mapping[str, NDArray[np.float64]], table: Columns) -> None:
    for signal, samples in raw.items():
        largest = float(np.max(np.abs(samples)))
        if largest > LARGEST_NUMBER:
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': {signal} is as large as {largest:.3g}, which nobody measures "
                f"(up to {LARGEST_NUMBER:g} is read). Check the column and its type."
            )


def _refuse_dialect(path: Path, **dialect: object) -> None:
    for key, value in dialect.items():
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
    inputs: Sequence[NamedSignal],
    outputs: Sequence[NamedSignal],
    role: Role,
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Return the signals that can be used, with notes on those that cannot."""
    constant = {signal for signal, samples in raw.items() if is_constant(samples)}
    for signal in inputs:
        if role == "estimation" and signal.name in constant:
            raise InputError(
                f"{path.name}, column '{table.labels[signal.name]}': the input {signal.name} is constant "
                f"({raw[signal.name][0]:g}), so nothing is excited and nothing can be identified. Check the column, "
                'give the record role = "validation", or leave it out.'
            )
    if outputs and outputs[0].name in constant:
        first = outputs[0].name
        raise InputError(
            f"{path.name}, column '{table.labels[first]}': the output {first} never changes ({raw[first][0]:g}). "
            "Check sensor and column, or leave the record out."
        )
    still = sorted(constant.intersection(output.name for output in outputs[1:]))
    notes = [f"{path.name}: {signal} never changes and is taken as not measured." for signal in still]
    return {signal: samples for signal, samples in raw.items() if signal not in still}, notes


def _clipping_notes(path: Path, raw: Mapping[str, NDArray[np.float64]], table: Columns) -> list[str]:
    return [
        f"Warning: {path.name}, column '{table.labels[signal]}': {signal} looks clipped, {count} samples stand exactly at "
        f"its extreme {level:g}. Check range and saturation of sensor, amplifier or drive."
        for signal, samples in raw.items()
        for level, count in clipping(samples)
    ]

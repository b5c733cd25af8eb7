"""How does a text file become a checked `Record` of a rig's signals?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.conditioning import time_base
from rigsight.records.plausibility import clipping, is_constant
from rigsight.records.read_csv import ColumnMapping, Columns, read_csv
from rigsight.records.record import Hold, Kind, Record, Role

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
    separator: str | None = None,
    decimal: str | None = None,
    header: bool | None = None,
    comment: str | None = None,
) -> Record:
    """Read, check and repair one record.

    Parameters
    ----------
    path
        Delimited text file.
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
    separator, decimal, header, comment
        See `read_csv`.

    Raises
    ------
    InputError
        Naming file, line or column, and the mend, for whatever makes the record unusable.
    """
    columns = columns or {}
    time = columns.get(TIME, ColumnMapping(TIME))
    if time.scale < 0.0:
        raise InputError(f"{path.name}: the scale of time must be positive, got {time.scale:g}.")
    signals = [*inputs, *outputs]
    wanted = {signal.name: columns.get(signal.name, ColumnMapping(signal.name)) for signal in signals}
    # A column that was mapped by hand is meant to be there.
    spare = [output.name for output in outputs[1 if require_outputs else 0 :] if output.name not in columns]
    table = read_csv(
        path,
        {TIME: time, **wanted},
        optional=spare,
        separator=separator,
        decimal=decimal,
        header=header,
        comment=comment,
    )
    base = time_base(table.values[TIME], table.lines, path.name)
    holds: dict[str, Hold] = {signal.name: hold for signal in inputs}
    raw = {signal.name: table.values[signal.name] for signal in signals if signal.name in table.values}
    notes = [*table.notes, *base.notes]
    if require_outputs:
        raw, constant_notes = _moving(path, raw, table, inputs, outputs, role)
        notes += constant_notes
    notes += _clipping_notes(path, raw, table)
    return Record(
        name=name or path.stem,
        dt=base.dt * time.scale,
        signals={
            signal: wanted[signal].to_si(base.resample(samples, holds.get(signal)))
            for signal, samples in raw.items()
        },
        units={TIME: "s"} | {signal.name: signal.unit for signal in signals if signal.name in raw},
        t0=base.t0 * time.scale + time.offset,
        role=role,
        kind=kind,
        amplitude=amplitude,
        hold=hold,
        source=path,
        notes=tuple(notes),
    )


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

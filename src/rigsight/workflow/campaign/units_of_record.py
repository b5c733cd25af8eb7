"""Signals of a record that was made in memory, in the units of its rig."""

from __future__ import annotations

from dataclasses import replace

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.records.channel_units import UnknownUnitError, conversion, has_si
from rigsight.rigs import Rig


def in_units_of(rig: Rig, record: Record) -> Record:
    """Return a record with its signals in the units of a rig, with a note for each that was converted.

    A signal without a unit is taken to be in that of the rig.

    Raises
    ------
    InputError
        If a unit is unknown or measures something else.
    """
    units, signals, notes = dict(record.units), dict(record.signals), list(record.notes)
    amplitude = record.amplitude
    for signal in (*rig.inputs, *rig.outputs):
        stated = record.units.get(signal.name, "")
        if signal.name not in record or (stated and not has_si(signal.unit)):
            continue
        units[signal.name] = signal.unit
        if not stated or stated == signal.unit or {stated, signal.unit} == {"", "1"}:
            continue
        try:
            scale, offset = conversion(stated, signal.unit)
        except UnknownUnitError as error:
            raise InputError(
                f"Record '{record.name}': the unit '{stated}' of {signal.name} {error}; {signal.name} is in {signal.unit}. Give "
                f'the right unit, or units = {{"{signal.name}": "{signal.unit}"}} to take the values without conversion.'
            ) from None
        if (scale, offset) == (1.0, 0.0):
            continue
        signals[signal.name] = scale * record[signal.name] + offset
        added = f"; {offset:.6g} {signal.unit} was added, as for an absolute temperature" if offset else ""
        notes.append(
            f"Record '{record.name}': {signal.name} was converted from {stated}, the unit of the record, to {signal.unit}{added}."
        )
        if amplitude is not None and [source.name for source in rig.inputs] == [signal.name]:
            amplitude *= scale
    return replace(record, units=units, signals=signals, notes=tuple(notes), amplitude=amplitude)

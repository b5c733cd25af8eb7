"""Signals of a record that was made in memory, in the units of its rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.records.channel_units import UnknownUnitError, conversion, has_si, is_a
from rigsight.rigs import Rig, rotational


def is_in_units_of(rig: Rig, record: Record) -> bool:
    """Return True if all signals of a record have the units of a rig."""
    return all(record.units.get(name) == unit for name, unit in rig.signal_units.items() if name in record)


def rig_in_units_of(rig: Rig, records: Sequence[Record]) -> Rig:
    """Return a built-in rig in the units that its records state; any other rig as it is."""
    other = rotational(rig)
    if other is None:
        return rig
    stated = [
        (name, unit) for record in records for name, unit in record.units.items() if unit and name in record
    ]
    own, turned = rig.signal_units, other.signal_units
    turns = any(
        not is_a(unit, own[name]) and is_a(unit, turned[name])
        for name, unit in stated
        if name in own and own[name] != turned[name]
    )
    return other if turns else rig


def in_units_of(rig: Rig, record: Record) -> Record:
    """Return a record with its signals in the units of a rig, with a note for each that was converted.

    A signal without a unit is taken to be in that of the rig.
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

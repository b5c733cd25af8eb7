"""Read a record that a file lists into a checked `Record` of the signals of a rig."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields, replace
from pathlib import Path

from rigsight.errors import InputError, nearest, shown
from rigsight.records import ColumnMapping, ReadingOptions, Record
from rigsight.records.read_record import TIME, read_stretches
from rigsight.records.signals import signals_beside
from rigsight.rigs import Rig
from rigsight.units import INPUT_UNIT
from rigsight.workflow.campaign.campaign_file import RecordTable
from rigsight.workflow.campaign.given_simulation import checked_numbers
from rigsight.workflow.campaign.where import Location, Where


def inside(path: Path, where: str, asked: str) -> Path:
    """Return a file that another file names, in the same folder: a received campaign must not read other files."""
    folder = path.parent.resolve()
    name = Path(asked)
    try:
        is_inside, exists = (folder / name).resolve().is_relative_to(folder), (folder / name).is_file()
    except (OSError, ValueError, RuntimeError):
        # The name is too long, contains a null or an unpaired surrogate, or is a link to itself.
        raise InputError(f"{where}: is not a valid file name: {shown(asked)}.") from None
    if name.is_absolute() or ".." in name.parts or not is_inside:
        is_link = not name.is_absolute() and ".." not in name.parts
        how = "is a link to a file" if is_link else "lies"
        raise InputError(
            f"{where}: '{asked}' {how} outside the campaign's folder; put the file beside {path.name}."
        )
    if not exists:
        files = [str(file.relative_to(folder)) for file in folder.iterdir() if file.is_file()]
        raise InputError(
            f"{where}: '{asked}' does not exist in the folder of {path.name}.{nearest(asked, files)} Check the name."
        )
    return path.parent / name


def file_inside(path: Path, number: int, record: RecordTable, where: Where | None = None) -> Path:
    """Return the file of a record."""
    # The message names the file by itself.
    where = replace(where or Where(path.name), data={})
    return inside(path, where.at("records", number - 1, "file"), record.file)


def read_listed_record(
    path: Path,
    rig: Rig,
    number: int,
    record: RecordTable,
    file: Path,
    where: Where | None = None,
    given: Collection[str] = (),
    other: Rig | None = None,
) -> tuple[Record, ...]:
    """Read a record as described in the file that lists it; it is split where its clock pauses."""
    where = where or Where(path.name, {"records": [None] * (number - 1) + [{"file": record.file}]})
    own = ("records", number - 1)
    columns = _columns(path, where, own, rig, record)
    constants = checked_numbers(where, (*own, "constants"), rig, rig.constants, record.constants)
    _check_inputs(where, own, rig, record)
    try:
        return read_stretches(
            file,
            rig.inputs,
            rig.outputs,
            replace(
                options_of(rig, other),
                columns=columns,
                constants=constants,
                constant_inputs=record.inputs,
                gain=next(
                    (
                        c.name
                        for c in rig.constants
                        if INPUT_UNIT in c.unit and c.name in {*given, *constants}
                    ),
                    "",
                ),
                **{key: getattr(record, key) for key in _OF_RECORD},
            ),
        )
    except InputError as error:
        # The error is in the record's file, which the message already names.
        raise InputError(f"{replace(where, data={}).at(*own)}: {error}") from None


def options_of(rig: Rig, other: Rig | None = None) -> ReadingOptions:
    """Return how records of a rig are read, of which `other` is the same in other units."""
    return ReadingOptions(
        required_outputs=rig.required_outputs,
        absent_inputs=rig.absent_inputs,
        moving_inputs=rig.moving_inputs,
        beside=signals_beside(_own(rig)),
        other_units=() if other is None else (other.signal_units,),
    )


_OF_RECORD = {field.name for field in fields(ReadingOptions)}.intersection(RecordTable.model_fields) - {
    "columns",
    "constants",
}


def _own(rig: Rig) -> list[str]:
    return [signal.name for signal in (*rig.inputs, *rig.outputs)]


def _columns(
    path: Path, where: Where, own: Location, rig: Rig, record: RecordTable
) -> dict[str, ColumnMapping]:
    known = [TIME, *_own(rig), *signals_beside(_own(rig))]
    columns = {}
    for signal, column in record.columns.items():
        here = where.at(*own, "columns", signal)
        if signal not in known:
            raise InputError(
                f"{here}: is not a signal of {rig.name}.{nearest(signal, known)} Signals: {', '.join(known)}."
            )
        try:
            if isinstance(column, str | int):
                columns[signal] = ColumnMapping(column)
            else:
                columns[signal] = ColumnMapping(
                    column.name, column.scale, column.offset, column.unit, column.unwrap, column.time
                )
        except InputError as error:
            raise InputError(f"{here}: {error}") from None
        if not isinstance(column, str | int) and column.file is not None:
            file = inside(path, replace(where, data={}).at(*own, "columns", signal, "file"), column.file)
            columns[signal] = replace(columns[signal], file=file)
    return columns


def _check_inputs(where: Where, own: Location, rig: Rig, record: RecordTable) -> None:
    """Refuse constant values for signals that are not inputs, are recorded, or prescribe a motion."""
    names = [signal.name for signal in rig.inputs]
    for name in record.inputs:
        here = where.at(*own, "inputs", name)
        if name not in names:
            listed = ", ".join(names) or "none"
            raise InputError(
                f"{here}: is not an input of {rig.name}.{nearest(name, names)} Inputs: {listed}."
            )
        if name in record.columns:
            raise InputError(f"{here}: cannot be given together with columns.{name}; give one of the two.")
        if name not in rig.absent_inputs:
            raise InputError(
                f"{here}: prescribes a motion of {rig.name} and must be recorded. Give its column under columns."
            )

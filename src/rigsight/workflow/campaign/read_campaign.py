"""Read a `campaign.toml` with its rig and all its records, and collect notes on it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError, nearest, readable, shown
from rigsight.records import ColumnMapping, ReadingOptions, Record
from rigsight.records.channel_table import files_read_once
from rigsight.records.read_record import TIME, read_stretches
from rigsight.records.signals import signals_beside
from rigsight.rigs import Rig, read_rig_file, rotational
from rigsight.units import INPUT_UNIT
from rigsight.workflow.campaign.campaign_file import (
    WHICH_RIG,
    Location,
    Offsets,
    RecordTable,
    RigTable,
    Where,
    checked_numbers,
    checked_simulation,
    locate,
    read_campaign_table,
    rig_named,
)
from rigsight.workflow.campaign.record_notes import is_in_units_of, record_notes
from rigsight.workflow.own.own_effects import effect_on
from rigsight.workflow.own.own_rigs import known_rigs


def read_campaign(
    campaign: str | Path, own_effects: Iterable[Effect] = (), own_rigs: Iterable[Rig] = ()
) -> Campaign:
    """Read a campaign and all its records.

    Parameters
    ----------
    campaign
        The toml file or its folder.
    own_effects
        Effects that the given simulation may have beside those of the catalogue.
    own_rigs
        Rigs that it may name beside the built-in ones.

    Raises
    ------
    InputError
        Naming file and key, or file, line and column, of what cannot be used, and how to correct it.

    Examples
    --------
    >>> import rigsight as rs
    >>> rs.read_campaign("measurements/march")
    Traceback (most recent call last):
    rigsight.errors.InputError: measurements/march does not exist; name a campaign.toml or the folder that contains it.
    """
    path = locate(Path(campaign))
    table, where = read_campaign_table(path)
    rig = listed_rig(path, table.rig, where, own_rigs)
    known = {effect.name: effect for effect in (*CATALOGUE, *own_effects)}
    by_record = set.intersection(*(set(record.constants) for record in table.records))
    modelled = [effect_on(rig, name, known, where.at("rig", "effects")) for name in table.rig.effects]
    known_constants, parameters = checked_simulation(
        where, rig, modelled, table.rig.constants, table.rig.parameters, by_record
    )
    check_roles(where, table.records)
    files = [file_inside(path, number, record, where) for number, record in enumerate(table.records, 1)]
    # A rig file says itself in which units its signals are.
    other = rotational(rig) if table.rig.model is not None else None
    with files_read_once():
        rig, read = _read_all(path, rig, other, table.records, files, where, table.rig.constants)
    title = table.title or readable(path.parent.resolve().name)
    records = _with_distinct_names(read)
    return campaign_of_records(
        title, rig, known_constants, parameters, records, modelled, table.offsets, path
    )


def check_roles(where: Where, records: Sequence[RecordTable | Record]) -> None:
    """Refuse records of which none may be fitted."""
    if all(record.role != "estimation" for record in records):
        raise InputError(
            f'{where.at("records")}: none has role = "estimation", so nothing can be fitted. Give at least one record this role.'
        )


def campaign_of_records(
    title: str,
    rig: Rig,
    known: Mapping[str, float],
    parameters: Mapping[str, float],
    records: Sequence[Record],
    modelled: Sequence[Effect],
    offsets: Offsets,
    path: Path | None = None,
) -> Campaign:
    """Return checked records as a campaign; a note tells constants that only records give: they have those of the first."""
    if offsets == "per_record":
        outputs = [signal.name for signal in rig.outputs]
        records = [record.with_free_offsets(outputs) for record in records]
    first = {name: value for name, value in records[0].constants.items() if name not in known}
    values, notes = {**known, **first}, []
    if first:
        listed = ", ".join(f"{name} = {value:g}" for name, value in first.items())
        notes.append(
            f"Each record has its own {', '.join(first)}; models are written with the values of the first record, {listed}."
        )
    return Campaign(
        title=title,
        rig=rig,
        constants={constant.name: values[constant.name] for constant in rig.constants},
        parameters=dict(parameters),
        records=tuple(records),
        modelled=tuple(modelled),
        path=path,
        notes=(*notes, *record_notes(title if path is None else path.name, rig, records)),
    )


def _read_all(
    path: Path,
    rig: Rig,
    other: Rig | None,
    tables: Sequence[RecordTable],
    files: Sequence[Path],
    where: Where,
    given: Collection[str],
) -> tuple[Rig, list[tuple[RecordTable, Record]]]:
    """Return the rig in the units that the columns of its records state, and all stretches of these records in them."""
    listed, found, errors = [*zip(tables, files, strict=True)], [], list[str]()
    for number, (table, file) in enumerate(listed, 1):
        try:
            found.append(read_listed_record(path, rig, number, table, file, where, given, other))
        except InputError as error:
            errors.append(str(error))
    if errors:
        raise InputError("\n".join(errors))
    in_other = [parts[0] for parts in found if other is not None and is_in_units_of(other, parts[0])]
    if other is not None and in_other:
        rig = other
        for number, (table, file) in enumerate(listed, 1):
            if is_in_units_of(rig, found[number - 1][0]):
                continue
            try:
                found[number - 1] = read_listed_record(path, rig, number, table, file, where, given)
            except InputError as error:
                units = ", ".join(f"{name} in {unit}" for name, unit in rig.signal_units.items())
                raise InputError(f"{error} Units are those of '{in_other[0].name}': {units}.") from None
    return rig, [(table, part) for (table, _), parts in zip(listed, found, strict=True) for part in parts]


def listed_rig(path: Path, table: RigTable, where: Where, own_rigs: Iterable[Rig] = ()) -> Rig:
    """Return the rig that a campaign names, or whose file it names."""
    if table.model is not None and table.file is not None:
        raise InputError(
            f"{where.at('rig', 'file')}: cannot be given together with rig.model; give one of the two."
        )
    if table.file is not None:
        rig = read_rig_file(inside(path, where.at("rig", "file"), table.file))
    elif table.model is not None:
        rig = rig_named(where, table.model, known_rigs(own_rigs))
    else:
        raise InputError(f"{where.at('rig', 'model')}: is missing. Write {WHICH_RIG}")
    _check_simulator(rig, table, where)
    return rig


def _check_simulator(rig: Rig, table: RigTable, where: Where) -> None:
    """Refuse a campaign whose simulator is not that of its rig file: external simulators such as an FMU execute code."""
    bodies = rig.mechanism.bodies
    own = None if bodies is None else bodies.kind
    if table.simulator == own:
        return
    if own is None:
        raise InputError(
            f"{where.at('rig', 'simulator')}: is '{table.simulator}', but the rig is simulated by its own equations. Remove the "
            "line, or add a [simulator] to the rig file."
        )
    got = "is missing" if table.simulator is None else f"is '{table.simulator}'"
    key = where.at("rig", "simulator") if table.simulator is not None else where.at("rig")
    raise InputError(
        f'{key}: simulator {got}, but the rig file simulates its bodies with {own}: write simulator = "{own}".'
    )


def _with_distinct_names(read: Sequence[tuple[RecordTable, Record]]) -> tuple[Record, ...]:
    """Give every record a unique name, which is its key in results."""
    taken = {asked.name for asked, _ in read if asked.name is not None}
    named: dict[str, Record] = {}
    for asked, record in read:
        name = free_name(record.name, {*named, *(taken if asked.name is None else ())})
        named[name] = replace(record, name=name)
    return tuple(named.values())


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name, with a number behind it where others have it."""
    free, count = name, 1
    while free in taken:
        count += 1
        free = f"{name}_{count}"
    return free


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
    return inside(
        path, replace(where or Where(path.name), data={}).at("records", number - 1, "file"), record.file
    )


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
    constants = checked_numbers(where, (*own, "constants"), rig.name, rig.constants, record.constants)
    _check_inputs(where, own, rig, record)
    gains = (c.name for c in rig.constants if INPUT_UNIT in c.unit and c.name in {*given, *constants})
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
                gain=next(gains, ""),
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
        beside=signals_beside(rig.signal_units),
        other_units=() if other is None else (other.signal_units,),
    )


_OF_RECORD = {field.name for field in fields(ReadingOptions)}.intersection(RecordTable.model_fields) - {
    "columns",
    "constants",
}


def _columns(
    path: Path, where: Where, own: Location, rig: Rig, record: RecordTable
) -> dict[str, ColumnMapping]:
    known = [TIME, *rig.signal_units, *signals_beside(rig.signal_units)]
    columns = {}
    for signal, column in record.columns.items():
        here = where.at(*own, "columns", signal)
        if signal not in known:
            raise InputError(
                f"{here}: is not a signal of {rig.name}.{nearest(signal, known)} Signals: {', '.join(known)}."
            )
        try:
            given = {"name": column} if isinstance(column, str | int) else column.model_dump(exclude={"file"})
            columns[signal] = ColumnMapping(**given)
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

"""What is a campaign: one rig, its known numbers, the simulation in question, and the records about it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError, nearest, shown
from rigsight.parameters import Parameter
from rigsight.records import ColumnMapping, Record, read_record
from rigsight.records.read_record import TIME
from rigsight.rigs import RIGS, Rig
from rigsight.simulate import Structure, compose
from rigsight.workflow.campaign_file import CampaignTable, RecordTable, locate, read_campaign_table

_SMALLEST_SHARE, _LARGEST_SHARE = 200.0, 4.0
"""How far the amplitude of an input may lie below and above half its range: one line of many, and a step counted from rest."""
_RATES_APART = 100.0
"""Ratio of sample times from which they are asked about."""
NO_VALIDATION = '{file}: no record has role = "validation"; gaps are judged on the records that were fitted, which flatters them.'


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign, read or made of records, and checked.

    Attributes
    ----------
    title
        What a report calls it.
    path
        The toml file; None for a campaign that was made of records in memory.
    rig
        The declared rig.
    constants
        All constants of the rig, defaults filled in [SI].
    modelled
        Effects that the simulation in question has already.
    parameters
        The parameters that were given, as they were given [SI]; what is missing of the rig's is to be identified.
    records
        In the order of the file, with distinct names.
    notes
        What was noticed about the campaign as a whole.
    """

    title: str
    path: Path | None
    rig: Rig
    modelled: tuple[Effect, ...]
    constants: dict[str, float]
    parameters: dict[str, float]
    records: tuple[Record, ...]
    notes: tuple[str, ...] = ()

    # That of the dataclass would hold every sample.
    def __repr__(self) -> str:
        names = [record.name for record in self.records]
        return f"Campaign({self.title!r}, rig={self.rig.name!r}, records={names!r})"

    @property
    def called(self) -> str:
        """How messages call it: by its file, or by its title."""
        return self.title if self.path is None else self.path.name

    @property
    def folder(self) -> Path | None:
        """The folder that holds its file."""
        return None if self.path is None else self.path.parent

    @property
    def estimation(self) -> tuple[Record, ...]:
        """Records that may be fitted."""
        return tuple(record for record in self.records if record.role == "estimation")

    @property
    def validation(self) -> tuple[Record, ...]:
        """Records that are only ever scored."""
        return tuple(record for record in self.records if record.role == "validation")


def read_campaign(campaign: str | Path, own_effects: Iterable[Effect] = ()) -> Campaign:
    """Read a campaign and all its records.

    Parameters
    ----------
    campaign
        The toml file or its folder.
    own_effects
        Effects that the simulation in question may have beside those of the catalogue.

    Raises
    ------
    InputError
        Naming file and key, or file, line and column, of what cannot be used, and the mend.

    Examples
    --------
    >>> import rigsight as rs
    >>> rs.read_campaign("measurements/march")
    Traceback (most recent call last):
    rigsight.errors.InputError: measurements/march does not exist; name a campaign.toml or the folder that holds one.
    """
    path = locate(Path(campaign))
    table = read_campaign_table(path)
    given = checked_simulation(
        path.name, table.rig.model, table.rig.effects, table.rig.constants, table.rig.parameters, own_effects
    )
    if all(record.role != "estimation" for record in table.records):
        raise InputError(
            f'{path.name}: records: none has role = "estimation", so nothing can be fitted. Give at least one that role.'
        )
    files = [file_inside(path, number, record) for number, record in enumerate(table.records, 1)]
    records = tuple(
        read_listed_record(path, given.rig, number, record, file)
        for number, (record, file) in enumerate(zip(table.records, files, strict=True), 1)
    )
    notes = [
        note for note in (_rates_apart(records), *(_other_amplitude(r, given.rig) for r in records)) if note
    ]
    if all(record.role != "validation" for record in records):
        notes.append(NO_VALIDATION.format(file=path.name))
    return Campaign(
        title=table.title or path.parent.resolve().name,
        path=path,
        rig=given.rig,
        modelled=given.modelled,
        constants=given.constants,
        parameters=given.parameters,
        records=_with_distinct_names(table, records),
        notes=tuple(notes),
    )


def _rates_apart(records: Sequence[Record]) -> str:
    """Say that sample times lie so far apart that the time of one record is probably in another unit; empty if they do not."""
    finest, coarsest = (choose(records, key=lambda record: record.dt) for choose in (min, max))
    if coarsest.dt < _RATES_APART * finest.dt:
        return ""
    return (
        f"The sample times of the records differ by a factor of {coarsest.dt / finest.dt:.3g}: '{finest.name}' has "
        f"{finest.dt:.3g} s, '{coarsest.name}' {coarsest.dt:.3g} s. Is the time of one of them in ms? Then write "
        't = { name = "...", unit = "ms" } for it.'
    )


def _other_amplitude(record: Record, rig: Rig) -> str:
    """Say that the stated amplitude cannot be that of the input; empty if it can, as a peak, an RMS or that of a line."""
    half = 0.5 * float(np.ptp(record[rig.inputs[0].name]))
    stated = record.amplitude
    if stated is None or half == 0.0 or half / _SMALLEST_SHARE <= abs(stated) <= _LARGEST_SHARE * half:
        return ""
    return (
        f"Record '{record.name}': amplitude = {stated:g}, but '{rig.inputs[0].name}' moves by {half:.3g} to each side. Is one of "
        "them in another unit?"
    )


@dataclass(frozen=True)
class GivenSimulation:
    """The rig, and what is known of the simulation in question; see `Campaign`."""

    rig: Rig
    modelled: tuple[Effect, ...]
    constants: dict[str, float]
    parameters: dict[str, float]


def checked_simulation(
    where: str,
    rig: str,
    effects: Iterable[str],
    constants: Mapping[str, float],
    parameters: Mapping[str, float],
    own_effects: Iterable[Effect] = (),
) -> GivenSimulation:
    """Return a rig and the simulation in question with all defaults filled in.

    Parameters
    ----------
    where
        How messages begin: the file, or the title of a campaign in memory.
    rig
        Name of the rig.
    effects
        Names of the effects that the simulation has already.
    constants, parameters
        Known numbers by name [SI].
    own_effects
        Effects that may be named beside those of the catalogue.

    Raises
    ------
    InputError
        Naming the key of what is unknown, missing or out of range, and what is allowed.
    """
    if rig not in RIGS:
        raise InputError(f"{where}: rig.model: is '{rig}'.{nearest(rig, RIGS)} Allowed: {', '.join(RIGS)}.")
    found = RIGS[rig]
    known = _constants(where, found, constants)
    modelled = _modelled(where, found, effects, own_effects)
    return GivenSimulation(found, modelled, known, _parameters(where, compose(found, modelled), parameters))


def _constants(where: str, rig: Rig, given: Mapping[str, float]) -> dict[str, float]:
    checked = _checked(where, "rig.constants", rig, rig.constants, given)
    for constant in rig.constants:
        if constant.name in checked:
            continue
        if constant.default is None:
            raise InputError(
                f"{where}: rig.constants.{constant.name}: is missing; {rig.name} needs it "
                f"({constant.description} [{constant.unit}])."
            )
        checked[constant.name] = constant.default
    gain = rig.motion.drive_gain
    if checked.get(str(gain)) == 0.0:
        raise InputError(f"{where}: rig.constants.{gain}: is 0, so that the input would drive nothing.")
    return {constant.name: checked[constant.name] for constant in rig.constants}


def _modelled(where: str, rig: Rig, names: Iterable[str], own: Iterable[Effect]) -> tuple[Effect, ...]:
    known = {effect.name: effect for effect in (*CATALOGUE, *own)}
    for name in names:
        if name not in known:
            raise InputError(
                f"{where}: rig.effects: '{name}' is unknown.{nearest(name, known)} Known: {', '.join(known)}."
            )
    modelled = tuple(known[name] for name in names)
    try:
        compose(rig, modelled)
    except InputError as error:
        raise InputError(f"{where}: rig.effects: {error}") from None
    return modelled


def _parameters(where: str, structure: Structure, given: Mapping[str, float]) -> dict[str, float]:
    rig = structure.rig
    constants = {constant.name for constant in rig.constants}
    own = [parameter for parameter in structure.parameters if parameter.name not in constants]
    checked = _checked(where, "rig.parameters", rig, (*own, *rig.alternative_parameters), given)
    for parameter in own:
        if parameter not in rig.parameters and parameter.name not in checked:
            if parameter.default is None:
                raise InputError(
                    f"{where}: rig.parameters.{parameter.name}: is missing; the simulation is said to have an effect that "
                    f"needs it ({parameter.description} [{parameter.unit}]). Give its value, or remove the effect."
                )
            checked[parameter.name] = parameter.default
    for alternative, determined in ((a.parameter.name, a.gives) for a in rig.alternatives):
        if alternative in checked and determined in checked:
            raise InputError(
                f"{where}: rig.parameters.{alternative}: stands beside {determined}, which it determines; "
                "give one of the two."
            )
    return checked


def _checked(
    where: str, key: str, rig: Rig, allowed: Iterable[Parameter], given: Mapping[str, float]
) -> dict[str, float]:
    known = {parameter.name: parameter for parameter in allowed}
    checked = {}
    for name, value in given.items():
        if name not in known:
            listed = ", ".join(known) or "none"
            raise InputError(
                f"{where}: {key}.{name}: unknown to {rig.name}.{nearest(name, known)} Known: {listed}."
            )
        try:
            checked[name] = known[name].check(value)
        except InputError as error:
            raise InputError(f"{where}: {key}.{name}: {error}") from None
    return checked


def file_inside(path: Path, number: int, record: RecordTable) -> Path:
    """Return the file of a record; a campaign that was sent to someone must not read what is none of its business.

    Parameters
    ----------
    path
        The file that lists the record.
    number
        Place of the record in that file, from 1.
    record
        What is listed.

    Raises
    ------
    InputError
        If there is none, or it lies outside the folder of `path`.
    """
    key = f"{path.name}: record {number}: file"
    folder = path.parent.resolve()
    asked = Path(record.file)
    try:
        inside, exists = (folder / asked).resolve().is_relative_to(folder), (folder / asked).is_file()
    except (OSError, ValueError, RuntimeError):
        # Longer than names may be, with a null or half a sign in it, or a link to itself.
        raise InputError(f"{key}: is no file name that can be looked up: {shown(record.file)}.") from None
    if asked.is_absolute() or ".." in asked.parts or not inside:
        is_link = not asked.is_absolute() and ".." not in asked.parts
        how = "is a link that leaves" if is_link else "leaves"
        raise InputError(
            f"{key}: '{record.file}' {how} the campaign's folder; put the file beside {path.name}."
        )
    if not exists:
        files = [str(file.relative_to(folder)) for file in folder.iterdir() if file.is_file()]
        raise InputError(
            f"{key}: '{record.file}' does not exist in {path.parent}.{nearest(record.file, files)} Check the name."
        )
    return path.parent / asked


def read_listed_record(path: Path, rig: Rig, number: int, record: RecordTable, file: Path) -> Record:
    """Read a record as a file that lists it describes it.

    Parameters
    ----------
    path
        The file that lists the record.
    rig
        Rig whose signals it holds.
    number
        Place of the record in that file, from 1.
    record
        What is listed.
    file
        See `file_inside`.

    Raises
    ------
    InputError
        Naming the file that lists it, the record, and line and column of what cannot be used.
    """
    key = f"{path.name}: record {number} ({record.file})"
    known = [TIME, *(signal.name for signal in (*rig.inputs, *rig.outputs))]
    columns = {}
    for signal, column in record.columns.items():
        if signal not in known:
            raise InputError(
                f"{key}: columns.{signal}: no signal of {rig.name}.{nearest(signal, known)} Signals: {', '.join(known)}."
            )
        try:
            if isinstance(column, str | int):
                columns[signal] = ColumnMapping(column)
            else:
                columns[signal] = ColumnMapping(column.name, column.scale, column.offset, column.unit)
        except InputError as error:
            raise InputError(f"{key}: columns.{signal}: {error}") from None
    try:
        return read_record(
            file,
            rig.inputs,
            rig.outputs,
            columns=columns,
            name=record.name,
            role=record.role,
            kind=record.kind,
            amplitude=record.amplitude,
            hold=record.hold,
            dt=record.dt,
            resample=record.resample,
            separator=record.separator,
            decimal=record.decimal,
            header=record.header,
            comment=record.comment,
        )
    except InputError as error:
        raise InputError(f"{path.name}: record {number}: {error}") from None


def _with_distinct_names(table: CampaignTable, records: tuple[Record, ...]) -> tuple[Record, ...]:
    """Give every record a name of its own: results are keyed by it."""
    taken = {record.name for record in table.records if record.name is not None}
    named: list[Record] = []
    used: set[str] = set()
    for asked, record in zip(table.records, records, strict=True):
        name, count = record.name, 1
        while name in used or (asked.name is None and name in taken):
            count += 1
            name = f"{record.name}_{count}"
        used.add(name)
        named.append(replace(record, name=name))
    return tuple(named)

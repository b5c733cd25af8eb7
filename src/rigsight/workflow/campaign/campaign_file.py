"""The allowed contents of a `campaign.toml` and of its given simulation, where its keys are, and the messages for all else."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, Field, ValidationError

from rigsight.effects import Effect
from rigsight.errors import InputError, nearest, shown
from rigsight.parameters import Parameter
from rigsight.records import Hold, Kind, Role
from rigsight.records.formats.known import MEASURED_SUFFIXES
from rigsight.rigs import Rig
from rigsight.rigs.reading.toml_places import Place, nearest_place, toml_tables, value_places
from rigsight.simulate import Structure, compose
from rigsight.workflow.own.own_rigs import text_of

MOST_RECORDS = 1000
Offsets = Literal["shared", "per_record"]
"""Whether the offset of a sensor is the same in all records."""
_TWICE = (
    "every record begins with [[records]], in double brackets; its columns follow it under [records.columns]. Other tables and "
    "keys may occur only once"
)
WHICH_RIG = 'model = "NAME" for a rig that rigsight rigs lists, or file = "my_rig.toml" for one of your own.'
LARGEST_FILE = 10_000_000

Number = Annotated[float, Field(allow_inf_nan=False)]
Seconds = Annotated[float, Field(allow_inf_nan=False, gt=0.0)]

LISTS = ("records", "withheld")
"""Keys that hold lists of records."""

Location = tuple[str | int, ...]


class FileTable(BaseModel, extra="forbid", strict=True, frozen=True):
    """A table of a file written by hand: unknown keys and numbers in quotes are errors."""


Checked = TypeVar("Checked", bound=FileTable)


class ColumnTable(FileTable):
    """``{ name = "current", scale = 1.0, offset = 0.0 }``: value in SI = scale * column + offset; or ``unit = "mA"`` instead.

    ``unwrap = true`` for an angle that begins again after a full turn, or the period of a counter.
    ``time`` names the column of its time, ``file`` the file that holds both, where they are not those of the record.
    """

    name: str | int
    scale: Number | None = None
    offset: Number | None = None
    unit: Annotated[str, Field(min_length=1)] | None = None
    unwrap: bool | Annotated[float, Field(allow_inf_nan=False, gt=0.0)] | None = None
    time: str | int | None = None
    file: Annotated[str, Field(min_length=1)] | None = None


class RigTable(FileTable):
    """``[rig]``: the rig, its simulator, and effects, constants and parameters of the given simulation."""

    model: str | None = None
    file: Annotated[str, Field(min_length=1)] | None = None
    simulator: str | None = None
    effects: list[str] = []
    constants: dict[str, Number] = {}
    parameters: dict[str, Number] = {}


class RecordTable(FileTable):
    """``[[records]]``: one measured file, its role and format, and constants of the rig in it."""

    file: Annotated[str, Field(min_length=1)]
    name: Annotated[str, Field(min_length=1)] | None = None
    role: Role = "estimation"
    kind: Kind = "operation"
    amplitude: Number | None = None
    hold: Hold = "foh"
    dt: Seconds | None = None
    resample: Seconds | None = None
    start: Number | None = None
    end: Number | None = None
    columns: dict[str, str | int | ColumnTable] = {}
    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Annotated[str, Field(pattern=r"^[.,]$")] | None = None
    header: bool | Annotated[int, Field(ge=1)] | None = None
    comment: Annotated[str, Field(min_length=1)] | None = None
    constants: dict[str, Number] = {}
    inputs: dict[str, Number] = {}


class CampaignTable(FileTable):
    """The whole file."""

    title: str = ""
    offsets: Offsets = "shared"
    rig: RigTable
    records: Annotated[list[RecordTable], Field(min_length=1, max_length=MOST_RECORDS)]


_ALLOWED = {
    "decimal": '"." or ",", GOT',
    "header": "true, false, or the number of the line with the column names, GOT",
    "separator": "one character, GOT; a blank means any white space",
    "unwrap": "true or false for an angle, or the numbers after which the column begins again, GOT",
}
"""Key -> what it may be, and what it got."""


def locate(campaign: Path) -> Path:
    """Return the toml file for a toml file or its folder."""
    if not campaign.exists():
        raise InputError(f"{campaign} does not exist; name a campaign.toml or the folder that contains it.")
    if not campaign.is_dir():
        if campaign.suffix.lower() in MEASURED_SUFFIXES:
            raise InputError(
                f"{campaign.name} is a measured file, not a campaign. Name its campaign.toml, or the folder; "
                f"'rigsight init {campaign.parent}' makes a draft."
            )
        return campaign
    path = campaign / "campaign.toml"
    if path.is_file():
        return path
    others = ", ".join(sorted(other.name for other in campaign.glob("*.toml"))[:10])
    remedy = (
        f"Name one of its files: {others}."
        if others
        else f"Write one beside the records; 'rigsight init {campaign}' makes a draft."
    )
    raise InputError(f"Folder {campaign} contains no campaign.toml. {remedy}")


def read_campaign_table(path: Path) -> tuple[CampaignTable, Where]:
    """Return the checked contents of a campaign file, and where its keys are."""
    text = text_of(path, "a campaign.toml", LARGEST_FILE, "; save it as UTF-8", "the campaign.toml")
    data = toml_tables(
        text, path.name, dict.fromkeys(("Cannot declare", "Cannot overwrite", "Cannot mutate"), _TWICE)
    )
    where = Where(path.name, data, value_places(text))
    return checked_file(where, data, CampaignTable), where


def checked_file(where: Where, data: dict[str, Any], table: type[Checked]) -> Checked:
    """Return what a file holds as a table."""
    try:
        return table.model_validate(data)
    except ValidationError as error:
        problems: list[dict[str, Any]] = [dict(problem) for problem in error.errors(include_url=False)]
    keys = [_without_union_members(problem["loc"]) for problem in problems]
    # If one alternative fails in detail, the errors of the other alternatives are left out.
    reported = [
        _message(where, key, table, problem)
        for problem, key in zip(problems, keys, strict=True)
        if not any(len(other) > len(key) and other[: len(key)] == key for other in keys)
    ]
    raise first_errors(list(dict.fromkeys(reported)))


def first_errors(reported: Sequence[str]) -> InputError:
    """Return an error with the first of several messages."""
    more = f"\n(and {len(reported) - 5} more)" if len(reported) > 5 else ""
    return InputError("\n".join(reported[:5]) + more)


def _message(where: Where, location: Location, table: type[FileTable], problem: dict[str, Any]) -> str:
    if not location:
        # Only a key with an unpaired surrogate has no location.
        return f"{where.name}: a key is not valid text: {shown(problem['input'])}. Use plain letters."
    key = where.at(*location)
    kind, got = problem["type"], problem["input"]
    if kind == "missing":
        return f"{key}: is missing.{_how_to_write(location)}"
    if kind == "extra_forbidden":
        allowed = _allowed_keys(location, table)
        return f"{key}: unknown key.{nearest(str(location[-1]), allowed)} Allowed here: {', '.join(allowed)}."
    if (message := value_message(problem)) is not None:
        return f"{key}: {message}"
    if location == ("records",) and kind in ("too_short", "too_long"):
        count = len(got)
        return f"{key}: {count} given, 1 to {MOST_RECORDS} are allowed.{_how_to_write(location)}"
    if location[-1] in _ALLOWED:
        return f"{key}: must be {_ALLOWED[str(location[-1])].replace('GOT', f'got {shown(got)}')}."
    if "columns" in location[:-1]:
        return (
            f"{key}: got {shown(got)}. Write the name of the column, its number counted from 1, "
            'or { name = "...", scale = 1.0, offset = 0.0 }, or { name = "...", unit = "mm" }.'
        )
    return (
        f"{key}: {problem['msg'][0].lower()}{problem['msg'][1:]}, got {shown(got)}.{_how_to_write(location)}"
    )


def value_message(problem: dict[str, Any]) -> str | None:
    """Return what is wrong with a value that is none of several words, or no number; None for other errors."""
    kind, got = problem["type"], problem["input"]
    if kind == "literal_error":
        allowed = str(problem["ctx"]["expected"]).replace(" or ", ", ")
        words = [option.strip("' ") for option in allowed.split(",")]
        return f"is {shown(got)}.{nearest(got, words) if isinstance(got, str) else ''} Allowed: {allowed}."
    if kind == "finite_number":
        return f"must be a finite number, got {shown(got)}."
    if kind == "float_type":
        return f"must be a number, got {shown(got)}. Write numbers without quotes and units."
    return None


def _without_union_members(location: Location) -> Location:
    """Drop the names of alternatives that pydantic puts into a location; they are not keys of the file."""
    kept: list[str | int] = []
    for i, part in enumerate(location):
        if "columns" in kept and i >= kept.index("columns") + 2 and part in ("str", "int", "ColumnTable"):
            continue
        if not kept or kept[-1] not in ("header", "unwrap"):
            kept.append(part)
    return tuple(kept)


def _allowed_keys(location: Location, table: type[FileTable]) -> list[str]:
    if location[0] == "rig" and len(location) > 1:
        table = RigTable
    elif location[0] in LISTS and len(location) > 1:
        table = ColumnTable if "columns" in location else RecordTable
    return list(table.model_fields)


def _how_to_write(location: Location) -> str:
    return {
        "rig": f" Write [rig] and {WHICH_RIG}",
        "model": f" Write {WHICH_RIG}",
        "records": ' Write [[records]] and file = "..." for every record.',
        "file": ' Write file = "name.csv".',
    }.get(str(location[-1]), "")


@dataclass(frozen=True)
class Where:
    """The locations of keys."""

    name: str  # the file, or the name of a campaign in memory
    # The contents of the file, so that a record can be named by its file.
    data: Mapping[str, Any] = field(default_factory=dict)
    # Line and column of each value by its keys; empty if unknown.
    places: Mapping[Location, Place] = field(default_factory=dict)

    def at(self, *location: str | int) -> str:
        """Return the beginning of a message: ``campaign.toml, line 7, column 5: rig.constants.v``."""
        place, _ = nearest_place(location, self.places)
        where = self.name if place is None else f"{self.name}, line {place[0]}, column {place[1]}"
        return f"{where}: {self.called(location)}"

    def called(self, location: Location) -> str:
        """Return a location as text: ``rig.constants.v``, ``record 2 (step.csv): role``."""
        if len(location) < 2 or location[0] not in LISTS or not isinstance(location[1], int):
            return ".".join(map(str, location))
        listed = self.data.get(location[0])
        table = (
            listed[location[1]] if isinstance(listed, list | tuple) and len(listed) > location[1] else None
        )
        file = table.get("file") if isinstance(table, dict) else None
        record = f"record {location[1] + 1}" + (f" ({file})" if isinstance(file, str) and file else "")
        rest = ".".join(map(str, location[2:]))
        return f"{record}: {rest}" if rest else record


def rig_named(where: Where, name: str, known: Mapping[str, Rig]) -> Rig:
    """Return the rig that ``rig.model`` names."""
    if name not in known:
        raise InputError(
            f"{where.at('rig', 'model')}: is '{name}'.{nearest(name, known)} Allowed: {', '.join(known)}; for a rig of your own "
            'give its file: file = "my_rig.toml".'
        )
    return known[name]


def checked_simulation(
    where: Where,
    rig: Rig,
    modelled: Sequence[Effect],
    constants: Mapping[str, float],
    parameters: Mapping[str, float],
    of_records: Collection[str] = (),
) -> tuple[dict[str, float], dict[str, float]]:
    """Return constants and parameters of the given simulation, all defaults filled in."""
    _check_tables(where, rig, constants, parameters)
    known = _constants(where, rig, constants, of_records)
    try:
        structure = compose(rig, modelled)
    except InputError as error:
        raise InputError(f"{where.at('rig', 'effects')}: {error}") from None
    return known, _parameters(where, structure, parameters)


def checked_numbers(
    where: Where, key: Location, whose: str, allowed: Iterable[Parameter], given: Mapping[str, float]
) -> dict[str, float]:
    """Return given numbers, each one that is allowed and within its range."""
    known = {parameter.name: parameter for parameter in allowed}
    checked = {}
    for name, value in given.items():
        here = where.at(*key, name)
        if name not in known:
            listed = ", ".join(known) or "none"
            raise InputError(f"{here}: unknown to {whose}.{nearest(name, known)} Known: {listed}.")
        try:
            checked[name] = known[name].check(value)
        except InputError as error:
            raise InputError(f"{here}: {error}") from None
    return checked


def _check_tables(
    where: Where, rig: Rig, constants: Mapping[str, float], parameters: Mapping[str, float]
) -> None:
    """Refuse a constant among the parameters, and a parameter among the constants, before one of them counts as missing."""
    own_constants = {constant.name for constant in rig.constants}
    own_parameters = {parameter.name for parameter in (*rig.parameters, *rig.alternative_parameters)}
    for table, given, others, kind in (
        ("parameters", parameters, own_constants - own_parameters, "constant"),
        ("constants", constants, own_parameters - own_constants, "parameter"),
    ):
        for name in given:
            if name in others:
                raise InputError(
                    f"{where.at('rig', table, name)}: unknown to {rig.name} under rig.{table}. It is a {kind}: give it under "
                    f"rig.{kind}s."
                )


def _constants(
    where: Where, rig: Rig, given: Mapping[str, float], of_records: Collection[str]
) -> dict[str, float]:
    checked = checked_numbers(where, ("rig", "constants"), rig.name, rig.constants, given)
    for constant in rig.constants:
        if constant.name in checked or constant.name in of_records:
            continue
        if constant.default is None:
            raise InputError(
                f"{where.at('rig', 'constants', constant.name)}: is missing; {rig.name} needs it "
                f"({constant.description} [{constant.unit}])."
            )
        checked[constant.name] = constant.default
    if rig.has_one_motion:
        gain = rig.motion.drive_gain
        if checked.get(str(gain)) == 0.0:
            raise InputError(
                f"{where.at('rig', 'constants', str(gain))}: is 0, so the input would have no effect. Give a gain other than 0."
            )
    return {constant.name: checked[constant.name] for constant in rig.constants if constant.name in checked}


def _parameters(where: Where, structure: Structure, given: Mapping[str, float]) -> dict[str, float]:
    rig = structure.rig
    constants = {constant.name for constant in rig.constants}
    own = [parameter for parameter in structure.parameters if parameter.name not in constants]
    checked = checked_numbers(
        where, ("rig", "parameters"), rig.name, (*own, *rig.alternative_parameters), given
    )
    for parameter in own:
        if parameter not in rig.parameters and parameter.name not in checked:
            if parameter.default is None:
                raise InputError(
                    f"{where.at('rig', 'parameters', parameter.name)}: is missing; the effects of the given simulation "
                    f"need it ({parameter.description} [{parameter.unit}]). Give its value, or remove the effect and fit it: "
                    "'rigsight identify CAMPAIGN --effect NAME'."
                )
            checked[parameter.name] = parameter.default
    for effect in structure.effects:
        for pair in effect.ordered:
            larger, smaller = (structure.parameter_name(effect, name) for name in pair)
            if checked[larger] < checked[smaller]:
                raise InputError(
                    f"{where.at('rig', 'parameters', larger)}: must be at least {smaller} = {checked[smaller]:g} in "
                    f"{effect.name}, got {checked[larger]:g}."
                )
    for alternative, determined in ((a.parameter.name, a.gives) for a in rig.alternatives):
        if alternative in checked and determined in checked:
            raise InputError(
                f"{where.at('rig', 'parameters', alternative)}: cannot be given together with {determined}, which follows from "
                "it; give one of the two."
            )
    return checked

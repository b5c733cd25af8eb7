"""The allowed contents of a `campaign.toml`, where its keys are, and the messages for what is not allowed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigsight.errors import InputError, nearest, shown
from rigsight.records import Hold, Kind, Role
from rigsight.records.formats.known import file_size
from rigsight.rigs.reading.toml_places import Place, toml_tables, value_places

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


class FileTable(BaseModel):
    """A table of a file written by hand: unknown keys and numbers in quotes are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


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


def locate(campaign: Path) -> Path:
    """Return the toml file for a toml file or its folder."""
    if not campaign.exists():
        raise InputError(f"{campaign} does not exist; name a campaign.toml or the folder that contains it.")
    if not campaign.is_dir():
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
    try:
        if file_size(path, "the campaign.toml") > LARGEST_FILE:
            raise InputError(
                f"{path.name} is larger than {LARGEST_FILE / 1e6:g} MB, so it is not a campaign.toml."
            )
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text (byte {error.start}); save it as UTF-8.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    data = toml_tables(
        text, path.name, dict.fromkeys(("Cannot declare", "Cannot overwrite", "Cannot mutate"), _TWICE)
    )
    where = Where.of_toml(path.name, text, data)
    return checked_file(where, data, CampaignTable), where


def checked_file(where: Where, data: dict[str, Any], table: type[Checked]) -> Checked:
    """Return what a file holds as a table."""
    try:
        return table.model_validate(data)
    except ValidationError as error:
        reported = _messages(
            where, data, table, [dict(problem) for problem in error.errors(include_url=False)]
        )
        more = f"\n(and {len(reported) - 5} more)" if len(reported) > 5 else ""
        raise InputError("\n".join(reported[:5]) + more) from None


def _messages(
    where: Where, data: dict[str, Any], table: type[FileTable], problems: list[dict[str, Any]]
) -> list[str]:
    """Return one line per error; if one alternative fails in detail, the errors of the other alternatives are left out."""
    keys = [_without_union_members(problem["loc"], data) for problem in problems]
    reported = [
        _message(where, data, table, problem)
        for problem, key in zip(problems, keys, strict=True)
        if not any(len(other) > len(key) and other[: len(key)] == key for other in keys)
    ]
    return list(dict.fromkeys(reported))


def _message(where: Where, data: dict[str, Any], table: type[FileTable], problem: dict[str, Any]) -> str:
    location = _without_union_members(problem["loc"], data)
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
    if location[-1] == "decimal":
        return f'{key}: must be "." or ",", got {shown(got)}.'
    if location[-1] == "header":
        return (
            f"{key}: must be true, false, or the number of the line with the column names, got {shown(got)}."
        )
    if location[-1] == "separator":
        return f"{key}: must be one character, got {shown(got)}; a blank means any white space."
    if location[-1] == "unwrap":
        return f"{key}: must be true or false for an angle, or the numbers after which the column begins again, got {shown(got)}."
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


def _without_union_members(location: tuple[str | int, ...], data: dict[str, Any]) -> tuple[str | int, ...]:
    """Drop the names of alternatives that pydantic puts into a location; they are not keys of the file."""
    kept: list[str | int] = []
    here: Any = data
    for i, part in enumerate(location):
        if "columns" in kept and i >= kept.index("columns") + 2 and part in ("str", "int", "ColumnTable"):
            continue
        if kept and kept[-1] in ("header", "unwrap"):
            continue
        kept.append(part)
        try:
            here = here[part]
        except (KeyError, IndexError, TypeError):
            here = None
    return tuple(kept)


def _allowed_keys(location: tuple[str | int, ...], table: type[FileTable]) -> list[str]:
    if location[0] == "rig" and len(location) > 1:
        table = RigTable
    elif location[0] in LISTS and len(location) > 1:
        table = ColumnTable if "columns" in location else RecordTable
    return list(table.model_fields)


def _how_to_write(location: tuple[str | int, ...]) -> str:
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

    @classmethod
    def of_toml(cls, name: str, text: str, data: Mapping[str, Any]) -> Where:
        """Return the locations of the keys of a TOML file."""
        return cls(name, data, value_places(text))

    def at(self, *location: str | int) -> str:
        """Return the beginning of a message: ``campaign.toml, line 7, column 5: rig.constants.v``."""
        return f"{self.name}{self._place(location)}: {self.called(location)}"

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

    def _place(self, location: Location) -> str:
        """Return the line of a key; for a missing key, the line of its table."""
        for length in range(len(location), 0, -1):
            own = location[:length]
            place = self.places.get(own) or next(
                (inner for key, inner in self.places.items() if key[:length] == own), None
            )
            if place is not None:
                return f", line {place[0]}, column {place[1]}"
        return ""

"""Content of a rig file: its tables and keys, parsed expressions, and the position of each for messages."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Annotated, Any, NoReturn, get_args, get_origin

import sympy as sp
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rigsight.errors import InputError, nearest, shown
from rigsight.rigs.parts import reading_symbol
from rigsight.rigs.reading.expressions import (
    Expression,
    ExpressionError,
    force_name,
    parsed,
    rate_name,
    to_sympy,
)
from rigsight.rigs.reading.toml_places import Path, nearest_place

NAMED = ("inputs", "constants", "parameters", "alternatives", "coordinates", "states", "signals", "drives")
"""Tables whose names no two entries may share."""
JOINT_PARTS = ("motion", "stiffness", "damping", "rest", "force")
DRIVE_PARTS = ("signal", "force", "along")
_EXPRESSIONS: Mapping[str, tuple[str, ...]] = {
    "joints": (*JOINT_PARTS, "inertia"),
    "drives": DRIVE_PARTS,
    "sensors": ("reads",),
    "states": ("rate", "start"),
    "alternatives": ("value",),
}
"""Keys of each table whose values are expressions."""
_LONGEST_QUOTE = 60


Number = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(max_length=5000)]
Formula = Text | Number


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _InputTable(_Table):
    unit: Text
    about: Text = ""


class ConstantTable(_Table):
    """``[constants.NAME]``: a known number."""

    unit: Text
    about: Text = ""
    lower: Number | None = None
    upper: Number | None = None
    default: Number | None = None


class ParameterTable(ConstantTable):
    """``[parameters.NAME]``: a number to identify."""

    log: bool = False


class _AlternativeTable(ConstantTable):
    gives: Text
    value: Formula


class _CoordinateTable(_Table):
    unit: Text
    about: Text = ""
    prescribed_by: Text | None = None
    rate: Text | None = None


class _EnergyTable(_Table):
    kinetic: Formula = 0.0
    potential: Formula = 0.0


class _JointTable(_Table):
    motion: Formula
    stiffness: Formula = 0.0
    damping: Formula = 0.0
    rest: Formula = 0.0
    force: Formula = 0.0
    inertia: Formula | None = None
    damps_spring: bool = False
    about: Text = ""


class _DriveTable(_Table):
    signal: Formula
    force: Formula
    along: Formula
    about: Text = ""


class _SensorTable(_Table):
    reads: Formula
    unit: Text
    about: Text = ""
    upper_cut: Annotated[Number, Field(gt=0.0)] | None = None


class _StateTable(_Table):
    rate: Formula
    unit: Text
    start: Formula | None = None
    about: Text = ""


class SimulatorTable(_Table):
    """``[simulator]``: another program that moves bodies, its model, and what coordinates and parameters are called there."""

    kind: Text
    file: Text
    digest: Text | None = None
    without_armature: bool = False
    step: Annotated[Number, Field(gt=0.0)] | None = None
    coordinates: dict[str, Text] = {}
    parameters: dict[str, Text] = {}
    states: dict[str, Text] = {}
    rates: dict[str, Text] = {}
    forces: dict[str, Text] = {}


class RigTable(_Table):
    """The whole file."""

    name: Annotated[str, Field(min_length=1, max_length=100)]
    summary: Text = ""
    inputs: dict[str, _InputTable] = {}
    constants: dict[str, ConstantTable] = {}
    parameters: dict[str, ParameterTable] = {}
    alternatives: dict[str, _AlternativeTable] = {}
    coordinates: dict[str, _CoordinateTable] = {}
    energy: _EnergyTable = _EnergyTable()
    simulator: SimulatorTable | None = None
    joints: dict[str, _JointTable] = {}
    drives: dict[str, _DriveTable] = {}
    sensors: dict[str, _SensorTable] = {}
    states: dict[str, _StateTable] = {}
    signals: dict[str, Formula] = {}
    initial: dict[str, Formula] = {}


class Declaration:
    """The tables of a rig file with their expressions, by the path of keys of each.

    `content` is what TOML made of the file, `places` are line and column of each value, see `toml_places`, and `source` is how
    messages call the file.
    """

    def __init__(self, content: dict[str, Any], places: Mapping[Path, tuple[int, int]], source: str) -> None:
        self.content = content
        self._places = places
        self._source = source
        try:
            self.table = RigTable.model_validate(content)
        except ValidationError as error:
            # A key that is missing may be the one that is misspelled.
            first = min(error.errors(), key=lambda found: found["type"] != "extra_forbidden")
            self.refuse(*path_and_sentence(first))
        self.expressions: dict[Path, Expression] = {}
        self._parse()
        names = [*self.names(*NAMED, "sensors"), *map(force_name, self.table.joints)]
        written = dict(zip(names, names, strict=True))
        written |= {
            rate_name(name): own.rate or rate_name(name) for name, own in self.table.coordinates.items()
        }
        self.symbols = {name: sp.Symbol(symbol, real=True) for name, symbol in written.items()}

    def refuse(self, path: Path, message: str, within: int | None = None) -> NoReturn:
        """Raise a message with the place of a value, or of the nearest table around it."""
        where, (place, is_own) = self._source, nearest_place(path, self._places)
        if place is not None:
            column = place[1] + (within + 1 if within is not None and is_own else 0)
            where += f", line {place[0]}, column {column}"
        named = f"{'.'.join(map(str, path))}: " if path else ""
        raise InputError(f"{where}: {named}{message}.")

    def check_known(self, path: Path, what: str, name: str, known: Collection[str]) -> None:
        """Refuse a name that stands for something declared, and does not."""
        if name not in known:
            declared = ", ".join(known) or "none"
            self.refuse(path, f"there is no {what} '{name}'.{nearest(name, known)} Declared: {declared}")

    def refuse_expression(self, path: Path, error: ExpressionError) -> NoReturn:
        """Raise what is wrong with an expression, with a quote of it."""
        text = self.expressions[path].text if path in self.expressions else ""
        self.refuse(path, f"{error}, in '{quoted(text)}'" if text else str(error), error.place)

    def names(self, *keys: str) -> set[str]:
        """Return the names that tables declare."""
        return {name for key in keys for name in getattr(self.table, key)}

    def reads_sensor(self, path: Path, name: str) -> bool:
        """Return True if a name in an expression is a sensor's reading, not the coordinate or state that is called the same."""
        if name not in self.table.sensors:
            return False
        shared = name in self.table.coordinates or name in self.table.states
        in_control = path[0] == "drives" and path[-1] == "signal"
        return in_control or not shared

    def sympy(self, path: Path) -> sp.Expr:
        """Return an expression as sympy sees it."""
        readings = {
            name: reading_symbol(name) for name in self.table.sensors if self.reads_sensor(path, name)
        }
        try:
            return to_sympy(self.expressions[path], self.symbols | readings)
        except ExpressionError as error:
            self.refuse_expression(path, error)

    def _parse(self) -> None:
        table = self.table
        for name in ("kinetic", "potential"):
            self._parse_one(("energy", name), getattr(table.energy, name))
        for key, fields in _EXPRESSIONS.items():
            for name, own in getattr(table, key).items():
                for field in fields:
                    if getattr(own, field) is not None:
                        self._parse_one((key, name, field), getattr(own, field))
        for key in ("signals", "initial"):
            for name, formula in getattr(table, key).items():
                self._parse_one((key, name), formula)

    def _parse_one(self, path: Path, formula: str | float) -> None:
        text = formula if isinstance(formula, str) else f"{formula:.17g}"
        try:
            self.expressions[path] = parsed(text)
        except ExpressionError as error:
            self.refuse(path, f"{error}, in '{quoted(text)}'" if text.strip() else str(error), error.place)


def quoted(text: str) -> str:
    """Return the text of an expression as messages quote it."""
    return text if len(text) <= _LONGEST_QUOTE else f"{text[: _LONGEST_QUOTE - 3]}..."


_WANTED = {
    "string_type": "text in quotes",
    "string_too_short": "at least one character",
    "float_type": "a number without quotes, as 0.05",
    "finite_number": "a finite number",
    "bool_type": "true or false without quotes",
}
_FORMULA = "constrained-str"
"""What pydantic appends to the path of a formula that is no text."""


def path_and_sentence(error: Any) -> tuple[tuple[str | int, ...], str]:
    """Return the path of what pydantic found, and one sentence for it."""
    path = tuple(error["loc"])
    key = str(path[-1]) if path else ""
    if error["type"] == "extra_forbidden":
        allowed = _keys_at(path[:-1])
        known = f"{nearest(key, allowed)} Allowed: {', '.join(allowed)}"
        return path, f"'{key}' is not a key of this table.{known}"
    if error["type"] == "missing":
        return path[:-1], f"the line '{key} = ...' is missing"
    if error["type"] == "string_too_long":
        most, count = error["ctx"]["max_length"], len(error["input"])
        own = path[:-1] if key == _FORMULA else path
        return own, f"it may have at most {most} characters but has {count}"
    got = shown(error.get("input"))
    if error["type"] in ("model_type", "dict_type", "model_attributes_type"):
        return path, f"this is a table: write [{'.'.join(map(str, path))}] and its keys below, got {got}"
    if key in (_FORMULA, "float"):
        return path[:-1], f"expected an expression in quotes or a number, got {got}"
    return path, f"expected {_WANTED.get(error['type'], error['msg'])}, got {got}"


def _keys_at(path: tuple[str | int, ...]) -> list[str]:
    table: Any = RigTable
    for key in path:
        # A table of named entries holds one kind of table under every name.
        table = get_args(table)[1] if get_origin(table) is dict else table.model_fields[str(key)].annotation
    return list(table.model_fields)

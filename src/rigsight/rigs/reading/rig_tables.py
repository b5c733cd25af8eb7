"""Tables and keys of a rig file, before any expression is parsed."""

from __future__ import annotations

from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field

from rigsight.errors import nearest, shown

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

"""Content of a rig file: its tables, parsed expressions, and the position of each for messages."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Mapping
from typing import Any, NoReturn

import sympy as sp
from lark import Token, Tree
from pydantic import ValidationError

from rigsight.errors import InputError, nearest
from rigsight.rigs.parts import reading_symbol
from rigsight.rigs.reading.expressions import (
    FUNCTIONS,
    MOST_POWER,
    READS,
    Expression,
    ExpressionError,
    force_name,
    parsed,
    place_of,
    rate_name,
)
from rigsight.rigs.reading.rig_tables import RigTable, path_and_sentence

_LARGEST = 1e300
"""Largest constant; products of a few of them leave the range of numbers."""


Path = tuple[str | int, ...]

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
        self.symbols = self._declared_symbols()

    def refuse(self, path: Path, message: str, within: int | None = None) -> NoReturn:
        """Raise a message with the place of a value, or of the nearest table around it."""
        place, length = None, 0
        for length in range(len(path), 0, -1):
            own = path[:length]
            # A table may have no header of its own, but one within it.
            place = self._places.get(own) or next(
                (inner for key, inner in self._places.items() if key[:length] == own), None
            )
            if place is not None:
                break
        where = self._source
        if place is not None:
            column = place[1] + (within + 1 if within is not None and len(path) == length else 0)
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

    def _declared_symbols(self) -> dict[str, sp.Symbol]:
        names = [*self.names(*NAMED, "sensors"), *map(force_name, self.table.joints)]
        rates = {rate_name(name): own.rate or rate_name(name) for name, own in self.table.coordinates.items()}
        written = dict(zip(names, names, strict=True)) | rates
        return {name: sp.Symbol(symbol, real=True) for name, symbol in written.items()}


def quoted(text: str) -> str:
    """Return the text of an expression as messages quote it."""
    return text if len(text) <= _LONGEST_QUOTE else f"{text[: _LONGEST_QUOTE - 3]}..."


def to_sympy(expression: Expression, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    """Return an expression as sympy sees it."""
    built = _built(expression.tree, symbols)
    if built.has(sp.I, sp.nan, sp.zoo, sp.oo):
        raise ExpressionError("this has no real value")
    return built


def _built(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    value, place = _of_node(node, symbols), place_of(node)
    size = value if value.is_Rational else sp.S.Zero
    if value.is_number and not value.is_Rational:
        try:
            number = complex(value)
        except (OverflowError, TypeError, ValueError):
            raise ExpressionError("a number is too large or undefined", place) from None
        if number.imag != 0.0 or math.isnan(number.real):
            raise ExpressionError("this has no real value", place)
        size = number.real
    if abs(size) > _LARGEST:
        raise ExpressionError("a number is too large", place)
    return value


def _of_node(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    assert isinstance(node, Tree)
    if node.data == "number":
        return _number(str(node.children[0]), place_of(node))
    if node.data in READS:
        written = READS[str(node.data)](str(node.children[0]))
        if written not in symbols:
            raise ExpressionError(
                f"'{written}' is not known here.{nearest(written, symbols)}", place_of(node)
            )
        return symbols[written]
    if node.data == "call":
        name, *arguments = node.children
        return FUNCTIONS[str(name)].build(*(_built(argument, symbols) for argument in arguments))
    parts = [_built(child, symbols) for child in node.children]
    if node.data == "over" and parts[0].is_zero:
        raise ExpressionError("a division by zero", place_of(node.children[0]))
    if node.data in _OPERATIONS:
        return _OPERATIONS[str(node.data)](*parts)
    base, exponent = parts
    if exponent.is_number and abs(float(exponent)) > MOST_POWER:
        raise ExpressionError(
            f"an exponent must be within +-{MOST_POWER}, this one is {float(exponent):g}",
            place_of(node.children[1]),
        )
    power = base**exponent
    if power.is_Pow and power.exp.is_number and abs(float(power.exp)) > MOST_POWER:
        raise ExpressionError(
            f"powers of powers must stay within +-{MOST_POWER}, this is the {float(power.exp):g}th",
            place_of(node),
        )
    return power


_OPERATIONS: Mapping[str, Callable[..., sp.Expr]] = {
    "sum": sp.Add,
    "product": sp.Mul,
    "negative": operator.neg,
    "minus": operator.neg,
    "plus": operator.pos,
    "times": operator.pos,
    "over": lambda below: 1 / below,
}


def _number(text: str, place: int) -> sp.Expr:
    """Return a number: whole ones stay whole, as powers of symbols need them."""
    value = float(text)
    if math.isinf(value):
        raise ExpressionError(f"{text} is too large", place)
    if text.isdigit() and len(text) <= 15:
        return sp.Integer(int(text))
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 1e15 else sp.Float(value)

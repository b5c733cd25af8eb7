"""Do the units of a rig file add up? Dimensional analysis of all its expressions.

A number that is part of a formula (2, 0.5) is dimensionless. Any other (9.81) may be a constant without a stated unit, so a
product with it may have any unit. Angles are dimensionless, as in SI.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache
from tokenize import TokenError
from typing import Any

from lark import Token, Tree

from rigsight.rigs.reading.declaration import Declaration, quoted
from rigsight.rigs.reading.expressions import (
    FUNCTIONS,
    READS,
    ExpressionError,
    constant,
    force_name,
    place_of,
    rate_name,
)
from rigsight.rigs.reading.toml_places import Path
from rigsight.units import INPUT_UNIT

Dimension = Any
"""Powers of the base quantities, as pint holds them; None for anything."""

_UNIT = re.compile(r"(?:1|[A-Za-zµΩ°%()]++(?:\^-?\d)?|[ */])+")
_LONGEST = 60
_LARGEST_POWER = 100
"""Largest power of a base unit in a message; equations whose units add up have small ones."""
_FORMULA_NUMBER = re.compile(r"\d|\d\.(?:0|5|25|75)|0\.125")
_WORD = re.compile(r"[A-Za-zΩ]+")
_SIGNS = str.maketrans({"²": "^2", "³": "^3", "·": " "})
_USUAL = {"Nm": "N m", "Nms": "N m s", "Ohm": "ohm", "Ω": "ohm"}


class UnitError(ValueError):
    """What is wrong with the text of a unit."""


@cache
def dimension(unit: str) -> Dimension:
    """Return what a unit measures."""
    from pint.errors import PintError

    text = _WORD.sub(lambda word: _USUAL.get(word[0], word[0]), unit.strip()).translate(_SIGNS)
    if text in ("", "1"):
        return _registry().dimensionless.dimensionality
    if len(text) > _LONGEST:
        raise UnitError(f"a unit may have {_LONGEST} characters, this one has {len(text)}")
    if not _UNIT.fullmatch(text) or re.search(r"\)\s*\^|\(\s*\)", text):
        raise UnitError(f"'{unit}' is not a unit; write one like N m/rad, kg m^2 or 1/s")
    registry = _registry()
    try:
        # A blank multiplies, and what follows a stroke in parentheses is all below it.
        quantity = registry.Quantity(1.0, registry.parse_units(re.sub(r"(?<=[\w)]) +(?=[\w(])", "*", text)))
        si = quantity.to_base_units()
        zero = float(registry.Quantity(0.0, quantity.units).to_base_units().magnitude)
    except (
        PintError,
        ValueError,
        TypeError,
        AttributeError,
        AssertionError,
        OverflowError,
        ZeroDivisionError,
        SyntaxError,
        TokenError,
    ):
        raise UnitError(f"the unit '{unit}' is unknown; write one like N m/rad, kg m^2 or 1/s") from None
    if zero:
        raise UnitError(
            f"the unit '{unit}' is not SI: equations are in {_plain(si.units)}, which has another zero"
        )
    if abs(float(si.magnitude) - 1.0) > 1e-12:
        raise UnitError(
            f"the unit '{unit}' is not SI: equations are in {_plain(si.units)}, which is {1.0 / si.magnitude:g} {unit}"
        )
    return si.dimensionality


@cache
def _registry() -> Any:
    from pint import UnitRegistry

    registry: Any = UnitRegistry(cache_folder=None)
    registry.define(f"{INPUT_UNIT} = [{INPUT_UNIT}]")
    return registry


def measured_in(of: Dimension) -> str:
    """Return ``"in kg m/s^2"``, or that there is no unit, for messages."""
    powers = _registry().UnitsContainer({_BASES[name]: power for name, power in of.items()})
    unit = _plain(_registry().get_base_units(powers)[1])
    return "without a unit (angles have none)" if unit == "1" else f"in {unit}"


_BASES = {
    "[length]": "meter",
    "[mass]": "kilogram",
    "[time]": "second",
    "[current]": "ampere",
    "[temperature]": "kelvin",
    "[substance]": "mole",
    "[luminosity]": "candela",
    f"[{INPUT_UNIT}]": INPUT_UNIT,
}


def _plain(units: Any) -> str:
    return f"{units:~C}".replace("**", "^").replace("*", " ") or "1"


class _Walk:
    def __init__(self, text: str, dimensions: Mapping[str, Dimension]) -> None:
        self._text = text
        self._dimensions = dimensions
        self._plain = _registry().dimensionless.dimensionality

    def of(self, node: Tree[Token] | Token) -> Dimension:
        assert isinstance(node, Tree)
        if node.data == "number":
            text = str(node.children[0])
            is_plain = _FORMULA_NUMBER.fullmatch(text) is not None and float(text) != 0.0
            return self._plain if is_plain else None
        if node.data in READS:
            name = str(node.children[0])
            return self._dimensions[READS[str(node.data)](name)]
        if node.data == "call":
            return self._call(node)
        if node.data == "power":
            return self._power(node)
        parts = [self.of(child) for child in node.children]
        if node.data == "sum":
            return self._same(node.children, parts, "are added or subtracted")
        if node.data == "product":
            return None if None in parts else math.prod(parts[1:], start=parts[0])
        if node.data == "over":
            return None if parts[0] is None else 1 / parts[0]
        return parts[0]

    def _call(self, node: Tree[Token]) -> Dimension:
        name, *arguments = node.children
        kind, parts = FUNCTIONS[str(name)].kind, [self.of(argument) for argument in arguments]
        if kind == "pure":
            if parts[0] is not None and parts[0] != self._plain:
                raise ExpressionError(
                    f"{name}(...) takes a dimensionless number, but {self._quoted(arguments[0])} is {measured_in(parts[0])}",
                    place_of(arguments[0]),
                )
            return self._plain
        if kind == "root":
            return None if parts[0] is None else parts[0] ** 0.5
        common = self._same(arguments, parts, f"are compared by {name}")
        return self._plain if kind in ("sign", "ratio") else common

    def _power(self, node: Tree[Token]) -> Dimension:
        base, exponent = (self.of(child) for child in node.children)
        if exponent is not None and exponent != self._plain:
            raise ExpressionError(
                f"an exponent must be dimensionless, but {self._quoted(node.children[1])} is {measured_in(exponent)}",
                place_of(node.children[1]),
            )
        if base is None or base == self._plain:
            return base
        power = constant(node.children[1])
        # An exponent that is a parameter gives an undefined unit, and so do powers of powers.
        if power is None or max(abs(p * power) for p in base.values()) > _LARGEST_POWER:
            return None
        return base**power

    def _same(self, nodes: list[Any], parts: list[Dimension], what: str) -> Dimension:
        common, first = None, nodes[0]
        for node, part in zip(nodes, parts, strict=True):
            if common is None:
                common, first = part, node
            elif part is not None and part != common:
                raise ExpressionError(
                    f"{self._quoted(first)} {measured_in(common)} and {self._quoted(node)} {measured_in(part)} {what}",
                    place_of(node),
                )
        return common

    def _quoted(self, node: Tree[Token] | Token) -> str:
        text = self._text[place_of(node) : _end_of(node)].strip()
        return f"'{text if len(text) <= 40 else text[:37] + '...'}'"


def _end_of(node: Tree[Token] | Token) -> int:
    if isinstance(node, Token):
        return node.end_pos or 0
    closed = node.data in ("rate", "force", "call")
    return max((_end_of(child) for child in node.children), default=0) + closed


class Units:
    """The units of all expressions of a rig file."""

    def __init__(self, declaration: Declaration) -> None:
        self._declaration = declaration
        self._table = declaration.table
        self._second, self._energy = dimension("s"), dimension("J")
        self._dimensions = self._declared()

    def check(self, order: list[Path]) -> None:
        """Reject unknown or inconsistent units; `order` are the paths of signals, each behind those that it reads."""
        for name in self._table.joints:
            motion = self._of(("joints", name, "motion"))
            self._dimensions[force_name(name)] = None if motion is None else self._energy / motion
        for path in order:
            if path[0] == "sensors":
                self._is(path, dimension(self._table.sensors[str(path[1])].unit), "as its unit says")
            else:
                self._dimensions[str(path[1])] = self._of(path)
        for part in ("kinetic", "potential"):
            self._is(("energy", part), self._energy, "as energies are")
        for name in self._table.joints:
            self._check_joint(name)
        for name in self._table.drives:
            along = self._of(("drives", name, "along"))
            wanted = None if along is None else self._energy / along
            why = "because force times the expression that it acts along is in J"
            self._is(("drives", name, "force"), wanted, why)
        for name, state in self._table.states.items():
            measured = dimension(state.unit)
            self._is(("states", name, "rate"), measured / self._second, "from the unit of the state")
            if state.start is not None:
                self._is(("states", name, "start"), measured, "as the state is")
        for name, alternative in self._table.alternatives.items():
            gives = alternative.gives
            self._is(("alternatives", name, "value"), self._dimensions[gives], f"as {gives} is")
        for name in self._table.initial:
            self._is(("initial", name), self._dimensions[name], "as what starts is")

    def _declared(self) -> dict[str, Dimension]:
        found: dict[str, Dimension] = {}
        for key in ("inputs", "constants", "parameters", "alternatives", "coordinates", "states", "sensors"):
            for name, own in getattr(self._table, key).items():
                try:
                    measured = dimension(own.unit)
                except UnitError as error:
                    self._declaration.refuse((key, name, "unit"), str(error))
                # A sensor may be called as the coordinate that it shows; what a control law reads of it is a reading.
                found.setdefault(name, measured)
                if key == "coordinates":
                    found[rate_name(name)] = measured / self._second
        return found

    def _of(self, path: Path) -> Dimension:
        expression = self._declaration.expressions[path]
        read = {
            name: dimension(self._table.sensors[name].unit)
            for name in expression.reads
            if self._declaration.reads_sensor(path, name)
        }
        try:
            return _Walk(expression.text, {**self._dimensions, **read}).of(expression.tree)
        except ExpressionError as error:
            self._declaration.refuse_expression(path, error)

    def _is(self, path: Path, wanted: Dimension, why: str) -> None:
        got = self._of(path)
        if got is not None and wanted is not None and got != wanted:
            text = quoted(self._declaration.expressions[path].text)
            self._declaration.refuse(
                path, f"'{text}' is {measured_in(got)} but should be {measured_in(wanted)}, {why}"
            )

    def _check_joint(self, name: str) -> None:
        motion, force = self._of(("joints", name, "motion")), self._dimensions[force_name(name)]
        if motion is None or force is None:
            return
        derived = "from the unit of the motion"
        self._is(("joints", name, "stiffness"), force / motion, derived)
        self._is(("joints", name, "damping"), force * self._second / motion, derived)
        self._is(("joints", name, "rest"), motion, "as the motion is")
        self._is(("joints", name, "force"), force, derived)
        if self._table.joints[name].inertia is not None:
            self._is(("joints", name, "inertia"), force * self._second**2 / motion, derived)

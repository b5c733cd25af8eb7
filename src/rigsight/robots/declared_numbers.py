"""Parameters of a rig file from a model, and the corresponding fields of the model."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp

from rigsight.rigs.reading.expressions import FUNCTIONS

_LONGEST = 40
"""Characters of a part's name; what is made of it has more."""


@dataclass(frozen=True)
class Field:
    """A number of a MuJoCo model: attribute of an element, and which of several numbers it is."""

    element: str  # ``"joint"``, ``"actuator"`` or ``"body"``
    index: int  # its number in the model
    attribute: str  # as MuJoCo's XML calls it
    entry: int = 0  # which number of an attribute of several
    sign: float = 1.0  # -1 where a rig file and MuJoCo count it the other way


class DeclaredNumbers:
    """Constants and parameters, each declared once, and the numbers of the model that each stands for."""

    def __init__(self, names: Names) -> None:
        self._names = names
        self._constants: dict[str, tuple[str, dict[str, Any]]] = {}
        self.parameters: dict[str, dict[str, Any]] = {}
        self.fields: dict[str, tuple[Field, ...]] = {}

    @property
    def constants(self) -> Mapping[str, dict[str, Any]]:
        """Their tables, by name."""
        return dict(self._constants.values())

    @property
    def values(self) -> dict[str, float]:
        """Parameters as the model has them."""
        return {name: float(table["default"]) for name, table in self.parameters.items()}

    def constant(self, wished: str, value: float, unit: str, about: str, *fields: Field) -> sp.Expr:
        """Return the symbol of a constant; zero for one that is zero."""
        return sp.S.Zero if value == 0.0 else self.symbol_of_constant(wished, value, unit, about, *fields)

    def symbol_of_constant(
        self, wished: str, value: float, unit: str, about: str, *fields: Field
    ) -> sp.Symbol:
        """Return the symbol of a constant, also of one that is zero."""
        if wished not in self._constants:
            name = self._names.free(wished)
            self._constants[wished] = name, {"unit": unit, "default": value, "about": about}
            if fields:
                self.fields[name] = fields
        return sp.Symbol(self._constants[wished][0], real=True)

    def factor(self, wished: str, value: float, about: str, *fields: Field) -> str:
        """Return a factor in front of an expression, ``"NAME*"``; nothing for 1."""
        return "" if value == 1.0 else f"{self.constant(wished, value, '1', about, *fields)}*"

    def parameter(
        self, wished: str, value: float, unit: str, about: str, *fields: Field, lower: float | None = 0.0
    ) -> str:
        """Return the name of a parameter."""
        name = self._names.free(wished)
        table: dict[str, Any] = {"unit": unit, "default": value, "about": about}
        self.parameters[name] = table if lower is None else {**table, "lower": lower}
        self.fields[name] = fields
        return name


class Names:
    """Gives names that no other part has."""

    def __init__(self) -> None:
        self._taken = {*FUNCTIONS, "t", "d", "force"}

    def free(self, wished: str, otherwise: str = "part") -> str:
        """Return the requested name if it is valid and free, or a similar one."""
        name = re.sub(r"\W+", "_", wished, flags=re.ASCII).strip("_")[:_LONGEST] or otherwise
        name = name if not name[0].isdigit() else f"{otherwise}_{name}"
        found, count = name, 1
        while found in self._taken:
            count += 1
            found = f"{name}_{count}"
        self._taken.add(found)
        return found

"""Result of the trust analysis as data: for each parameter values by group, p-value, pattern and likely cause."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.diagnose.trust.patterns import Meaning, Pattern


@dataclass(frozen=True)
class GroupValue:
    """A parameter estimated from one group alone.

    Attributes
    ----------
    group
        Name of the record, the level of an amplitude or constant, or the window.
    value, std
        In the unit of the number.
    """

    group: str
    value: float
    std: float


@dataclass(frozen=True)
class ParameterTrust:
    """Trust in one parameter.

    Attributes
    ----------
    name, unit
        Of the number.
    value, std
        Of the common fit.
    of_effect
        True for a number of an effect, False for one of the rig.
    groups
        Values by kind of group: ``"record"``, ``"amplitude"``, a constant by name, ``"portion"``, ``"window"``. Groups that do
        not determine it alone are left out.
    p_value
        Probability of such differences if it is the same everywhere, adjusted for all tests of all parameters.
    largest
        Largest difference between groups, in standard errors of that difference.
    pattern
        How it differs.
    direction
        1 if it rises with `goes_with`, -1 if it falls, else 0.
    goes_with
        What it changes with: ``"amplitude"``, the name of a constant, ``"time"``; if several cannot be distinguished, all of
        them.
    points_to
        Likely cause and next experiment; None where it is stable.
    """

    name: str
    unit: str
    value: float
    std: float
    of_effect: bool
    groups: Mapping[str, tuple[GroupValue, ...]]
    p_value: float
    largest: float
    pattern: Pattern
    direction: int = 0
    goes_with: tuple[str, ...] = ()
    points_to: Meaning | None = None

    @property
    def stable(self) -> bool:
        """True if nothing contradicts that it is the same everywhere."""
        return self.pattern in (Pattern.STABLE, Pattern.UNKNOWN)

    @property
    def moves(self) -> str:
        """Verb of how it differs along `goes_with`."""
        return {1: "grows", -1: "falls", 0: "differs"}[self.direction]


@dataclass(frozen=True)
class Entangled:
    """Two strongly correlated parameters.

    Attributes
    ----------
    names
        Of both.
    correlation
        Of their errors.
    text
        Description, a sentence.
    """

    names: tuple[str, str]
    correlation: float
    text: str


@dataclass(frozen=True)
class Trust:
    """Whether the parameters of the diagnosed model are the same wherever they are estimated.

    Attributes
    ----------
    statement
        In a few sentences.
    parameters
        One each, those that differ first.
    entangled
        Pairs that can hardly be separated.
    """

    statement: str
    parameters: tuple[ParameterTrust, ...] = ()
    entangled: tuple[Entangled, ...] = field(default=())

    @property
    def stable(self) -> bool:
        """True if no parameter differs significantly anywhere."""
        return all(parameter.stable for parameter in self.parameters)

    def to_json(self) -> dict[str, Any]:
        """Return the entry ``trust`` of ``diagnosis.json``."""
        return {
            "statement": self.statement,
            "stable": self.stable,
            "parameters": [_parameter(parameter) for parameter in self.parameters],
            "entangled": [
                {"names": list(pair.names), "correlation": _number(pair.correlation), "text": pair.text}
                for pair in self.entangled
            ],
        }


def _parameter(parameter: ParameterTrust) -> dict[str, Any]:
    told = parameter.points_to
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "value": _number(parameter.value),
        "std": _number(parameter.std),
        "of_effect": parameter.of_effect,
        "by_group": {
            kind: [
                {"group": one.group, "value": _number(one.value), "std": _number(one.std)} for one in groups
            ]
            for kind, groups in parameter.groups.items()
        },
        "p_value": _number(parameter.p_value),
        "largest_difference": _number(parameter.largest),
        "pattern": str(parameter.pattern),
        "direction": parameter.moves if parameter.direction else None,
        "goes_with": list(parameter.goes_with),
        "points_to": None if told is None else told.cause,
        "next_experiment": None if told is None else told.experiment,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

"""Result of the trust analysis as data: for each parameter values by group, p-value, pattern and likely cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigsight.diagnose.trust.patterns import Meaning, Pattern


@dataclass(frozen=True)
class GroupValue:
    """A parameter estimated from one group alone."""

    group: str  # name of the record, the level of an amplitude or constant, or the window
    # In the unit of the number.
    value: float
    std: float


@dataclass(frozen=True)
class ParameterTrust:
    """Trust in one parameter."""

    # Of the number.
    name: str
    unit: str
    # Of the common fit.
    value: float
    std: float
    of_effect: bool  # true for a number of an effect, False for one of the rig
    # Values by kind of group: ``"record"``, ``"amplitude"``, a constant by name, ``"portion"``, ``"window"``.
    # Groups that do not determine it alone are left out.
    groups: Mapping[str, tuple[GroupValue, ...]]
    # Probability of such differences if it is the same everywhere, adjusted for all tests of all parameters.
    p_value: float
    largest: float  # largest difference between groups, in standard errors of that difference
    pattern: Pattern  # how it differs
    direction: int = 0  # 1 if it rises with `goes_with`, -1 if it falls, else 0
    # What it changes with: ``"amplitude"``, the name of a constant, ``"time"``; if several cannot be
    # distinguished, all of them.
    goes_with: tuple[str, ...] = ()
    points_to: Meaning | None = None  # likely cause and next experiment; None where it is stable

    @property
    def stable(self) -> bool:
        """True if nothing contradicts that it is the same everywhere."""
        return self.pattern in (Pattern.STABLE, Pattern.UNKNOWN)

    @property
    def moves(self) -> str:
        """Verb of how it differs along `goes_with`."""
        return {1: "grows", -1: "falls", 0: "differs"}[self.direction]


@dataclass(frozen=True)
class CorrelatedParameters:
    """Two strongly correlated parameters."""

    names: tuple[str, str]  # of both
    correlation: float  # of their errors
    text: str  # description, a sentence


@dataclass(frozen=True)
class Trust:
    """Whether the parameters of the diagnosed model are the same wherever they are estimated."""

    statement: str  # in a few sentences
    parameters: tuple[ParameterTrust, ...] = ()  # one each, those that differ first
    entangled: tuple[CorrelatedParameters, ...] = field(default=())  # pairs that can hardly be separated

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
            "entangled": self.entangled,
        }


def _parameter(parameter: ParameterTrust) -> dict[str, Any]:
    reported = parameter.points_to
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "value": parameter.value,
        "std": parameter.std,
        "of_effect": parameter.of_effect,
        "by_group": parameter.groups,
        "p_value": parameter.p_value,
        "largest_difference": parameter.largest,
        "pattern": parameter.pattern,
        "direction": parameter.moves if parameter.direction else None,
        "goes_with": parameter.goes_with,
        "points_to": None if reported is None else reported.cause,
        "next_experiment": None if reported is None else reported.experiment,
    }

"""The trust in the parameters of a diagnosed model as data, and in a few sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np

from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.estimates import PORTION, RECORD, WINDOW_LENGTH
from rigsight.diagnose.trust.patterns import Meaning, Pattern
from rigsight.identify.information import listed


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


_LENGTHS = {"whole": "whole records", "half": "halves", "quarter": "quarters"}
_ONE_RECORD = "A single record cannot show whether they hold at another amplitude."


def statement(
    numbers: Sequence[ParameterTrust],
    pairs: Sequence[CorrelatedParameters],
    n_records: int,
    asked: Sequence[str],
    left_open: Sequence[str] = (),
) -> str:
    """Return the statement on the parameters, in a few sentences."""
    differing = [number for number in numbers if not number.stable]
    sentences = [_differs(alike) for alike in _alike(differing)[: TRUST.reported]]
    if len(_alike(differing)) > TRUST.reported:
        rest = [number.name for alike in _alike(differing)[TRUST.reported :] for number in alike]
        sentences.append(f"{listed(rest)} also {'differs' if len(rest) == 1 else 'differ'}.")
    compared = [number for number in numbers if number.pattern is Pattern.STABLE]
    if compared:
        sentences.append(_same(compared, bool(differing), len(compared) == len(numbers), asked))
    if left_open:
        verb = "is" if len(left_open) == 1 else "are"
        sentences.append(f"{listed(left_open)} {verb} not determined even by all records together.")
    open_numbers = [
        number.name
        for number in numbers
        if number.pattern is Pattern.UNKNOWN and number.name not in left_open
    ]
    if open_numbers:
        it = "it" if len(open_numbers) == 1 else "them"
        where = "no two groups of records determine" if n_records > 1 else "no part of the record determines"
        sentences.append(f"{listed(open_numbers)} could not be compared: {where} {it} alone.")
    if n_records == 1:
        sentences.append(_ONE_RECORD)
    return " ".join([*sentences, *(pair.text for pair in pairs[: TRUST.pairs_told])])


def _alike(numbers: Sequence[ParameterTrust]) -> list[list[ParameterTrust]]:
    """Return parameters grouped by pattern and likely cause, in their order."""

    def way(number: ParameterTrust) -> tuple[str, tuple[str, ...], str]:
        return number.pattern, number.goes_with, number.points_to.cause if number.points_to else ""

    first = {way(number): place for place, number in reversed(list(enumerate(numbers)))}
    ordered = sorted(numbers, key=lambda number: first[way(number)])
    return [list(alike) for _, alike in groupby(ordered, key=way)]


def _differs(alike: Sequence[ParameterTrust]) -> str:
    reported = [_course(number) for number in alike[: TRUST.reported]]
    if len(alike) > TRUST.reported:
        reported.append(f"{listed([number.name for number in alike[TRUST.reported :]])} likewise")
    cause = alike[0].points_to.cause if alike[0].points_to else ""
    text = f"{'; '.join(reported)}: {cause}." if cause else f"{'; '.join(reported)}."
    first, *others = alike[0].goes_with or ("",)
    if others:
        text += f" In these records {first} and {listed(others)} change together, so their influences cannot be separated."
    return text


def _course(number: ParameterTrust) -> str:
    """Return how a parameter differs, with values at both ends of its trend."""
    moves = number.moves
    if number.pattern is Pattern.WINDOW:
        return f"{number.name} {moves} when windows get shorter{_ends(number, number.groups[WINDOW_LENGTH], 'in')}"
    if number.pattern is Pattern.PORTION:
        return f"{number.name} {moves} along the records{_ends(number, number.groups[PORTION], 'in')}"
    if number.pattern is Pattern.TIME:
        return f"{number.name} {moves} from record to record{_ends(number, number.groups[RECORD], 'in')}"
    if number.pattern is Pattern.RECORD:
        return f"{number.name} differs from record to record without a trend{_extremes(number)}"
    what = number.goes_with[0]
    if not number.direction:
        return f"{number.name} differs with {what}, without a trend{_extremes(number, what)}"
    return f"{number.name} {moves} with {what}{_ends(number, number.groups[what], 'at')}"


def _ends(number: ParameterTrust, groups: Sequence[GroupValue], preposition: str) -> str:
    if len(groups) < 2:
        return ""
    return ", " + _values(number, groups[0], groups[-1], preposition)


def _extremes(number: ParameterTrust, kind: str = RECORD) -> str:
    groups = number.groups[kind]
    if len(groups) < 2:
        return ""
    lowest, highest = min(groups, key=lambda one: one.value), max(groups, key=lambda one: one.value)
    return ", " + _values(number, lowest, highest, "in" if kind == RECORD else "at")


def _values(number: ParameterTrust, first: GroupValue, second: GroupValue, preposition: str) -> str:
    unit = "" if number.unit in ("", "1", "input") else f" {number.unit}"
    digits = _digits(first, second)
    return " and ".join(
        f"{one.value:.{digits}g}{unit} {preposition} {_LENGTHS.get(one.group, one.group)}"
        for one in (first, second)
    )


def _digits(first: GroupValue, second: GroupValue) -> int:
    """Return digits that show a difference, three at least."""
    size, apart = max(abs(first.value), abs(second.value)), abs(first.value - second.value)
    digits = 3
    while digits < 7 and size > 0.0 and apart < 5.0 * size * 10.0 ** (1 - digits):
        digits += 1
    return digits


def _same(numbers: Sequence[ParameterTrust], is_rest: bool, are_all: bool, asked: Sequence[str]) -> str:
    where = "in every record" if RECORD in asked else ""
    if WINDOW_LENGTH in asked:
        where = f"{where} and in shorter windows" if where else "along the record and in shorter windows"
    largest = max(number.largest for number in numbers)
    names = [number.name for number in numbers]
    if is_rest:
        who = (
            f"The other number, {names[0]}, is" if len(names) == 1 else f"The other {len(names)} numbers are"
        )
    elif len(names) == 1:
        who = f"{names[0]} is"
    else:
        who = f"All {len(names)} numbers are" if are_all else f"{len(names)} numbers are"
    text = f"{who} the same {where or 'wherever they were compared'} (largest difference {largest:.2g} standard errors)."
    vague = {number.name: error for number in numbers if (error := _vagueness(number)) > TRUST.vague}
    if vague:
        name = max(vague, key=vague.__getitem__)
        more = (
            f", {listed([other for other in vague if other != name])} hardly better" if len(vague) > 1 else ""
        )
        text += f" But single groups determine {name} only to {percent(vague[name])}{more}: smaller differences would not show."
    return text


def _vagueness(number: ParameterTrust) -> float:
    """Return the typical relative error of a parameter in groups; zero for one that may be zero."""
    errors = [one.std for groups in number.groups.values() for one in groups]
    if not errors or abs(number.value) <= TRUST.may_be_zero * number.std:
        return 0.0
    return float(np.median(errors)) / abs(number.value)


def percent(share: float) -> str:
    """Return a share in percent with two digits."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"

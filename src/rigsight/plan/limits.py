"""Limits of stroke, speed, force and their rates, and payloads, as a user gives them; how much of them a record uses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.errors import InputError, nearest
from rigsight.records import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class Limit:
    """The largest absolute value of a signal, or of its rate."""

    signal: str
    value: float  # in the unit of the signal, of a rate per second
    is_rate: bool = False

    @property
    def name(self) -> str:
        """Name as it is given: ``x`` or ``d(x)``."""
        return f"d({self.signal})" if self.is_rate else self.signal

    def reached(self, record: Record) -> float:
        """Return the largest absolute value in a record."""
        samples = record[self.signal]
        if self.is_rate:
            samples = np.diff(samples) / record.dt
        return float(np.max(np.abs(samples)))


def read_limits(rig: Rig, asked: Sequence[str]) -> tuple[Limit, ...]:
    """Return the limits that texts such as ``x=0.02`` and ``d(x)=0.5`` state; those on constants are left to `read_payloads`.

    Raises
    ------
    InputError
        If a name is unknown, a signal stated twice, or a value not a positive number.
    """
    known = {
        limit.name: limit
        for signal in (*rig.inputs, *rig.outputs)
        for limit in (Limit(signal.name, 0.0), Limit(signal.name, 0.0, is_rate=True))
    }
    constants = [constant.name for constant in rig.constants]
    found: dict[str, Limit] = {}
    for text, name, value in _read(asked):
        if name in constants:
            continue
        if name not in known:
            allowed = (*known, *constants)
            raise InputError(
                f"--limit {text}: '{name}' is unknown.{nearest(name, allowed)} Allowed: {', '.join(allowed)}, each as NAME=VALUE."
            )
        if name in found:
            raise InputError(f"--limit {text}: '{name}' is limited twice; give one value.")
        if not 0.0 < value < math.inf:
            raise InputError(f"--limit {text}: the value must be a positive number.")
        found[name] = Limit(known[name].signal, value, known[name].is_rate)
    return tuple(found.values())


def read_payloads(rig: Rig, asked: Sequence[str]) -> tuple[Mapping[str, float], ...]:
    """Return the values that constants of a rig may have in an experiment, such as an added mass, by texts such as ``m=2``.

    Raises
    ------
    InputError
        If a value lies outside of the range of its constant.
    """
    constants = {constant.name: constant for constant in rig.constants}
    return tuple({name: constants[name].check(value)} for _, name, value in _read(asked) if name in constants)


def _read(asked: Sequence[str]) -> Iterator[tuple[str, str, float]]:
    """Yield each text with its name and its value, which is NaN where it is no number."""
    for text in asked:
        name, _, number = (part.strip() for part in text.partition("="))
        try:
            yield text, name, float(number)
        except ValueError:
            yield text, name, math.nan


def with_recorded_range(limits: Sequence[Limit], rig: Rig, records: Sequence[Record]) -> tuple[Limit, ...]:
    """Return the limits, with the largest recorded value for each input that has none."""
    limited = {limit.signal for limit in limits if not limit.is_rate}
    added = []
    for signal in rig.inputs:
        if signal.name not in limited:
            largest = max(Limit(signal.name, 0.0).reached(record) for record in records)
            if largest > 0.0:
                added.append(Limit(signal.name, largest))
    return (*limits, *added)


def use_of(limits: Sequence[Limit], record: Record) -> float:
    """Return the largest share of a limit that a record uses."""
    return max((limit.reached(record) / limit.value for limit in limits), default=0.0)

"""A physical parameter (name, unit, bounds, null value), and complete values of several."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from rigsight.errors import InputError, check_in_range, nearest

_ENDLESS = 1e100
"""Null values from here on stand for infinity."""


@dataclass(frozen=True)
class Parameter:
    """One number of a model."""

    name: str  # identifier, the symbol of the equations (``k_c``)
    description: str  # what the number means, one line
    # Product of powers of base quantities (`rigsight.units`); gives unit and characteristic size on any rig.
    dimension: str = ""
    unit: str = ""  # SI unit as text (``"N m/rad"``), ``"1"`` if dimensionless
    # Physically admissible range. That the simulation stays finite is checked over `search`.
    lower: float = -math.inf
    upper: float = math.inf
    # Value at which the effect that owns the parameter vanishes; None if another of its parameters does that.
    null: float | None = None
    # Value used when none is given; a fit leaves a parameter with ``fitted=False`` there.
    default: float | None = None
    starts: tuple[float, ...] = ()  # start values for a search, in characteristic units
    # Range that a search explores, in characteristic units, inside [lower, upper].
    search: tuple[float, float] = (-math.inf, math.inf)
    logarithmic: bool = False  # true for positive quantities that are searched over decades
    # False for a redundant or purely conventional number that no record can determine. A fit leaves it at its
    # first start, if it has one, else at its default.
    fitted: bool = True

    def held_at(self, size: float) -> float:
        """Return where a fit leaves a number that it does not move."""
        if self.starts:
            return self.starts[0] * size
        if self.default is None:
            raise ValueError(f"Parameter {self.name} is not fitted and has neither a start nor a default.")
        return self.default

    @property
    def is_limit(self) -> bool:
        """True if the effect that owns the parameter vanishes where it is infinite."""
        return self.null is not None and self.null >= _ENDLESS

    def grown(self, value: float, factor: float) -> float:
        """Return the value with which the parameter scales its effect by a factor; the same if another one does that."""
        if self.null is None:
            return value
        return value / factor if self.is_limit else self.null + factor * (value - self.null)

    def check(self, value: float) -> float:
        """Return `value` as a float."""
        return check_in_range(f"Parameter '{self.name}'", value, self.lower, self.upper, self.unit)


def complete_values(parameters: Iterable[Parameter], values: Mapping[str, float]) -> dict[str, float]:
    """Return checked values in the order of the parameters, with defaults of those that are not given."""
    known = {parameter.name: parameter for parameter in parameters}
    unknown = [name for name in values if name not in known]
    if unknown:
        hint = nearest(unknown[0], known)
        raise InputError(f"Unknown parameters: {', '.join(unknown)}.{hint} Known: {', '.join(known)}.")
    complete = {name: values.get(name, parameter.default) for name, parameter in known.items()}
    if missing := [name for name, value in complete.items() if value is None]:
        raise InputError(f"Missing parameters: {', '.join(missing)}.")
    return {name: known[name].check(value) for name, value in complete.items() if value is not None}

"""A physical parameter (name, unit, bounds, null value) and sets of their values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
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


@dataclass(frozen=True)
class ParameterSet:
    """An ordered set of parameters with their values, convertible to a vector and back."""

    parameters: tuple[Parameter, ...]
    values: tuple[float, ...]

    @classmethod
    def from_mapping(cls, parameters: Iterable[Parameter], values: Mapping[str, float]) -> ParameterSet:
        """Order `values` as `parameters` are."""
        parameters = tuple(parameters)
        names = [parameter.name for parameter in parameters]
        missing = [name for name in names if name not in values]
        unknown = [name for name in values if name not in names]
        if unknown:
            hint = nearest(unknown[0], names)
            raise InputError(f"Unknown parameters: {', '.join(unknown)}.{hint} Known: {', '.join(names)}.")
        if missing:
            raise InputError(f"Missing parameters: {', '.join(missing)}.")
        return cls(parameters, tuple(p.check(values[p.name]) for p in parameters))

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in order."""
        return tuple(parameter.name for parameter in self.parameters)

    def to_mapping(self) -> dict[str, float]:
        """Return name -> value."""
        return dict(zip(self.names, self.values, strict=True))

    def replace(self, **values: float) -> ParameterSet:
        """Return a copy with some values changed."""
        return ParameterSet.from_mapping(self.parameters, {**self.to_mapping(), **values})

    def __getitem__(self, name: str) -> float:
        return self.values[self.names.index(name)]

    def __iter__(self) -> Iterator[tuple[Parameter, float]]:
        return iter(zip(self.parameters, self.values, strict=True))

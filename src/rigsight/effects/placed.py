"""One effect at one of several places of a rig: ``coulomb_friction@load_bearing``."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Generic, TypeVar

from rigsight.effects.effect import Effect, Start
from rigsight.units import at_place

AT = "@"

T = TypeVar("T")


def placed(effect: Effect, place: str) -> Effect:
    """Return an effect that acts at a named joint, drive or sensor; equal arguments give the same object.

    Effects that it contains as special cases stand at the same place.

    Parameters
    ----------
    effect
        An effect of no place.
    place
        Name of the joint, drive, sensor or state.
    """
    return _placed(ByIdentity(effect), place)


class ByIdentity(Generic[T]):
    """A key of a cache that is the object itself: declarations hold dictionaries and cannot be hashed."""

    def __init__(self, value: T) -> None:
        self.value = value
        self._identity = tuple(map(id, value)) if isinstance(value, tuple) else (id(value),)

    def __hash__(self) -> int:
        return hash(self._identity)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ByIdentity) and self._identity == other._identity


@cache
def _placed(key: ByIdentity[Effect], place: str) -> Effect:
    effect = key.value
    starts = tuple(
        start if start.parent is None else Start(start.values, f"{start.parent}{AT}{place}")
        for start in effect.starts
    )
    return replace(effect, name=f"{effect.name}{AT}{place}", at=place, starts=starts)


def kind_of(name: str) -> str:
    """Return the name of an effect without its place."""
    return name.partition(AT)[0]


def placed_dimension(effect: Effect, dimension: str) -> str:
    """Return the dimension of a parameter or state of an effect, at its place if it has one."""
    return dimension if effect.at is None else at_place(dimension, effect.at)

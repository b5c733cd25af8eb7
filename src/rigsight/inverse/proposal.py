"""What a regression along the measured motion says of the missing force: families, their shares, and numbers to start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, Family, kind_of
from rigsight.inverse.drive_gain import changed, slopes_of_changes
from rigsight.inverse.missing_force import MissingForce
from rigsight.inverse.regression import Sums

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NumbersAlongMotion:
    """Numbers that leave the least force along the motion, in units of the parameters, and how much more others leave."""

    names: tuple[str, ...]
    values: Floats  # shape (n,), within their bounds
    # Share of the squared missing force by which a change d raises the squared force that is left: d^T C d, shape (n, n).
    curvature: Floats


@dataclass(frozen=True, eq=False)
class NumbersBeside:
    """The numbers of the equations beside any effects that the motion judges."""

    names: tuple[str, ...]  # numbers of the equations, in the order of their columns
    of_rig: tuple[bool, ...]  # whether each is a parameter of the rig, not of an effect that is modelled
    is_gain: tuple[bool, ...]  # whether each is the gain of a drive
    start: Floats  # values at which the columns were taken, shape (n,)
    bounds: Sequence[tuple[float, float]]  # of each number
    sums: Sums
    missing: float  # sum of squares of the missing force of the equations alone, on stretches left out
    columns: Mapping[str, Sequence[int]]  # of each effect that the motion judges, by its name

    def beside(self, effects: Sequence[Effect]) -> NumbersAlongMotion:
        """Return the numbers of the rig beside effects; those that the motion does not judge have no columns."""
        chosen = [column for effect in effects for column in self.columns.get(effect.name, ())]
        kept, size = np.flatnonzero(self.of_rig), self.sums.size
        # What the numbers of effects can take over costs nothing.
        shared = np.linalg.inv(self.sums.normal(chosen))[kept[:, None], kept]
        of_changes = np.linalg.inv(shared) * np.outer(size[kept], size[kept])
        values = self.values(chosen)
        names = tuple(self.names[i] for i in kept)
        found = np.array([values[name] for name in names])
        slopes = slopes_of_changes(self.start[kept], found, np.array(self.is_gain)[kept])
        curvature = slopes.T @ of_changes @ slopes
        return NumbersAlongMotion(names, found, (curvature + curvature.T) / (2.0 * self.missing))

    def values(self, chosen: Sequence[int]) -> dict[str, float]:
        """Return all numbers of the equations beside chosen columns, within their bounds."""
        n = len(self.names)
        moved = changed(self.start, self.sums.solved(chosen)[:n], self.is_gain)
        found = np.clip(moved, *np.reshape(self.bounds, (n, 2)).T)
        return dict(zip(self.names, map(float, found), strict=True))


@dataclass(frozen=True)
class ProposedForm:
    """Another form of a family, beside the other families that were taken."""

    effect: Effect
    values: Mapping[str, float]  # its parameters
    left: float  # squared residual of held-out stretches that it leaves, in units of what the form that was taken leaves


@dataclass(frozen=True)
class ProposedStart:
    """Values at which an effect alone explains most of the missing force."""

    own: Mapping[str, float]  # its parameters
    numbers: Mapping[str, float]  # parameters of the equations beside it
    unexplained: float = 1.0  # share of the squared missing force that it leaves


@dataclass(frozen=True)
class ProposedCause:
    """A family at a place, in the form that explains most."""

    effect: Effect
    family: Family
    where: str
    # Share of the squared residual of held-out stretches that it removes beside those taken before, each
    # family alone for those not taken.
    share: float
    values: Mapping[str, float]  # parameters of the effect, as far as the regression gives them
    # 95 % limits of the share over stretches drawn with replacement.
    interval: tuple[float, float] = (0.0, 1.0)
    forms: tuple[
        ProposedForm, ...
    ] = ()  # of a family that was taken, the others that are possible in its place

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "family": str(self.family),
            "where": self.where,
            "effect": kind_of(self.effect.name),
            "share": self.share,
            "interval": list(self.interval),
            "parameters": dict(self.values),
        }


@dataclass(frozen=True)
class Proposal:
    """What a regression along the measured motion says of the missing force."""

    # In the order in which they were taken, each with the share that it removes beside those before it and with its parameters
    # beside all others.
    taken: tuple[ProposedCause, ...]
    alone: tuple[ProposedCause, ...]  # every family at every place by itself, the largest share first
    judged: frozenset[str]  # names of the effects that are terms of this regression
    # Names of effects whose forces nothing tells from a larger gain of their drive, such as its limit.
    undecided: frozenset[str] = field(default=frozenset(), kw_only=True)
    hidden: frozenset[str] = field(
        default=frozenset(), kw_only=True
    )  # names of effects that this motion cannot show
    # Share of the squared residual that those taken remove together.
    explained: float
    # Share that the best of so many terms exceeds in one of a hundred cases if none has to do with the
    # residual.
    by_chance: float
    # Share of the squared residual that noise of the sensors causes; None where their noise is not known.
    noise: float | None = None
    # At each joint, of any shape, the one that explains most first.
    forces: tuple[MissingForce, ...] = ()
    # Parameters of the equations beside those taken, and beside any others.
    numbers: Mapping[str, float] = field(default_factory=dict)
    numbers_beside: NumbersBeside | None = field(default=None, repr=False, compare=False)
    # Of every effect by its name, where it can have the sign that it needs.
    starts: Mapping[str, ProposedStart] = field(default_factory=dict)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """The forms of the families that were taken."""
        return tuple(cause.effect for cause in self.taken)

    def to_json(self) -> dict[str, Any]:
        """Return ``missing_force`` of ``diagnosis.json``."""
        return {
            "joints": [force.to_json() for force in self.forces],
            "families": [cause.to_json() for cause in self.alone if cause.share > self.by_chance],
            "taken": [cause.to_json() for cause in self.taken],
            "explained": self.explained,
            "by_chance": self.by_chance,
            "noise": self.noise,
        }

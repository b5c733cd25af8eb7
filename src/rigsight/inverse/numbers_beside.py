"""Numbers of the equations with which they hold best along the measured motion, beside any effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.inverse.drive_gain import changed, slopes_of_changes
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

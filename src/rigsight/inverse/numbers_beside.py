"""Numbers of the equations with which they hold best along the measured motion, beside any effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect

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
    """The sums of products of a regression, from which the numbers beside any effects follow.

    The first columns are those of the equations' numbers, the last one is the missing force; all but the last have mean square
    one.
    """

    names: tuple[str, ...]  # numbers of the equations, in the order of their columns
    of_rig: tuple[bool, ...]  # whether each is a parameter of the rig, not of an effect that is modelled
    start: Floats  # values at which the columns were taken, shape (n,)
    bounds: Sequence[tuple[float, float]]  # of each number
    size: Floats  # of the column of each number before it was scaled, shape (n,)
    products: Floats  # mean products of all columns, shape (n_columns, n_columns)
    missing: float  # mean square of the missing force of the equations alone, on stretches left out
    columns: Mapping[str, Sequence[int]]  # of each effect that the motion judges, by its name
    ridge: float  # added to the products of each column with itself: what nothing determines stays

    def beside(self, effects: Sequence[Effect]) -> NumbersAlongMotion:
        """Return the numbers of the rig beside effects; those that the motion does not judge have no columns."""
        chosen = [column for effect in effects for column in self.columns.get(effect.name, ())]
        kept = np.flatnonzero(self.of_rig)
        # What the numbers of effects can take over costs nothing.
        shared = np.linalg.inv(self._normal(chosen))[kept[:, None], kept]
        curvature = np.linalg.inv(shared) * np.outer(self.size[kept], self.size[kept])
        return NumbersAlongMotion(
            tuple(self.names[i] for i in kept),
            self.values(chosen)[kept],
            (curvature + curvature.T) / (2.0 * self.missing),
        )

    def values(self, chosen: Sequence[int]) -> Floats:
        """Return all numbers of the equations beside chosen columns, within their bounds, shape (n,)."""
        n = len(self.names)
        target = self.products[[*range(n), *chosen], -1]
        change = np.linalg.solve(self._normal(chosen), target)[:n] / self.size
        return np.asarray(np.clip(self.start + change, *np.reshape(self.bounds, (n, 2)).T))

    def _normal(self, chosen: Sequence[int]) -> Floats:
        at = np.array([*range(len(self.names)), *chosen], dtype=np.int64)
        return np.asarray(self.products[at[:, None], at] + self.ridge * np.eye(at.size))

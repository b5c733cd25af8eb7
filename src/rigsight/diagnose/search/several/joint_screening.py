"""Which effects explain a residual together, to first order?

Fitted alone, an effect compensates for the others that are missing, and one that can imitate all of them may explain most; with
three effects hidden, none of the best single ones need be among them. Together the responses to the true effects explain the
residual whichever is strongest. For small effects this is a choice of columns of a linear regression, tried for every pair; the
best pairs are extended to triples.

References
----------
T. Hastie, R. Tibshirani, J. Friedman, *The Elements of Statistical Learning* (Springer 2009), section 3.3, for the choice of the
best subset of columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.screening import Response, scaled
from rigsight.effects import Effect

Floats = NDArray[np.float64]

_DEPENDENT = 1e-6
"""Squared part of a column outside the others, in units of the column, below which it depends on them."""


@dataclass(frozen=True)
class EffectSet:
    """Effects whose responses explain a residual together."""

    effects: tuple[Effect, ...]  # in the order of the candidates
    # Values of their own parameters at which the responses have that size, for each effect by its own names.
    values: tuple[Mapping[str, float], ...]
    share: float  # share of the squared residual that they explain

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(effect.name for effect in self.effects)


def best_sets(responses: Sequence[Response], residual: Floats, size: int) -> list[EffectSet]:
    """Return the sets of effects that explain most of a residual together, best first."""
    total = float(residual @ residual)
    # A response that runs away in the simulation has no direction.
    with np.errstate(over="ignore"):
        responses = [r for r in responses if 0.0 < np.linalg.norm(r.column) < np.inf]
    if not responses or not total > 0.0:
        return []
    columns = _Columns.of(responses, residual)
    chosen, shares = np.arange(len(columns.responses))[:, None], columns.along**2
    for _ in range(size - 1):
        chosen, shares = columns.extended(chosen)
    found = (columns.effect_set(own, square / total) for own, square in zip(chosen, shares, strict=True))
    return [effect_set for effect_set in found if all(effect_set.values)]


@dataclass(frozen=True)
class _Columns:
    """Responses of unit length, none twice."""

    responses: tuple[Response, ...]  # with their own lengths
    # Products of the columns with each other and with the residual, shapes (n, n) and (n,).
    gram: Floats
    along: Floats
    reversible: NDArray[np.bool_]  # whether an effect may have either sign, shape (n,)

    @classmethod
    def of(cls, responses: Sequence[Response], residual: Floats) -> _Columns:
        unit = np.column_stack([r.column / np.linalg.norm(r.column) for r in responses])
        gram = unit.T @ unit
        # Starts of an effect that differ in size only have the same response.
        kept: list[int] = []
        for i, response in enumerate(responses):
            same = [j for j in kept if responses[j].effect == response.effect]
            if not any(gram[i, j] > 1.0 - _DEPENDENT for j in same):
                kept.append(i)
        chosen = tuple(responses[i] for i in kept)
        reversible = np.array([bool(scaled(r.effect, r.values, -1.0)) for r in chosen], dtype=bool)
        return cls(chosen, gram[np.ix_(kept, kept)], unit[:, kept].T @ residual, reversible)

    def extended(self, chosen: NDArray[np.int64]) -> tuple[NDArray[np.int64], Floats]:
        """Return sets with one more effect each, best first, and the squared residual that each explains."""
        names = np.array([response.effect.name for response in self.responses])
        found: dict[tuple[int, ...], float] = {}
        for own in chosen:
            inner = np.linalg.inv(self.gram[np.ix_(own, own)])
            weights, alone = inner @ self.gram[own], inner @ self.along[own]
            outside = 1.0 - np.einsum("ij,ij->j", self.gram[own], weights)
            usable = np.flatnonzero((outside > _DEPENDENT) & ~np.isin(names, names[own]))
            added = (self.along[usable] - self.along[own] @ weights[:, usable]) / outside[usable]
            factors = np.vstack([alone[:, None] - weights[:, usable] * added, added])
            members = np.vstack([np.repeat(own[:, None], usable.size, axis=1), usable])
            # An effect that would have to act the other way, such as a friction that drives, explains nothing.
            possible = np.all((factors > 0.0) | self.reversible[members], axis=0)
            explained = self.along[own] @ alone + added**2 * outside[usable]
            for members_of, square in zip(members.T[possible], explained[possible], strict=True):
                found[tuple(sorted(map(int, members_of)))] = float(square)
        best = self._beam(found)
        size = chosen.shape[1] + 1
        return np.array(best, dtype=np.int64).reshape(-1, size), np.array([found[own] for own in best])

    def _beam(self, found: Mapping[tuple[int, ...], float]) -> list[tuple[int, ...]]:
        """Return the best sets; of the same effects only as many starts as are fitted, as one with many would fill all places."""
        starts: Counter[frozenset[str]] = Counter()
        best: list[tuple[int, ...]] = []
        for members in sorted(found, key=lambda members: -found[members]):
            effects = frozenset(self.responses[i].effect.name for i in members)
            starts[effects] += 1
            if starts[effects] <= SEARCH.lengthy_starts:
                best.append(members)
            if len(best) == SEARCH.joint_beam:
                break
        return best

    def effect_set(self, own: NDArray[np.int64], share: float) -> EffectSet:
        """Return a set of columns, shape (size,), as effects with the sizes that the regression gives them."""
        factors = np.linalg.solve(self.gram[np.ix_(own, own)], self.along[own])
        members = [self.responses[i] for i in own]
        values = tuple(
            scaled(response.effect, response.values, float(factor / np.linalg.norm(response.column)))
            for response, factor in zip(members, factors, strict=True)
        )
        return EffectSet(tuple(response.effect for response in members), values, float(share))

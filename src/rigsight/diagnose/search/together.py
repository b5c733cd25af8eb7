"""Which effects explain the residual of the equations together? Screened to first order, then fitted from there.

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
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.first_look import FirstLook, started_from, widened
from rigsight.diagnose.search.screening import Response, Shortlist, scaled
from rigsight.diagnose.search.single_effects import followed
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import Effect
from rigsight.identify.start.declared_starts import with_own_values
from rigsight.records.record import Floats

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


class Together:
    """Sets of effects, screened against the equations without an effect."""

    # Candidates whose frequency or wave number the screening does not know are left out.

    def __init__(
        self,
        context: FitContext,
        reidentified: FittedModel,
        effects: Sequence[Effect],
    ) -> None:
        self._context = context
        self._reidentified = reidentified
        self._effects = effects
        self._sets: dict[int, list[EffectSet]] = {}

    def fitted(self, size: int, least_share: float = 0.0) -> list[FittedModel]:
        """Return models of so many effects that explain most together in the screening, fitted and scored."""
        # None where they explain less than this share of what one effect less leaves above the noise.
        context = self._context
        found: dict[frozenset[str], list[EffectSet]] = {}
        larger = self._best_sets(size)
        if least_share > 0.0 and larger:
            smaller = self._best_sets(size - 1)
            if not smaller or self._left(larger) > (1.0 - least_share) * self._left(smaller):
                return []
        for effect_set in larger:
            if len(found) < SEARCH.joint_sets or effect_set.names in found:
                found.setdefault(effect_set.names, []).append(effect_set)
        starts = list(found.values())
        context.prepare(context.simplest(sets[0].effects) for sets in starts)

        def look_at(sets: list[EffectSet]) -> FirstLook:
            effects = sets[0].effects
            values = [self._start(one) for one in sets[: SEARCH.lengthy_starts]]
            return started_from(context, effects, context.simplest(effects), values)

        looks = widened(context, list(context.threads.side_by_side(look_at, starts)))
        lowest = min((look.cost for look in looks), default=float("inf"))
        promising = sorted(
            (look for look in looks if look.cost <= SEARCH.near_the_best * lowest), key=lambda look: look.cost
        )

        def follow(look: FirstLook) -> FittedModel:
            return followed(context, look, promising=True, finish=False)

        models = context.threads.side_by_side(follow, promising[: SEARCH.most_followed])
        return [model for model in models if np.isfinite(model.error_over_noise)]

    def _best_sets(self, size: int) -> list[EffectSet]:
        if size not in self._sets:
            self._sets[size] = best_sets(self._responses, self._lineup.remainder, size)
        return self._sets[size]

    def _left(self, sets: Sequence[EffectSet]) -> float:
        """Return the squared residual above the noise that the best of sets leaves, to first order."""
        residual = self._lineup.remainder
        return max(float((1.0 - sets[0].share) * (residual @ residual)) - residual.size, 0.0)

    @cached_property
    def _lineup(self) -> Shortlist:
        return Shortlist(self._context, self._reidentified, liveliest=self._context.rig.has_one_motion)

    @cached_property
    def _responses(self) -> list[Response]:
        offered = self._context.offered(self._effects)
        return self._lineup.responses([e for e in offered if e.pulsation is None and e.wave_number is None])

    def _start(self, effect_set: EffectSet) -> dict[str, float]:
        """Return values of all parameters: the effects as the screening sizes them, the rig as without them."""
        context, fit = self._context, self._reidentified.fit
        for number, (effect, own) in enumerate(
            zip(effect_set.effects, effect_set.values, strict=True), start=1
        ):
            structure = context.simplest(effect_set.effects[:number])
            declared = next(iter(start_values(context, structure, effect, fit, {})))
            values = {**declared, **with_own_values(structure, effect, fit, own)}
            fit = replace(fit, values=values, structure=structure)
        return dict(fit.values)

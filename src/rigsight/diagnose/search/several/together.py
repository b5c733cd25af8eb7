"""Models of several effects that explain the residual of the equations together, fitted from where the screening puts them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.first_look import FirstLook, started_from, widened
from rigsight.diagnose.search.screening import Response, Shortlist
from rigsight.diagnose.search.several.joint_screening import EffectSet, best_sets
from rigsight.diagnose.search.single_effects import followed
from rigsight.diagnose.search.starts import start_values, with_own_values
from rigsight.effects import Effect


class Together:
    """Sets of effects, screened against the equations without an effect.

    Parameters
    ----------
    context
        Records, scales and noise.
    reidentified
        The equations without an effect.
    effects
        Candidates. Those whose frequency or wave number the screening does not know are left out.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """

    def __init__(
        self,
        context: FitContext,
        reidentified: FittedModel,
        effects: Sequence[Effect],
        prepare: Prepare | None = None,
    ) -> None:
        self._context = context
        self._reidentified = reidentified
        self._effects = effects
        self._prepare = prepare
        self._sets: dict[int, list[EffectSet]] = {}

    def fitted(self, size: int, least_share: float = 0.0) -> list[FittedModel]:
        """Return models of so many effects that explain most together in the screening, fitted and scored.

        None where they explain less than this share of what one effect less leaves above the noise.
        """
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
        if self._prepare is not None:
            self._prepare([context.simplest(sets[0].effects) for sets in starts])

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

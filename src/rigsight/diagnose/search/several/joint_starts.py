"""Does a pair similar to the best one explain more if both effects start from their declared values?

Pairs are built from a single effect that was fitted alone and therefore compensates for part of the second one. The second effect
then starts from wrong values, and a similar effect may win. Here both effects start together from the equations without an
effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import FirstLook, started_from, widened
from rigsight.diagnose.search.places import search_places
from rigsight.diagnose.search.several.pairs import larger_first
from rigsight.diagnose.search.single_effects import finished, followed, refine
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import Effect
from rigsight.identify import FitResult
from rigsight.simulate import Structure

_SEED = 0
"""Starts are the same for equal pairs: a diagnosis depends on its records alone."""


def with_joint_starts(
    context: FitContext,
    reidentified: FittedModel,
    models: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    effects: Sequence[Effect],
    is_adequate: Callable[[FittedModel], bool],
    prepare: Prepare | None = None,
) -> list[FittedModel]:
    """Return the models of several effects, with those pairs similar to the best one that explain more."""
    nearest = _plainest_of_the_best(models)
    if not nearest or len(nearest[0].effects) != 2:
        return list(models)
    best = nearest[0]
    if best.error_over_noise <= VERDICT.exact or is_adequate(best):
        return list(models)
    alone = {model.names[0]: model for model in singles if model.residuals}
    # Of two that say the same, such as a late drive and a late sensor, each has relatives of its own.
    relatives = list(
        {
            frozenset(effect.name for effect in two): two
            for pair in nearest
            if len(pair.effects) == 2
            for two in _relatives(context, pair, alone, effects)
        }.values()
    )
    if prepare is not None:
        prepare([context.simplest(two) for two in relatives])

    def look_at(two: tuple[Effect, Effect]) -> FirstLook:
        structure = context.simplest(two)
        return started_from(context, two, structure, _starts(context, two, structure, reidentified.fit))

    def follow(look: FirstLook) -> FittedModel:
        return finished(context, followed(context, look, promising=True, finish=False))

    looks = list(context.threads.side_by_side(look_at, relatives))
    promising = sorted(
        (look for look in widened(context, looks) if look.cost < SEARCH.near_the_best * best.fit.cost),
        key=lambda look: look.cost,
    )
    last = promising[: SEARCH.most_finished][-1].cost if promising else 0.0
    # A cost is a sum of squares, the factor is one of errors.
    alike = [look for look in promising if look.cost <= SEARCH.alike_pairs**2 * last]
    found = list(context.threads.side_by_side(follow, alike))
    better = [m for m in refine(context, found) if m.error_over_noise < best.error_over_noise]
    new = {frozenset(model.names) for model in better}
    return [*larger_first(better, singles), *(m for m in models if frozenset(m.names) not in new)]


def _plainest_of_the_best(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the best models; among equally good ones those with the fewest parameters first."""
    lowest = min((model.error_over_noise for model in models), default=np.inf)
    near = [m for m in models if m.error_over_noise <= SEARCH.alike_pairs * lowest]
    return sorted(near, key=lambda model: (model.n_free, model.error_over_noise))[: SEARCH.most_finished]


def _relatives(
    context: FitContext, pair: FittedModel, alone: Mapping[str, FittedModel], effects: Sequence[Effect]
) -> Iterator[tuple[Effect, Effect]]:
    """Yield the pair, and those with another effect at the place of one of the two.

    One whose push explains about as much beside the other effect; where the replaced effect has a memory any other with a memory
    too, as a push shows one shape of its loop.
    """
    yield pair.effects[0], pair.effects[1]
    for kept, replaced in (pair.effects, pair.effects[::-1]):
        if kept.name not in alone:
            continue
        place = context.rig.acts_at(replaced)
        instead = [
            e for e in context.offered(effects) if context.rig.acts_at(e) == place and e not in pair.effects
        ]
        shares = search_places(context, alone[kept.name], [replaced, *instead]).shares
        enough = VERDICT.larger_part * max(shares.values(), default=0.0)
        yield from (
            (kept, e) for e in instead if shares.get(e.name, 0.0) >= enough or (e.states and replaced.states)
        )


def _starts(
    context: FitContext, two: tuple[Effect, Effect], structure: Structure, base: FitResult
) -> list[dict[str, float]]:
    """Return values of all parameters: any declared numbers of one with any of the other; a draw of them where they are many."""
    first = context.simplest(two[:1])
    found = [
        values
        for start in start_values(context, first, two[0], base, {})
        for values in start_values(
            context, structure, two[1], replace(base, values=start, structure=first), {}
        )
    ]
    if len(found) <= SEARCH.joint_starts:
        return found
    drawn = np.random.default_rng(_SEED).choice(len(found), SEARCH.joint_starts, replace=False)
    return [found[i] for i in np.sort(drawn)]

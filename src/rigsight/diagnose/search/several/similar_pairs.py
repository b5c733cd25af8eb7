"""Which effects, similar to those of the best pair, explain more in their place?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import LOOK_ACCURACY, look_at, widened
from rigsight.diagnose.search.several.one_more_effect import is_among, with_one_more
from rigsight.diagnose.search.several.pair_search import PairSearch
from rigsight.diagnose.search.single_effects import followed
from rigsight.effects import Effect
from rigsight.simulate import carried_over


def with_similar(
    context: FitContext,
    pairs: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    effects: Sequence[Effect],
    prepare: Prepare | None,
) -> list[FittedModel]:
    """Return the pairs with those in which an effect that explains as much stands for one of the best pair.

    One of the two may be right and the other only similar to the right one, or records cannot distinguish them. What each of the
    two explains is the residual of the pair's other parameters without it.
    """
    found = list(pairs)
    replaced: FittedModel | None = None
    for _ in range(SEARCH.most_swaps):
        best = min(found, key=lambda pair: pair.error_over_noise)
        if best is replaced:
            break
        replaced = best
        for kept in best.effects:
            parent = _without_the_other(context, best, kept)
            found += with_one_more(context, parent, effects, found, singles, prepare)
    return found


def _without_the_other(context: FitContext, pair: FittedModel, kept: Effect) -> FittedModel:
    """Return the model of one effect of a pair with the values that it has there, and with initial states of its own."""
    structure = context.simplest((kept,), pair.fit.structure)
    values = {**carried_over(pair.fit.values, pair.fit.structure, structure), **dict(structure.fixed)}
    fit = context.problem(structure, context.estimation, LOOK_ACCURACY).fit(values, [])
    free = tuple(context.free_parameters(structure))
    errors = {name: pair.fit.standard_errors.get(name, 0.0) for name in free}
    return context.score((kept,), replace(fit, free=free, standard_errors=errors), roughly=True)


def with_other_forms(search: PairSearch, pairs: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the pairs with those in which a more general form of an effect, or a simpler one, stands for it."""
    found = list(pairs)
    for _ in range(SEARCH.most_swaps):
        best = _best(found)
        # Of two close forms of a law the simpler was extended first; it may explain too little beside the second effect.
        if best is None or best.error_over_noise <= VERDICT.exact:
            break
        found += _more_general(search, best, found)
    best = _best(found)
    if best is not None and best.error_over_noise <= search.allowed:
        found += _plainer(search, best, found)
    return found


def _best(pairs: Sequence[FittedModel]) -> FittedModel | None:
    return min(pairs, key=lambda pair: pair.error_over_noise, default=None)


def _more_general(search: PairSearch, pair: FittedModel, known: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the pairs in which one effect is replaced by a more general one, fitted from there.

    In combination with another effect a simpler form may lead at a first look, because it has fewer parameters to fit.
    """
    context = search.context
    alone = {model.names[0]: model for model in search.usable}
    swaps = []
    for member, other in (pair.effects, pair.effects[::-1]):
        if other.name in alone:
            swaps += [
                (other, child, member)
                for child in context.offered(search.effects)
                if member.name in child.parents
                and child != other
                and not is_among(known, {*alone[other.name].names, child.name})
            ]
    if search.prepare is not None:
        search.prepare([context.simplest((other, child)) for other, child, _ in swaps])

    def one(swap: tuple[Effect, Effect, Effect]) -> FittedModel:
        other, child, member = swap
        look = look_at(
            context,
            (other, child),
            alone[other.name].fit,
            {member.name: pair.fit},
            substeps=pair.fit.substeps,
        )
        (wide,) = widened(context, [look], substeps=pair.fit.substeps)
        return followed(context, wide, promising=wide.cost <= pair.fit.cost, finish=False)

    return list(context.threads.side_by_side(one, swaps))


def _plainer(search: PairSearch, pair: FittedModel, known: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the pairs in which a simpler form replaces an effect, fitted beside the other effect.

    Alone, a more general form may compensate for the missing effect; beside that effect the simpler one may suffice.
    """
    found: list[FittedModel] = []
    for kept in search.usable:
        if kept.effects[0] not in pair.effects:
            continue
        (replaced,) = (effect for effect in pair.effects if effect != kept.effects[0])
        simpler = [effect for effect in search.effects if effect.name in replaced.parents]
        if simpler:
            found += search.beside(kept, simpler, [*known, *found])
    return found

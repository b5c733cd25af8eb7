"""Which effects, similar to those of the best pair, explain more in their place?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import Scored
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import look_at, widened
from rigsight.diagnose.search.several.one_more_effect import is_among
from rigsight.diagnose.search.several.pair_search import PairSearch
from rigsight.diagnose.search.single_effects import followed
from rigsight.effects import Effect


def with_similar(search: PairSearch, pairs: Sequence[Scored], tried: Sequence[Scored]) -> list[Scored]:
    """Return the pairs with those in which an effect that alone explains as much stands for one of the best pair.

    One of the two may be right and the other only similar to the right one.

    Parameters
    ----------
    search
        Records, candidates and limits.
    pairs
        Fitted and scored.
    tried
        Single effects beside which all candidates have been tried.
    """
    found = list(pairs)
    best = _best(pairs)
    if best is None or best.error_over_noise > search.allowed:
        return found
    # An effect that was left out of the singles because another is equivalent may still be part of a pair.
    alone = {effect.name: np.inf for effect in search.effects} | {
        model.names[0]: model.error_over_noise for model in search.singles
    }
    for kept in (model for model in search.usable if model not in tried):
        if kept.effects[0] in best.effects:
            (name,) = set(best.names) - set(kept.names)
            instead = [e for e in search.effects if alone[e.name] <= VERDICT.comparable * alone[name]]
            # Not only the partners that other forms of the kept effect leave: the pair has shown that a second effect is needed.
            found += search.beside(kept, instead, found)
    return found


def with_other_forms(search: PairSearch, pairs: Sequence[Scored]) -> list[Scored]:
    """Return the pairs with those in which a more general form of an effect, or a simpler one, stands for it.

    Parameters
    ----------
    search
        Records, candidates and limits.
    pairs
        Fitted and scored.
    """
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


def _best(pairs: Sequence[Scored]) -> Scored | None:
    return min(pairs, key=lambda pair: pair.error_over_noise, default=None)


def _more_general(search: PairSearch, pair: Scored, known: Sequence[Scored]) -> list[Scored]:
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

    def one(swap: tuple[Effect, Effect, Effect]) -> Scored:
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


def _plainer(search: PairSearch, pair: Scored, known: Sequence[Scored]) -> list[Scored]:
    """Return the pairs in which a simpler form replaces an effect, fitted beside the other effect.

    Alone, a more general form may compensate for the missing effect; beside that effect the simpler one may suffice.
    """
    found: list[Scored] = []
    for kept in search.usable:
        if kept.effects[0] not in pair.effects:
            continue
        (replaced,) = (effect for effect in pair.effects if effect != kept.effects[0])
        simpler = [effect for effect in search.effects if effect.name in replaced.parents]
        if simpler:
            found += search.beside(kept, simpler, [*known, *found])
    return found

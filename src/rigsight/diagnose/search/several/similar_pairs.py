"""Which effects, similar to those of the best pair, explain more in their place?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import look_at, widened
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.one_more_effect import is_among, with_one_more
from rigsight.diagnose.search.single_effects import followed
from rigsight.effects import Effect


def with_similar(
    context: FitContext,
    pairs: Sequence[Scored],
    singles: Sequence[Scored],
    usable: Sequence[Scored],
    effects: Sequence[Effect],
    allowed: float,
    forms: OtherForms,
    tried: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    """Return the pairs with those in which an effect that alone explains as much stands for one of the best pair.

    One of the two may be right and the other only similar to the right one.

    Parameters
    ----------
    context
        Records, scales and noise.
    pairs, singles
        Fitted and scored.
    usable
        The single effects that could be simulated, best first.
    effects
        Candidates.
    allowed
        Error, in units of the noise floor, that a pair may leave to compete.
    forms
        Says which effects are worth trying beside another.
    tried
        Single effects beside which all have been tried.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """
    found = list(pairs)
    best = min(pairs, key=lambda pair: pair.error_over_noise, default=None)
    if best is None or best.error_over_noise > allowed:
        return found
    # An effect that was left out of the singles because another is equivalent may still be part of a pair.
    alone = {effect.name: np.inf for effect in effects} | {
        model.names[0]: model.error_over_noise for model in singles
    }
    for kept in (model for model in usable if model not in tried):
        if kept.effects[0] in best.effects:
            (name,) = set(best.names) - set(kept.names)
            instead = [e for e in effects if alone[e.name] <= VERDICT.comparable * alone[name]]
            found += with_one_more(context, kept, forms.partners(kept, instead), found, usable, prepare)
    return found


def with_other_forms(
    context: FitContext,
    pairs: Sequence[Scored],
    usable: Sequence[Scored],
    effects: Sequence[Effect],
    allowed: float,
    prepare: Prepare | None,
) -> list[Scored]:
    """Return the pairs with those in which a more general form of an effect, or a simpler one, stands for it.

    Parameters
    ----------
    context
        Records, scales and noise.
    pairs
        Fitted and scored.
    usable
        The single effects that could be simulated, best first.
    effects
        Candidates.
    allowed
        Error, in units of the noise floor, that a pair may leave to compete.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """
    found = list(pairs)
    for _ in range(SEARCH.most_swaps):
        best = min(found, key=lambda pair: pair.error_over_noise, default=None)
        # Of two close forms of a law the simpler was extended first; it may explain too little beside the second effect.
        if best is None or best.error_over_noise <= VERDICT.exact:
            break
        found += _more_general(context, best, usable, effects, found, prepare)
    best = min(found, key=lambda pair: pair.error_over_noise, default=None)
    if best is not None and best.error_over_noise <= allowed:
        found += _plainer(context, best, usable, effects, found, prepare)
    return found


def _more_general(
    context: FitContext,
    pair: Scored,
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    known: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    """Return the pairs in which one effect is replaced by a more general one, fitted from there.

    In combination with another effect a simpler form may lead at a first look, because it has fewer parameters to fit.
    """
    alone = {model.names[0]: model for model in singles}
    swaps = []
    for member, other in (pair.effects, pair.effects[::-1]):
        if other.name in alone:
            swaps += [
                (other, child, member)
                for child in context.offered(effects)
                if member.name in child.parents
                and child != other
                and not is_among(known, {*alone[other.name].names, child.name})
            ]
    if prepare is not None:
        prepare([context.simplest((other, child)) for other, child, _ in swaps])

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


def _plainer(
    context: FitContext,
    pair: Scored,
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    known: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    """Return the pairs in which a simpler form replaces an effect, fitted beside the other effect.

    Alone, a more general form may compensate for the missing effect; beside that effect the simpler one may suffice.
    """
    found: list[Scored] = []
    for single in singles:
        if single.effects[0] not in pair.effects:
            continue
        (replaced,) = (effect for effect in pair.effects if effect != single.effects[0])
        simpler = [effect for effect in effects if effect.name in replaced.parents]
        if simpler:
            found += with_one_more(context, single, simpler, [*known, *found], singles, prepare)
    return found

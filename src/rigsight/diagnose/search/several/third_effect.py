"""Does a third effect explain the residual of the best two?

Only tried if some candidate explains more than half of it in the screening, and more than another form of one of the two would.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import FirstLook
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.one_law import are_one_law
from rigsight.diagnose.search.several.one_more_effect import with_one_more
from rigsight.diagnose.search.single_effects import finished, followed, refine
from rigsight.effects import Effect
from rigsight.simulate import carried_over


def with_a_third(
    context: FitContext,
    singles: Sequence[FittedModel],
    pairs: Sequence[FittedModel],
    effects: Sequence[Effect],
    forms: OtherForms,
    prepare: Prepare | None = None,
) -> list[FittedModel]:
    """Return models of three effects, grown from the best pair, fitted and scored."""
    best = min(pairs, key=lambda pair: pair.error_over_noise, default=None)
    alone = min((model.error_over_noise for model in singles), default=np.inf)
    if best is None or not best.error_over_noise * VERDICT.worthwhile < alone:
        return []
    least = max(VERDICT.larger_part, forms.share(best))
    return with_one_more(context, best, effects, [], singles, prepare, least_share=least)


def with_relatives(
    context: FitContext,
    triples: Sequence[FittedModel],
    pairs: Sequence[FittedModel],
    singles: Sequence[FittedModel],
    effects: Sequence[Effect],
    prepare: Prepare | None = None,
) -> tuple[list[FittedModel], list[FittedModel]]:
    """Return the triples with those in which a relative stands for an effect of the best one, and the pairs with their parts.

    An effect found with an incomplete model may be only similar to the right one, or more general than needed.
    """
    alone = {model.names[0]: model.error_over_noise for model in singles}

    def as_good(replaced: Effect, other: Effect) -> bool:
        near = alone.get(other.name, np.inf) <= VERDICT.comparable * alone.get(replaced.name, 0.0)
        at_its_place = context.rig.acts_at(other) == context.rig.acts_at(replaced)
        related = at_its_place or are_one_law((replaced, other), context.rig)
        return near and related and other.name not in replaced.parents

    def plainer(replaced: Effect, other: Effect) -> bool:
        return other.name in replaced.parents

    found, known = list(triples), list(pairs)
    compared: FittedModel | None = None
    for is_tried in (as_good, plainer, as_good):
        best = min(found, key=lambda model: model.error_over_noise)
        if is_tried is as_good:
            if best is compared:
                break
            compared = best
        known = _with_refitted_parts(context, best, known)
        new: list[FittedModel] = []
        for replaced in best.effects:
            pair = next(p for p in known if set(p.names) == set(best.names) - {replaced.name})
            instead = [effect for effect in effects if is_tried(replaced, effect)]
            if instead and pair.residuals:
                new += with_one_more(context, pair, instead, [*found, *new], singles, prepare)
        found += finished_best(context, new)
    best = min(found, key=lambda model: model.error_over_noise)
    known = _with_refitted_parts(context, best, known)
    near = [pair for pair in known if pair.error_over_noise <= VERDICT.comparable * best.error_over_noise]
    return found, [*refine(context, near), *(pair for pair in known if pair not in near)]


def finished_best(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models, the best two fitted to convergence and those near them to full precision."""
    ordered = sorted(models, key=lambda model: model.error_over_noise)
    best = [finished(context, model) for model in ordered[: SEARCH.most_finished]]
    return refine(context, [*best, *ordered[SEARCH.most_finished :]])


def _with_refitted_parts(
    context: FitContext, triple: FittedModel, pairs: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the pairs with those of the effects of a triple, fitted from where they stand in it if that is better."""

    def one(effects: tuple[Effect, ...]) -> FittedModel:
        structure = context.simplest(effects, triple.fit.structure)
        values = {**carried_over(triple.fit.values, triple.fit.structure, structure), **dict(structure.fixed)}
        start = replace(triple.fit, values=values)
        look = FirstLook(
            effects, structure, tuple(context.free_parameters(structure)), (start,), float("inf")
        )
        return followed(context, look, promising=True, finish=False)

    found = {frozenset(pair.names): pair for pair in pairs}
    for part in context.threads.side_by_side(one, list(itertools.combinations(triple.effects, 2))):
        names = frozenset(part.names)
        if names not in found or part.error_over_noise < found[names].error_over_noise:
            found[names] = part
    return list(found.values())

"""Do several effects explain the residual of the best one? Those that explain it together first, then greedy forward selection.

Each effect of the best pairs is then also fitted alone from there, so that a pair competes with its own parts in the ranking.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for greedy forward selection of terms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import FirstLook
from rigsight.diagnose.search.same_equation import without_repeated_equations
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.pair_search import PairSearch
from rigsight.diagnose.search.several.similar_pairs import with_other_forms, with_similar
from rigsight.diagnose.search.several.third_effect import finished_best, with_a_third, with_relatives
from rigsight.diagnose.search.several.together import Together
from rigsight.diagnose.search.single_effects import finished, followed, refine
from rigsight.effects import Effect
from rigsight.simulate import carried_over


def grown(
    context: FitContext,
    singles: Sequence[FittedModel],
    effects: Sequence[Effect],
    at_floor: float,
    worthwhile: float,
    forms: OtherForms,
    together: Together,
    is_enough: Callable[[FittedModel], bool],
    prepare: Prepare | None = None,
) -> list[FittedModel]:
    """Return fitted models of two and three effects that close at least half of the error of the best with one less."""
    usable = sorted(
        (m for m in singles if m.residuals and np.isfinite(m.error_over_noise)),
        key=lambda m: m.error_over_noise,
    )
    if not usable or usable[0].error_over_noise <= at_floor:
        return []
    allowed = _half_closed(usable[0].error_over_noise)
    search = PairSearch(context, singles, usable, effects, at_floor, allowed, forms, prepare)
    # What is compared with a limit is fitted to convergence first.
    pairs = _best_converged(context, together.fitted(2))
    triples = _best_converged(context, together.fitted(3)) if _lowest(pairs) > at_floor else []
    if not _lowest(triples) <= VERDICT.exact < _lowest(pairs):
        pairs = _added_one_by_one(search, worthwhile, pairs)
    if _lowest(pairs) <= allowed:
        pairs = with_similar(context, pairs, usable, effects, prepare)
    pairs = _alike_finished(context, each_once(pairs))
    best = min(pairs, key=lambda pair: pair.error_over_noise, default=None)
    if best is not None and VERDICT.exact < best.error_over_noise <= at_floor and not is_enough(best):
        search = replace(search, at_floor=VERDICT.exact)
    triples, pairs = _competing_triples(search, triples, pairs)
    of_triples = [set(triple.names) for triple in triples]
    pairs = [
        pair
        for pair in pairs
        if pair.error_over_noise <= allowed or any(set(pair.names) < own for own in of_triples)
    ]
    models = each_once([*pairs, *triples])
    return larger_first(without_repeated_equations(context, models), singles)


def _added_one_by_one(
    search: PairSearch, worthwhile: float, known: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the known pairs with those that extend a single effect, and with other forms of their effects."""
    explaining = [model for model in search.usable if model.error_over_noise <= worthwhile] or search.usable
    return with_other_forms(search, _beside_singles(search, explaining, known))


def _alike_finished(context: FitContext, pairs: Sequence[FittedModel]) -> list[FittedModel]:
    """Return pairs, best first, with the best two, and those that explain as much, fitted to convergence."""
    # Of two that are one law, such as a late drive and a late sensor, the one that is finished alone would win.
    last = pairs[: SEARCH.most_finished][-1].error_over_noise if pairs else 0.0
    n_finished = sum(pair.error_over_noise <= SEARCH.alike_pairs * last for pair in pairs)
    return refine(context, [*(finished(context, pair) for pair in pairs[:n_finished]), *pairs[n_finished:]])


def _competing_triples(
    search: PairSearch, triples: Sequence[FittedModel], pairs: Sequence[FittedModel]
) -> tuple[list[FittedModel], list[FittedModel]]:
    """Return the triples that close half of what the best pair leaves, and the pairs with the parts of the best triples."""
    context, nearest = search.context, _lowest(pairs)
    if nearest <= search.at_floor:
        return [], list(pairs)
    if _lowest(triples) > search.at_floor:
        third = with_a_third(context, search.usable, pairs, search.effects, search.forms, search.prepare)
        triples = [*triples, *third]
    if triples:
        triples = finished_best(context, each_once(triples))
    triples = [triple for triple in triples if triple.error_over_noise <= _half_closed(nearest)]
    if not triples:
        return [], list(pairs)
    return with_relatives(context, triples, pairs, search.usable, search.effects, search.prepare)


def _beside_singles(
    search: PairSearch, explaining: Sequence[FittedModel], known: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the known pairs with those that extend single effects: until one explains all.

    Beside an effect that explains nothing a second one does what it does alone, so those that explain something are extended.
    """
    close = [
        model
        for model in explaining
        if model.error_over_noise <= SEARCH.beam * search.usable[0].error_over_noise
    ]
    # Of those that explain as much, the one with the fewest numbers leaves most for a second to explain; of those with as
    # many, the one that the catalogue has first is the plainer.
    best = min(close, key=lambda model: (model.n_free, model.error_over_noise))
    first = _plainest([model for model in close if model.n_free == best.n_free], best, search.effects)
    others = [model for model in close if model is not first and not _alike(first, model)]
    others = [model for model in others if max(model.fit.substeps) <= SEARCH.finest_steps]
    parents = [(first, VERDICT.exact)]
    if others:
        parents.append((_plainest(others, others[0], search.effects), VERDICT.exact))
        # Fitted by itself, an effect may stand far off for what a second one does to it: one more where no pair competes.
        parents.append(
            (min(others, key=lambda model: (model.n_free, model.error_over_noise)), search.allowed)
        )
    tried: list[FittedModel] = []
    # Pairs fitted from where the screening puts them may have ended in another minimum: others start from a single effect.
    settled = [pair for pair in known if pair.error_over_noise <= VERDICT.exact]
    found: list[FittedModel] = []
    for parent, enough in parents:
        if parent not in tried and _lowest([*known, *found]) > enough:
            partners = search.forms.partners(parent, search.effects)
            widely = np.inf if tried else search.at_floor
            tried.append(parent)
            found += search.beside(parent, partners, [*settled, *found], widely)
    return each_once([*known, *found])


def _best_converged(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models, best first, that one fitted to convergence."""
    ordered = sorted(models, key=lambda model: model.error_over_noise)
    return [*refine(context, [finished(context, model) for model in ordered[:1]]), *ordered[1:]]


def _lowest(models: Sequence[FittedModel]) -> float:
    return min((model.error_over_noise for model in models), default=np.inf)


def each_once(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return of the models with the same effects the best, best first."""
    found: dict[frozenset[str], FittedModel] = {}
    for model in sorted(models, key=lambda model: model.error_over_noise):
        found.setdefault(frozenset(model.names), model)
    return list(found.values())


def larger_first(models: Sequence[FittedModel], singles: Sequence[FittedModel]) -> list[FittedModel]:
    """Return models with the effect that explains more alone in first place."""
    alone = {model.names[0]: model.error_over_noise for model in singles}

    def remainder(effect: Effect) -> float:
        return alone.get(effect.name, np.inf)

    return [replace(model, effects=tuple(sorted(model.effects, key=remainder))) for model in models]


def _half_closed(remainder: float) -> float:
    """Return the error that one more effect may leave, in units of the noise floor."""
    return remainder - VERDICT.larger_part * (remainder - 1.0)


def _plainest(models: Sequence[FittedModel], like: FittedModel, effects: Sequence[Effect]) -> FittedModel:
    """Return of the models that explain as much as one of them that with the fewest numbers, the first among the candidates."""
    order = {effect.name: place for place, effect in enumerate(effects)}
    tied = [model for model in models if model.error_over_noise <= SEARCH.alike_pairs * like.error_over_noise]
    return min(tied, key=lambda model: (model.n_free, order.get(model.names[0], len(order))))


def refit_singles(
    context: FitContext, singles: Sequence[FittedModel], pairs: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the singles, refitted where they are better from their values in a pair than from their own starts.

    A second effect may only help the fit of the first out of a local minimum; the first alone then explains as much.
    """
    better = {model.names: model for model in singles}
    for pair in sorted(pairs, key=lambda pair: pair.error_over_noise)[: SEARCH.most_refitted]:
        for effect in pair.effects:
            known = better.get((effect.name,))
            if known is not None and known.error_over_noise <= SEARCH.alike_pairs * pair.error_over_noise:
                continue
            structure = context.simplest((effect,)) if known is None else known.fit.structure
            free = tuple(context.free_parameters(structure)) if known is None else known.fit.free
            values = {
                **(known or pair).fit.values,
                **dict(structure.fixed),
                **carried_over(pair.fit.values, pair.fit.structure, structure),
            }
            start = replace((known or pair).fit, values={name: values[name] for name in structure.names})
            alone = followed(
                context, FirstLook((effect,), structure, free, (start,), float("inf")), promising=True
            )
            # One that was left out of the singles, as another said the same, comes back only where it is all that is needed.
            if alone.error_over_noise <= (
                SEARCH.alike_pairs * pair.error_over_noise
                if known is None
                else known.error_over_noise / SEARCH.alike_pairs
            ):
                better[alone.names] = alone
    return list(better.values())


def _alike(one: FittedModel, other: FittedModel) -> bool:
    """Return True if one is a special or limiting case of the other: the effect missing in addition is the same."""
    parents = {name for model in (one, other) for effect in model.effects for name in effect.parents}
    return bool(parents & {*one.names, *other.names})

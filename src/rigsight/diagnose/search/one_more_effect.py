"""Models beside a model: with one effect more, with causes that the motion names, or with a part of its effects alone.

Every further effect gets a first fit; the promising ones are fitted carefully. The first fit is tried in both orders: from the
model with the new effect added, and from the new effect alone with those of the model added. Otherwise the effect found first
could hide a strong effect with memory.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.first_look import FirstLook, look_at, widened
from rigsight.diagnose.search.screening import structures_of_shortlist
from rigsight.diagnose.search.single_effects import followed
from rigsight.diagnose.search.starts import start_values
from rigsight.diagnose.search.worth_fitting import search_places
from rigsight.effects import Effect
from rigsight.identify import FitResult
from rigsight.identify.start.declared_starts import with_own_values
from rigsight.inverse import Proposal, ProposedCause, ProposedStart
from rigsight.simulate import Structure, carried_over


def reduced(
    context: FitContext, model: FittedModel, kept: tuple[Effect, ...]
) -> tuple[Structure, dict[str, float]]:
    """Return the equations with the effects that are kept, and the values that a model gives them."""
    structure = context.simplest(kept, model.fit.structure)
    return structure, {
        **carried_over(model.fit.values, model.fit.structure, structure),
        **dict(structure.fixed),
    }


def part_of(context: FitContext, model: FittedModel, kept: tuple[Effect, ...]) -> FittedModel:
    """Return a model with only the effects that are kept, fitted from the values that it gives them."""
    structure, values = reduced(context, model, kept)
    return fitted_from(context, model, kept, structure, values)


def fitted_from(
    context: FitContext,
    model: FittedModel,
    effects: tuple[Effect, ...],
    structure: Structure,
    values: dict[str, float],
) -> FittedModel:
    """Return equations with effects, fitted from given values and from the initial states of a model."""
    start, free = replace(model.fit, values=values), tuple(context.free_parameters(structure))
    look = FirstLook(effects, structure, free, (start,), float("inf"))
    return followed(context, look, promising=True, finish=False)


def with_causes(
    context: FitContext, model: FittedModel, causes: Sequence[ProposedCause], found: Proposal
) -> FittedModel:
    """Return a model with further causes, fitted from the values that the motion gives them and the equations."""
    numbers = {name: value for name, value in found.numbers.items() if name in model.fit.free}
    effects, fit = model.effects, replace(model.fit, values={**model.fit.values, **numbers})
    for cause in causes:
        effects = (*effects, cause.effect)
        structure = context.simplest(effects, fit.structure)
        declared = next(start_values(context, structure, cause.effect, fit, {}))
        values = {**declared, **with_own_values(structure, cause.effect, fit, cause.values)}
        fit = replace(fit, values=values, structure=structure)
    structure, start = fit.structure, replace(model.fit, values=fit.values)
    look = FirstLook(effects, structure, tuple(context.free_parameters(structure)), (start,), float("inf"))
    # More effects must leave less: a set that a short fit leaves far above the model is not followed.
    short = followed(context, look, promising=False)
    if short.fit.cost > SEARCH.near_the_best * model.fit.cost:
        return short
    return followed(context, replace(look, fits=(short.fit,)), promising=True, finish=False)


def as_along_motion(
    context: FitContext, reidentified: FittedModel, model: FittedModel, start: ProposedStart
) -> FittedModel:
    """Return the equations with an effect at the numbers that the motion gives it; a fit moves those of the rig alone."""
    (effect,), base = model.effects, reidentified.fit
    structure = context.simplest((effect,), base.structure)
    declared = next(start_values(context, structure, effect, base, {}))
    values = {**declared, **with_own_values(structure, effect, base, start.own)}
    free = context.free_parameters(structure)
    own = {structure.parameter_name(effect, parameter.name) for parameter in effect.parameters}
    problem = context.problem(structure, context.estimation)
    settled = problem.fit(values, [name for name in free if name not in own])
    # Standard errors of all numbers, where they are.
    there = problem.fit(settled.values, free, settled.initial_states, max_evaluations=1)
    message = "the numbers of the effect are those along the measured motion"
    scored = context.score((effect,), replace(there, success=settled.success, message=message))
    return replace(scored, along_motion=True)


def each_once(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return of the models with the same effects the best, best first."""
    found: dict[frozenset[str], FittedModel] = {}
    for model in sorted(models, key=lambda model: model.error_over_noise):
        found.setdefault(frozenset(model.names), model)
    return list(found.values())


def with_one_more(
    context: FitContext,
    parent: FittedModel,
    effects: Sequence[Effect],
    singles: Sequence[FittedModel],
    least_share: float = 0.0,
    enough: float = float("inf"),
    replaced: tuple[Effect, FitResult] | None = None,
) -> list[FittedModel]:
    """Return a model with each effect added that lowers its cost clearly, fitted and scored."""
    # `replaced` is an effect that was left out of the model, with the fit in which it was: its simpler and more general forms are
    # fitted whatever the screening says, the general ones from there.
    context = context.looking_at_residual(parent.fit)
    open_ones = [effect for effect in context.offered(effects) if effect not in parent.effects]
    context.prepare(structures_of_shortlist(context.rig, open_ones, (*context.modelled, *parent.effects)))
    search = search_places(context, parent, open_ones)
    if search.most < least_share * _above_noise(parent.fit) / parent.fit.cost:
        # The screening says nothing about effects that no push represents, such as periodic ones.
        unscreened = [effect for effect in search.effects if effect.name not in search.shares]
        return _fitted_beside(context, parent, unscreened, search.starts, singles)
    forms, parents = list[Effect](), dict[str, FitResult]()
    if replaced is not None:
        other, fit = replaced
        forms = [e for e in search.others if other.name in e.parents or e.name in other.parents]
        parents = {other.name: fit}
    chosen = [*search.effects, *forms]
    found = _fitted_beside(context, parent, chosen, search.starts, singles, parents)
    movable = [effect for effect in search.others if _has_a_shape(effect)]
    if movable and min((model.error_over_noise for model in found), default=float("inf")) > enough:
        # A push cannot move from its start: a resonance far from it explains little until it is fitted.
        found += _fitted_beside(context, parent, movable, search.starts, singles)
    return found


def _fitted_beside(
    context: FitContext,
    parent: FittedModel,
    effects: Sequence[Effect],
    starts: Mapping[str, Mapping[str, float]],
    singles: Sequence[FittedModel],
    parents: Mapping[str, FitResult] = MappingProxyType({}),
) -> list[FittedModel]:
    base = parent.fit
    context.prepare(context.simplest((*parent.effects, effect), base.structure) for effect in effects)
    alone = {model.names[0]: model.fit for model in singles}

    def steps(effect: Effect) -> tuple[int, ...]:
        """Return substeps that serve both: a lag needs finer ones than its parent."""
        own = alone.get(effect.name)
        if own is None:
            return base.substeps
        return tuple(
            max(n, min(m, SEARCH.most_added_steps)) for n, m in zip(base.substeps, own.substeps, strict=True)
        )

    def one(effect: Effect) -> FirstLook:
        pushed = [starts[effect.name]] if effect.name in starts else []
        return look_at(context, (*parent.effects, effect), base, parents, pushed, substeps=steps(effect))

    looks = list(context.threads.side_by_side(one, effects))
    near = min((look.nearest for look in looks), default=float("inf"))

    def wide(look: FirstLook) -> list[FirstLook]:
        return widened(context, [look], substeps=steps(look.effects[-1]), lowest=near)

    found = list(context.threads.side_by_side(wide, looks))
    looks = sorted(itertools.chain.from_iterable(found), key=_cost)[: SEARCH.both_ways]

    def other_way(found: FirstLook) -> FirstLook:
        second = found.effects[-1]
        if second.name not in alone or len(parent.effects) > 1:
            return found
        substeps = steps(second)
        turned = look_at(context, (second, *parent.effects), alone[second.name], {}, substeps=substeps)
        (wider,) = widened(context, [turned], substeps=substeps)
        return min(found, replace(wider, effects=found.effects), key=_cost)

    looks = list(context.threads.side_by_side(other_way, looks))
    lowest = min((found.cost for found in looks), default=float("inf"))
    unexplained = (1.0 - SEARCH.worth_following) * _above_noise(base)
    worth = min(base.cost - unexplained, SEARCH.near_the_best * lowest)
    promising = sorted((found for found in looks if found.cost <= worth), key=_cost)

    def follow(found: FirstLook) -> FittedModel:
        return followed(context, found, promising=True, finish=False)

    return list(context.threads.side_by_side(follow, promising[: SEARCH.most_followed]))


def _above_noise(fit: FitResult) -> float:
    """Return the part of a cost above that of noise alone; all of it if the noise floor is above the residual."""
    return fit.cost - fit.n_samples if fit.cost > fit.n_samples else fit.cost


def _has_a_shape(effect: Effect) -> bool:
    """Return True if a fit changes the shape of the force, and not only its size as a fit of a push does."""
    return any(p.fitted and p.null is None for p in effect.parameters)


def _cost(found: FirstLook) -> float:
    return found.cost

"""Sets of effects beside each other: a part of a model, or one with causes that the motion names, fitted from where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.first_look import FirstLook
from rigsight.diagnose.search.single_effects import followed
from rigsight.diagnose.search.starts import start_values, with_own_values
from rigsight.effects import Effect
from rigsight.inverse import Proposal, ProposedCause
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
    return fitted_from(context, model, effects, fit.structure, dict(fit.values))


def each_once(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return of the models with the same effects the best, best first."""
    found: dict[frozenset[str], FittedModel] = {}
    for model in sorted(models, key=lambda model: model.error_over_noise):
        found.setdefault(frozenset(model.names), model)
    return list(found.values())

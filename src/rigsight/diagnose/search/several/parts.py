"""A model of several effects without some of them, from where the others are in it."""

from __future__ import annotations

from dataclasses import replace

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.first_look import FirstLook
from rigsight.diagnose.search.single_effects import followed
from rigsight.effects import Effect
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

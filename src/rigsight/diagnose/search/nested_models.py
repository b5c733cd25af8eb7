"""Is each model at least as good as its special cases, and has each special case profited from the fits that contain it?

At the global minima chi square never rises with a parameter that is added. Fits that violate this order have stopped in a local
minimum: the larger model is fitted again from the smaller one, and the smaller one from the larger one with the addition removed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from graphlib import TopologicalSorter

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.basins import in_lowest_basin, is_lower, values_in
from rigsight.diagnose.search.starts import sized, start_values
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.simulate import Structure

_EQUAL = 1e-6
"""Relative difference of chi square that counts as none: that of the same motion simulated by different equations."""
_FAINT = 1e-3
"""Size of an effect that hardly acts, relative to its declared start: at zero itself other parameters have no influence."""
_TOLERANCE = 1e-4


def ordered_by_inclusion(
    context: FitContext, without: FittedModel, singles: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return models of one effect with a chi square that does not rise with generality."""
    found = {model.names[0]: model for model in singles}
    parents = {
        name: [parent for parent in model.effects[0].parents if parent in found]
        for name, model in found.items()
    }
    for name, model in found.items():
        children = [found[child] for child, own in parents.items() if name in own]
        found[name] = lowered_by_extensions(context, model, children)
    for name in TopologicalSorter(parents).static_order():
        found[name] = at_least_as_good(context, found[name], without)
        for parent in parents[name]:
            found[name] = _from_simpler_effect(context, found[name], found[parent])
    return list(found.values())


def lowered_by_extensions(
    context: FitContext, model: FittedModel, extensions: Sequence[FittedModel]
) -> FittedModel:
    """Return a model in the lowest minimum that is reached from better models which contain it."""
    better = [larger for larger in extensions if is_lower(larger.fit, model.fit)]
    if not better:
        return model
    return in_lowest_basin(context, model, [values_in(larger, model) for larger in better])


def at_least_as_good(context: FitContext, model: FittedModel, without: FittedModel) -> FittedModel:
    """Return a model of one effect with a chi square that is not above that of the equations without it.

    If no fit from the equations without the effect is better, the result equals them: the effect has its null value.
    """
    kept = set(without.fit.free) & set(model.fit.structure.names)
    if not _is_worse(model.fit, without.fit) or not kept <= set(model.fit.free):
        return model
    structure, (effect,) = model.fit.structure, model.effects
    sizes = {
        structure.parameter_name(effect, p.name): p.null
        for p in effect.parameters
        if p.null is not None and structure.parameter_name(effect, p.name) in model.fit.free
    }
    own = next(start_values(context, structure, effect, without.fit, {}), {})
    start = {
        **model.fit.values,
        **own,
        **without.fit.values,
        **context.constant_forces_beside(structure.effects),
    }
    faint = {name: sized(start[name], null, _FAINT) for name, null in sizes.items()}
    problem = context.problem(structure, context.estimation)
    found = _lowest_from(problem, [{**start, **faint}], model.fit.free, _states(structure, without.fit))
    if found.residuals and not _is_worse(found, without.fit):
        return context.score(model.effects, found, tolerance=_TOLERANCE)
    return _at_null(model, without, {**start, **sizes})


def _from_simpler_effect(context: FitContext, model: FittedModel, simpler: FittedModel) -> FittedModel:
    """Return a model in the lowest minimum that is reached from a simpler effect that is better."""
    if not _is_worse(model.fit, simpler.fit):
        return model
    structure, (effect,), (special,) = model.fit.structure, model.effects, simpler.effects
    starts = list(start_values(context, structure, effect, simpler.fit, {special.name: simpler.fit}))
    held = context.constant_forces_beside(structure.effects)
    known = simpler.fit.structure.values_of(special, simpler.fit.values)
    nulls = effect.null_values()
    if known.keys() & {p.name for p in effect.parameters}:
        equal = {
            p.name: known.get(p.name, nulls.get(p.name, 0.0))
            for p in effect.parameters
            if p.name in {**known, **nulls}
        }
        equal |= {larger: max(equal[larger], equal[smaller]) for larger, smaller in effect.ordered}
        named = {structure.parameter_name(effect, name): value for name, value in equal.items()}
        starts = [{**start, **named} for start in starts[:1]]
    problem, states = context.problem(structure, context.estimation), _states(structure, simpler.fit)
    best = _lowest_from(problem, [{**start, **held} for start in starts], model.fit.free, states)
    return context.score(model.effects, best, tolerance=_TOLERANCE) if best.cost < model.fit.cost else model


def _lowest_from(
    problem: GreyBoxFit,
    starts: Iterable[Mapping[str, float]],
    free: Sequence[str],
    states: Sequence[NDArray[np.float64]],
) -> FitResult:
    """Return the best fit from given and from guessed initial states: the first begin in the minimum of the simpler model."""
    return min(
        (
            problem.fit(start, free, initial, SEARCH.hopeless_evaluations, _TOLERANCE)
            for start in starts
            for initial in (states, None)
        ),
        key=lambda fit: fit.cost,
    )


def _is_worse(larger: FitResult, smaller: FitResult) -> bool:
    return larger.cost > (1.0 + _EQUAL) * smaller.cost


def _at_null(model: FittedModel, without: FittedModel, values: Mapping[str, float]) -> FittedModel:
    """Return a model at the null value of its effect: it moves as the equations without it, its parameters are not determined."""
    structure, free = model.fit.structure, model.fit.free
    unknown = np.full((len(free), len(free)), np.inf)
    at_null = replace(
        without.fit,
        structure=structure,
        values={name: values[name] for name in structure.names},
        free=free,
        standard_errors=dict.fromkeys(free, np.inf),
        covariance=unknown,
        initial_states=_states(structure, without.fit),
    )
    held_out = replace(
        without.held_out,
        structure=structure,
        values=at_null.values,
        initial_states=_states(structure, without.held_out),
    )
    return replace(without, effects=model.effects, fit=at_null, held_out=held_out)


def _states(structure: Structure, simpler: FitResult) -> tuple[NDArray[np.float64], ...]:
    """Return initial states and offsets of a simpler model for a structure that may have more states; those are zero."""
    names = [str(equation.symbol) for equation in simpler.structure.equations]

    def of_record(own: NDArray[np.float64]) -> NDArray[np.float64]:
        known = dict(zip(names, own[: len(names)].tolist(), strict=True))
        states = [known.get(str(equation.symbol), 0.0) for equation in structure.equations]
        return np.concatenate([states, own[len(names) :]])

    return tuple(map(of_record, simpler.initial_states))

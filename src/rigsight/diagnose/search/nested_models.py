"""Is each model in its lowest minimum, at least as good as its special cases, and none of them under another name?

If a mass sticks or play is crossed, one set of parameters may fit one part of the records and another set another part: the cost
has several minima, and the one nearest to the declared starts need not be the lowest. Two minima are compared by chi square. At
the global minima it never rises with a parameter that is added. Fits that violate this order have stopped in a local minimum: the
larger model is fitted again from the smaller one, and the smaller one from the larger one with the addition removed.

References
----------
W. H. Press et al., *Numerical Recipes* (Cambridge 2007), section 15.6, for differences of chi square.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from graphlib import TopologicalSorter

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import LOOK_ACCURACY
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import Effect
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.records.record import Floats
from rigsight.simulate import Structure, carried_over

_TOLERANCE = 1e-4
_SEED = 0
"""Starts are the same for equal models: a diagnosis depends on its records alone."""


def in_lowest_basins(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models, the best of them in the lowest minimum that was found."""
    # Each also starts from the parameters that it has in common with the best one, and the best one from those of the next,
    # because neither the mass of the rig nor an effect that both have depends on the others. If a model explains the records,
    # nothing else is tried.
    usable = [m for m in models if m.residuals and np.isfinite(m.error_over_noise)]
    ranked = sorted(usable, key=lambda model: model.error_over_noise)
    if not ranked:
        return list(models)
    leader = ranked[0]
    is_explained = leader.error_over_noise <= VERDICT.exact
    nearest = ranked[: SEARCH.basin_models]

    def lowest(own: FittedModel) -> FittedModel:
        starts = [] if is_explained else _starts(own)
        others = nearest[1:2] if own is leader else [leader]
        starts += [values_in(other, own) for other in others]
        return in_lowest_basin(context, own, [(start, None) for start in starts])

    found = dict(zip(map(id, nearest), context.threads.side_by_side(lowest, nearest), strict=True))
    return [found.get(id(model), model) for model in models]


def values_in(leader: FittedModel, model: FittedModel) -> dict[str, float]:
    """Return the parameters of a model with the values that another one has for those of both."""
    # An effect that is a special case of one of the other's has its parameters, too: a friction those of a friction that also
    # depends on the load.
    fit = model.fit
    common = carried_over(leader.fit.values, leader.fit.structure, fit.structure)
    for simple, general in itertools.product(model.effects, leader.effects):
        if simple.name in general.parents:
            own = leader.fit.structure.values_of(general, leader.fit.values)
            of_both = [p.name for p in simple.parameters if p.name in own]
            common |= {fit.structure.parameter_name(simple, name): own[name] for name in of_both}
    # Held parameters keep their value, such as a known constant force beside an effect that would absorb it.
    return {**fit.values, **{name: value for name, value in common.items() if name in fit.free}}


def in_lowest_basin(
    context: FitContext,
    model: FittedModel,
    starts: Iterable[tuple[Mapping[str, float], Sequence[Floats] | None]],
) -> FittedModel:
    """Return a model in the lowest minimum that is reached from where it is and from other values and initial states."""
    fit = model.fit
    rough = context.problem(fit.structure, context.estimation, LOOK_ACCURACY)

    def roughly(values: Mapping[str, float], states: Sequence[Floats] | None) -> FitResult:
        return rough.fit(values, fit.free, states, SEARCH.basin_evaluations, _TOLERANCE, finish=False)

    here, *elsewhere = itertools.starmap(roughly, [(fit.values, None), *starts])
    lowest = min([here, *elsewhere], key=lambda found: found.cost)
    # Roughly simulated, so that what looks lower may not be, and conversely: the finished fit decides.
    if not (is_lower(lowest, fit) or is_lower(lowest, here)):
        return model
    finished = context.problem(fit.structure, context.estimation).fit(
        lowest.values, fit.free, lowest.initial_states, SEARCH.basin_finish_evaluations, _TOLERANCE
    )
    if not (finished.residuals and is_lower(finished, fit)):
        return model
    return context.score(model.effects, finished)


def _starts(model: FittedModel) -> list[dict[str, float]]:
    fit, rng = model.fit, np.random.default_rng(_SEED)
    own = {fit.structure.parameter_name(e, p.name) for e in model.effects for p in e.parameters}
    names = [name for name in fit.free if name in own]
    factors = np.exp(
        SEARCH.basin_spread * rng.standard_normal((SEARCH.basin_starts if names else 0, len(names)))
    )
    return [
        {**fit.values, **{name: fit.values[name] * factor for name, factor in zip(names, row, strict=True)}}
        for row in factors.tolist()
    ]


def is_lower(one: FitResult, other: FitResult) -> bool:
    """Return True if one cost is significantly lower, in units of its own residual variance."""
    return one.cost + VERDICT.standard_errors**2 * one.cost / max(one.n_samples, 1) < other.cost


_EQUAL = 1e-6
"""Relative difference of chi square that counts as none: that of the same motion simulated by different equations."""
_FAINT = 1e-3
"""Size of an effect that hardly acts, relative to its declared start: at zero itself other parameters have no influence."""


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
    # States that no sensor shows are those of the better model, too: from others its numbers may lead elsewhere.
    structure = model.fit.structure
    return in_lowest_basin(
        context, model, [(values_in(larger, model), _states(structure, larger.fit)) for larger in better]
    )


def at_least_as_good(context: FitContext, model: FittedModel, without: FittedModel) -> FittedModel:
    """Return a model of one effect with a chi square that is not above that of the equations without it."""
    # If no fit from the equations without the effect is better, the result equals them: the effect has its null value.
    kept = set(without.fit.free) & set(model.fit.structure.names)
    if not _is_worse(model.fit, without.fit) or not kept <= set(model.fit.free):
        return model
    structure, (effect,) = model.fit.structure, model.effects
    sizes = {
        name: p
        for p in effect.parameters
        if p.null is not None and (name := structure.parameter_name(effect, p.name)) in model.fit.free
    }
    own = next(start_values(context, structure, effect, without.fit, {}), {})
    start = {
        **model.fit.values,
        **own,
        **without.fit.values,
        **context.constant_forces_beside(structure.effects),
    }
    faint = {name: p.grown(start[name], _FAINT) for name, p in sizes.items()}
    problem = context.problem(structure, context.estimation)
    found = _lowest_from(problem, [{**start, **faint}], model.fit.free, _states(structure, without.fit))
    if found.residuals and not _is_worse(found, without.fit):
        return context.score(model.effects, found, tolerance=_TOLERANCE)
    nulls = {name: p.null for name, p in sizes.items() if p.null is not None}
    return _at_null(model, without, {**start, **nulls})


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
    states: Sequence[Floats],
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


def _states(structure: Structure, fit: FitResult) -> tuple[Floats, ...]:
    """Return initial states and offsets of a fit for a structure that may have other states; those are zero."""
    names = [str(equation.symbol) for equation in fit.structure.equations]

    def of_record(own: Floats) -> Floats:
        known = dict(zip(names, own[: len(names)].tolist(), strict=True))
        states = [known.get(str(equation.symbol), 0.0) for equation in structure.equations]
        return np.concatenate([states, own[len(names) :]])

    return tuple(map(of_record, fit.initial_states))


def without_repeated_equations(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without those that are equivalent to a simpler one among them."""
    return _without_late_shifts(_without_needless_means(context, models))


def _without_needless_means(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without those whose mean force is not needed."""
    # An effect with a mean force and a simpler one with a constant force obey the same equation. If the simpler one, with the
    # same other effects, leaves the constant forces at their known values, the mean force is not needed.
    fits = {frozenset(model.names): model.fit for model in models}

    def is_needed(model: FittedModel) -> bool:
        held = context.constant_forces_beside(model.effects)
        plainer = [
            fit
            for effect in model.effects
            if effect.holds_constant_force
            for parent in effect.parents
            if (fit := fits.get(frozenset(model.names) - {effect.name} | {parent})) is not None
        ]
        return not held or not plainer or any(_moves(context, fit, held) for fit in plainer)

    return [model for model in models if is_needed(model)]


def _moves(context: FitContext, fit: FitResult, known: Mapping[str, float]) -> bool:
    """Return True if a fit changes a known constant force by more than the errors of other given values."""
    defaults = {p.name: p.default for p in context.rig.parameters}
    estimated = {name: value for name, value in context.given.items() if value != defaults.get(name)}
    others = _moves_of(fit, {name: value for name, value in estimated.items() if name not in known})
    usual = max(1.0, float(np.sqrt(np.mean(np.square(list(others.values())))))) if others else 1.0
    return any(
        move > VERDICT.standard_errors * (usual if name in estimated else 1.0)
        for name, move in _moves_of(fit, known).items()
    )


def _moves_of(fit: FitResult, known: Mapping[str, float]) -> dict[str, float]:
    """Return the deviation of a fit from known values, in standard errors."""
    return {
        name: abs(fit.values[name] - value) / fit.standard_errors[name]
        for name, value in known.items()
        if name in fit.free and fit.standard_errors[name] > 0.0
    }


def _without_late_shifts(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models without late time shifts if the same model with a sensor delay instead is among them."""
    # A late time base and a sensor delay obey the same equation; only an early reading is certainly a time shift.
    with_late_sensor = {
        _but(model, effect) for model in models for effect in model.effects if _is_late(effect)
    }

    def says_the_same(model: FittedModel) -> bool:
        return any(
            _shift(model, effect) > 0.0 and _but(model, effect) in with_late_sensor
            for effect in model.effects
            if effect.shifts_the_record
        )

    return [model for model in models if not says_the_same(model)]


def _is_late(effect: Effect) -> bool:
    return effect.reading_delay is not None and not effect.shifts_the_record


def _but(model: FittedModel, effect: Effect) -> tuple[frozenset[str], str | None]:
    """Return the names of the other effects, and where this one acts."""
    return frozenset(model.names) - {effect.name}, effect.at


def _shift(model: FittedModel, effect: Effect) -> float:
    """Return the time by which an effect shifts the record [s]."""
    return sum(model.fit.structure.values_of(effect, model.fit.values).values())

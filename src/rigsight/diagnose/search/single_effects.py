"""Which effect causes the gap: every candidate fitted to the estimation records and scored on the validation records.

Each candidate gets a first fit. Those near the best are fitted carefully, the best of them to full precision.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import (
    LOOK_ACCURACY,
    FirstLook,
    examined_again,
    look_at,
    mean_square,
    widened,
)
from rigsight.diagnose.search.nested_models import (
    at_least_as_good,
    in_lowest_basins,
    is_lower,
    ordered_by_inclusion,
    without_repeated_equations,
)
from rigsight.diagnose.search.starts import restart_values
from rigsight.effects import Effect
from rigsight.identify import DEFAULT_ACCURACY, FitResult, off_bounds
from rigsight.inverse import ProposedStart
from rigsight.simulate import Structure

_ROUGH_TOLERANCE = 1e-4
_HOPELESS_TOLERANCE = 1e-2


def reidentify(context: FitContext, start: Mapping[str, float]) -> FittedModel:
    """Re-identify the equations without an effect."""
    # Starts from the parameters of a regression, and from those of the given simulation: the regression does not determine all
    # parameters if no sensor reads a coordinate. Where parameters start at a bound, such as a friction given as zero, also from
    # inside of it.
    structure = context.composed()
    problem, free = context.problem(structure, context.estimation), context.free_parameters(structure)
    fit = problem.fit(start, free)
    if context.given:
        from_given = problem.fit({**start, **context.given}, free)
        if not fit.residuals or is_lower(from_given, fit):
            fit = from_given
    inside = off_bounds(structure, start, free, context.scales)
    if inside is not None:
        fit = min(fit, problem.fit(inside, free), key=lambda found: found.cost)
    return context.score((), fit)


def fit_candidates(
    context: FitContext,
    reidentified: FittedModel,
    effects: Iterable[Effect],
    progress: Callable[[str], None] | None = None,
    known: Sequence[FittedModel] = (),
    along_motion: Mapping[str, ProposedStart] = MappingProxyType({}),
    is_shown: bool = False,
    reached: FittedModel | None = None,
) -> list[FittedModel]:
    """Return every effect alone, fitted and scored, with those that were before."""
    # `along_motion` are values at which effects explain the missing force along the motion: one more start, or the only one where
    # the motion `is_shown`; then the equations start from their numbers there, too. `reached` is a model of several effects that
    # leaves nothing: beside it one effect alone only tells its share, so that rough fits are enough.
    before = {model.effects[0].name: model.fit for model in known if np.isfinite(model.fit.cost)}
    looks = _looks(context, reidentified, context.offered(effects), along_motion, is_shown, before)
    wide = {look.newest: look for look in widened(context, looks)}
    costs = [*(look.cost for look in wide.values()), *(fit.cost for fit in before.values())]
    lowest = min(costs, default=float("inf")) if reached is None else reached.fit.cost

    def one(found: FirstLook) -> FittedModel:
        found = wide.get(found.newest, found)
        promising = found.newest in wide and found.cost <= SEARCH.promising * lowest
        scored = followed(context, found, promising)
        scored = at_least_as_good(context, scored, reidentified)
        if progress is not None:
            progress(found.newest)
        return scored

    models = list(context.threads.side_by_side(one, looks))
    fitted = [*known, *models]
    refined = in_lowest_basins(context, refine(context, fitted)) if reached is None else fitted
    return without_repeated_equations(context, ordered_by_inclusion(context, reidentified, refined))


def _looks(
    context: FitContext,
    reidentified: FittedModel,
    effects: Sequence[Effect],
    along_motion: Mapping[str, ProposedStart],
    is_shown: bool,
    known: Mapping[str, FitResult],
) -> list[FirstLook]:
    """Look at every effect; those that start from a simpler one, if it is not known, come after it."""
    names = {effect.name for effect in effects}
    done: dict[str, FirstLook] = {}
    waiting = list(effects)

    def one(parents: Mapping[str, FitResult], effect: Effect) -> FirstLook:
        start = along_motion.get(effect.name)
        if start is None:
            return look_at(context, (effect,), reidentified.fit, parents)
        numbers = start.numbers if is_shown else {}
        return look_at(
            context, (effect,), reidentified.fit, parents, [start.own], are_enough=is_shown, numbers=numbers
        )

    while waiting:
        ready = [e for e in waiting if all(p in done or p not in names for p in e.parents)]
        ready = ready or waiting
        waiting = [effect for effect in waiting if effect not in ready]
        looked = {name: look.fits[0] for name, look in done.items() if np.isfinite(look.cost)}
        parents = {**known, **looked}
        looks = list(context.threads.side_by_side(partial(one, parents), ready))
        done.update({effect.name: look for effect, look in zip(ready, looks, strict=True)})
    return [done[effect.name] for effect in effects]


def fit_candidate(
    context: FitContext,
    effects: tuple[Effect, ...],
    base: FitResult,
    hold: frozenset[str] = frozenset(),
) -> FittedModel:
    """Fit and score one set of effects to full precision."""
    (found,) = widened(context, [look_at(context, effects, base, {}, hold=hold)])
    return refine(context, [followed(context, found, promising=True)])[0]


def refine(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Fit models with a held-out error close to the best to full precision, the best of them to convergence."""
    best = min((m.error_over_noise for m in models), default=float("inf"))

    def one(model: FittedModel) -> FittedModel:
        if not (np.isfinite(model.error_over_noise) and model.error_over_noise <= VERDICT.comparable * best):
            return model
        steps = max(substeps.mean for substeps in model.fit.substeps)
        return _refined(
            context, model, max(SEARCH.fewest_refine_evaluations, round(SEARCH.refine_evaluations / steps))
        )

    refined = list(context.threads.side_by_side(one, models))
    leading = min(range(len(refined)), key=lambda i: refined[i].error_over_noise, default=None)
    if (
        leading is not None
        and np.isfinite(refined[leading].error_over_noise)
        and not refined[leading].fit.success
    ):
        refined[leading] = _refined(context, refined[leading], SEARCH.refine_evaluations)
    return refined


def contenders(models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models that are close enough to the best one to have been fitted to full precision."""
    usable = [model for model in models if model.residuals and np.isfinite(model.error_over_noise)]
    best = min((model.error_over_noise for model in usable), default=float("inf"))
    return [model for model in usable if model.error_over_noise <= VERDICT.comparable * best]


def _refined(context: FitContext, model: FittedModel, max_evaluations: int) -> FittedModel:
    fit = context.problem(model.fit.structure, context.estimation)
    result = fit.fit(
        model.fit.values,
        model.fit.free,
        initial_states=model.fit.initial_states,
        max_evaluations=max_evaluations,
    )
    if not result.residuals or result.cost > model.fit.cost * (1.0 + 1e-3):
        return model
    return context.score(model.effects, result)


def followed(context: FitContext, look: FirstLook, promising: bool, finish: bool = True) -> FittedModel:
    """Fit a candidate to all records after its first look: carefully if it is promising, else only to rank it."""
    # `finish` is False where many are followed of which only the best are worth fits from elsewhere and more free numbers.
    scored = _fitted(context, look.effects, look.structure, look.free, look.fits, promising, look.nearest)
    return finished(context, scored) if promising and finish else scored


def finished(context: FitContext, scored: FittedModel) -> FittedModel:
    """Continue the fit from other starts, and with exponents and constant forces freed, where that helps."""
    scored = restarted(context, scored)
    fixed = scored.fit.structure.fixed
    names = [
        scored.fit.structure.parameter_name(effect, own)
        for effect in scored.effects
        for own in effect.special_cases
    ]
    special = [name for name in names if name in dict(fixed)]
    if special:
        structure = context.composed(scored.effects, {n: v for n, v in fixed if n not in special})
        scored = _released(context, scored, structure, special)
    structure = scored.fit.structure
    return _released(context, scored, structure, context.releasable_parameters(structure))


def restarted(context: FitContext, settled: FittedModel) -> FittedModel:
    """Restart the fit from values suggested by its effects, as long as that lowers the cost."""
    structure, free = settled.fit.structure, settled.fit.free
    for _ in range(SEARCH.most_restarts):
        if settled.error_over_noise <= VERDICT.exact:
            break
        starts = [s for effect in settled.effects for s in restart_values(structure, effect, settled.fit)]
        if not starts:
            break
        enough = (1.0 - SEARCH.worth_restarting) * settled.fit.cost
        better = [found for found in examined_again(context, settled.fit, starts) if found.cost < enough]
        if not better:
            break
        again = _fitted(context, settled.effects, structure, free, better, True)
        if again.fit.cost >= settled.fit.cost:
            break
        settled = again
    return settled


def _released(
    context: FitContext, settled: FittedModel, structure: Structure, released: Sequence[str]
) -> FittedModel:
    """Fit on with further parameters free; keep them only if the held-out error falls."""
    if not released or not np.isfinite(settled.error_over_noise) or settled.error_over_noise <= VERDICT.exact:
        return settled
    free = [name for name in structure.names if name in (*settled.fit.free, *released)]
    begin = replace(settled.fit, values=settled.fit.all_values)
    freer = _fitted(context, settled.effects, structure, free, (begin,), True)
    return freer if freer.error_over_noise < settled.error_over_noise / VERDICT.release_gain else settled


def _fitted(
    context: FitContext,
    effects: tuple[Effect, ...],
    structure: Structure,
    free: Sequence[str],
    starts: Sequence[FitResult],
    promising: bool,
    nearest: float = float("inf"),
) -> FittedModel:
    fit = context.problem(structure, context.estimation, DEFAULT_ACCURACY if promising else LOOK_ACCURACY)
    evaluations = SEARCH.rough_evaluations if promising else SEARCH.hopeless_evaluations
    tolerance = _ROUGH_TOLERANCE if promising else _HOPELESS_TOLERANCE

    def whole(values: Mapping[str, float]) -> FitResult:
        return fit.fit(values, free, max_evaluations=evaluations, tolerance=tolerance)

    results = [whole(start.values) for start in (starts if promising else starts[:1])]
    if promising and min(map(mean_square, results)) > SEARCH.stuck * nearest:
        in_pieces = context.problem(structure, context.cut_in_pieces(context.estimation, SEARCH.long_piece))
        near = in_pieces.fit(
            starts[0].values, free, max_evaluations=evaluations, tolerance=tolerance, finish=False
        )
        results.append(whole(near.values))
    usable = [result for result in results if result.residuals]
    if not usable:
        return FittedModel(effects, results[0], results[0], float("inf"))
    best = min(usable, key=lambda result: result.cost)
    return context.score(effects, best, roughly=not promising, tolerance=_ROUGH_TOLERANCE)

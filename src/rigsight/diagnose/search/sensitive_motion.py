"""Which effect explains a motion that is sensitive to small disturbances? Decided in windows of a few cycles.

If a disturbance as small as the noise eventually leads to a different motion, not even the true model follows a whole record. In
windows of a few cycles, each with its own initial state, the true model does and a wrong one does not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.predictability import growth_of_disturbances
from rigsight.diagnose.search.starts import start_values


def is_predictable(
    context: FitContext,
    reidentified: FittedModel,
    models: Sequence[FittedModel],
    at_floor: float,
    rng: np.random.Generator,
) -> bool:
    """Return False if no model explains the records and the motion of a good one is sensitive to small disturbances."""
    usable = _nearest(models)
    if not usable or usable[0].error_over_noise <= at_floor:
        return True
    near = [
        model for model in usable if model.error_over_noise <= VERDICT.comparable * usable[0].error_over_noise
    ][: SEARCH.most_asked]
    # If the residual is much larger than the effect of a disturbance, sensitivity does not explain it.
    return all(
        growth_of_disturbances(context, reidentified, model, rng)
        <= max(VERDICT.sensitive, VERDICT.larger_part * model.error_over_noise)
        for model in near
    )


def fitted_in_windows(
    context: FitContext, reidentified: FittedModel, singles: Sequence[FittedModel]
) -> list[FittedModel]:
    """Fit the best models in windows; the others are only scored there, with the parameters that they have."""
    nearest = {model.names for model in _nearest(singles)[: SEARCH.most_asked]}

    def one(model: FittedModel) -> FittedModel:
        if not model.residuals:
            return model
        return _fitted(context, reidentified, model) if model.names in nearest else _scored(context, model)

    return list(context.threads.side_by_side(one, singles))


def _nearest(singles: Sequence[FittedModel]) -> list[FittedModel]:
    usable = (model for model in singles if model.residuals and np.isfinite(model.error_over_noise))
    return sorted(usable, key=lambda model: model.error_over_noise)


def _fitted(context: FitContext, reidentified: FittedModel, model: FittedModel) -> FittedModel:
    structure, free = model.fit.structure, model.fit.free
    (effect,) = model.effects
    own = [structure.parameter_name(effect, p.name) for p in effect.parameters if p.null == 0.0]
    declared = list(start_values(context, structure, effect, reidentified.fit, {}))
    starts = [
        model.fit.values,
        *({**s, **{n: f * s[n] for n in own if n in free}} for s in declared for f in SEARCH.smaller_starts),
    ]
    few = context.problem(structure, context.estimation[:: SEARCH.glimpsed_windows])
    glimpses = sorted(
        (few.fit_windows(start, free, SEARCH.window_evaluations, most_rounds=1) for start in starts),
        key=lambda fit: fit.cost,
    )
    problem = context.problem(structure, context.estimation)
    fits = [problem.fit_windows(glimpse.values, free) for glimpse in glimpses[: SEARCH.window_starts]]
    usable = [fit for fit in fits if fit.residuals]
    if not usable:
        return model.not_simulated()
    best = min(usable, key=lambda fit: fit.cost)
    return scored_in_windows(context, replace(model, fit=best), best.values)


def _scored(context: FitContext, model: FittedModel) -> FittedModel:
    structure = model.fit.structure
    there = context.problem(structure, context.estimation).fit_windows(model.fit.values, ())
    fit = replace(
        model.fit,
        residuals=there.residuals,
        initial_states=there.initial_states,
        cost=there.cost,
        substeps=there.substeps,
    )
    return scored_in_windows(context, replace(model, fit=fit), fit.values)


def scored_in_windows(context: FitContext, model: FittedModel, values: Mapping[str, float]) -> FittedModel:
    """Return a model scored on the windows that judge, with these numbers and the initial states that suit them."""
    result = context.problem(model.fit.structure, context.scoring).fit_windows(values, ())
    error_over_noise = result.weighted_rms if result.residuals else float("inf")
    return replace(model, held_out=result, error_over_noise=error_over_noise)

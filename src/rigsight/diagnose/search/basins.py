"""Has the fit of a candidate reached its lowest minimum? This is checked by fits from other start values of its effects.

If a mass sticks or play is crossed, one set of parameters may fit one part of the records and another set another part: the cost
has several minima, and the one nearest to the declared starts need not be the lowest. Two minima are compared by chi square.

References
----------
W. H. Press et al., *Numerical Recipes* (Cambridge 2007), section 15.6, for differences of chi square.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import LOOK_ACCURACY
from rigsight.identify import FitResult
from rigsight.simulate import carried_over

_TOLERANCE = 1e-4
_SEED = 0
"""Starts are the same for equal models: a diagnosis depends on its records alone."""


def in_lowest_basins(context: FitContext, models: Sequence[FittedModel]) -> list[FittedModel]:
    """Return the models, the best of them in the lowest minimum that was found.

    Each also starts from the parameters that it has in common with the best one, and the best one from those of the next, because
    neither the mass of the rig nor an effect that both have depends on the others. If a model explains the records, nothing else
    is tried.
    """
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
        return in_lowest_basin(context, own, [*starts, *(values_in(other, own) for other in others)])

    found = dict(zip(map(id, nearest), context.threads.side_by_side(lowest, nearest), strict=True))
    return [found.get(id(model), model) for model in models]


def values_in(leader: FittedModel, model: FittedModel) -> dict[str, float]:
    """Return the parameters of a model with the values that another one has for those of both.

    An effect that is a special case of one of the other's has its parameters, too: a friction those of a friction that also
    depends on the load.
    """
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
    context: FitContext, model: FittedModel, starts: Sequence[dict[str, float]]
) -> FittedModel:
    """Return a model in the lowest minimum that is reached from where it is and from other starts."""
    fit = model.fit
    rough = context.problem(fit.structure, context.estimation, LOOK_ACCURACY)

    def roughly(values: dict[str, float]) -> FitResult:
        return rough.fit(values, fit.free, None, SEARCH.basin_evaluations, _TOLERANCE, finish=False)

    here, *elsewhere = map(roughly, [fit.values, *starts])
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

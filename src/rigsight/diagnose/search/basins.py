"""Does a candidate's fit end in the lowest of its basins? Fits from numbers of its effects that are some way off tell.

Where a mass sticks, or play is crossed, one set of numbers explains one part of the records and another one another part: the
cost has several minima, and the one next to the declared starts need not be the lowest. Two minima are compared by chi square.

References
----------
W. H. Press et al., *Numerical Recipes* (Cambridge 2007), section 15.6, for differences of chi square.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.first_look import LOOK_ACCURACY
from rigsight.identify import FitResult

_TOLERANCE = 1e-4
_SEED = 0
"""Starts are the same for equal models: a diagnosis depends on its records alone."""


def in_lowest_basins(context: FitContext, models: Sequence[Scored]) -> list[Scored]:
    """Return the models, the nearest of them in the lowest basin that was found.

    Parameters
    ----------
    context
        Records, scales and noise.
    models
        Fitted and scored.
    """
    usable = [
        m
        for m in models
        if m.residuals and np.isfinite(m.error_over_noise) and m.error_over_noise > VERDICT.exact
    ]
    best = min((m.error_over_noise for m in models if m.residuals), default=np.inf)
    if best <= VERDICT.exact:
        return list(models)
    nearest = sorted(usable, key=lambda model: model.error_over_noise)[: SEARCH.basin_models]
    found = dict(
        zip(
            map(id, nearest),
            context.threads.side_by_side(lambda own: _lowest(context, own), nearest),
            strict=True,
        )
    )
    return [found.get(id(model), model) for model in models]


def _lowest(context: FitContext, model: Scored) -> Scored:
    fit = model.fit
    rough = context.problem(fit.structure, context.estimation, LOOK_ACCURACY)

    def roughly(values: dict[str, float]) -> FitResult:
        return rough.fit(values, fit.free, None, SEARCH.basin_evaluations, _TOLERANCE, finish=False)

    lowest = min(map(roughly, [fit.values, *_starts(model)]), key=lambda found: found.cost)
    # Roughly simulated, so that what looks lower may not be: the finished fit decides.
    if not _is_lower(lowest, fit):
        return model
    finished = context.problem(fit.structure, context.estimation).fit(
        lowest.values, fit.free, lowest.initial_states, SEARCH.basin_finish_evaluations, _TOLERANCE
    )
    if not (finished.residuals and _is_lower(finished, fit)):
        return model
    return context.score(model.effects, finished)


def _starts(model: Scored) -> list[dict[str, float]]:
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


def _is_lower(one: FitResult, other: FitResult) -> bool:
    """Return True if one cost is surely lower, in units of the variance that it leaves itself."""
    return one.cost + VERDICT.standard_errors**2 * one.cost / max(one.n_samples, 1) < other.cost

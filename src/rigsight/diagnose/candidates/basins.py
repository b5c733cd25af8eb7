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

from rigsight.diagnose.candidates.first_look import LOOK_ACCURACY
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.identify import FitResult

_MOST_MODELS = 3
"""Nearest models that are looked at; a farther one is named only if these are lost."""
_EXPLAINED = 1.05
"""Excess over the floor up to which nothing lower is looked for."""
_N_STARTS = 6
_SPREAD = 0.3
"""Standard deviation of the logarithms of an effect's numbers at these starts. On two drawn rigs of dry friction (coverage study,
seed 1) half of such starts led from a wrong basin to the right one; with a spread of 1 fewer did."""
_SURELY = 9.0
"""Chi square by which a basin must be lower: three standard errors of one combination of numbers."""
_EVALUATIONS, _TOLERANCE = 15, 1e-4
_FINISH_EVALUATIONS = 60
_SEED = 0
"""Starts are the same for equal models: a diagnosis depends on its records alone."""


def in_lowest_basins(bench: Workbench, models: Sequence[Scored]) -> list[Scored]:
    """Return the models, the nearest of them in the lowest basin that was found.

    Parameters
    ----------
    bench
        Records, scales and noise.
    models
        Fitted and scored.
    """
    usable = [m for m in models if m.residuals and np.isfinite(m.excess) and m.excess > _EXPLAINED]
    best = min((m.excess for m in models if m.residuals), default=np.inf)
    if best <= _EXPLAINED:
        return list(models)
    nearest = sorted(usable, key=lambda model: model.excess)[:_MOST_MODELS]
    found = dict(
        zip(
            map(id, nearest),
            bench.threads.side_by_side(lambda own: _lowest(bench, own), nearest),
            strict=True,
        )
    )
    return [found.get(id(model), model) for model in models]


def _lowest(bench: Workbench, model: Scored) -> Scored:
    fit = model.fit
    rough = bench.problem(fit.structure, bench.estimation, LOOK_ACCURACY)

    def roughly(values: dict[str, float]) -> FitResult:
        return rough.fit(values, fit.free, None, _EVALUATIONS, _TOLERANCE, finish=False)

    lowest = min(map(roughly, [fit.values, *_starts(model)]), key=lambda found: found.cost)
    # Roughly simulated, so that what looks lower may not be: the finished fit decides.
    if not _is_lower(lowest, fit):
        return model
    finished = bench.problem(fit.structure, bench.estimation).fit(
        lowest.values, fit.free, lowest.initial_states, _FINISH_EVALUATIONS, _TOLERANCE
    )
    if not (finished.residuals and _is_lower(finished, fit)):
        return model
    return bench.score(model.effects, finished)


def _starts(model: Scored) -> list[dict[str, float]]:
    fit, rng = model.fit, np.random.default_rng(_SEED)
    own = {fit.structure.parameter_name(e, p.name) for e in model.effects for p in e.parameters}
    names = [name for name in fit.free if name in own]
    factors = np.exp(_SPREAD * rng.standard_normal((_N_STARTS if names else 0, len(names))))
    return [
        {**fit.values, **{name: fit.values[name] * factor for name, factor in zip(names, row, strict=True)}}
        for row in factors.tolist()
    ]


def _is_lower(one: FitResult, other: FitResult) -> bool:
    """Return True if one cost is surely lower, in units of the variance that it leaves itself."""
    return one.cost + _SURELY * one.cost / max(one.n_samples, 1) < other.cost

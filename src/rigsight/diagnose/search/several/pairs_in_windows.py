"""Which two effects together explain a motion that is sensitive to small disturbances?

Whole records cannot decide: not even the true pair follows one to its end, and a fit to them may stop far away. So the best pairs
are first fitted in short pieces of the most excited stretches, from the starts of both effects, and then in windows of a few
cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.first_look import started_from
from rigsight.diagnose.search.sensitive_motion import scored_in_windows
from rigsight.diagnose.search.starts import start_values


def pairs_in_windows(
    context: FitContext, windows: FitContext, reidentified: FittedModel, pairs: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the best pairs, fitted and scored in windows."""
    of_two = [pair for pair in pairs if len(pair.effects) == 2]
    nearest = sorted(of_two, key=lambda pair: pair.error_over_noise)[: SEARCH.most_windowed_pairs]

    def one(pair: FittedModel) -> FittedModel:
        return _fitted(context, windows, reidentified, pair)

    return list(context.threads.side_by_side(one, nearest))


def _fitted(
    context: FitContext, windows: FitContext, reidentified: FittedModel, pair: FittedModel
) -> FittedModel:
    structure = pair.fit.structure
    first, second = pair.effects
    alone = context.simplest((first,))
    bases = [
        replace(reidentified.fit, structure=alone, values=values)
        for values in start_values(context, alone, first, reidentified.fit, {})
    ]
    starts = [start for base in bases for start in start_values(context, structure, second, base, {})]
    look = started_from(context, pair.effects, structure, starts)
    problem = windows.problem(structure, windows.estimation)
    fits = [problem.fit_windows(fit.values, pair.fit.free) for fit in (pair.fit, *look.fits)]
    usable = [fit for fit in fits if fit.residuals]
    if not usable:
        return pair.not_simulated()
    best = min(usable, key=lambda fit: fit.cost)
    return scored_in_windows(windows, replace(pair, fit=best), best.values)

"""Which two effects together explain a motion in which chance has a part?

Whole records cannot tell: not even the true pair follows one to its end. Pairs are looked at in short pieces of the liveliest
stretches, from the starts of both effects; those that come nearest are fitted in windows of a few cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from rigsight.diagnose.chance import scored_in_windows
from rigsight.diagnose.first_look import Look, looked_from
from rigsight.diagnose.starts import start_values
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect

_MOST_FIRST = 3
"""Single effects, the nearest in windows, beside which a second one is tried; an assumption."""
_MOST_FITTED = 3
"""Pairs that are fitted in windows: those nearest to the short pieces."""


def pairs_in_windows(
    bench: Workbench,
    windows: Workbench,
    linear: Scored,
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    n_jobs: int = 1,
) -> list[Scored]:
    """Return the pairs that come nearest, fitted and scored in windows, each with the effect first that explains more by itself.

    Parameters
    ----------
    bench
        Whole records, scales and noise.
    windows
        The same cut into windows.
    linear
        The re-identified equations on whole records.
    singles
        Every effect alone, fitted in windows.
    effects
        Candidates for the second place.
    n_jobs
        Pairs looked at or fitted at the same time.
    """
    usable = sorted((m for m in singles if m.residuals and np.isfinite(m.excess)), key=lambda m: m.excess)
    wanted: dict[frozenset[str], tuple[Scored, Effect]] = {}
    for first in usable[:_MOST_FIRST]:
        for second in bench.offered(effects):
            if second not in first.effects:
                wanted.setdefault(frozenset({*first.names, second.name}), (first, second))
    looks = Parallel(n_jobs=n_jobs, prefer="threads")(
        delayed(_look)(bench, linear, first, second) for first, second in wanted.values()
    )
    nearest = sorted(looks, key=lambda look: look.nearest)[:_MOST_FITTED]
    return list(
        Parallel(n_jobs=n_jobs, prefer="threads")(delayed(_fitted)(windows, look) for look in nearest)
    )


def _look(bench: Workbench, linear: Scored, first: Scored, second: Effect) -> Look:
    effects = (*first.effects, second)
    special = {name: value for effect in effects for name, value in effect.special_cases.items()}
    structure = bench.composed(effects, special)
    bases = [first.fit]
    for values in start_values(bench, first.fit.structure, first.effects[0], linear.fit, {}):
        bases.append(replace(first.fit, values=values))
    starts = [start for base in bases for start in start_values(bench, structure, second, base, {})]
    return looked_from(bench, effects, structure, starts)


def _fitted(windows: Workbench, look: Look) -> Scored:
    problem = windows.problem(look.structure, windows.estimation)
    fits = [problem.fit_windows(near.values, look.free) for near in look.fits]
    usable = [fit for fit in fits if fit.residuals]
    if not usable:
        return Scored(look.effects, look.fits[0], (), (), float("inf"))
    best = min(usable, key=lambda fit: fit.cost)
    return scored_in_windows(windows, Scored(look.effects, best, (), (), float("inf")), best.values)

"""Which two effects together explain a motion in which chance has a part?

Whole records cannot tell: not even the true pair follows one to its end, and a fit to them may stop far from it. So the nearest
pairs are looked at in short pieces of the liveliest stretches, from the starts of both effects, and fitted in windows of a few
cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.diagnose.candidates.chance import scored_in_windows
from rigsight.diagnose.candidates.first_look import looked_from
from rigsight.diagnose.candidates.starts import start_values
from rigsight.diagnose.workbench import Scored, Workbench

_MOST_FITTED = 3
"""Pairs that are fitted in windows: those nearest to the whole records, which the true one still is; an assumption."""


def pairs_in_windows(
    bench: Workbench, windows: Workbench, linear: Scored, pairs: Sequence[Scored]
) -> list[Scored]:
    """Return the nearest pairs, fitted and scored in windows.

    Parameters
    ----------
    bench
        Whole records, scales and noise.
    windows
        The same cut into windows.
    linear
        The re-identified equations on whole records.
    pairs
        Fitted to whole records; models of more effects are left out.
    """
    of_two = [pair for pair in pairs if len(pair.effects) == 2]
    nearest = sorted(of_two, key=lambda pair: pair.excess)[:_MOST_FITTED]

    def one(pair: Scored) -> Scored:
        return _fitted(bench, windows, linear, pair)

    return list(bench.threads.side_by_side(one, nearest))


def _fitted(bench: Workbench, windows: Workbench, linear: Scored, pair: Scored) -> Scored:
    structure = pair.fit.structure
    first, second = pair.effects
    alone = bench.simplest((first,))
    bases = [
        replace(linear.fit, structure=alone, values=values)
        for values in start_values(bench, alone, first, linear.fit, {})
    ]
    starts = [start for base in bases for start in start_values(bench, structure, second, base, {})]
    look = looked_from(bench, pair.effects, structure, starts)
    problem = windows.problem(structure, windows.estimation)
    fits = [problem.fit_windows(fit.values, pair.fit.free) for fit in (pair.fit, *look.fits)]
    usable = [fit for fit in fits if fit.residuals]
    if not usable:
        return pair.not_simulated()
    best = min(usable, key=lambda fit: fit.cost)
    return scored_in_windows(windows, replace(pair, fit=best), best.values)

"""Selection of terms: every support is fitted by output error and judged by free-run simulation of held-out records.

Regression proposes terms; this module selects them. A term must improve the fit to the held-out records by more than the penalty
of the Bayesian information criterion for their independent samples; of two indistinguishable models the one with fewer terms is
kept.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.discover.bench import HOPELESS, Attempt, Bench, Support, Trial
from rigsight.discover.regression import STRONG, information_criterion, sparse_path
from rigsight.discover.support_starts import PlaceRegression
from rigsight.effects.placed import kind_of
from rigsight.errors import SimulationError
from rigsight.identify import FitResult
from rigsight.records.record import Floats

_SEEDS = 5
_MOST_TERMS = 5
_GROWTH = 3
_WORTH = 0.02
"""Share of the regression's residual power that a term must explain to be polished, unless it is the best candidate."""
_ROUNDS = 4
"""Rounds in which terms are added; rounds in which terms are only removed end by themselves."""
_BESIDE = 2
"""Equations that are extended beside the best, if terms act at several joints."""
_NEAR = 1.5
"""Factor of the smallest held-out error up to which they are."""
_RELEASED = 0.98
"""Factor by which a released special value (an exponent of 1) must lower the held-out error to be kept."""

_FEWEST = 10.0
"""Independent samples that are assumed at least."""
_CHANCE = 2.0
"""Standard deviations by which an RMS may exceed the floor by chance."""
_WHITE = 0.75
"""Share of independent samples from which residuals count as white."""


def independent_samples(trial: Trial) -> float:
    """Return the number of independent samples that is equivalent to the colored held-out errors of all outputs."""
    return sum(map(_independent, trial.shown)) or _FEWEST


def _independent(residuals: Floats) -> float:
    n = residuals.size
    centered = residuals - np.mean(residuals)
    power = np.abs(np.fft.rfft(centered, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: n // 2] / max(float(centered @ centered), 1e-300)
    # Beyond a tenth of the record the remaining correlation is random.
    lags = correlation[1 : max(2, n // 10)]
    return float(max(n / (1.0 + 2.0 * np.sum(lags**2)), _FEWEST))


def at_floor(trial: Trial) -> bool:
    """Return True if a held-out error is as small and as white as the noise: there is nothing left to explain."""
    n = sum(errors.size for errors in trial.shown)
    if n == 0:
        return False
    return bool(
        trial.error_over_noise <= 1.0 + _CHANCE / np.sqrt(2.0 * n)
        and independent_samples(trial) >= _WHITE * n
    )


def criterion(trial: Trial, independent: float) -> float:
    """Return the information criterion of a held-out error."""
    if not np.isfinite(trial.error_over_noise):
        return float("inf")
    return information_criterion(trial.error_over_noise**2, trial.n_free, independent)


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen support, and all that were tried."""

    best: Trial  # the chosen support
    trials: tuple[Trial, ...]  # all polished supports, best first
    independent: float  # number of independent samples of the held-out errors
    bench: Bench  # with the last regressions


def select(
    bench: Bench,
    progress: Callable[[str], None],
    about: Callable[[Bench, FitResult], Bench] = lambda bench, _: bench,
) -> Selection:
    """Search for the support with the lowest held-out criterion: seeds from the regression, then steps of one term.

    Before terms are added to an equation, also to that without any, `about` may return a bench with the regression of what this
    equation lacks.
    """

    def tried(supports: Sequence[Support]) -> list[Trial]:
        trials = bench.trials_of(
            [Attempt(support) for support in supports],
            lambda support: progress(", ".join(sorted(support)) or "linear"),
        )
        enough = HOPELESS * min(trial.error_over_noise for trial in bench.trials.values())
        releases = [
            Attempt(t.support, special, {**t.fit.values, **dict(t.fit.structure.fixed)})
            for t in trials
            if (special := t.fit.structure.special_cases) and t.error_over_noise < enough and not at_floor(t)
        ]
        released = {trial.support: trial for trial in bench.trials_of(releases)}
        return [_better(trial, released.get(trial.support)) for trial in trials]

    pool = tried([frozenset()])
    if not at_floor(pool[0]):
        bench = about(bench, pool[0].fit)
    for _, as_long in itertools.groupby(proposals(bench), key=len):
        if any(at_floor(trial) for trial in pool):
            break
        pool += tried(list(as_long))
    if not any(at_floor(trial) for trial in pool):
        # The regression may prefer a complex term to a simple one, although only the fit of the complex one gets stuck.
        pool += tried(_special_cases(bench, [trial.support for trial in pool]))
    finest = min(pool, key=lambda t: t.error_over_noise)
    if not math.isfinite(finest.error_over_noise):
        raise SimulationError(
            f"The equations of {bench.rig.name} cannot be simulated near these records: {finest.fit.message}"
        )
    independent = independent_samples(finest)

    def cost(trial: Trial) -> float:
        return criterion(trial, independent)

    best = _fewest(pool, cost)
    # A term that another one has made unnecessary is removed, even if that one was added later.
    for number in range(_ROUNDS + _MOST_TERMS):
        shorter, longer = _simpler(bench, best.support), list[Support]()
        if number < _ROUNDS and len(best.support) < _MOST_TERMS and not at_floor(best):
            *others, own = _to_extend(bench, pool, best)
            for trial in others:
                bench = about(bench, trial.fit)
                pool += tried([trial.support | {name} for name in next_terms(bench, trial.support)])
            bench = about(bench, own.fit)
            longer = [best.support | {name} for name in next_terms(bench, best.support)]
        pool += tried([*shorter, *longer])
        # A fit that stopped too early from the values of the regression may continue from those of the longer equation.
        pool += bench.shortened([support for support in shorter if support], best)
        finest = min(pool, key=lambda t: t.error_over_noise)
        independent = independent_samples(finest)
        found = _fewest(pool, cost)
        if found is best:
            break
        best = found
    by_support: dict[Support, Trial] = {}
    for trial in sorted(pool, key=cost):
        by_support.setdefault(trial.support, trial)
    ordered = list(by_support.values())
    return Selection(best, tuple(ordered), independent, bench)


def _better(held: Trial, released: Trial | None) -> Trial:
    """Return the trial with released special values if its lower error justifies the additional parameters."""
    return (
        held
        if released is None or released.error_over_noise >= _RELEASED * held.error_over_noise
        else released
    )


def _fewest(trials: Sequence[Trial], cost: Callable[[Trial], float]) -> Trial:
    """Return the trial with the fewest parameters of those that the held-out records do not distinguish from the best."""
    lowest = min(cost(trial) for trial in trials)
    close = [trial for trial in trials if cost(trial) <= lowest + STRONG or cost(trial) == lowest]
    # With equal numbers of parameters, fewer states are preferred: a loop with one state to a series of sliders with six.
    return min(close, key=lambda t: (t.n_free, len(t.fit.structure.states), cost(t)))


def _to_extend(bench: Bench, pool: Sequence[Trial], best: Trial) -> list[Trial]:
    """Return the trials whose equations get a further term, the best last.

    With terms at several joints, a wrong term that imitates two right ones at once can be better than either of them alone.
    """
    if len(bench.places) < 2:
        return [best]
    as_long = {trial.support: trial for trial in pool if len(trial.support) == len(best.support)}
    ordered = sorted(as_long.values(), key=lambda trial: -trial.error_over_noise)
    near = [t for t in ordered if t.error_over_noise < _NEAR * best.error_over_noise and t is not best]
    return [*near[-_BESIDE:], best]


def proposals(bench: Bench) -> list[Support]:
    """Return the supports that the regressions propose for polishing, short ones first."""
    costs = {support: cost for place in bench.places for support, cost in _proposed_at(bench, place).items()}
    # Short ones first: if one term reaches the noise floor, two need not be tried.
    found = sorted(costs, key=lambda support: costs[support])[:_SEEDS]
    # The same terms at the other joints: a force at one joint moves those beside it in nearly the same way.
    kinds = {kind_of(name) for support in found for name in support}
    offered = [name for place in bench.places[1:] and bench.places for name in place.offered]
    further = [frozenset({name}) for name in offered if kind_of(name) in kinds]
    found += [support for support in further if support not in found]
    return sorted(found, key=lambda support: (len(support), costs.get(support, math.inf)))


def _proposed_at(bench: Bench, place: PlaceRegression) -> dict[Support, float]:
    """Return the supports that the regression at a place proposes, with a criterion that is comparable between places."""
    names, projected = place.offered, place.projected
    if not names:
        return {}
    columns = np.column_stack([bench.candidates[name].column for name in names])
    together = np.column_stack([columns, *bench.own_terms.values()])
    paths = sparse_path(bench.sparse(projected), together)
    supports = {tuple(i for i in path if i < len(names)) for path in paths}
    shares = [projected.explained(columns[:, [i]])[1] for i in range(len(names))]
    supports |= {(int(i),) for i in np.argsort(shares)[::-1][:_GROWTH]}
    # Forces of different joints differ in size: what counts is the share that is left.
    whole = projected.solved(columns[:, :0])[1] ** 2 or 1.0

    def remainder(support: tuple[int, ...]) -> float:
        return projected.solved(columns[:, list(support)])[1] ** 2 / whole

    def worth(support: tuple[int, ...]) -> bool:
        shorter = [tuple(i for i in support if i != out) for out in support]
        return len(support) == 1 or all(
            remainder(support) < (1.0 - _WORTH) * remainder(less) for less in shorter
        )

    return {
        frozenset(names[i] for i in support): information_criterion(
            remainder(support), len(support), projected.independent
        )
        for support in supports
        if 0 < len(support) <= place.longest and worth(support)
    }


def _simpler(bench: Bench, support: Support) -> list[Support]:
    """Return the supports with one term less, or with a special case in place of a term."""
    found = [support - {name} for name in sorted(support)]
    return found + _special_cases(bench, [support])


def _special_cases(bench: Bench, supports: Sequence[Support]) -> list[Support]:
    """Return the supports with a special case in place of a term, each once, without the given ones."""
    found = {
        support - {name} | {parent}: None
        for support in supports
        for name in sorted(support)
        for parent in bench.candidates[name].effect.parents
        if parent in bench.candidates and parent not in support
    }
    return [support for support in found if support not in supports]


def next_terms(bench: Bench, support: Support) -> list[str]:
    """Return the terms that explain most of the regression residuals of a support, the best first."""
    shares: dict[str, float] = {}
    for place in bench.places:
        inside = [bench.candidates[name].column for name in sorted(support & {*place.offered})]
        beside = replace(place.projected, base=np.column_stack([place.projected.base, *inside]))
        for name in place.offered:
            if name not in support:
                shares[name] = beside.explained(bench.candidates[name].column[:, None])[1]
    unused = list(shares)
    ranked = np.argsort(list(shares.values()))[::-1][:_GROWTH]
    return [unused[i] for rank, i in enumerate(ranked) if rank == 0 or shares[unused[i]] > _WORTH]

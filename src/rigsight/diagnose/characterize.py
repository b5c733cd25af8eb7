"""Which effect causes the gap: every candidate fitted to the estimation records and scored on the validation records.

Each candidate gets a first look. From all its starts it is fitted to the liveliest stretches of the records: in short pieces with
initial states of their own, which keeps a model that is far off in step with the motion, then in one piece. From where the best
of these ended it is fitted roughly to the whole records. Those that come near the best are fitted with care, the best of them
to full precision.

References
----------
H. G. Bock, in *Modelling of Chemical Reaction Systems* (Springer 1981) 102, for fits in pieces (multiple shooting, here without
the condition that pieces join).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from rigsight.diagnose.starts import restart_values, start_values, with_own_values
from rigsight.diagnose.windows import cut
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect
from rigsight.identify import DEFAULT_ACCURACY, EffectRegression, FitResult
from rigsight.records.record import Record
from rigsight.simulate import Structure

_LOOK_EVALUATIONS = 25
_GLIMPSE_EVALUATIONS = 8
_MOST_STARTS = 4
"""Starts that are fitted further; which of more they are, the first few evaluations of each tell."""
_MOST_RESTARTS = 4
_WORTH_RESTARTING = 1e-3
"""Share of the cost that a fit from elsewhere must remove to be followed."""
_PIECE = 4.0
"""Length of a piece in periods of the rig: a model that is far off stays in step with the motion for about as long.

An assumption, like the lengths and factors below: half to two periods did worse on play of a few widths, nothing else was tried.
"""
_WIDE_EVALUATIONS = 12
_LOOK_TOLERANCE = 1e-3
_LOOK_ACCURACY = 1e-3
_LONG_PIECE = 20.0
_MOST_PIECES = 40
"""In all: every piece has initial states of its own, and the fit's equations grow with them."""
_STUCK = 2.0
"""Mean squared error of whole records, in units of that of their liveliest stretches, at which a fit counts as stopped short."""
_ROUGH_EVALUATIONS = 40
_ROUGH_TOLERANCE = 1e-4
_HOPELESS_EVALUATIONS = 8
_REFINE_EVALUATIONS = 150
"""With one integration step per sample; a model that takes more gets fewer: far stiffer ones follow a valley without end."""
_FEWEST_REFINE_EVALUATIONS = 15
_HOPELESS_TOLERANCE = 1e-2
_NEAR = 25.0
"""A candidate whose error in the liveliest stretches is below this factor of the best (five times its RMS) sees whole records."""
_PROMISING = 9.0
"""A candidate that costs less than this factor of the best on whole records (three times its RMS) is followed to the end."""
_CONTENDER = 1.5
"""A model whose held-out error is within this factor of the best is fitted to full precision."""
_ALIKE = 1.05
"""Starts whose first looks end within this factor of the best cost are all followed."""
_WORTH_RELEASING = 1.05
"""Excess over the floor above which a fixed exponent is released."""
_RELEASE_GAIN = 1.02
"""Factor by which a released exponent must lower the held-out error to be kept."""


@dataclass(frozen=True)
class Look:
    """First fits of a candidate to part of the records or roughly to all, best first, those that ended at the same place once.

    Attributes
    ----------
    effects, structure, free
        What was fitted.
    fits
        What was reached.
    nearest
        Mean squared error that was reached in their liveliest stretches.
    """

    effects: tuple[Effect, ...]
    structure: Structure
    free: tuple[str, ...]
    fits: tuple[FitResult, ...]
    nearest: float

    @property
    def newest(self) -> str:
        """Name of the effect that was added last."""
        return self.effects[-1].name

    @property
    def cost(self) -> float:
        """Lowest cost that was reached."""
        return self.fits[0].cost


def fit_linear(bench: Workbench, start: Mapping[str, float]) -> Scored:
    """Re-identify the equations without an effect."""
    structure = bench.composed()
    fit = bench.problem(structure, bench.estimation)
    return bench.score((), fit.fit(start, bench.free_parameters(structure)))


def fit_candidates(
    bench: Workbench,
    linear: Scored,
    effects: Iterable[Effect],
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> list[Scored]:
    """Fit and score every effect alone.

    Parameters
    ----------
    bench
        Records, scales and noise.
    linear
        The re-identified equations.
    effects
        Candidates; those that the rig does not offer are left out.
    n_jobs
        Candidates fitted at the same time.
    progress
        Called with the name of each candidate that is done.
    """
    regression = None
    if bench.rig.is_driven:
        regression = EffectRegression(bench.rig, bench.estimation, linear.fit.values, bench.scales)
    looks = _looks(bench, linear, bench.offered(effects), regression, n_jobs)
    wide = {look.newest: look for look in widened(bench, looks, n_jobs)}
    lowest = min((look.cost for look in wide.values()), default=float("inf"))

    def one(found: Look) -> Scored:
        found = wide.get(found.newest, found)
        promising = found.newest in wide and found.cost <= _PROMISING * lowest
        scored = followed(bench, found, promising)
        if progress is not None:
            progress(found.newest)
        return scored

    models = list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(look) for look in looks))
    return refine(bench, models, n_jobs)


def _looks(
    bench: Workbench,
    linear: Scored,
    effects: Sequence[Effect],
    regression: EffectRegression | None,
    n_jobs: int,
) -> list[Look]:
    """Look at every effect; those that start from a simpler one come after it."""
    names = {effect.name for effect in effects}
    done: dict[str, Look] = {}
    waiting = list(effects)
    while waiting:
        ready = [e for e in waiting if all(p in done or p not in names for p in e.parents)]
        ready = ready or waiting
        waiting = [effect for effect in waiting if effect not in ready]
        parents = {name: look.fits[0] for name, look in done.items() if np.isfinite(look.cost)}
        looks = Parallel(n_jobs=n_jobs, prefer="threads")(
            delayed(look_at)(bench, (effect,), linear.fit, parents, regression) for effect in ready
        )
        done.update({effect.name: look for effect, look in zip(ready, looks, strict=True)})
    return [done[effect.name] for effect in effects]


def fit_candidate(
    bench: Workbench,
    effects: tuple[Effect, ...],
    base: FitResult,
    hold: frozenset[str] = frozenset(),
) -> Scored:
    """Fit and score one set of effects to full precision.

    Parameters
    ----------
    bench
        Records, scales and noise.
    effects
        All effects of the model; the last is new.
    base
        Fit without the last.
    hold
        Rig parameters to keep at their base value.
    """
    (found,) = widened(bench, [look_at(bench, effects, base, {}, hold=hold)])
    return refine(bench, [followed(bench, found, promising=True)])[0]


def refine(bench: Workbench, models: Sequence[Scored], n_jobs: int = 1) -> list[Scored]:
    """Fit those models to full precision whose held-out error is close to the best."""
    best = min((m.excess for m in models), default=float("inf"))

    def one(model: Scored) -> Scored:
        if not (np.isfinite(model.excess) and model.excess <= _CONTENDER * best):
            return model
        fit = bench.problem(model.fit.structure, bench.estimation)
        result = fit.fit(
            model.fit.values,
            model.fit.free,
            initial_states=model.fit.initial_states,
            max_evaluations=max(_FEWEST_REFINE_EVALUATIONS, _REFINE_EVALUATIONS // max(model.fit.substeps)),
        )
        if not result.residuals or result.cost > model.fit.cost * (1.0 + 1e-3):
            return model
        return bench.score(model.effects, result)

    return list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(model) for model in models))


def look_at(
    bench: Workbench,
    effects: tuple[Effect, ...],
    base: FitResult,
    parents: Mapping[str, FitResult],
    regression: EffectRegression | None = None,
    hold: frozenset[str] = frozenset(),
    substeps: Sequence[int] | None = None,
) -> Look:
    """Fit a set of effects to the liveliest stretches of the records, from all starts of the last effect.

    Parameters
    ----------
    bench
        Records, scales and noise.
    effects
        All effects of the model; the last is new.
    base
        Fit without the last.
    parents
        Fits with a simpler effect in place of the last, by name of that effect.
    regression
        Gives one more start, where it can.
    hold
        Rig parameters to keep at their base value.
    substeps
        Integration steps per sample of each record; None chooses them, which needs the accurate integrator.
    """
    special = {name: value for effect in effects for name, value in effect.special_cases.items()}
    structure = bench.composed(effects, special)
    free = tuple(name for name in bench.free_parameters(structure) if name not in hold)
    starts = list(start_values(bench, structure, effects[-1], base, parents))
    regressed = regression.start(effects[-1]) if regression is not None else None
    if regressed is not None:
        starts.append({**starts[0], **with_own_values(structure, effects[-1], base, regressed)})
    nearest = _looked(bench, structure, free, starts, substeps)
    if not np.isfinite(nearest[0].cost) and bench.start:
        unbent = replace(base, values={**base.values, **bench.start})
        nearest = _looked(
            bench, structure, free, list(start_values(bench, structure, effects[-1], unbent, {})), substeps
        )
    return Look(effects, structure, free, nearest, _mean_square(nearest[0]))


def _looked(
    bench: Workbench,
    structure: Structure,
    free: tuple[str, ...],
    starts: Sequence[Mapping[str, float]],
    substeps: Sequence[int] | None = None,
) -> tuple[FitResult, ...]:
    """Fit to the liveliest stretches: in pieces from every start, from the best places in one."""
    fit = bench.problem(structure, bench.look, _LOOK_ACCURACY)
    pieces = [_pieces(bench, [record], _PIECE) for record in bench.look]
    in_pieces = bench.problem(structure, [piece for parts in pieces for piece in parts], _LOOK_ACCURACY)
    of_pieces = None
    if substeps is not None:
        of_pieces = [n for n, parts in zip(substeps, pieces, strict=True) for _ in parts]

    def tried(
        start: Mapping[str, float], states: Sequence[NDArray[np.float64]] | None, most: int
    ) -> FitResult:
        return in_pieces.fit(start, free, states, most, _LOOK_TOLERANCE, False, of_pieces)

    if len(starts) > _MOST_STARTS:
        glimpses = sorted(
            (tried(start, None, _GLIMPSE_EVALUATIONS) for start in starts), key=lambda f: f.cost
        )
        first = [tried(g.values, g.initial_states, _LOOK_EVALUATIONS) for g in glimpses[:_MOST_STARTS]]
    else:
        first = [tried(start, None, _LOOK_EVALUATIONS) for start in starts]
    near = [
        fit.fit(found.values, free, None, _LOOK_EVALUATIONS, _LOOK_TOLERANCE, False, substeps)
        for found in _distinct(first, alike=float("inf"))
    ]
    return _distinct(near)


def widened(
    bench: Workbench,
    looks: Sequence[Look],
    n_jobs: int = 1,
    substeps: Sequence[int] | None = None,
    lowest: float = float("inf"),
) -> list[Look]:
    """Fit those looks roughly to the whole records that came near the best one in the liveliest stretches; drop the others.

    Parameters
    ----------
    bench
        Records, scales and noise.
    looks
        First looks.
    n_jobs
        Looks fitted at the same time.
    substeps
        Integration steps per sample of each record; None chooses them.
    lowest
        Mean squared error in the liveliest stretches that a look beside these has reached.
    """
    lowest = min([lowest, *(look.nearest for look in looks)])

    def one(look: Look) -> Look:
        return replace(look, fits=_on_whole_records(bench, look.structure, look.free, look.fits, substeps))

    near = [look for look in looks if look.nearest <= _NEAR * lowest]
    return list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(look) for look in near))


def _on_whole_records(
    bench: Workbench,
    structure: Structure,
    free: tuple[str, ...],
    fits: Sequence[FitResult],
    substeps: Sequence[int] | None = None,
) -> tuple[FitResult, ...]:
    whole = bench.problem(structure, bench.estimation, _LOOK_ACCURACY)
    return _distinct(
        [
            whole.fit(near.values, free, None, _WIDE_EVALUATIONS, _LOOK_TOLERANCE, False, substeps)
            for near in fits
        ]
    )


def followed(bench: Workbench, look: Look, promising: bool, finish: bool = True) -> Scored:
    """Fit a looked-at candidate to all records: with care if it is promising, else only to place it in the ranking.

    `finish` is False where many are followed of which only the best are worth fits from elsewhere and more free numbers.
    """
    scored = _fitted(bench, look.effects, look.structure, look.free, look.fits, promising, look.nearest)
    return finished(bench, scored) if promising and finish else scored


def finished(bench: Workbench, scored: Scored) -> Scored:
    """Fit on from elsewhere, and with exponents and constant forces free that were fixed so far, where that helps."""
    scored = restarted(bench, scored)
    fixed = scored.fit.structure.fixed
    special = scored.effects[-1].special_cases
    if special:
        structure = bench.composed(scored.effects, {n: v for n, v in fixed if n not in special})
        scored = _released(bench, scored, structure, list(special))
    structure = scored.fit.structure
    return _released(bench, scored, structure, bench.releasable_parameters(structure))


def restarted(bench: Workbench, settled: Scored) -> Scored:
    """Fit from the places to which its effects say that a fit may have to be moved, for as long as that lowers the cost."""
    structure, free = settled.fit.structure, settled.fit.free
    near = bench.problem(structure, bench.look, _LOOK_ACCURACY)
    for _ in range(_MOST_RESTARTS):
        if settled.excess <= _WORTH_RELEASING:
            break
        starts = [s for effect in settled.effects for s in restart_values(structure, effect, settled.fit)]
        if not starts:
            break
        looks = sorted(
            (near.fit(s, free, None, _LOOK_EVALUATIONS, _LOOK_TOLERANCE, False) for s in starts),
            key=lambda fit: fit.cost,
        )
        better = [
            found
            for found in _on_whole_records(bench, structure, free, looks[:_MOST_STARTS])
            if found.cost < (1.0 - _WORTH_RESTARTING) * settled.fit.cost
        ]
        if not better:
            break
        again = _fitted(bench, settled.effects, structure, free, better, True)
        if again.fit.cost >= settled.fit.cost:
            break
        settled = again
    return settled


def _released(bench: Workbench, settled: Scored, structure: Structure, released: Sequence[str]) -> Scored:
    """Fit on with further parameters free; keep them only if the held-out error falls."""
    if not released or not np.isfinite(settled.excess) or settled.excess <= _WORTH_RELEASING:
        return settled
    free = [name for name in structure.names if name in (*settled.fit.free, *released)]
    start = {**settled.fit.values, **dict(settled.fit.structure.fixed)}
    freer = _fitted(bench, settled.effects, structure, free, (replace(settled.fit, values=start),), True)
    return freer if freer.excess < settled.excess / _RELEASE_GAIN else settled


def _fitted(
    bench: Workbench,
    effects: tuple[Effect, ...],
    structure: Structure,
    free: Sequence[str],
    starts: Sequence[FitResult],
    promising: bool,
    nearest: float = float("inf"),
) -> Scored:
    fit = bench.problem(structure, bench.estimation, DEFAULT_ACCURACY if promising else _LOOK_ACCURACY)
    evaluations = _ROUGH_EVALUATIONS if promising else _HOPELESS_EVALUATIONS
    tolerance = _ROUGH_TOLERANCE if promising else _HOPELESS_TOLERANCE

    def whole(values: Mapping[str, float]) -> FitResult:
        return fit.fit(values, free, max_evaluations=evaluations, tolerance=tolerance)

    results = [whole(start.values) for start in (starts if promising else starts[:1])]
    if promising and min(map(_mean_square, results)) > _STUCK * nearest:
        in_pieces = bench.problem(structure, _pieces(bench, bench.estimation, _LONG_PIECE))
        near = in_pieces.fit(
            starts[0].values, free, max_evaluations=evaluations, tolerance=tolerance, finish=False
        )
        results.append(whole(near.values))
    usable = [result for result in results if result.residuals]
    if not usable:
        return Scored(effects, results[0], (), (), float("inf"))
    return bench.score(effects, min(usable, key=lambda result: result.cost), roughly=not promising)


def _pieces(bench: Workbench, records: Sequence[Record], periods: float) -> tuple[Record, ...]:
    """Cut records into pieces of so many periods of the rig, longer where they would be too many."""
    duration = sum(record.n_samples * record.dt for record in records)
    return cut(records, max(periods * bench.period, duration * len(bench.look) / len(records) / _MOST_PIECES))


def _mean_square(fit: FitResult) -> float:
    return fit.cost / fit.n_samples


def _distinct(fits: Sequence[FitResult], alike: float = _ALIKE) -> tuple[FitResult, ...]:
    """Return the best fit, and the next one that ended elsewhere if its cost is within a factor of the best."""
    ordered = sorted(fits, key=lambda result: result.cost)
    best = ordered[0]
    values = np.array([best.values[name] for name in best.free])
    for other in ordered[1:]:
        theirs = np.array([other.values[name] for name in other.free])
        if other.cost <= alike * best.cost and not np.allclose(values, theirs, rtol=0.05, atol=1e-12):
            return best, other
    return (best,)

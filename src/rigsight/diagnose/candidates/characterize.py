"""Which effect causes the gap: every candidate fitted to the estimation records and scored on the validation records.

Each candidate gets a first look. Those that come near the best there are fitted with care, the best of them to full precision.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rigsight.diagnose.candidates.basins import in_lowest_basins
from rigsight.diagnose.candidates.first_look import (
    LOOK_ACCURACY,
    Look,
    look_at,
    looked_again,
    mean_square,
    widened,
)
from rigsight.diagnose.candidates.starts import restart_values, sized, start_values
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect
from rigsight.identify import DEFAULT_ACCURACY, EffectRegression, FitResult
from rigsight.simulate import Structure

_MOST_RESTARTS = 4
_WORTH_RESTARTING = 1e-3
"""Share of the cost that a fit from elsewhere must remove to be followed."""
_FAINT = 1e-3
_LONG_PIECE = 20.0
_STUCK = 2.0
"""Mean squared error of whole records, in units of that of their liveliest stretches, at which a fit counts as stopped short."""
_ROUGH_EVALUATIONS = 40
_ROUGH_TOLERANCE = 1e-4
_HOPELESS_EVALUATIONS = 8
_REFINE_EVALUATIONS = 150
"""With one integration step per sample; a model that takes more gets fewer: far stiffer ones follow a valley without end."""
_FEWEST_REFINE_EVALUATIONS = 15
_HOPELESS_TOLERANCE = 1e-2
_PROMISING = 9.0
"""A candidate that costs less than this factor of the best on whole records (three times its RMS) is followed to the end."""
CONTENDER = 1.5
"""A model whose held-out error is within this factor of the best is fitted to full precision."""
_WORTH_RELEASING = 1.05
"""Excess over the floor above which a fixed exponent is released."""
_SIGNIFICANT = 3.0
"""Standard errors by which a constant force must differ from what is known of it to be one that is needed: one chance in 370.

One that was estimated, as its value other than the default tells, is known no better than the other numbers of the simulation in
question: it must differ by as many times their root mean square.
"""
_RELEASE_GAIN = 1.02
"""Factor by which a released exponent must lower the held-out error to be kept."""


def fit_linear(bench: Workbench, start: Mapping[str, float]) -> Scored:
    """Re-identify the equations without an effect."""
    structure = bench.composed()
    fit = bench.problem(structure, bench.estimation)
    return bench.score((), fit.fit(start, bench.free_parameters(structure)))


def fit_candidates(
    bench: Workbench,
    linear: Scored,
    effects: Iterable[Effect],
    progress: Callable[[str], None] | None = None,
    known: Sequence[Scored] = (),
) -> list[Scored]:
    """Return every effect alone, fitted and scored, with those that were before.

    Parameters
    ----------
    bench
        Records, scales and noise.
    linear
        The re-identified equations.
    effects
        Candidates; those that the rig does not offer are left out.
    progress
        Called with the name of each candidate that is done.
    known
        Effects that were fitted before: these start from them, and compete with them.
    """
    regression = None
    if bench.rig.has_one_motion and bench.rig.is_driven and bench.driven:
        regression = EffectRegression(bench.rig, bench.driven, linear.fit.values, bench.scales)
    before = {model.effects[0].name: model.fit for model in known if np.isfinite(model.fit.cost)}
    looks = _looks(bench, linear, bench.offered(effects), regression, before)
    wide = {look.newest: look for look in widened(bench, looks)}
    costs = [*(look.cost for look in wide.values()), *(fit.cost for fit in before.values())]
    lowest = min(costs, default=float("inf"))

    def one(found: Look) -> Scored:
        found = wide.get(found.newest, found)
        promising = found.newest in wide and found.cost <= _PROMISING * lowest
        scored = followed(bench, found, promising)
        if scored.fit.cost > (1.0 + _WORTH_RESTARTING) * linear.fit.cost:
            scored = min(scored, _from_hardly_any(bench, found, linear.fit), key=lambda model: model.fit.cost)
        if progress is not None:
            progress(found.newest)
        return scored

    models = list(bench.threads.side_by_side(one, looks))
    refined = in_lowest_basins(bench, refine(bench, [*known, *models]))
    refined = with_a_mean_that_is_needed(bench, refined)
    late = {m.effects[0].at for m in refined if m.effects[0].measured_late is not None and not _shift(m)}
    return [model for model in refined if not (_shift(model) > 0.0 and model.effects[0].at in late)]


def _from_hardly_any(bench: Workbench, look: Look, base: FitResult) -> Scored:
    """Fit a candidate from where it is nearly absent: its equations are those of the base there, so that none need be worse."""
    structure, (effect,) = look.structure, look.effects
    start = next(start_values(bench, structure, effect, base, {}))
    faint = {
        (name := structure.parameter_name(effect, p.name)): sized(start[name], p.null, _FAINT)
        for p in effect.parameters
        if p.null is not None
    }
    # A constant force that is held where somebody knows it stays there.
    known = bench.constant_forces_beside(look.effects)
    begin = replace(base, values={**start, **base.values, **faint, **known})
    return _fitted(bench, look.effects, structure, look.free, (begin,), promising=False)


def _shift(model: Scored) -> float:
    """Return the time by which a single effect shifts a record: late it is what a late sensor shows as well [s]."""
    (effect,), fit = model.effects, model.fit
    return sum(fit.structure.values_of(effect, fit.values).values()) if effect.shifts_the_record else 0.0


def with_a_mean_that_is_needed(bench: Workbench, models: Sequence[Scored]) -> list[Scored]:
    """Return single effects without those whose mean force nothing asks for.

    An effect with a mean force, and a plainer one beside a constant force, are the same equation. Where the plainer one leaves
    the constant forces where they are known to be, it is the whole of it.
    """
    alone = {model.names: model.fit for model in models}

    def is_needed(model: Scored) -> bool:
        held = bench.constant_forces_beside(model.effects)
        plainer = [alone[name,] for name in model.effects[0].parents if (name,) in alone]
        return not held or not plainer or any(_moves(bench, fit, held) for fit in plainer)

    return [model for model in models if is_needed(model)]


def _moves(bench: Workbench, fit: FitResult, known: Mapping[str, float]) -> bool:
    """Return True if a fit moves a constant force that is known: farther than others that somebody estimated are wrong."""
    defaults = {p.name: p.default for p in bench.rig.parameters}
    estimated = {name: value for name, value in bench.given.items() if value != defaults.get(name)}
    others = _moves_of(fit, {name: value for name, value in estimated.items() if name not in known})
    usual = max(1.0, float(np.sqrt(np.mean(np.square(list(others.values())))))) if others else 1.0
    return any(
        move > _SIGNIFICANT * (usual if name in estimated else 1.0)
        for name, move in _moves_of(fit, known).items()
    )


def _moves_of(fit: FitResult, known: Mapping[str, float]) -> dict[str, float]:
    """Return how far a fit lies from known values, in standard errors."""
    return {
        name: abs(fit.values[name] - value) / fit.standard_errors[name]
        for name, value in known.items()
        if name in fit.free and fit.standard_errors[name] > 0.0
    }


def _looks(
    bench: Workbench,
    linear: Scored,
    effects: Sequence[Effect],
    regression: EffectRegression | None,
    known: Mapping[str, FitResult],
) -> list[Look]:
    """Look at every effect; those that start from a simpler one, if it is not known, come after it."""
    names = {effect.name for effect in effects}
    done: dict[str, Look] = {}
    waiting = list(effects)

    def one(parents: Mapping[str, FitResult], effect: Effect) -> Look:
        regressed = regression.start(effect) if regression is not None else None
        return look_at(bench, (effect,), linear.fit, parents, [] if regressed is None else [regressed])

    while waiting:
        ready = [e for e in waiting if all(p in done or p not in names for p in e.parents)]
        ready = ready or waiting
        waiting = [effect for effect in waiting if effect not in ready]
        looked = {name: look.fits[0] for name, look in done.items() if np.isfinite(look.cost)}
        parents = {**known, **looked}
        looks = list(bench.threads.side_by_side(partial(one, parents), ready))
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


def refine(bench: Workbench, models: Sequence[Scored]) -> list[Scored]:
    """Fit those models to full precision whose held-out error is close to the best; the best of them to the end."""
    best = min((m.excess for m in models), default=float("inf"))

    def one(model: Scored) -> Scored:
        if not (np.isfinite(model.excess) and model.excess <= CONTENDER * best):
            return model
        steps = max(substeps.mean for substeps in model.fit.substeps)
        return _refined(bench, model, max(_FEWEST_REFINE_EVALUATIONS, round(_REFINE_EVALUATIONS / steps)))

    refined = list(bench.threads.side_by_side(one, models))
    leading = min(range(len(refined)), key=lambda i: refined[i].excess, default=None)
    if leading is not None and np.isfinite(refined[leading].excess) and not refined[leading].fit.success:
        refined[leading] = _refined(bench, refined[leading], _REFINE_EVALUATIONS)
    return refined


def contenders(models: Sequence[Scored]) -> list[Scored]:
    """Return the models that are close enough to the best one to have been fitted to full precision."""
    usable = [model for model in models if model.residuals and np.isfinite(model.excess)]
    best = min((model.excess for model in usable), default=float("inf"))
    return [model for model in usable if model.excess <= CONTENDER * best]


def _refined(bench: Workbench, model: Scored, max_evaluations: int) -> Scored:
    fit = bench.problem(model.fit.structure, bench.estimation)
    result = fit.fit(
        model.fit.values,
        model.fit.free,
        initial_states=model.fit.initial_states,
        max_evaluations=max_evaluations,
    )
    if not result.residuals or result.cost > model.fit.cost * (1.0 + 1e-3):
        return model
    return bench.score(model.effects, result)


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
    names = [
        scored.fit.structure.parameter_name(effect, own)
        for effect in scored.effects
        for own in effect.special_cases
    ]
    special = [name for name in names if name in dict(fixed)]
    if special:
        structure = bench.composed(scored.effects, {n: v for n, v in fixed if n not in special})
        scored = _released(bench, scored, structure, special)
    structure = scored.fit.structure
    return _released(bench, scored, structure, bench.releasable_parameters(structure))


def restarted(bench: Workbench, settled: Scored) -> Scored:
    """Fit from the places to which its effects say that a fit may have to be moved, for as long as that lowers the cost."""
    structure, free = settled.fit.structure, settled.fit.free
    for _ in range(_MOST_RESTARTS):
        if settled.excess <= _WORTH_RELEASING:
            break
        starts = [s for effect in settled.effects for s in restart_values(structure, effect, settled.fit)]
        if not starts:
            break
        enough = (1.0 - _WORTH_RESTARTING) * settled.fit.cost
        better = [found for found in looked_again(bench, settled.fit, starts) if found.cost < enough]
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
    fit = bench.problem(structure, bench.estimation, DEFAULT_ACCURACY if promising else LOOK_ACCURACY)
    evaluations = _ROUGH_EVALUATIONS if promising else _HOPELESS_EVALUATIONS
    tolerance = _ROUGH_TOLERANCE if promising else _HOPELESS_TOLERANCE

    def whole(values: Mapping[str, float]) -> FitResult:
        return fit.fit(values, free, max_evaluations=evaluations, tolerance=tolerance)

    results = [whole(start.values) for start in (starts if promising else starts[:1])]
    if promising and min(map(mean_square, results)) > _STUCK * nearest:
        in_pieces = bench.problem(structure, bench.cut_in_pieces(bench.estimation, _LONG_PIECE))
        near = in_pieces.fit(
            starts[0].values, free, max_evaluations=evaluations, tolerance=tolerance, finish=False
        )
        results.append(whole(near.values))
    usable = [result for result in results if result.residuals]
    if not usable:
        return Scored(effects, results[0], results[0], float("inf"))
    return bench.score(effects, min(usable, key=lambda result: result.cost), roughly=not promising)

"""Which effect causes the gap: every candidate fitted to the estimation records and scored on the validation records."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from joblib import Parallel, delayed
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.units import characteristic_value

_LOOK_EVALUATIONS = 25
_LOOK_TOLERANCE = 1e-3
_LOOK_ACCURACY = 1e-3
_ROUGH_EVALUATIONS = 40
_ROUGH_TOLERANCE = 1e-4
_CONTENDER = 1.5
"""A model whose held-out error is within this factor of the best is fitted to full precision."""
_ALIKE = 1.05
"""Starts whose first looks end within this factor of the best cost are all followed."""
_WORTH_RELEASING = 1.05
"""Excess over the floor above which a fixed exponent is released."""


@dataclass(frozen=True)
class Scored:
    """A fitted model with its residuals on the records that score it.

    Attributes
    ----------
    effects
        The effects added.
    fit
        The fit to the estimation records.
    residuals
        Per scoring record, shape (n_samples, n_outputs), NaN where an output was not measured.
    initial_states
        Per scoring record.
    excess
        RMS of the residuals in units of the noise floor.
    """

    effects: tuple[Effect, ...]
    fit: FitResult
    residuals: tuple[NDArray[np.float64], ...]
    initial_states: tuple[NDArray[np.float64], ...]
    excess: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def n_free(self) -> int:
        """Number of fitted parameters."""
        return len(self.fit.free)


@dataclass(frozen=True)
class Workbench:
    """What every candidate is fitted and scored with.

    Attributes
    ----------
    rig
        The rig.
    estimation, scoring
        Records to fit and records to score, already cut into windows where that is needed.
    look
        The liveliest stretch of each estimation record, for a first look at each start.
    scales
        Size of each base quantity.
    noise
        Noise floor of each output.
    held
        Parameters of the rig that no fit moves (a spring that is not there, outputs that were not measured).
    """

    rig: Rig
    estimation: tuple[Record, ...]
    scoring: tuple[Record, ...]
    look: tuple[Record, ...]
    scales: Mapping[str, float]
    noise: Mapping[str, float]
    held: frozenset[str]

    def free_parameters(self, structure: Structure) -> list[str]:
        """Return what a fit of this structure moves."""
        names = [p.name for p in self.rig.parameters if p.name not in self.held]
        bias = {symbol.name for symbol in self.rig.motion.bias.free_symbols}
        rest = {symbol.name for symbol in self.rig.motion.rest.free_symbols}
        no_spring = {s.name for s in self.rig.motion.stiffness.free_symbols} <= self.held
        bends = any(_bends_the_spring(effect) for effect in structure.effects)
        if self.rig.is_driven and no_spring and not bends:
            names = [name for name in names if name not in rest]
        elif self.rig.is_driven and rest and not bends:
            # A linear spring cannot tell a constant force from a shifted rest position.
            names = [name for name in names if name not in bias]
        fixed = dict(structure.fixed)
        for effect in structure.effects:
            names += [p.name for p in effect.parameters if p.fitted and p.name not in fixed]
        return [name for name in structure.names if name in names]

    def score(self, effects: tuple[Effect, ...], fit: FitResult) -> Scored:
        """Simulate the scoring records with a fitted model; only their initial states are estimated."""
        result = GreyBoxFit(fit.structure, self.scoring, self.scales, self.noise).fit(fit.values, [])
        excess = result.weighted_rms if result.residuals else float("inf")
        return Scored(effects, fit, result.residuals, result.initial_states, excess)


def _bends_the_spring(effect: Effect) -> bool:
    expressions = [e for e in (effect.torque, effect.deflection) if e is not None]
    return any(canonical.x in expression.free_symbols for expression in expressions)


def liveliest(records: Sequence[Record], output: str, n_samples: int = 8000) -> tuple[Record, ...]:
    """Return the stretch of each record in which an output moves most, together about `n_samples` long."""
    share = max(500, n_samples // max(1, len(records)))
    stretches = []
    for record in records:
        if record.n_samples <= share:
            stretches.append(record)
            continue
        energy = np.cumsum((record[output] - np.mean(record[output])) ** 2)
        start = int(np.argmax(energy[share:] - energy[:-share]))
        stretches.append(record.slice(start, start + share))
    return tuple(stretches)


def fit_linear(bench: Workbench, start: Mapping[str, float]) -> Scored:
    """Re-identify the equations without an effect."""
    structure = compose(bench.rig)
    fit = GreyBoxFit(structure, bench.estimation, bench.scales, bench.noise)
    return bench.score((), fit.fit(start, bench.free_parameters(structure)))


def fit_candidates(
    bench: Workbench,
    linear: Scored,
    effects: Iterable[Effect],
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> list[Scored]:
    """Fit and score every effect alone; effects that start from a parent's fit come after it."""
    waiting = [effect for effect in effects if bench.rig.offers(effect)]
    if {s.name for s in bench.rig.motion.stiffness.free_symbols} <= bench.held:
        waiting = [effect for effect in waiting if effect.spring is None and effect.deflection is None]
    done: dict[str, Scored] = {}
    names = {effect.name for effect in waiting}
    while waiting:
        ready = [e for e in waiting if all(p in done or p not in names for p in e.parents)]
        ready = ready or waiting
        waiting = [effect for effect in waiting if effect not in ready]

        def one(effect: Effect) -> Scored:
            scored = fit_candidate(bench, (effect,), linear, done)
            if progress is not None:
                progress(effect.name)
            return scored

        results = Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(effect) for effect in ready)
        done.update({effect.name: scored for effect, scored in zip(ready, results, strict=True)})
    return list(done.values())


def fit_candidate(
    bench: Workbench,
    effects: tuple[Effect, ...],
    base: Scored,
    parents: Mapping[str, Scored],
    hold: frozenset[str] = frozenset(),
) -> Scored:
    """Fit the last of `effects` on top of `base`, from several starts, and score it.

    Parameters
    ----------
    bench
        Records, scales and noise.
    effects
        All effects of the model.
    base
        Scored model with all effects but the last.
    parents
        Scored models of single effects by name, as further start points.
    hold
        Rig parameters to keep at their start.
    """
    added = effects[-1]
    fixed = {name: value for effect in effects for name, value in effect.special_cases.items()}
    scored = _best_of_starts(bench, effects, fixed, list(_starts(bench, added, base, parents)), hold)
    if added.special_cases and scored.excess > _WORTH_RELEASING:
        kept = {name: value for name, value in fixed.items() if name not in added.special_cases}
        released = _best_of_starts(bench, effects, kept, [{**scored.fit.values, **fixed}], hold)
        if released.fit.success and released.excess < scored.excess / 1.02:
            return released
    return scored


def refine(bench: Workbench, models: Sequence[Scored], n_jobs: int = 1) -> list[Scored]:
    """Fit those models to full precision whose held-out error is close to the best."""
    best = min((m.excess for m in models), default=float("inf"))

    def one(model: Scored) -> Scored:
        if not model.excess <= _CONTENDER * best:
            return model
        fit = GreyBoxFit(model.fit.structure, bench.estimation, bench.scales, bench.noise)
        result = fit.fit(model.fit.values, model.fit.free, initial_states=model.fit.initial_states)
        if not result.residuals or result.cost > model.fit.cost * (1.0 + 1e-3):
            return model
        return bench.score(model.effects, result)

    return list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(model) for model in models))


def _best_of_starts(
    bench: Workbench,
    effects: tuple[Effect, ...],
    fixed: Mapping[str, float],
    starts: Sequence[Mapping[str, float]],
    hold: frozenset[str],
) -> Scored:
    structure = compose(bench.rig, effects, fixed)
    free = [name for name in bench.free_parameters(structure) if name not in hold]
    look = GreyBoxFit(structure, bench.look, bench.scales, bench.noise, _LOOK_ACCURACY)
    looks = [
        look.fit(
            start,
            free,
            max_evaluations=_LOOK_EVALUATIONS,
            tolerance=_LOOK_TOLERANCE,
            finish=False,
        )
        for start in starts
    ]
    lowest = min(result.cost for result in looks)
    followed = [result for result in looks if result.cost <= _ALIKE * lowest]
    fit = GreyBoxFit(structure, bench.estimation, bench.scales, bench.noise)
    finals = [
        fit.fit(
            result.values,
            free,
            max_evaluations=_ROUGH_EVALUATIONS,
            tolerance=_ROUGH_TOLERANCE,
        )
        for result in _distinct(followed)
    ]
    finals = [result for result in finals if result.residuals]
    if not finals:
        return Scored(effects, looks[0], (), (), float("inf"))
    return bench.score(effects, min(finals, key=lambda result: result.cost))


def _distinct(looks: Sequence[FitResult]) -> list[FitResult]:
    """Return looks that did not end at the same place, best first."""
    kept: list[FitResult] = []
    for look in sorted(looks, key=lambda result: result.cost):
        values = np.array([look.values[name] for name in look.free])
        others = [np.array([other.values[name] for name in look.free]) for other in kept]
        if not any(np.allclose(values, other, rtol=0.05, atol=1e-12) for other in others):
            kept.append(look)
    return kept[:2]


def _starts(
    bench: Workbench, effect: Effect, base: Scored, parents: Mapping[str, Scored]
) -> Iterable[dict[str, float]]:
    fitted = [p for p in effect.parameters if p.fitted and p.name not in effect.special_cases]
    rest = {p.name: p.default for p in effect.parameters if p not in fitted and p.default is not None}
    if effect.starts:
        for start in effect.starts:
            origin = base if start.parent is None else parents.get(start.parent)
            if origin is not None and origin.fit.residuals:
                yield {**origin.fit.values, **rest, **_evaluated(bench, start.values, origin.fit.values)}
        return
    sizes = [characteristic_value(p.dimension, bench.scales) for p in fitted]
    for combination in itertools.product(*(p.starts for p in fitted)):
        own = {p.name: c * size for p, c, size in zip(fitted, combination, sizes, strict=True)}
        yield {**base.fit.values, **rest, **own}


def _evaluated(
    bench: Workbench, formulas: Mapping[str, sp.Expr], values: Mapping[str, float]
) -> dict[str, float]:
    stiffness = bench.rig.motion.stiffness
    numbers = {
        canonical.k: values[stiffness.name],
        canonical.drive_size: bench.scales["drive"],
        canonical.x_size: bench.scales["x"],
        canonical.v_size: bench.scales["x"] / bench.scales["time"],
    }
    result = {}
    for name, formula in formulas.items():
        own = {s: values[s.name] for s in formula.free_symbols if s not in numbers}
        value = float(formula.subs({**numbers, **own}))
        result[stiffness.name if name == "k" else name] = value
    return result

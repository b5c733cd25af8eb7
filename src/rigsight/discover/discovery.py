"""The whole discovery: records and a rig -> library, sparse regression, held-out selection, polished equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.doubts import doubts, warnings_of
from rigsight.discover.equations import equations
from rigsight.discover.hysteresis import LOOP, LOOPS, ForceEquation, force_equation
from rigsight.discover.library import Candidate, candidates, offered_effects, torque_along
from rigsight.discover.motion import Motion, motion_of
from rigsight.discover.own_regression import own_regression, rows_of
from rigsight.discover.regression import Projected, alike, inclusion_probabilities
from rigsight.discover.result import Alternative, Coefficient, Discovery, Run, Term
from rigsight.discover.selection import (
    STRONG,
    Bench,
    Selection,
    Trial,
    criterion,
    next_terms,
    proposals,
    select,
)
from rigsight.discover.weak_form import Rows
from rigsight.errors import InputError, SimulationError
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales, linear_start
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.simulate.model import Model

Method = Literal["full", "discrepancy"]
METHODS: tuple[Method, ...] = ("discrepancy", "full")
_LEAST_SAMPLES = 200
_HELD_BACK = 0.3
_SAME_COLUMN = 0.999
_FINAL_EVALUATIONS = 150
_CLEARLY_OFF = 3.0
"""Standard errors from its special value at which an exponent is released."""
_ENSEMBLE_TERMS = 6
_SAME_REST = 1e-5
"""Shift of the rest position, in units of the motion, that changes no column."""


@dataclass(frozen=True)
class Task:
    """What is to be discovered.

    Attributes
    ----------
    title
        For people.
    rig
        The rig.
    constants
        Every constant of the rig.
    records
        Estimation and validation records, cut into windows where the rig drifts.
    noise
        Noise floor of each output.
    no_spring
        True for an axis that has none.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    records: tuple[Record, ...]
    noise: Mapping[str, float]
    no_spring: bool = False


def discover(
    task: Task,
    method: Method = "discrepancy",
    pointwise: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Discovery:
    """Discover the governing equations behind records.

    Parameters
    ----------
    task
        Records and rig.
    method
        ``"full"``: the whole acceleration is regressed, the rig's damper competes with every other term.
        ``"discrepancy"``: the rig's own terms stand, what they leave is regressed.
    pointwise
        Regress sample by sample instead of in the weak form.
    seed
        Seed of the ensembles.
    progress
        Called with a short text when a stage or support is done.

    Raises
    ------
    InputError
        If there is no estimation record, one is too short, or none moves the rig.
    SimulationError
        If the rig's own equations cannot be simulated near the records.
    """
    say = progress or (lambda _: None)
    rng = np.random.default_rng(seed)
    estimation, held_out, how = _split(task)
    values = _linear_values(task, estimation)
    scales = characteristic_scales(task.rig, estimation, values)
    output = task.rig.outputs[0].name
    motions = [motion_of(task.rig, record, values, task.noise[output]) for record in estimation]
    say("motion smoothed")
    rows = rows_of(motions, scales["time"], pointwise)
    projected = own_regression(task.rig, task.no_spring, motions, rows)
    library = _library(task, motions, rows, projected, scales)
    library, same = _distinct(library, projected)
    say("library")
    bench = Bench(
        rig=task.rig,
        estimation=tuple(_without_downstream(task.rig, record) for record in estimation),
        held_out=tuple(_without_downstream(task.rig, record) for record in held_out),
        values=values,
        scales=scales,
        noise=task.noise,
        held=_held(task),
        candidates={candidate.name: candidate for candidate in library},
        projected=projected,
        own_terms=_own_terms(task, projected) if method == "full" else {},
    )
    selection = select(bench, say)
    if not math.isfinite(selection.best.excess):
        raise SimulationError(
            f"The equations of {task.rig.name} cannot be simulated near these records: {selection.best.fit.message}"
        )
    chosen = _without_damper(bench, selection, say)
    final, held = _polished(task, bench, chosen)
    # A record that was set aside is fitted by the polish as well: only the equation before it has not seen it.
    judged = chosen if how else bench.scored(chosen.support, final)
    if not math.isfinite(judged.excess):
        raise SimulationError("The polished equations cannot be simulated on the held-out records.")
    say("polished")
    inclusion = _inclusion(task, bench, selection, final, motions, rows, rng)
    force = _force_equation(bench, final, motions, rows, rng)
    say("ensembles")
    found = _Found(estimation, held_out, how, selection, chosen, judged, final, inclusion, force, same, held)
    return _assembled(task, method, pointwise, bench, found)


def _split(task: Task) -> tuple[tuple[Record, ...], tuple[Record, ...], str]:
    """Return the records to fit, those to score, and in words how the latter were found."""
    estimation = tuple(r for r in task.records if r.role == "estimation")
    validation = tuple(r for r in task.records if r.role == "validation")
    if not estimation:
        raise InputError('A discovery needs at least one record with role = "estimation".')
    for record in estimation:
        if record.n_samples < _LEAST_SAMPLES:
            raise InputError(
                f"Record '{record.name}' has {record.n_samples} samples; a discovery needs at least {_LEAST_SAMPLES} in each."
            )
    if validation:
        return estimation, validation, ""
    if len(estimation) > 1:
        middle = sorted(estimation, key=lambda r: float(np.std(r[task.rig.inputs[0].name])))[
            len(estimation) // 2
        ]
        rest = tuple(record for record in estimation if record is not middle)
        return (
            rest,
            (middle,),
            f"No record is for validation; '{middle.name}' was set aside to choose the terms.",
        )
    cut = int((1.0 - _HELD_BACK) * estimation[0].n_samples)
    return (
        (estimation[0].slice(0, cut),),
        (replace(estimation[0].slice(cut, None), name=f"{estimation[0].name} (end)"),),
        "There is a single record; its last part was set aside to choose the terms, which judges no other amplitude.",
    )


def _linear_values(task: Task, estimation: Sequence[Record]) -> dict[str, float]:
    known = {"k": 0.0} if task.no_spring else {}
    return {**task.constants, **linear_start(task.rig, estimation, task.constants, known)}


def _held(task: Task) -> frozenset[str]:
    """Return what no fit moves while terms are chosen: what the motion knows nothing of, and one of two rests."""
    motion = task.rig.motion
    held = set(task.rig.downstream_parameters)
    if task.rig.is_driven:
        # A linear spring cannot tell a constant force from a shifted rest position.
        rest, bias = motion.rest.free_symbols, motion.bias.free_symbols
        held |= {symbol.name for symbol in (rest if task.no_spring else bias)}
    if task.no_spring:
        held.add(motion.stiffness.name)
    return frozenset(held)


def _without_downstream(rig: Rig, record: Record) -> Record:
    """Return a record without the outputs that the motion knows nothing of."""
    keep = {rig.inputs[0].name, rig.outputs[0].name}
    return replace(record, signals={name: s for name, s in record.signals.items() if name in keep})


def _library(
    task: Task, motions: Sequence[Motion], rows: Rows, projected: Projected, scales: Mapping[str, float]
) -> list[Candidate]:
    effects = offered_effects(task.rig, not task.no_spring)
    found = candidates(effects, motions, rows, projected, scales, task.rig.is_driven)
    return [c for c in found if np.all(np.isfinite(c.column)) and np.any(c.column)]


def _distinct(
    library: Sequence[Candidate], projected: Projected
) -> tuple[list[Candidate], dict[str, list[str]]]:
    """Leave out terms that these records cannot tell from an earlier one; return the rest, and who stands for whom."""
    if not library:
        return [], {}
    columns = np.column_stack([candidate.column for candidate in library])
    stands_for: dict[str, list[str]] = {}
    dropped: set[int] = set()
    for i, j, _ in alike(projected, columns, _SAME_COLUMN):
        # A loop may turn into friction or damping, not the other way round: the simpler term stands for it.
        loops = [library[k].name in LOOPS for k in (i, j)]
        first, second = (j, i) if loops == [True, False] else (i, j)
        if first not in dropped and second not in dropped:
            dropped.add(second)
            stands_for.setdefault(library[first].name, []).append(library[second].name)
    return [candidate for i, candidate in enumerate(library) if i not in dropped], stands_for


def _own_terms(task: Task, projected: Projected) -> dict[str, NDArray[np.float64]]:
    """Return the columns of the rig's damper and spring, which compete in the full form."""
    motion = task.rig.motion
    first = 1 if task.rig.is_driven else 0
    own = {motion.damping.name: projected.base[:, first]}
    if not task.no_spring:
        own[motion.stiffness.name] = projected.base[:, first + 1]
    return own


def _without_damper(bench: Bench, selection: Selection, say: Callable[[str], None]) -> Trial:
    """Let the rig's own damper go in the full form, where the held-out records do not miss it."""
    chosen = selection.best
    damping = bench.rig.motion.damping.name
    if damping not in bench.own_terms:
        return chosen
    special = {name for effect in chosen.fit.structure.effects for name in effect.special_cases}
    without = bench.trial(
        chosen.support,
        release=frozenset(special - set(dict(chosen.fit.structure.fixed))),
        start={**dict(chosen.fit.structure.fixed), **chosen.fit.values, damping: 0.0},
        left_out=frozenset({damping}),
    )
    say(f"without {damping}")
    worse = criterion(without, selection.independent) - criterion(chosen, selection.independent)
    return without if worse < STRONG else chosen


@dataclass(frozen=True, eq=False)
class _Found:
    """What the stages of a discovery hand on."""

    estimation: tuple[Record, ...]
    held_out: tuple[Record, ...]
    how: str
    selection: Selection
    chosen: Trial
    judged: Trial
    final: FitResult
    inclusion: Mapping[str, float]
    force: ForceEquation | None
    same: Mapping[str, list[str]]
    held: str


def _polished(task: Task, bench: Bench, chosen: Trial) -> tuple[FitResult, str]:
    """Fit the chosen structure once more, all outputs and all records that may be fitted, to full precision.

    A special value (an exponent of 1) is released as well: where the fit leaves it clearly, the intervals of everything else
    would be wrong with it. Returns the fit and, where the special value was kept, a note on how well it is known.
    """
    records = tuple(record for record in task.records if record.role == "estimation")
    rig = task.rig
    free = set(chosen.fit.free)
    measured = {name for record in records for name in record.signals}
    if any(symbol.name in measured for symbol in rig.downstream):
        free |= rig.downstream_parameters

    def fitted(structure: Structure, start: Mapping[str, float], moved: set[str]) -> FitResult:
        return GreyBoxFit(structure, records, bench.scales, bench.noise).fit(
            start, [name for name in structure.names if name in moved], max_evaluations=_FINAL_EVALUATIONS
        )

    special = {name: value for e in chosen.fit.structure.effects for name, value in e.special_cases.items()}
    start = {**special, **dict(chosen.fit.structure.fixed), **chosen.fit.values}
    fit = fitted(bench.structure(chosen.support, frozenset(special)), start, free | set(special))
    if not math.isfinite(fit.cost):
        fit = fitted(chosen.fit.structure, chosen.fit.values, free)
        if not math.isfinite(fit.cost):
            raise SimulationError(f"The discovered equations cannot be fitted to all records: {fit.message}")
        return fit, ""
    known = {name: (fit.values[name], fit.standard_errors[name]) for name in special}
    if not special or any(abs(v - special[n]) > _CLEARLY_OFF * error for n, (v, error) in known.items()):
        return fit, ""
    held = fitted(compose(rig, chosen.fit.structure.effects, special), fit.values, free - set(special))
    if not math.isfinite(held.cost):
        return fit, ""
    told = ", ".join(f"{name} = {value:.4g} +/- {error:.2g}" for name, (value, error) in known.items())
    kept = ", ".join(f"{name} = {value:g}" for name, value in special.items())
    return held, f"{kept} is held; released, the fit says {told}, and the other coefficients move with it."


def _inclusion(
    task: Task,
    bench: Bench,
    selection: Selection,
    final: FitResult,
    motions: Sequence[Motion],
    rows: Rows,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Return the inclusion probability of the terms that came near the equation, and of the rig's own in the full form.

    The columns are taken about the rest position of the polished equation: about any other, a cubic spring shows a square.
    """
    polished = [name for trial in selection.trials for name in sorted(trial.support)]
    proposed = [name for support in proposals(bench) for name in sorted(support)]
    shares = {n: bench.projected.explained(c.column[:, None])[1] for n, c in bench.candidates.items()}
    ranked = sorted(shares, key=lambda name: -shares[name])
    kept = set(final.structure.effect_names)
    # An effect that contains a kept one as a special case explains whatever that does, and would only share its draws.
    offered_terms = [
        name
        for name in dict.fromkeys((*polished, *proposed, *ranked))
        if name in kept or not kept & _ancestors(bench, name)
    ]
    names = offered_terms[:_ENSEMBLE_TERMS]
    shift = _rest_shift(bench, final)
    if abs(shift) < _SAME_REST * bench.scales["x"]:
        shift = 0.0
    moved = [replace(m, x=m.x - shift, measured=m.measured - shift) for m in motions] if shift else motions
    projected = own_regression(task.rig, task.no_spring, moved, rows) if shift else bench.projected
    own_terms = _own_terms(task, projected) if bench.own_terms else {}
    library = [bench.candidates[name] for name in names]
    if shift:
        # The loop does not know where rest is.
        loops = [candidate for candidate in library if candidate.name in LOOPS]
        effects = [candidate.effect for candidate in library if candidate.name not in LOOPS]
        library = loops + candidates(effects, moved, rows, projected, bench.scales, task.rig.is_driven)
    again = replace(
        bench,
        candidates={candidate.name: candidate for candidate in library},
        projected=projected,
        own_terms=own_terms,
    )
    offered = [*own_terms, *again.candidates]
    if not offered:
        return {}
    columns = np.column_stack([again.column(name) for name in offered])
    found = inclusion_probabilities(again.sparse, columns, rng)
    return dict(zip(offered, map(float, found), strict=True))


def _ancestors(bench: Bench, name: str) -> set[str]:
    """Return the effects that a term has as special or limiting cases, and theirs."""
    parents = [parent for parent in bench.candidates[name].effect.parents if parent in bench.candidates]
    return set(parents).union(*(_ancestors(bench, parent) for parent in parents))


def _rest_shift(bench: Bench, final: FitResult) -> float:
    """Return how far the polished rest position lies from the one that the motion was smoothed about."""
    motion = bench.rig.motion
    if not bench.rig.is_driven:
        return 0.0
    return sum(final.values[s.name] - bench.values[s.name] for s in motion.rest.free_symbols)


def _force_equation(
    bench: Bench, final: FitResult, motions: Sequence[Motion], rows: Rows, rng: np.random.Generator
) -> ForceEquation | None:
    """Regress the equation of the hysteretic force that the polished model leaves as a residual of the measured motion."""
    rig, values = bench.rig, {**dict(final.structure.fixed), **final.values}
    loops = [effect for effect in final.structure.effects if effect.name == LOOP]
    if not loops or not rig.is_driven:
        return None
    others = [e for e in final.structure.effects if e.name != LOOP]
    if any(effect.torque is None for effect in others):
        return None
    motion = rig.motion

    def number(expression: sp.Expr) -> float:
        return float(expression.subs({s: values[s.name] for s in expression.free_symbols}))

    without_memory = values[final.structure.parameter_name(loops[0], "a")] * number(motion.stiffness)
    shift = _rest_shift(bench, final)
    forces = []
    for own in motions:
        force = (
            number(motion.drive_gain) * own.u
            + number(motion.bias)
            - number(motion.inertia) * own.acceleration
        )
        force -= number(motion.damping) * own.v + without_memory * (own.x - shift)
        for effect in others:
            force -= torque_along(effect, final.structure.values_of(effect, values), own)
        forces.append(force)
    n = values[final.structure.parameter_name(loops[0], "n")]
    return force_equation(motions, rows, forces, n, rng)


def _assembled(task: Task, method: Method, pointwise: bool, bench: Bench, found: _Found) -> Discovery:
    rig, final, selection = task.rig, found.final, found.selection
    output = rig.outputs[0].name
    structure = final.structure
    constants = {p.name for p in rig.constants}
    numbers = {n: v for n, v in final.values.items() if n not in final.free and n not in constants}
    text, latex = equations(structure, numbers)
    own = {p.name for p in rig.parameters}
    units = {p.name: p.unit for p in structure.parameters}
    coefficients = {
        name: Coefficient(final.values[name], final.standard_errors[name], units[name]) for name in final.free
    }
    terms = _terms(bench, found, coefficients)
    measured = np.concatenate([record[output] for record in found.held_out])
    size = float(np.std(measured)) or 1.0
    warnings = warnings_of(
        task,
        found.estimation,
        found.held_out,
        found.how,
        selection,
        found.chosen,
        found.judged.excess,
        terms,
        found.held,
        found.force,
        task.noise[output] / size,
        next(iter(next_terms(bench, found.chosen.support)), ""),
    )
    return Discovery(
        title=task.title,
        rig=rig.name,
        method=method,
        form="pointwise" if pointwise else "weak",
        equations=text,
        latex=latex,
        rig_parameters={name: c for name, c in coefficients.items() if name in own},
        terms=terms,
        alternatives=tuple(_alternative(trial, selection) for trial in selection.trials),
        force_equation={} if found.force is None else dict(found.force.inclusion),
        held_out=tuple(record.name for record in found.held_out),
        held_out_error=found.judged.excess,
        held_out_nrmse=found.judged.excess * task.noise[output] / size,
        noise_floor=task.noise[output] / size,
        independent=selection.independent,
        runs=_runs(bench, found, output),
        output=output,
        unit=rig.outputs[0].unit,
        model=Model.of(structure, final.values, found.estimation[0].hold).to_json(),
        warnings=warnings,
    )


def _terms(bench: Bench, found: _Found, coefficients: Mapping[str, Coefficient]) -> tuple[Term, ...]:
    structure = found.final.structure
    kept = {effect.name for effect in structure.effects}
    terms = []
    for name in bench.own_terms:
        stays = name in coefficients
        own = {name: coefficients[name]} if stays else {}
        terms.append(Term(name, "The rig's own.", stays, found.inclusion.get(name, 0.0), own))
    for effect in structure.effects:
        names = [structure.parameter_name(effect, p.name) for p in effect.parameters]
        own = {name: coefficients[name] for name in names if name in coefficients}
        terms.append(
            Term(
                effect.name, effect.summary, True, found.inclusion.get(effect.name, 0.0), own,
                doubts(effect, own, found.inclusion.get(effect.name, 0.0), found.same.get(effect.name, [])),
            )
        )  # fmt: skip
    rest = sorted(set(found.inclusion) - kept - set(bench.own_terms), key=lambda n: -found.inclusion[n])
    terms += [Term(n, bench.candidates[n].effect.summary, False, found.inclusion[n], {}) for n in rest]
    return tuple(terms)


def _alternative(trial: Trial, selection: Selection) -> Alternative:
    bic = criterion(trial, selection.independent)
    aic = bic - trial.n_free * (math.log(selection.independent) - 2.0)
    return Alternative(tuple(sorted(trial.support)), trial.n_free, trial.excess, aic, bic)


def _runs(bench: Bench, found: _Found, output: str) -> tuple[Run, ...]:
    """Return the free runs of the chosen model on the held-out records."""
    ends = np.cumsum([record.n_samples for record in found.held_out])
    parts = np.split(found.judged.residuals * bench.noise[output], ends[:-1])
    return tuple(
        Run(record.name, record.role, record.t, record[output], record[output] - error)
        for record, error in zip(found.held_out, parts, strict=True)
    )

"""The whole discovery: records and a rig -> library, sparse regression, held-out selection, refitted equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from rigsight.discover.assembly import Found, assembled
from rigsight.discover.bench import Attempt, Bench, Trial
from rigsight.discover.ensembles import inclusion, regressed_force
from rigsight.discover.joints.joint_discovery import discover_at_joints
from rigsight.discover.motion import motion_of
from rigsight.discover.regression import STRONG, Projected, Regressed, RegressionData, alike, own_terms, split
from rigsight.discover.result import Discovery
from rigsight.discover.selection import Selection, criterion, select
from rigsight.discover.terms.hysteresis import is_loop
from rigsight.discover.terms.library import Candidate, candidates, offered_effects
from rigsight.effects import Place
from rigsight.errors import InputError, SimulationError
from rigsight.identify import (
    FitResult,
    GreyBoxFit,
    IdleThreads,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
    without_offsets,
)
from rigsight.records.record import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, special_values

Method = Literal["full", "discrepancy"]
METHODS: tuple[Method, ...] = ("discrepancy", "full")
_SAME_COLUMN = 0.999
_FINAL_EVALUATIONS = 150
_CLEARLY_OFF = 3.0
"""Standard errors from its special value at which an exponent is released."""


def discover(
    data: RegressionData,
    method: Method = "discrepancy",
    pointwise: bool = False,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    n_jobs: int = 1,
) -> Discovery:
    """Discover the governing equations of a rig from records.

    The method ``"full"`` regresses the whole acceleration, where the rig's damper competes with every other term;
    ``"discrepancy"`` keeps the rig's own terms and regresses their residual, the only form for a rig of several joints.
    Point-wise rows, instead of the weak form, are not for such a rig either. The seed is that of the ensembles; the result is
    the same with any number of jobs.
    """
    if not data.rig.mechanism.joints:
        raise InputError(
            f"The rig '{data.rig.name}' has no joint, so no force is missing in it. Use 'rigsight diagnose', which tries effects "
            "of its sensors."
        )
    if not data.rig.has_one_motion:
        if method != "discrepancy" or pointwise:
            raise InputError(
                f"The rig '{data.rig.name}' has several joints: missing forces are found by regression on its responses, in the "
                f"discrepancy form. The full form and point-wise rows are available only for rigs with one motion."
            )
        return discover_at_joints(data, seed, progress, n_jobs)
    say = progress or (lambda _: None)
    threads = IdleThreads(n_jobs)
    rng = np.random.default_rng(seed)
    estimation, held_out, how = split(data)
    values = _linear_values(data, estimation)
    scales = characteristic_scales(data.rig, estimation, values)
    output = data.rig.outputs[0].name
    # Outputs that do not affect the motion would otherwise be simulated in every fit.
    alone = tuple(_without_downstream(data.rig, record) for record in estimation)
    swallowed, centered = _offsets_found(data, alone, values, scales, _held(data))
    motions = threads.results(
        lambda index: motion_of(data.rig, centered[index], values, data.noise[output]),
        [record.n_samples for record in estimation],
    )
    say("motion smoothed")
    regressed = Regressed.of(data.rig, data.has_stiffness, motions, scales, pointwise, threads)
    projected = regressed.projected
    library, same = _distinct(_library(data, regressed), projected)
    say("library")
    bench = Bench(
        rig=data.rig.motion_alone(),
        estimation=alone,
        held_out=tuple(_without_downstream(data.rig, record) for record in held_out),
        values=values,
        scales=scales,
        noise=data.noise,
        held=_held(data) | swallowed,
        candidates={candidate.name: candidate for candidate in library},
        projected=projected,
        own_terms=own_terms(data.rig, data.has_stiffness, projected) if method == "full" else {},
        threads=threads,
    )
    selection = select(bench, say)
    chosen = _without_damper(bench, selection, say)
    final, held = _polished(data, bench, chosen)
    # A record that was set aside is used in the final fit too: it is unseen only for the selection of the equation.
    judged = chosen if how else bench.scored(chosen.support, final)
    if math.isfinite(judged.error_over_noise) and judged.residuals.size == 0:
        # A short equation may be chosen although its error is so far above that of a longer one that its score stayed rough.
        judged = bench.scored(chosen.support, judged.fit)
    if not math.isfinite(judged.error_over_noise):
        raise SimulationError("The refitted equations cannot be simulated on the held-out records.")
    say("polished")
    included = inclusion(data, bench, selection, final, regressed, rng)
    force = regressed_force(bench, final, regressed, rng)
    say("ensembles")
    found = Found(estimation, held_out, how, selection, chosen, judged, final, included, force, same, held)
    return assembled(data, method, pointwise, bench, found)


def _linear_values(data: RegressionData, estimation: Sequence[Record]) -> dict[str, float]:
    known = {} if data.has_stiffness else {"k": 0.0}
    return {
        **data.campaign.constants,
        **linear_start(data.rig, estimation, data.campaign.constants, {**known, **data.held}),
    }


def _held(data: RegressionData) -> frozenset[str]:
    """Return parameters held during selection: those without effect on the motion, and constant force or rest position."""
    motion = data.rig.motion
    held = {*data.rig.downstream_parameters, *data.held}
    if data.rig.is_driven:
        # With a linear spring, a constant force and a shifted rest position cannot be distinguished.
        rest, bias = motion.rest.free_symbols, motion.bias.free_symbols
        held |= {symbol.name for symbol in (bias if data.has_stiffness else rest)}
    if not data.has_stiffness:
        held.add(motion.stiffness.name)
    return frozenset(held)


def _offsets_found(
    data: RegressionData,
    records: Sequence[Record],
    values: Mapping[str, float],
    scales: Mapping[str, float],
    held: frozenset[str],
) -> tuple[frozenset[str], Sequence[Record]]:
    """Return the parameters that the records' offsets can replace, and the records without the offsets of a first fit."""
    if not any(record.free_offsets for record in records):
        return frozenset(), records
    structure = compose(data.rig.motion_alone())
    asked = [p.name for p in data.rig.parameters if p.name in structure.names and p.name not in held]
    known = {name: values[name] for name in structure.names}
    swallowed = frozenset(swallowed_by_offsets(structure, records, scales, data.noise, known, asked))
    free = [name for name in asked if name not in swallowed]
    fit = GreyBoxFit(structure, records, scales, data.noise).fit(known, free, finish=False)
    return swallowed, without_offsets(records, fit)


def _without_downstream(rig: Rig, record: Record) -> Record:
    """Return a record without the outputs that do not affect the motion."""
    keep = {rig.inputs[0].name, rig.outputs[0].name}
    return replace(record, signals={name: s for name, s in record.signals.items() if name in keep})


def _library(data: RegressionData, regressed: Regressed) -> list[Candidate]:
    effects = offered_effects(data.rig, data.has_stiffness)
    if all(is_constant(motion.u) for motion in regressed.motions):
        effects = [effect for effect in effects if effect.place is not Place.ACTUATOR]
    found = candidates(effects, regressed)
    return [c for c in found if np.all(np.isfinite(c.column)) and np.any(c.column)]


def _distinct(
    library: Sequence[Candidate], projected: Projected
) -> tuple[list[Candidate], dict[str, list[str]]]:
    """Leave out terms that these records do not distinguish from an earlier one; return the rest, and the terms each replaces."""
    if not library:
        return [], {}
    columns = np.column_stack([candidate.column for candidate in library])
    stands_for: dict[str, list[str]] = {}
    dropped: set[int] = set()
    for i, j, _ in alike(projected, columns, _SAME_COLUMN):
        # A loop may degenerate to friction or damping, but not vice versa: the simpler term represents it.
        loops = [is_loop(library[k].effect) for k in (i, j)]
        first, second = (j, i) if loops == [True, False] else (i, j)
        if first not in dropped and second not in dropped:
            dropped.add(second)
            stands_for.setdefault(library[first].name, []).append(library[second].name)
    return [candidate for i, candidate in enumerate(library) if i not in dropped], stands_for


def _without_damper(bench: Bench, selection: Selection, say: Callable[[str], None]) -> Trial:
    """In the full form, leave out the rig's own damper if the held-out error does not rise significantly without it."""
    chosen = selection.best
    damping = bench.rig.motion.damping.name
    if damping not in bench.own_terms:
        return chosen
    special = {(e.name, own) for e in chosen.fit.structure.effects for own in e.special_cases}
    without = bench.trial(
        Attempt(
            chosen.support,
            release=frozenset(special - chosen.fit.structure.special_cases),
            start={**dict(chosen.fit.structure.fixed), **chosen.fit.values, damping: 0.0},
            left_out=frozenset({damping}),
        )
    )
    say(f"without {damping}")
    worse = criterion(without, selection.independent) - criterion(chosen, selection.independent)
    return without if worse < STRONG else chosen


def _polished(data: RegressionData, bench: Bench, chosen: Trial) -> tuple[FitResult, str]:
    """Fit the chosen structure once more to full precision, with all outputs and all estimation records.

    Special values (an exponent of 1) are released as well: if the fitted value clearly differs, the intervals of all other
    coefficients would be wrong with it. Returns the fit and, if the special value was kept, a note on its uncertainty.
    """
    records = tuple(record for record in data.records if record.role == "estimation")
    rig = data.rig
    free = set(chosen.fit.free)
    measured = {name for record in records for name in record.signals}
    if any(symbol.name in measured for symbol in rig.downstream):
        start = {p: bench.values[p] for p in compose(rig).names}
        free |= rig.downstream_parameters
        free -= set(
            swallowed_by_offsets(
                compose(rig), records, bench.scales, bench.noise, start, sorted(free & start.keys())
            )
        )

    def fitted(structure: Structure, start: Mapping[str, float], moved: set[str]) -> FitResult:
        return GreyBoxFit(structure, records, bench.scales, bench.noise, threads=bench.threads).fit(
            start, [name for name in structure.names if name in moved], max_evaluations=_FINAL_EVALUATIONS
        )

    special = special_values(rig, chosen.fit.structure.effects)
    start = {**special, **dict(chosen.fit.structure.fixed), **chosen.fit.values}
    effects = chosen.fit.structure.effects
    fit = fitted(compose(rig, effects), start, free | set(special))
    if not math.isfinite(fit.cost):
        fit = fitted(compose(rig, effects, dict(chosen.fit.structure.fixed)), chosen.fit.values, free)
        if not math.isfinite(fit.cost):
            raise SimulationError(f"The discovered equations cannot be fitted to all records: {fit.message}")
        return fit, ""
    known = {name: (fit.values[name], fit.standard_errors[name]) for name in special}
    if not special or any(abs(v - special[n]) > _CLEARLY_OFF * error for n, (v, error) in known.items()):
        return fit, ""
    held = fitted(compose(rig, effects, special), fit.values, free - set(special))
    if not math.isfinite(held.cost):
        return fit, ""
    reported = ", ".join(f"{name} = {value:.4g} +/- {error:.2g}" for name, (value, error) in known.items())
    kept = ", ".join(f"{name} = {value:g}" for name, value in special.items())
    return (
        held,
        f"{kept} is held; if released, the fit gives {reported}, and the other coefficients change with it.",
    )

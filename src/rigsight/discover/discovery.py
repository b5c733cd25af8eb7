"""The whole discovery: records and a rig -> library, sparse regression, held-out selection, refitted equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from rigsight.discover.assembly import Found, assembled
from rigsight.discover.bench import Attempt, Bench, Trial
from rigsight.discover.each_joint import EachJoint
from rigsight.discover.one_motion import OneMotion
from rigsight.discover.regression import STRONG, RegressionData, split
from rigsight.discover.result import Discovery
from rigsight.discover.selection import Selection, criterion, select
from rigsight.errors import InputError, SimulationError
from rigsight.identify import (
    FitResult,
    GreyBoxFit,
    IdleThreads,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
)
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, special_values

Method = Literal["full", "discrepancy"]
METHODS: tuple[Method, ...] = ("discrepancy", "full")
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
    one_motion = data.rig.has_one_motion
    if not one_motion and (method != "discrepancy" or pointwise):
        raise InputError(
            f"The rig '{data.rig.name}' has several joints: missing forces are found by regression on its responses, in the "
            f"discrepancy form. The full form and point-wise rows are available only for rigs with one motion."
        )
    say = progress or (lambda _: None)
    threads = IdleThreads(n_jobs)
    rng = np.random.default_rng(seed)
    estimation, held_out, how = split(data)
    values = _linear_values(data, estimation)
    bench = Bench(
        rig=data.rig.motion_alone() if one_motion else data.rig,
        # Outputs that do not affect the motion would otherwise be simulated in every fit.
        estimation=tuple(_without_downstream(data.rig, record) for record in estimation),
        held_out=tuple(_without_downstream(data.rig, record) for record in held_out),
        values=values,
        scales=characteristic_scales(data.rig, estimation, values),
        noise=data.noise,
        held=_held(data),
        threads=threads,
    )
    front = (
        OneMotion.of(data, bench, method == "full", pointwise) if one_motion else EachJoint.of(data, bench)
    )
    say("library")
    selection = select(front.begun, say, front.about)
    bench = selection.bench
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
    examined = front.examined(bench, selection, final, rng)
    say("ensembles")
    found = Found(estimation, held_out, how, selection, chosen, judged, final, examined, front.same, held)
    return assembled(data, method, "pointwise" if pointwise else front.form, found)


def _linear_values(data: RegressionData, estimation: Sequence[Record]) -> dict[str, float]:
    known = {} if data.has_stiffness else {"k": 0.0}
    return {
        **data.campaign.constants,
        **linear_start(data.rig, estimation, data.campaign.constants, {**known, **data.held}),
    }


def _held(data: RegressionData) -> frozenset[str]:
    """Return parameters held during selection: those without effect on the motion, and constant force or rest position."""
    if not data.rig.has_one_motion:
        return frozenset({p.name for p in data.rig.parameters if not p.fitted} | {*data.held})
    motion = data.rig.motion
    held = {*data.rig.downstream_parameters, *data.held}
    if data.rig.is_driven:
        # With a linear spring, a constant force and a shifted rest position cannot be distinguished.
        rest, bias = motion.rest.free_symbols, motion.bias.free_symbols
        held |= {symbol.name for symbol in (bias if data.has_stiffness else rest)}
    if not data.has_stiffness:
        held.add(motion.stiffness.name)
    return frozenset(held)


def _without_downstream(rig: Rig, record: Record) -> Record:
    """Return a record without the outputs that do not affect the motion."""
    if not rig.has_one_motion:
        return record
    keep = {rig.inputs[0].name, rig.outputs[0].name}
    return replace(record, signals={name: s for name, s in record.signals.items() if name in keep})


def _without_damper(bench: Bench, selection: Selection, say: Callable[[str], None]) -> Trial:
    """In the full form, leave out the rig's own damper if the held-out error does not rise significantly without it."""
    chosen = selection.best
    if not bench.own_terms:
        return chosen
    damping = bench.rig.motion.damping.name
    special = {(e.name, own) for e in chosen.fit.structure.effects for own in e.special_cases}
    without = bench.trial(
        Attempt(
            chosen.support,
            release=frozenset(special - chosen.fit.structure.special_cases),
            start={**chosen.fit.all_values, damping: 0.0},
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
    if rig.has_one_motion and any(symbol.name in measured for symbol in rig.downstream):
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
    start = {**special, **chosen.fit.all_values}
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

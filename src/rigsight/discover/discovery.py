"""The whole discovery: records and a rig -> regression along the motion, held-out selection, refitted equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.discover.along_motion import AlongMotion
from rigsight.discover.assembly import Found, assembled
from rigsight.discover.bench import Attempt, Bench, Trial
from rigsight.discover.own_laws import offered_shape
from rigsight.discover.records import DiscoveryData, split
from rigsight.discover.result import Discovery
from rigsight.discover.selection import BY_NOISE, select
from rigsight.discover.terms import offered_terms
from rigsight.effects import Effect
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
from rigsight.metrics import rms
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, special_values

_FINAL_EVALUATIONS = 150
_CLEARLY_OFF = 3.0
"""Standard errors from its special value at which an exponent is released."""


def discover(
    data: DiscoveryData,
    own_effects: Sequence[Effect] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    n_jobs: int = 1,
) -> Discovery:
    """Discover the governing equations of a rig from records.

    The rig's own terms are kept; what they leave of the force along the motion is regressed on the terms of all effects. The seed
    is that of the ensembles; the result is the same with any number of jobs.
    """
    if not data.rig.mechanism.joints:
        raise InputError(
            f"The rig '{data.rig.name}' has no joint, so no force is missing in it. Use 'rigsight diagnose', which tries effects "
            "of its sensors."
        )
    say = progress or (lambda _: None)
    estimation, held_out, how = split(data)
    # Parameters of effects that are modelled are as they were given.
    values = {**data.campaign.given, **_linear_values(data, estimation)}
    rig = data.rig.motion_alone() if data.rig.has_one_motion else data.rig
    modelled = data.campaign.modelled
    offered = [e for e in offered_terms(rig, own_effects) if e.name not in {m.name for m in modelled}]
    bench = Bench(
        rig=rig,
        # Outputs that do not affect the motion would otherwise be simulated in every fit.
        estimation=tuple(_without_downstream(data.rig, record) for record in estimation),
        held_out=tuple(_without_downstream(data.rig, record) for record in held_out),
        values=values,
        scales=characteristic_scales(data.rig, estimation, values),
        noise=data.noise,
        held=_held(data),
        effects={effect.name: effect for effect in offered},
        modelled=modelled,
        threads=IdleThreads(n_jobs),
    )
    bench = replace(bench, held=bench.held | _swallowed(bench))
    along = _along(data, bench, bench.estimation, bench.values)
    starts = [bench.values] if along is None else [bench.values, {**bench.values, **along.numbers}]
    (linear,) = bench.trials_of([Attempt(frozenset(), starts)])
    if math.isfinite(linear.fit.cost) and any(record.free_offsets for record in estimation):
        along = _along(data, bench, without_offsets(bench.estimation, linear.fit), linear.fit.values)
    say("regression along the motion")
    selection = select(bench, linear, along, say)
    chosen = selection.best
    final, held = _polished(data, bench, chosen)
    # A record that was set aside is used in the final fit too: it is unseen only for the selection of the equation.
    judged = chosen if how else bench.scored(chosen.support, final)
    if math.isfinite(judged.error_over_noise) and judged.residuals.size == 0:
        # A short equation may be chosen although its error is so far above that of a longer one that its score stayed rough.
        judged = bench.scored(chosen.support, judged.fit)
    if not math.isfinite(judged.error_over_noise):
        raise SimulationError("The refitted equations cannot be simulated on the held-out records.")
    check_predicts(judged.error_over_noise, bench.rig.name, bench.held_out, bench.noise)
    say("polished")
    inclusion = {} if along is None else along.inclusion(final, np.random.default_rng(seed))
    say("ensembles")
    shape = None
    if along is not None and judged.error_over_noise > BY_NOISE:
        shape = offered_shape(bench, along, chosen, say)
    found = Found(estimation, held_out, how, bench, selection, judged, final, along, inclusion, held, shape)
    return assembled(data, found)


def check_predicts(error: float, rig: str, held_out: Sequence[Record], noise: Mapping[str, float]) -> None:
    """Refuse equations that say less of the held-out records than their means do, for another reason than noise."""
    apart = [
        (record[name] - np.mean(record[name])) / floor
        for record in held_out
        for name, floor in noise.items()
        if name in record
    ]
    of_means = rms(np.concatenate(apart))
    if error > max(of_means, BY_NOISE):
        raise SimulationError(
            f"In free run the best equation of {rig} leaves {error:.3g} times the noise floor on the held-out "
            f"records; their means alone leave {of_means:.3g}. A rig that is unstable without its controller leaves every free "
            "run. Use 'rigsight diagnose', whose fits follow the sensors of such a rig."
        )


def _along(
    data: DiscoveryData, bench: Bench, records: Sequence[Record], known: Mapping[str, float]
) -> AlongMotion | None:
    """Return the regression along the motion of the estimation records."""
    campaign = replace(data.campaign, rig=bench.rig, records=tuple(records))
    return AlongMotion.of(campaign, known, list(bench.effects.values()))


def _swallowed(bench: Bench) -> frozenset[str]:
    """Return the parameters that the records' offsets can replace."""
    if not any(record.free_offsets for record in bench.estimation):
        return frozenset()
    structure = bench.structure(frozenset())
    known = {name: bench.values[name] for name in structure.names if name in bench.values}
    asked = [name for name in bench.free_parameters(structure) if name in known]
    return frozenset(
        swallowed_by_offsets(structure, bench.estimation, bench.scales, bench.noise, known, asked)
    )


def _linear_values(data: DiscoveryData, estimation: Sequence[Record]) -> dict[str, float]:
    known = {} if data.has_stiffness else {"k": 0.0}
    return {
        **data.campaign.constants,
        **linear_start(data.rig, estimation, data.campaign.constants, {**known, **data.held}),
    }


def _held(data: DiscoveryData) -> frozenset[str]:
    """Return parameters held during selection: those without effect on the motion, and constant force or rest position."""
    if not data.rig.has_one_motion:
        return frozenset({p.name for p in data.rig.parameters if not p.fitted} | {*data.held})
    motion = data.rig.motion
    held = {*data.rig.downstream_parameters, *data.held}
    if data.rig.is_driven:
        # With a linear spring, a constant force and a shifted rest position cannot be distinguished.
        rest, bias = motion.rest.free_symbols, motion.bias.free_symbols
        if not data.has_stiffness:
            held |= {symbol.name for symbol in rest}
        elif rest:
            held |= {symbol.name for symbol in bias}
    if not data.has_stiffness:
        held.add(motion.stiffness.name)
    return frozenset(held)


def _without_downstream(rig: Rig, record: Record) -> Record:
    """Return a record without the outputs that do not affect the motion."""
    if not rig.has_one_motion:
        return record
    keep = {signal.name for signal in (*rig.inputs, *rig.motion_alone().outputs)}
    return replace(record, signals={name: s for name, s in record.signals.items() if name in keep})


def _polished(data: DiscoveryData, bench: Bench, chosen: Trial) -> tuple[FitResult, str]:
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

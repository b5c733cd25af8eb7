"""The whole diagnosis: records and a given simulation -> verdict, ranking, gap budget, completed model.

This is its order. The numbers are those of the sections in docs/verdict.md, which say what each step decides; thresholds are in
`policy`. `examine` does steps 1 to 9, and is repeated if a model leaves less than a noise floor that was measured at rest.

1. `noise_floors` finds the noise; `windowing_of` decides over which stretch a rig that drifts is compared.
2. `reidentify` fits the equations without an effect; `held_by_motion` keeps them to the measured motion.
3. `data_quality` checks the records; with `asked_offsets` all is repeated with offsets by record.
4. `propose` asks the motion for the missing force and `worth_fitting` what it rules out; `search_places` screens by pushes.
5. `fit_candidates` fits every effect alone, `lowered_by_extensions` the equations again from the best of them.
6. `is_predictable` asks whether whole records can decide; else `fitted_in_windows`.
7. `several_effects` adds effects where one does not explain the records, drops and exchanges them.
8. `rank` compares all models that can be the cause (`can_be_cause`, `beyond_disturbance`).
9. `judge` names the verdict, `by_motion` the cause where simulations do not decide; `adequacy` tests what the model leaves.
10. `trained` gives probabilities of models, `families_at_places` those of families.
11. `localize`, `with_own_errors` and `advise`: where, how sure, what next. `verdict_notes` says what else is to be known.
12. `trust` asks whether the parameters are the same everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign, with_weighed_spring
from rigsight.diagnose.advise import advise
from rigsight.diagnose.bootstrap import with_own_errors
from rigsight.diagnose.examination import Examination, examine
from rigsight.diagnose.fit_context import FitContext, FittedModel, Prepare, candidates_on
from rigsight.diagnose.location.localize import localize
from rigsight.diagnose.location.trace import budget_intervals, effect_shares, traces_of
from rigsight.diagnose.noise.adequacy import remainder_of
from rigsight.diagnose.noise.detection import AT_REST, NoiseFloor, disturbance
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.result import (
    Candidate,
    Diagnosis,
    Estimate,
    LikelyCauses,
    OutputGap,
    probability_not_tried,
)
from rigsight.diagnose.trust.trust import record_numbers, trust
from rigsight.diagnose.verdict.calibration import Situation, trained
from rigsight.diagnose.verdict.families import (
    FamilyAtPlace,
    Shares,
    families_at_places,
    keys_of,
    shares_of_force,
    shares_of_gap,
)
from rigsight.diagnose.verdict.judgement import traced_to, with_most_probable_family
from rigsight.diagnose.verdict.ranking import Grounds
from rigsight.diagnose.verdict_notes import Basis, verdict_notes
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import InputError
from rigsight.identify import FitMemory
from rigsight.identify.fit.windows import readings
from rigsight.metrics import nrmse
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate.model import Model


def diagnose(
    campaign: Campaign,
    effects: Sequence[Effect] = CATALOGUE,
    seed: int = 0,
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
    prepare: Prepare | None = None,
    memory: FitMemory | None = None,
) -> Diagnosis:
    """Diagnose the gap between a simulation and records of its rig.

    `prepare` compiles structures that are about to be simulated side by side; fits that `memory` has are not done again.
    """
    say = progress or (lambda _: None)
    if not campaign.estimation:
        raise InputError('A diagnosis needs at least one record with role = "estimation".')
    campaign = with_weighed_spring(campaign)
    effects = candidates_on(campaign.rig, effects, campaign.modelled)
    rng = np.random.default_rng(seed)
    found = examine(campaign, effects, rng, n_jobs, say, prepare, memory)
    below_rest = None
    if any(floor.method == AT_REST for floor in found.floors) and _least_left(found) < VERDICT.refutes_rest:
        below_rest = _least_left(found)
        found = examine(campaign, effects, rng, n_jobs, say, prepare, memory, at_rest=False)
    families = _families(found, rng)
    judgement = with_most_probable_family(found.judgement, campaign.rig, found.ranking, families)
    if judgement is not found.judgement:
        found = replace(found, judgement=judgement)
        families = _families(found, rng)
    notes = verdict_notes(Basis(campaign, found, rng, below_rest))
    diagnosis = _assembled(campaign, found, families, notes, rng)
    named = found.judgement.model if diagnosis.effects else found.reidentified
    if found.judgement.verdict != "unknown":
        diagnosis = with_own_errors(diagnosis, found.context, named, seed)
        say("standard errors")
    own = next(candidate for candidate in diagnosis.candidates if candidate.effects == named.names)
    std = {name: estimate.std for name, estimate in own.parameters.items()}
    trusted = trust(found.context, named, campaign.records, campaign.constants, std)
    say("trust in the numbers")
    return replace(diagnosis, trust=trusted)


def _least_left(found: Examination) -> float:
    return min(model.error_over_noise for model in (found.before, found.reidentified, *found.ranking.order))


def _families(found: Examination, rng: np.random.Generator) -> tuple[FamilyAtPlace, ...]:
    ranking, calibration, situation = found.ranking, trained(), _situation(found)
    probabilities = calibration.probabilities(situation, ranking.probabilities)
    listed = math.fsum(probabilities) + calibration.without_effect(situation)
    shares = [grounds.share for grounds in ranking.grounds]
    return families_at_places(
        found.context.rig,
        found.reidentified,
        found.judgement.model,
        list(zip(ranking.order, probabilities, shares, strict=True)),
        max(0.0, 1.0 - listed),
        found.context.floors,
        rng.spawn(1)[0],
        found.proposal,
        found.judgement.by_motion,
        ranking.impossible,
    )


def _assembled(
    campaign: Campaign,
    found: Examination,
    families: tuple[FamilyAtPlace, ...],
    notes: tuple[str, ...],
    rng: np.random.Generator,
) -> Diagnosis:
    scored_on = "validation" if campaign.validation else "estimation"
    rig, context, before, reidentified = campaign.rig, found.context, found.before, found.reidentified
    ranking, judgement, floors = found.ranking, found.judgement, found.floors
    is_effect = judgement.verdict == "effect"
    after = judgement.model if is_effect else (before if judgement.verdict == "none" else reidentified)
    noise, measured = context.noise, _measured(rig, context.scoring)
    traces = traces_of(context, before, reidentified, after)
    scored = [trace for trace in traces if trace.role == scored_on]
    at_floor = {
        name: noise[name] / spread if (spread := float(np.std(values))) > 0.0 else math.inf
        for name, values in measured.items()
    }
    errors = [_errors(rig, model.residuals, measured) for model in (before, reidentified, after)]
    gap = {
        name: OutputGap(
            before=errors[0][name],
            reidentified=errors[1][name],
            after=errors[2][name],
            noise_floor=at_floor[name],
            intervals=budget_intervals(scored, name, at_floor[name], rng),
        )
        for name in measured
    }
    calibration, situation = trained(), _situation(found)
    without_effect = _candidate(context, reidentified, calibration.without_effect(situation))
    probabilities = calibration.probabilities(situation, ranking.probabilities)
    ranked = list(zip(ranking.order, probabilities, ranking.grounds, strict=True))
    with_effect = [_candidate(context, *own) for own in ranked]
    candidates = tuple(
        sorted((*with_effect, without_effect), key=lambda c: (-c.probability, c.error_over_noise))
    )
    chosen = judgement.model.effects if is_effect else ()
    if judgement.by_motion:
        rivals = _other_families(rig, ranking.order, families, judgement.model)
        outside = 1.0 - math.fsum(own.probability for own in families) >= calibration.least_probability
        likely = LikelyCauses((judgement.model.names, *rivals), outside)
    else:
        likely = _likely(candidates, calibration.least_probability)
        rivals = _not_distinguished(candidates, likely, judgement.model.names) if is_effect else []
    where = tuple(rig.where(effect) for effect in chosen)
    if judgement.verdict == "unknown":
        where = _evidence(found)
    remainder = None
    if found.adequacy is not None and found.adequacy.adequate:
        floors = tuple(
            _up_to(floor, _column(rig, judgement.model.residuals, floor.output)) for floor in floors
        )
    if found.adequacy is not None:
        lower_bound = any(floor.lower_bound for floor in floors)
        remainder = remainder_of(reidentified, judgement.model, found.adequacy, lower_bound, is_effect)
    if judgement.verdict != "unknown":
        floors = _with_disturbance(context, judgement.model, floors, found.windowing.bandwidth)
    return Diagnosis(
        title=campaign.title,
        rig=rig.name,
        verdict=judgement.verdict,
        effects=tuple(effect.name for effect in chosen),
        where=where,
        ambiguous_with=tuple(rivals),
        likely=likely,
        error_of_choice=ranking.error_of_choice if np.isfinite(ranking.error_of_choice) else None,
        candidates=candidates,
        gap=gap,
        noise_floors=floors,
        traces=traces,
        units={signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs)},
        given=dict(campaign.given),
        record_numbers=record_numbers(context, after, campaign.estimation[0].hold),
        model=Model.of(after.fit.structure, after.fit.values, campaign.estimation[0].hold).to_json(),
        notes=notes,
        windows=found.windowing.length,
        window_cycles=found.windowing.cycles,
        bandwidth=found.windowing.bandwidth,
        scored_on=scored_on,
        data_quality=found.quality,
        advice=advise(
            context, judgement.model, [model for model in ranking.order if model.names in rivals], noise
        ),
        places=found.places,
        adequate=None if found.adequacy is None else found.adequacy.adequate,
        remainder=remainder,
        families=families,
        missing_force=found.proposal,
        shares=_shares(found, families),
        localization=localize(context, traces, scored_on, before, reidentified, after, rng, floors),
        effect_shares=effect_shares(
            [effect.name for effect in chosen], {frozenset(c.effects): c.validation_nrmse for c in candidates}
        ),
    )


def _shares(found: Examination, families: Sequence[FamilyAtPlace]) -> Shares | None:
    if found.judgement.by_motion and found.proposal is not None:
        return shares_of_force(families, found.proposal)
    if found.adequacy is None:
        return None
    return shares_of_gap(families, found.reidentified, found.judgement.model, found.adequacy.adequate)


def _situation(found: Examination) -> Situation:
    """Return the figures from which the probability of the verdict is computed."""
    ranking, judgement = found.ranking, found.judgement
    first = ranking.order[0] if ranking.order else None
    return Situation(
        judgement.verdict,
        ranking.probabilities[0] if first is not None else 0.0,
        found.reidentified.error_over_noise if first is None else first.error_over_noise,
        found.reidentified.error_over_noise,
        0 if first is None else len(first.effects),
        found.adequacy is not None and found.adequacy.adequate,
        any(floor.lower_bound for floor in found.floors),
        bool(found.places),
    )


def _likely(candidates: Sequence[Candidate], least: float) -> LikelyCauses:
    """Return the causes with at least the required probability, and always the most probable one."""
    outside = probability_not_tried(candidates)
    most = max(outside, *(candidate.probability for candidate in candidates))
    enough = min(least, most)
    sets = tuple(candidate.effects for candidate in candidates if candidate.probability >= enough)
    return LikelyCauses(sets, outside >= enough)


def _other_families(
    rig: Rig, order: Sequence[FittedModel], families: Sequence[FamilyAtPlace], named: FittedModel
) -> list[tuple[str, ...]]:
    """Return the first model in the ranking of each other family that is more probable than negligible."""
    keys = [
        (own.family, own.where)
        for own in families
        if own.probability > VERDICT.surely and (own.family, own.where) not in keys_of(rig, named.effects)
    ]
    found = [next((m.names for m in order if keys_of(rig, m.effects) == (key,)), None) for key in keys]
    return [names for names in found if names is not None]


def _not_distinguished(
    candidates: Sequence[Candidate], likely: LikelyCauses, named: tuple[str, ...]
) -> list[tuple[str, ...]]:
    """Return the other likely causes, and those that are first in the ranking in more than a negligible share of resamplings."""
    return [
        candidate.effects
        for candidate in candidates
        if candidate.effects not in ((), named)
        and (
            candidate.effects in likely.sets
            or (candidate.grounds is not None and candidate.grounds.share > VERDICT.surely)
        )
    ]


def _with_disturbance(
    context: FitContext, model: FittedModel, floors: Sequence[NoiseFloor], bandwidth: float | None
) -> tuple[NoiseFloor, ...]:
    """Return the floors, that of the first output with the disturbance force that would cause the error of a model above it."""
    first = context.rig.outputs[0].name
    if not all(first in record for record in context.scoring):
        return tuple(floors)
    residuals = [residual[:, 0] for residual in model.residuals]
    return tuple(
        replace(
            floor,
            disturbance=disturbance(
                context.rig, model.fit.values, context.scoring, residuals, floor.std, bandwidth
            ),
        )
        if floor.output == first
        else floor
        for floor in floors
    )


def _up_to(floor: NoiseFloor, residual: Floats) -> NoiseFloor:
    """Return a lower bound with the upper limit that an adequate model's remainder gives it; another floor as it is."""
    if not floor.lower_bound or not residual.size:
        return floor
    return replace(floor, interval=(floor.interval[0], max(float(np.std(residual)), floor.std)))


def _evidence(found: Examination) -> tuple[str, ...]:
    """Return the places to which the evidence points if the cause is unknown."""
    # The place of the push that explains most, or the joint at which the missing force along the motion must act; on a rig with
    # one motion the place whose signals correlate with the residual, else the place of the best effect.
    # A push that explains most of the gap is stronger evidence than a force of any shape.
    pushed = max((place.share for place in found.places), default=0.0) >= VERDICT.larger_part
    traced = () if found.proposal is None else traced_to(found.context.rig, found.proposal.forces)
    if traced and not pushed:
        return traced
    if found.places:
        return tuple(place.name for place in found.places if place.examined and place.share > 0.0)
    rig = found.context.rig
    if found.gap_at:
        return ("sensor" if found.gap_at in {signal.name for signal in rig.outputs} else found.gap_at,)
    return tuple(dict.fromkeys(rig.where(effect) for effect in found.judgement.model.effects))


def _column(rig: Rig, residuals: Sequence[Floats], output: str) -> Floats:
    index = [signal.name for signal in rig.outputs].index(output)
    column = np.concatenate([residual[:, index] for residual in residuals])
    return np.asarray(column[np.isfinite(column)])


def _errors(rig: Rig, residuals: Sequence[Floats], measured: Mapping[str, Floats]) -> dict[str, float]:
    """Return the NRMSE of each output; infinite for a model that could not be simulated."""
    return {
        name: nrmse(_column(rig, residuals, name), values) if residuals else math.inf
        for name, values in measured.items()
    }


def _measured(rig: Rig, records: Sequence[Record]) -> dict[str, Floats]:
    shown = {signal.name: list(readings(records, signal.name).values()) for signal in rig.outputs}
    return {name: np.concatenate(parts) for name, parts in shown.items() if parts}


def _candidate(
    context: FitContext, model: FittedModel, probability: float, grounds: Grounds | None = None
) -> Candidate:
    units = {p.name: p.unit for p in model.fit.structure.parameters}
    rig = context.rig
    return Candidate(
        effects=model.names,
        where=tuple(rig.where(effect) for effect in model.effects),
        probability=probability,
        validation_nrmse=_errors(rig, model.residuals, _measured(rig, context.scoring)),
        estimation_nrmse=_errors(rig, model.fit.residuals, _measured(rig, context.estimation)),
        error_over_noise=model.error_over_noise,
        parameters={
            name: Estimate(model.fit.values[name], model.fit.standard_errors[name], units[name])
            for name in model.fit.free
        },
        success=model.fit.success,
        message=model.fit.message,
        grounds=grounds,
    )

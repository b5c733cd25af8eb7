"""Errors of all models on the same records, and the judgement that follows from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.checks import data_quality, with_best_model, with_offsets_told
from rigsight.diagnose.data_quality.finding import DataQuality
from rigsight.diagnose.data_quality.offsets_by_record import asked_offsets, with_offsets_free
from rigsight.diagnose.fit_context import FitContext, FittedModel, Prepare, fit_context_of, start_values_of
from rigsight.diagnose.noise.adequacy import Adequacy, Checks
from rigsight.diagnose.noise.detection import NoiseFloor, noise_floors
from rigsight.diagnose.noise.evidence import Evidence
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.evidence_for_more import beyond_disturbance, split_distinguishable, with_parts
from rigsight.diagnose.search.fitted_models import AllModels, single_models, with_several_effects
from rigsight.diagnose.search.horizon import restores, windowing_of
from rigsight.diagnose.search.one_more_effect import as_along_motion
from rigsight.diagnose.search.possible_cause import can_be_cause
from rigsight.diagnose.search.single_effects import contenders, fit_candidate
from rigsight.diagnose.search.worth_fitting import SuspectedPlace
from rigsight.diagnose.verdict.families import keys_of, probable_part, with_shown_families
from rigsight.diagnose.verdict.judgement import (
    Judgement,
    by_motion,
    forms_of,
    is_exact,
    judge,
    main_cause,
    most_remainder,
    with_unseen,
)
from rigsight.diagnose.verdict.plausibility import doubts, plausible_first
from rigsight.diagnose.verdict.ranking import Ranking, rank, with_last
from rigsight.effects import Effect
from rigsight.identify import FitMemory, IdleThreads
from rigsight.identify.fit.windows import Windowing
from rigsight.inverse import Proposal


@dataclass(frozen=True)
class Examination:
    """All models, fitted and scored on the same records."""

    floors: tuple[NoiseFloor, ...]  # noise floor of each output
    context: FitContext  # records, scales and noise
    windowing: Windowing  # how records were cut
    # The given simulation, and its equations with refitted parameters.
    before: FittedModel
    reidentified: FittedModel
    ranking: Ranking  # the candidates
    judgement: Judgement  # the verdict
    quality: DataQuality  # quality of the data
    checks: Checks  # say whether the residual of a model is noise and disturbance
    # Pairs with a low error that do not compete, because other laws fit equally well.
    imitations: tuple[FittedModel, ...] = ()
    # Share of the gap that a push explains, by place; empty on a rig with one motion.
    places: tuple[SuspectedPlace, ...] = ()
    # What the motion says of the missing force; None where the sensors do not show the motion.
    proposal: Proposal | None = None

    @property
    def adequacy(self) -> Adequacy | None:
        """Whether the residual of the diagnosed model correlates with anything; None where that model could not be scored."""
        return self.checks.of(self.judgement.model) if self.judgement.model.residuals else None

    @property
    def doubts(self) -> tuple[str, ...]:
        """Implausible parameters of the diagnosed model."""
        model = self.judgement.model
        return tuple(doubt.text for doubt in doubts(model, self.reidentified)) if model.effects else ()

    @property
    def gap_at(self) -> str:
        """For an unknown cause the joint, drive or sensor whose signals correlate most with the gap; empty where none does."""
        return self.checks.of(self.reidentified).place if self.judgement.verdict == "unknown" else ""


def examine(
    campaign: Campaign,
    effects: Sequence[Effect],
    rng: np.random.Generator,
    n_jobs: int,
    say: Callable[[str], None],
    prepare: Prepare | None,
    memory: FitMemory | None,
    at_rest: bool = True,
) -> Examination:
    """Fit the given simulation, its equations and every candidate; rank and judge them."""
    start = start_values_of(campaign)
    floors, windowing = _floors(campaign, n_jobs, at_rest, start)
    say("noise floor")
    noise = {floor.output: floor.std for floor in floors}
    lower_bound = any(floor.lower_bound for floor in floors)
    context = fit_context_of(campaign, noise, windowing, memory, IdleThreads(n_jobs), start, prepare)
    alone = single_models(campaign, context, windowing, effects, say)
    quality = data_quality(alone.context, campaign.records, alone.reidentified)
    allowed = VERDICT.at_lower_bound if lower_bound else most_remainder(alone.reidentified.error_over_noise)
    asked = (
        asked_offsets(alone.context, alone.reidentified, alone.singles, allowed) if windowing.whole else None
    )
    if asked is not None:
        say("offsets by record")
        freed = with_offsets_free(campaign)
        again = examine(freed, effects, rng, n_jobs, say, prepare, memory, at_rest)
        return replace(again, quality=replace(again.quality, findings=(asked, *again.quality.findings)))
    models = with_several_effects(campaign, alone, lower_bound, allowed, rng, say)
    context, before, reidentified = models.alone.context, models.alone.before, models.alone.reidentified
    checks = models.checks
    ranking, imitations = _ranked(models, allowed, rng)
    is_usable = bool(ranking.order) and bool(ranking.order[0].residuals) and ranking.probabilities[0] > 0.0
    best, tied = (ranking.order[0], ranking.tied) if is_usable else (reidentified, ())
    is_reached = best.error_over_noise <= allowed and not lower_bound
    if len(best.effects) > 1 and not (is_reached or checks.is_adequate(best)):
        best = probable_part(campaign.rig, reidentified, best, ranking.order)

    def judged(model: FittedModel) -> Judgement:
        return judge(
            before.error_over_noise,
            reidentified,
            model,
            checks.is_adequate,
            lambda: main_cause(campaign.rig, reidentified, model, tied, context.floors, rng),
            lower_bound,
        )

    judgement = judged(best)
    if judgement.verdict == "unknown" and best.effects:
        # The plainest form of a family may explain less than half of the gap, and another one more.
        forms = map(judged, forms_of(campaign.rig, ranking, keys_of(campaign.rig, best.effects)))
        judgement = next((own for own in forms if own.verdict == "effect"), judgement)
    if not is_exact(judgement, best, allowed, checks.is_adequate):
        proposal, along = models.alone.proposal, partial(as_along_motion, context, reidentified)
        ranking = with_unseen(campaign.rig, reidentified, ranking, proposal, along)
        judgement = by_motion(judgement, campaign.rig, reidentified, ranking, context.floors, proposal)
    quality = with_best_model(quality, context, judgement.model)
    quality = with_offsets_told(quality, context, judgement.model)
    say("adequacy")
    return Examination(
        floors,
        context,
        models.alone.windowing,
        before,
        reidentified,
        ranking,
        judgement,
        quality,
        checks,
        imitations,
        models.alone.search.places,
        models.alone.proposal,
    )


def _floors(
    campaign: Campaign, n_jobs: int, at_rest: bool, start: Mapping[str, float]
) -> tuple[tuple[NoiseFloor, ...], Windowing]:
    """Return the noise floor of each output, and how records are compared with models."""
    drifts = campaign.drifts or not restores(campaign)
    floors = noise_floors(campaign.rig, campaign.records, drifts, at_rest)
    if not drifts:
        return floors, Windowing()
    windowing, amplified = windowing_of(
        campaign, {floor.output: floor.std for floor in floors}, n_jobs, start
    )
    return tuple(_raised(floor, amplified.get(floor.output, 1.0)) for floor in floors), windowing


def _raised(floor: NoiseFloor, factor: float) -> NoiseFloor:
    low, high = floor.interval
    return replace(floor, std=factor * floor.std, interval=(factor * low, factor * high))


def _ranked(
    models: AllModels, allowed: float, rng: np.random.Generator
) -> tuple[Ranking, tuple[FittedModel, ...]]:
    """Return the ranking of all models with effects, and those that do not compete because other laws fit equally well."""
    context, reidentified = models.alone.context, models.alone.reidentified
    singles, found = (
        [with_shown_families(m, context.scales) for m in own]
        for own in (models.alone.singles, models.several)
    )
    can_be = partial(can_be_cause, context, reidentified=reidentified, models=[*singles, *found])
    possible = [model for model in singles if can_be(model)]
    # Families that the motion names were judged beside each other, on stretches to which they were not fitted.
    named = models.alone.named
    by_motion = [m for m in found if named.issuperset(keys_of(context.rig, m.effects))]
    others = [model for model in found if model not in by_motion]
    others, imitations = split_distinguishable(others, possible, allowed, models.checks.is_adequate)
    several = [*by_motion, *others]
    rivals = sorted(contenders(possible or singles), key=lambda model: model.error_over_noise)
    evidence = Evidence(context, reidentified, next(iter(rivals), reidentified))
    if not models.are_in_windows:
        stand = beyond_disturbance(evidence, rivals, singles, models.forms.with_own_evidence(singles, others))
        several = with_parts([*by_motion, *stand], several)
    candidates: list[FittedModel] = []
    not_shown: list[FittedModel] = []
    for model in (*singles, *several):
        (candidates if can_be(model) else not_shown).append(model)
    likeliest = min(contenders(candidates), key=evidence.criterion, default=None)
    # A likelihood treats the residual as noise: it is used only if the residual of the most likely model is noise.
    counts = likeliest is not None and models.checks.is_adequate(likeliest)
    gap = reidentified.error_over_noise
    ranked = partial(
        rank, noise=context.floors, rng=rng, gap=gap, criterion=evidence.criterion, evidence_counts=counts
    )
    ranking = ranked(candidates)
    if ranking.order and ranking.order[0].residuals:
        if not models.are_in_windows:
            ranking = _with_offset_rivals(context, ranking, models.alone.effects, ranked)
        if ranking.order[0].error_over_noise > allowed:
            places = {e.name: context.rig.acts_at(e) for model in ranking.order for e in model.effects}
            ranking = plausible_first(ranking, reidentified, places)
    return with_last(ranking, not_shown), tuple(imitations)


def _with_offset_rivals(
    context: FitContext,
    ranking: Ranking,
    effects: Sequence[Effect],
    ranked: Callable[[Sequence[FittedModel]], Ranking],
) -> Ranking:
    """Let an even effect without a constant force compete where the best model needs a constant force."""
    # A symmetric spring under a constant force and an asymmetric spring without one obey the same equation.
    best = ranking.order[0]
    released = context.releasable_parameters(best.fit.structure)
    needed = [
        name
        for name in best.fit.free
        if name in released
        and abs(best.fit.values[name]) > VERDICT.standard_errors * best.fit.standard_errors[name]
    ]
    if not needed or len(best.effects) >= SEARCH.most_effects:
        return ranking
    known = {frozenset(model.names) for model in ranking.order}
    rivals = []
    for effect in effects:
        is_even = effect.signature.even_harmonics and not effect.holds_constant_force
        is_new = frozenset((*best.names, effect.name)) not in known
        if is_even and is_new and context.rig.offers(effect) and effect not in best.effects:
            base = replace(best.fit, values={**best.fit.values, **dict.fromkeys(needed, 0.0)})
            rivals.append(fit_candidate(context, (*best.effects, effect), base, hold=frozenset(needed)))
    return ranked([*ranking.order, *rivals])

"""Errors of all models on the same records, and the judgement that follows from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.checks import data_quality, with_best_model, with_offsets_told
from rigsight.diagnose.data_quality.finding import DataQuality
from rigsight.diagnose.data_quality.offsets_by_record import asked_offsets, with_offsets_free
from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.diagnose.fitting.preparation import Prepare, fit_context_of
from rigsight.diagnose.fitting.windows import Windowing, leading_output
from rigsight.diagnose.noise.adequacy import Adequacy, Checks
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.diagnose.noise.evidence import Evidence
from rigsight.diagnose.noise.noise_floor import NoiseFloor
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.horizon import brings_back, preparing, windowing_of
from rigsight.diagnose.search.places import Search, SuspectedPlace, search_places
from rigsight.diagnose.search.sensitive_motion import fitted_in_windows, is_predictable
from rigsight.diagnose.search.several.evidence_for_more import OtherForms, beyond_disturbance, with_parts
from rigsight.diagnose.search.several.one_law import split_distinguishable
from rigsight.diagnose.search.several.pairs import refit_singles
from rigsight.diagnose.search.several.pairs_in_windows import pairs_in_windows
from rigsight.diagnose.search.several.several_effects import several_effects
from rigsight.diagnose.search.single_effects import contenders, fit_candidate, fit_candidates, reidentify
from rigsight.diagnose.verdict.judgement import (
    Judgement,
    judge,
    most_left,
)
from rigsight.diagnose.verdict.main_cause import main_cause
from rigsight.diagnose.verdict.plausibility import doubts, plausible_first
from rigsight.diagnose.verdict.ranking import Ranking, noise_vector, rank
from rigsight.effects import Effect
from rigsight.errors import InputError, SimulationError
from rigsight.identify import (
    FitMemory,
    IdleThreads,
    characteristic_scales,
)
from rigsight.rigs import Rig
from rigsight.simulate import Structure


@dataclass(frozen=True)
class Examination:
    """All models, fitted and scored on the same records.

    Attributes
    ----------
    floors
        Noise floor of each output.
    context
        Records, scales and noise.
    windowing
        How records were cut.
    before, linear
        The given simulation, and its equations with refitted parameters.
    ranking
        The candidates.
    judgement
        The verdict.
    quality
        Quality of the data.
    imitations
        Pairs with a low error that do not compete, because other laws fit equally well.
    places
        Share of the gap that a push explains, by place; empty on a rig with one motion.
    adequacy
        Whether the residual of the diagnosed model is correlated with anything; None where that model could not be scored.
    doubts
        Implausible parameters of the diagnosed model.
    gap_at
        For an unknown cause the joint, drive or sensor whose signals correlate most with the gap; empty where none is known.
    """

    floors: tuple[NoiseFloor, ...]
    context: FitContext
    windowing: Windowing
    before: Scored
    reidentified: Scored
    ranking: Ranking
    judgement: Judgement
    quality: DataQuality
    imitations: tuple[Scored, ...] = ()
    places: tuple[SuspectedPlace, ...] = ()
    adequacy: Adequacy | None = None
    doubts: tuple[str, ...] = ()
    gap_at: str = ""


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
    """Fit the given simulation, its equations and every candidate; rank and judge them.

    Parameters
    ----------
    campaign
        Records and the given simulation.
    effects
        Candidates.
    rng
        Source of the resampling behind probabilities.
    n_jobs, say, prepare, memory
        As of `diagnose`.
    at_rest
        As of `noise_floors`.

    Raises
    ------
    InputError
        If the given simulation cannot be run.
    SimulationError
        If the rig's own equations cannot be simulated near the records.
    """
    drifts = campaign.drifts or not brings_back(campaign)
    floors = noise_floors(campaign.rig, campaign.records, drifts, at_rest)
    say("noise floor")
    noise = {floor.output: floor.std for floor in floors}
    lower_bound = any(floor.lower_bound for floor in floors)
    at_floor = VERDICT.at_lower_bound if lower_bound else VERDICT.at_floor
    windowing = Windowing()
    if drifts:
        windowing, amplified = windowing_of(campaign, noise, n_jobs)
        floors = tuple(_raised(floor, amplified.get(floor.output, 1.0)) for floor in floors)
        noise = {floor.output: floor.std for floor in floors}
    ready = preparing(prepare, windowing.cut(campaign.records))
    models = _singly(campaign, noise, effects, windowing, n_jobs, say, ready, memory)
    allowed = VERDICT.at_lower_bound if lower_bound else most_left(models.reidentified.error_over_noise)
    asked = (
        asked_offsets(models.context, models.reidentified, models.singles, allowed)
        if windowing.whole
        else None
    )
    if asked is not None:
        say("offsets by record")
        freed = with_offsets_free(campaign)
        again = examine(freed, effects, rng, n_jobs, say, prepare, memory, at_rest)
        return replace(again, quality=replace(again.quality, findings=(asked, *again.quality.findings)))
    pairs: list[Scored] = []
    cut, in_windows = None, False
    forms = OtherForms(models.context, lower_bound)
    if windowing.whole and not is_predictable(
        models.context, models.reidentified, models.singles, at_floor, rng
    ):
        cut = _cut(campaign, noise, models)
        say("in windows")
        in_windows = _explained(cut, cut.singles, at_floor)
    checks = Checks(models.context, rng, VERDICT.at_floor, np.inf if lower_bound else VERDICT.most_left)
    if not in_windows:
        pairs = several_effects(
            models.context, models.reidentified, models.singles, effects, forms, checks, lower_bound, ready
        )
        models = replace(models, singles=refit_singles(models.context, models.singles, pairs))
        if windowing.whole and not is_predictable(models.context, models.reidentified, pairs, allowed, rng):
            cut = cut or _cut(campaign, noise, models)
            found = pairs_in_windows(models.context, cut.context, models.reidentified, pairs)
            say("pairs in windows")
            in_windows = _explained(cut, found, VERDICT.at_floor)
            pairs = found if in_windows else pairs
    if cut is not None and in_windows:
        models = cut
    context, before, reidentified = models.context, models.before, models.reidentified
    if in_windows:
        checks = Checks(context, rng, VERDICT.at_floor, np.inf if lower_bound else VERDICT.most_left)
    pairs, imitations = split_distinguishable(pairs, models.singles, allowed, checks.is_adequate)
    best_single = min(
        contenders(models.singles), key=lambda model: model.error_over_noise, default=reidentified
    )
    evidence = Evidence(context, reidentified, best_single)
    if not in_windows:
        stand = beyond_disturbance(evidence, models.singles, forms.with_own_evidence(models.singles, pairs))
        pairs = with_parts(stand, pairs)
    vector = noise_vector([signal.name for signal in campaign.rig.outputs], noise)
    candidates = [*models.singles, *pairs]
    likeliest = min(contenders(candidates), key=evidence.criterion, default=None)
    # A likelihood treats the residual as noise: it is used only if the residual of the most likely model is noise.
    counts = likeliest is not None and checks.is_adequate(likeliest)
    ranking = rank(candidates, vector, rng, reidentified.error_over_noise, evidence.criterion, counts)
    if ranking.order and ranking.order[0].residuals:
        if not in_windows:
            ranking = _with_offset_rivals(
                context,
                ranking,
                effects,
                vector,
                rng,
                reidentified.error_over_noise,
                evidence.criterion,
                counts,
            )
        if ranking.order[0].error_over_noise > allowed:
            ranking = plausible_first(ranking, reidentified, _places(campaign.rig, ranking))
        best, tied = ranking.order[0], ranking.tied
        judgement = judge(
            before.error_over_noise,
            reidentified,
            best,
            checks.is_adequate,
            lambda: main_cause(campaign.rig, reidentified, best, tied, vector, rng),
            lower_bound,
        )
    else:
        judgement = Judgement("unknown", reidentified, "No candidate could be fitted.")
    quality = with_best_model(models.quality, context, judgement.model)
    quality = with_offsets_told(quality, context, judgement.model)
    left = checks.of(judgement.model) if judgement.model.residuals else None
    say("adequacy")
    return Examination(
        floors,
        models.context,
        models.windowing,
        before,
        reidentified,
        ranking,
        judgement,
        quality,
        tuple(imitations),
        models.search.places,
        left,
        tuple(doubt.text for doubt in doubts(judgement.model, reidentified))
        if judgement.model.effects
        else (),
        checks.of(reidentified).place if judgement.verdict == "unknown" else "",
    )


def _raised(floor: NoiseFloor, factor: float) -> NoiseFloor:
    low, high = floor.interval
    return replace(floor, std=factor * floor.std, interval=(factor * low, factor * high))


def _places(rig: Rig, ranking: Ranking) -> dict[str, str]:
    return {effect.name: rig.acts_at(effect) for model in ranking.order for effect in model.effects}


@dataclass(frozen=True)
class _Singly:
    """Results of every effect by itself."""

    windowing: Windowing
    context: FitContext
    before: Scored
    reidentified: Scored
    quality: DataQuality
    singles: list[Scored]
    search: Search


def _singly(
    campaign: Campaign,
    noise: Mapping[str, float],
    effects: Sequence[Effect],
    windowing: Windowing,
    n_jobs: int,
    say: Callable[[str], None],
    prepare: Prepare | None,
    memory: FitMemory | None,
) -> _Singly:
    context = fit_context_of(campaign, noise, windowing, memory, IdleThreads(n_jobs))
    reidentified = reidentify(context, context.start)
    if not reidentified.residuals:
        raise SimulationError(
            f"The equations of {campaign.rig.name} cannot be fitted to the records: {reidentified.fit.message}"
        )
    bent = bool(campaign.given) and context.leaves_numbers_open(reidentified.fit)
    if bent or not campaign.rig.has_one_motion:
        # Motion and forces between the sensors are known once the equations fit, or from the given simulation.
        known = {**campaign.constants, **reidentified.fit.values, **(campaign.given if bent else {})}
        context = replace(context, scales=characteristic_scales(campaign.rig, campaign.estimation, known))
    say("re-identified")
    before = _before(campaign, context, reidentified)
    if campaign.given:
        say("given simulation")
    quality = data_quality(context, campaign.records, reidentified)
    search = search_places(context, reidentified, context.offered(effects))
    say("suspects")
    if prepare is not None:
        prepare([context.simplest((effect,)) for effect in search.effects])
    singles = fit_candidates(context, reidentified, search.effects, say)
    if (
        search.others
        and min((model.error_over_noise for model in singles), default=np.inf) > VERDICT.at_floor
    ):
        # A right model must not be lost because places or effects were ranked wrongly.
        if prepare is not None:
            prepare([context.simplest((effect,)) for effect in search.others])
        singles = fit_candidates(context, reidentified, search.others, say, singles)
    return _Singly(windowing, context, before, reidentified, quality, singles, search)


def _cut(campaign: Campaign, noise: Mapping[str, float], models: _Singly) -> _Singly:
    """Return the models in windows of a few cycles."""
    leading = leading_output(campaign.rig, campaign.records)
    windowing = Windowing.by_cycles({leading: noise[leading], **noise})
    known = models.context
    context = fit_context_of(campaign, noise, windowing, known.memory, known.threads, known.start)
    reidentified = reidentify(context, models.reidentified.fit.values)
    singles = fitted_in_windows(context, reidentified, models.singles)
    before = _before(campaign, context, reidentified) if reidentified.residuals else models.before
    return _Singly(windowing, context, before, reidentified, models.quality, singles, models.search)


def _explained(cut: _Singly, models: Sequence[Scored], at_floor: float) -> bool:
    """Return True if one of the models explains the records in windows and the equations without an effect do not."""
    best = min((model.error_over_noise for model in models), default=float("inf"))
    return bool(cut.reidentified.residuals) and best <= at_floor < cut.reidentified.error_over_noise


def _before(campaign: Campaign, context: FitContext, reidentified: Scored) -> Scored:
    """Score the given simulation; parameters that were not given are identified with the given ones held."""
    if not campaign.given:
        return reidentified
    structure = context.composed()
    start = {**context.start, **reidentified.fit.values, **campaign.given}
    missing = [name for name in context.free_parameters(structure) if name not in campaign.given]
    fit = context.problem(structure, context.estimation).fit(start, missing)
    if not fit.residuals:
        raise InputError(_why_not_run(context, structure, start))
    return context.score((), fit)


def _why_not_run(context: FitContext, structure: Structure, values: Mapping[str, float]) -> str:
    """Name the records that the given simulation cannot follow, with what decides it."""
    failing = [r for r in context.estimation if not context.problem(structure, [r]).fit(values, ()).residuals]
    told = ", ".join(f"'{record.name}' (sample time {record.dt:.3g} s)" for record in failing[:5])
    where = f" in {told}" if told else ""
    return (
        f"The given simulation cannot be run: with the given parameters the motion{where} diverges or is too fast for the sample "
        f"time. Check the units of time and input, and the given parameters."
    )


def _with_offset_rivals(
    context: FitContext,
    ranking: Ranking,
    effects: Sequence[Effect],
    noise: NDArray[np.float64],
    rng: np.random.Generator,
    gap: float,
    criterion: Callable[[Scored], float],
    evidence_counts: bool,
) -> Ranking:
    """Let an even effect without a constant force compete where the best model needs a constant force.

    A symmetric spring under a constant force and an asymmetric spring without one obey the same equation.
    """
    best = ranking.order[0]
    released = context.releasable_parameters(best.fit.structure)
    needed = [
        name
        for name in best.fit.free
        if name in released
        and abs(best.fit.values[name]) > VERDICT.standard_errors * best.fit.standard_errors[name]
    ]
    if not needed:
        return ranking
    rivals = []
    for effect in effects:
        is_even = effect.signature.even_harmonics and not effect.holds_constant_force
        if is_even and context.rig.offers(effect) and effect not in best.effects:
            base = replace(best.fit, values={**best.fit.values, **dict.fromkeys(needed, 0.0)})
            rivals.append(fit_candidate(context, (*best.effects, effect), base, hold=frozenset(needed)))
    return rank([*ranking.order, *rivals], noise, rng, gap, criterion, evidence_counts)

"""Which models are fitted: the equations alone, with each effect, and with several; on whole records or in windows of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import FitContext, FittedModel, candidates_on, fit_context_of
from rigsight.diagnose.noise.adequacy import Checks
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.diagnose.search.evidence_for_more import OtherForms
from rigsight.diagnose.search.horizon import fitted_in_windows, is_predictable, pairs_in_windows
from rigsight.diagnose.search.nested_models import lowered_by_extensions, ordered_by_inclusion
from rigsight.diagnose.search.one_more_effect import part_of, with_causes
from rigsight.diagnose.search.several_effects import (
    larger_part_closed,
    refit_singles,
    settled,
    several_effects,
)
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.diagnose.search.worth_fitting import (
    Search,
    SingleModels,
    WorthFitting,
    search_places,
    worth_fitting,
)
from rigsight.effects import CATALOGUE, Effect, kind_of
from rigsight.errors import InputError, SimulationError
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import Windowing, leading_output
from rigsight.inverse import Proposal, hidden_effects, propose
from rigsight.simulate import Structure


@dataclass(frozen=True)
class AllModels:
    """Models with any number of effects, fitted and scored on the same records."""

    alone: SingleModels  # those with at most one effect
    several: list[FittedModel]  # those with two and three effects
    # Whether they are fitted and scored in windows of a few cycles, because the motion is sensitive to small
    # disturbances.
    are_in_windows: bool
    checks: Checks  # say whether the residual of a model is noise and disturbance
    forms: OtherForms  # say how much another form of an effect would explain; of whole records


def single_models(
    campaign: Campaign,
    context: FitContext,
    windowing: Windowing,
    effects: Sequence[Effect],
    say: Callable[[str], None],
) -> SingleModels:
    """Fit and score the given simulation, its equations and every candidate."""
    reidentified = reidentify(context, context.start)
    if not reidentified.residuals:
        raise SimulationError(
            f"The equations of {campaign.rig.name} cannot be fitted to the records: {reidentified.fit.message}"
        )
    say("re-identified")
    known = _known(campaign, context, reidentified)
    proposal = propose(campaign, known, effects, context.noise)
    say("missing force")
    offered = {kind_of(effect.name) for effect in candidates_on(campaign.rig, CATALOGUE, campaign.modelled)}
    are_chosen = not offered <= {kind_of(effect.name) for effect in effects}
    hidden = hidden_effects(campaign, known, effects) if proposal is None else proposal.hidden
    effects = [effect for effect in effects if effect.name not in hidden]
    worth = worth_fitting(campaign.rig, proposal, effects)
    if are_chosen:
        worth = replace(worth, alone=tuple(effects), are_chosen=True)
    context = _with_known_motion(campaign, context, reidentified)
    if (
        worth.is_shown
        and context.scoring != context.estimation
        and len(context.look) == len(context.estimation)
    ):
        # What a law errs does not average out: the most excited stretches say as much as whole records.
        context = replace(context, estimation=context.look)
        reidentified = reidentify(context, reidentified.fit.values)
    if worth.is_shown and proposal is not None and windowing.observer is not None:
        context, reidentified = held_by_motion(context, reidentified, proposal)
    together = None
    if worth.is_shown and proposal is not None and len(proposal.taken) > 1:
        together = with_causes(context, reidentified, proposal.taken, proposal)
        say("causes that the motion names")
    search, singles = _singles(context, reidentified, worth, together, say)
    lowered = lowered_by_extensions(context, reidentified, singles)
    if lowered.fit.cost <= (1.0 - SEARCH.worth_restarting) * reidentified.fit.cost:
        # What was compared with a local minimum of the equations was compared with a gap that does not exist.
        reidentified = lowered
        say("re-identified from a candidate")
        singles = ordered_by_inclusion(context, reidentified, singles)
    before = _before(campaign, context, reidentified)
    if campaign.given:
        say("given simulation")
    return SingleModels(
        windowing, context, before, reidentified, singles, search, proposal, tuple(effects), worth, together
    )


def held_by_motion(
    context: FitContext, reidentified: FittedModel, proposal: Proposal
) -> tuple[FitContext, FittedModel]:
    """Return the context whose fits must also hold along the measured motion, and the equations fitted so."""
    # A simulation that tracks the sensors hardly leaves them where the mass is large, whatever force it lacks. Where the
    # equations follow the sensors to within noise nothing is missing.
    found, error = proposal.numbers_beside, reidentified.error_over_noise
    if found is None or error <= VERDICT.at_floor:
        return context, reidentified
    context = replace(context, along_motion=found, error_of_force=error)
    known = found.beside(())
    start = dict(zip(known.names, map(float, known.values), strict=True))
    return context, reidentify(context, {**reidentified.fit.values, **start})


def _with_known_motion(campaign: Campaign, context: FitContext, reidentified: FittedModel) -> FitContext:
    """Return the context with scales from the motion and the forces between the sensors."""
    # These are known once the equations fit, or from the given simulation.
    known = _known(campaign, context, reidentified)
    if known.items() >= reidentified.fit.values.items() and campaign.rig.has_one_motion:
        return context
    return replace(context, scales=characteristic_scales(campaign.rig, campaign.estimation, known))


def _known(campaign: Campaign, context: FitContext, reidentified: FittedModel) -> dict[str, float]:
    """Return the numbers of the equations fitted without an effect; those given where that fit leaves some of them open."""
    is_bent = bool(campaign.given) and context.leaves_numbers_open(reidentified.fit)
    return {**campaign.constants, **reidentified.fit.values, **(campaign.given if is_bent else {})}


def _singles(
    context: FitContext,
    reidentified: FittedModel,
    worth: WorthFitting,
    together: FittedModel | None,
    say: Callable[[str], None],
) -> tuple[Search, list[FittedModel]]:
    """Return where was searched, and every effect by itself."""
    search = search_places(context, reidentified, context.offered(worth.alone))
    say("suspects")
    # Beside causes that leave nothing together, one that the motion does not judge must explain the larger part itself.
    leaves_nothing = together is not None and together.error_over_noise <= settled(reidentified)
    least = VERDICT.larger_part if leaves_nothing else VERDICT.larger_part * search.most
    first = [e for e in context.offered(worth.alone) if _comes_first(e, search, worth, least)]
    others = [effect for effect in (*search.effects, *search.others) if effect not in first]
    context.prepare(context.simplest((effect,)) for effect in first)
    reached = together if leaves_nothing else None
    singles = fit_candidates(context, reidentified, first, say, (), worth.starts, worth.is_shown, reached)
    best = min((model.error_over_noise for model in singles), default=np.inf)
    # What the motion rules out need not be fitted for a remainder that no law reaches, nor where the motion names the cause.
    enough = VERDICT.at_floor
    if worth.is_shown and not worth.are_chosen:
        enough = np.inf if worth.explained >= VERDICT.larger_part else larger_part_closed(reidentified)
    if others and best > enough:
        # A right model must not be lost because places or effects were ranked wrongly.
        context.prepare(context.simplest((effect,)) for effect in others)
        singles = fit_candidates(context, reidentified, others, say, singles, worth.starts, worth.is_shown)
    return search, singles


def _comes_first(effect: Effect, search: Search, worth: WorthFitting, least: float) -> bool:
    """Return True for an effect that the motion names, or that explains so much in the screening."""
    if not worth.is_shown:
        return effect in search.effects or effect in worth.named
    # What the motion does not judge has to explain enough itself, not only another effect at its place.
    is_candidate = effect in worth.named or effect.name in worth.undecided
    return is_candidate or search.shares.get(effect.name, search.most) >= least


def with_several_effects(
    campaign: Campaign,
    models: SingleModels,
    lower_bound: bool,
    allowed: float,
    rng: np.random.Generator,
    say: Callable[[str], None],
) -> AllModels:
    """Fit and score several effects together where one does not explain the records; in windows where only these can decide."""
    context, whole = models.context, models.windowing.whole
    at_floor = VERDICT.at_lower_bound if lower_bound else VERDICT.at_floor
    most_remainder = np.inf if lower_bound else VERDICT.most_remainder
    forms = OtherForms(context, lower_bound)
    cut: SingleModels | None = None
    if whole and not is_predictable(context, models.reidentified, models.singles, at_floor, rng):
        cut = _in_windows(campaign, models)
        say("in windows")
        if _explained(cut, cut.singles, at_floor):
            return AllModels(cut, [], True, Checks(cut.context, rng, VERDICT.at_floor, most_remainder), forms)
    checks = Checks(context, rng, VERDICT.at_floor, most_remainder)

    def ask(model: FittedModel) -> Proposal | None:
        beside = replace(campaign, modelled=(*campaign.modelled, *model.effects))
        return propose(beside, {**campaign.constants, **model.fit.all_values}, models.effects, context.noise)

    found = several_effects(models, ask, checks, lower_bound)
    for model in found[:1]:
        # The parts of a set compete with it, and tell the share of each.
        known = {single.names for single in models.singles}
        alone = [(effect,) for effect in model.effects if (effect.name,) not in known]
        parts = context.threads.side_by_side(partial(part_of, context, model), alone)
        models = replace(models, singles=[*models.singles, *parts])
    if not models.worth.is_shown:
        models = replace(models, singles=refit_singles(context, models.singles, found))
    if whole and not is_predictable(context, models.reidentified, found, allowed, rng):
        cut = cut or _in_windows(campaign, models)
        pairs = pairs_in_windows(context, cut.context, models.reidentified, found)
        say("pairs in windows")
        if _explained(cut, pairs, VERDICT.at_floor):
            return AllModels(
                cut, pairs, True, Checks(cut.context, rng, VERDICT.at_floor, most_remainder), forms
            )
    return AllModels(models, found, False, checks, forms)


def _in_windows(campaign: Campaign, models: SingleModels) -> SingleModels:
    """Return the models in windows of a few cycles."""
    known, leading = models.context, leading_output(campaign.rig, campaign.records)
    noise = {leading: known.noise[leading], **known.noise}
    windowing = Windowing(cycles=VERDICT.window_cycles, noise=noise)
    context = fit_context_of(campaign, known.noise, windowing, known.memory, known.threads, known.start)
    reidentified = reidentify(context, models.reidentified.fit.values)
    singles = fitted_in_windows(context, reidentified, models.singles)
    before = _before(campaign, context, reidentified) if reidentified.residuals else models.before
    return replace(
        models,
        windowing=windowing,
        context=context,
        before=before,
        reidentified=reidentified,
        singles=singles,
    )


def _explained(cut: SingleModels, models: Sequence[FittedModel], at_floor: float) -> bool:
    """Return True if one of the models explains the records in windows and the equations without an effect do not."""
    best = min((model.error_over_noise for model in models), default=float("inf"))
    return bool(cut.reidentified.residuals) and best <= at_floor < cut.reidentified.error_over_noise


def _before(campaign: Campaign, context: FitContext, reidentified: FittedModel) -> FittedModel:
    """Score the given simulation; parameters that were not given are identified with the given ones held."""
    if not campaign.given:
        return reidentified
    structure = context.composed()
    start = {**context.start, **reidentified.fit.values, **campaign.given}
    missing = [name for name in context.free_parameters(structure) if name not in campaign.given]
    fit = context.problem(structure, context.estimation).fit(start, missing)
    scored = context.score((), fit) if fit.residuals else None
    if scored is None or not scored.residuals:
        raise InputError(_why_not_run(context, structure, fit.values if fit.residuals else start))
    return scored


def _why_not_run(context: FitContext, structure: Structure, values: Mapping[str, float]) -> str:
    """Name the records that the given simulation cannot follow, with what decides it."""
    failing = [r for r in context.records if not context.problem(structure, [r]).fit(values, ()).residuals]
    reported = ", ".join(f"'{record.name}' (sample time {record.dt:.3g} s)" for record in failing[:5])
    where = f" in {reported}" if reported else ""
    return (
        f"The given simulation cannot be run: with the given parameters the motion{where} diverges or is too fast for the sample "
        f"time. Check the units of time and input, and the given parameters."
    )

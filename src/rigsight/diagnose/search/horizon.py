"""Over which stretch of a record can a simulation be compared with it? Rigs that drift, and motion that cannot be predicted.

A rig that drifts is compared over as long as the gap needs to become visible. If a disturbance as small as the noise eventually
leads to a different motion, not even the true model follows a whole record. In windows of a few cycles, each with its own initial
state, the true model does and a wrong one does not. A fit of two effects to whole records may then stop far away: the best pairs
are first fitted in short pieces of the most excited stretches, from the starts of both effects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import FitContext, FittedModel, fit_context_of, start_values_of
from rigsight.diagnose.policy import HORIZON, SEARCH, VERDICT
from rigsight.diagnose.search.first_look import started_from
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.diagnose.search.starts import start_values
from rigsight.errors import SimulationError
from rigsight.identify import DEFAULT_ACCURACY, FitResult, IdleThreads
from rigsight.identify.fit.first_states import first_state
from rigsight.identify.fit.windows import (
    Observer,
    Windowing,
    followed_sensors,
    leading_output,
    typical_period,
    window_length,
)
from rigsight.identify.linear_view import longest_free_run, near_rest
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import evaluated
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    record_values,
    simulate_outputs,
)


def restores(campaign: Campaign) -> bool:
    """Return True if records can be run free: else errors of forces or of initial states accumulate."""
    # The spring of one mass must be stiffer than the slowest observer. No rig may be unstable near its rest, or leave its
    # records.
    if not (campaign.rig.has_one_motion and campaign.rig.is_driven):
        return longest_free_run(_poles(campaign), campaign.estimation) is None and not _is_lost(campaign)
    typical = 2.0 * np.pi / typical_period(campaign.rig, campaign.estimation)
    poles = _poles(campaign)
    returns = bool(np.min(np.abs(poles)) >= HORIZON.observer_loose * typical)
    return returns and longest_free_run(poles, campaign.estimation) is None


def _is_lost(campaign: Campaign) -> bool:
    """Return True if the given simulation, run free, ends so far from a record that its error says nothing of the equations."""
    known = {**campaign.constants, **campaign.given}
    structure = compose(campaign.rig, campaign.modelled)
    if not all(name in known for name in structure.names):
        return False
    columns = [signal.name for signal in campaign.rig.outputs]
    for record in campaign.estimation:
        held = record_input(structure, record)
        p = parameter_vector(structure, record_values(structure, known, record))
        state = first_state(structure, record, known)
        try:
            run = simulate_outputs(structure, held, p, state, record.n_samples)
        except SimulationError:
            return False
        for name in followed_sensors(campaign.rig, [record]):
            error = run[:, columns.index(name)] - record[name]
            if np.sqrt(np.mean(error**2)) > HORIZON.lost * np.std(record[name]) > 0.0:
                return True
    return False


def _poles(campaign: Campaign) -> NDArray[np.complex128]:
    """Return the poles near rest of the rig before any fit [1/s]; none where its equations have no derivative there."""
    rig = campaign.rig
    if rig.has_one_motion:
        if not rig.is_driven:
            return np.zeros(0, dtype=np.complex128)
        motion, values = rig.motion, start_values_of(campaign)
        numbers = [evaluated(part, values) for part in (motion.inertia, motion.damping, motion.stiffness)]
        return np.roots(numbers).astype(np.complex128)
    # The start values of several bodies take seconds; the given simulation is stable where the rig is, or cannot be run at all.
    if not all(parameter.name in campaign.given for parameter in rig.parameters):
        return np.zeros(0, dtype=np.complex128)
    try:
        return near_rest(compose(rig), {**campaign.constants, **campaign.given}, campaign.estimation).poles
    except SimulationError:
        return np.zeros(0, dtype=np.complex128)


def windowing_of(
    campaign: Campaign, noise: Mapping[str, float], n_jobs: int, start: Mapping[str, float]
) -> tuple[Windowing, dict[str, float]]:
    """Return how records of a rig that drifts are compared with models: by an observer."""
    # The bandwidth of the observer is as high as possible while the gap remains clear, so that errors do not accumulate longer
    # than necessary, but not so high that the tracked noise shows in the error of a true model. If no sensor reads the motion
    # alone, records are cut into windows.
    sensors, poles = followed_sensors(campaign.rig, campaign.records), _poles(campaign)
    limit = longest_free_run(poles, campaign.estimation)
    if not sensors:
        longest = window_length(campaign.rig, campaign.estimation)
        return Windowing(min(longest, limit or longest)), dict.fromkeys(noise, 1.0)
    typical = 2.0 * np.pi / typical_period(campaign.rig, campaign.estimation)
    slowest = HORIZON.observer_loose * typical
    if limit is not None:
        slowest = max(slowest, HORIZON.observer_holds * float(np.max(np.abs(poles))))
    bandwidth = min(
        max(HORIZON.observer_close * typical, slowest),
        HORIZON.observer_sampling / max(record.dt for record in campaign.records),
    )
    values = start
    while True:
        windowing = Windowing(observer=Observer(sensors, bandwidth))
        context = fit_context_of(campaign, noise, windowing, None, IdleThreads(n_jobs), start)
        reidentified = reidentify(context, values)
        amplified = noise_of_following(context, reidentified.fit)
        shows = (
            reidentified.error_over_noise >= HORIZON.clear_gap and max(amplified.values()) <= VERDICT.at_floor
        )
        if shows or bandwidth <= slowest:
            return windowing, {name: max(1.0, factor) for name, factor in amplified.items()}
        values = reidentified.fit.values if reidentified.residuals else start
        bandwidth = max(bandwidth / HORIZON.observer_step, slowest)


def noise_of_following(context: FitContext, fit: FitResult) -> dict[str, float]:
    """Return the error of a true model that tracks noisy sensors, by sensor, in units of the noise."""
    # The true parameters are unknown: the larger of two values, with the given and with the fitted parameters.
    record, rng = context.estimation[0], np.random.default_rng(0)
    sensors = [signal.name for signal in context.rig.outputs]
    added = {
        name: rng.normal(scale=context.noise[name], size=record.n_samples)
        for name in sensors
        if name in record
    }
    noisy = record.with_signals(**{name: record[name] + noise for name, noise in added.items()})
    data = context.problem(fit.structure, [record, noisy], DEFAULT_ACCURACY).data

    def remainder(values: Mapping[str, float]) -> dict[str, float]:
        p = parameter_vector(data.structure, values)
        state = fit.initial_states[0]
        try:
            quiet, moved = (
                simulate_outputs(
                    data.structure, d.held, d.parameters(p), state, record.n_samples, DEFAULT_ACCURACY
                )
                for d in data.records
            )
        except SimulationError:
            return dict.fromkeys(added, 0.0)
        shown = dict(zip(sensors, (moved - quiet).T, strict=True))
        return {name: float(np.std(own - shown[name])) / context.noise[name] for name, own in added.items()}

    fitted, given = remainder(fit.values), remainder({**fit.values, **context.given})
    return {name: max(fitted[name], given[name]) for name in added}


_ACCURACY = 1e-5


def growth_of_disturbances(
    context: FitContext, reidentified: FittedModel, model: FittedModel, rng: np.random.Generator
) -> float:
    """Return the effect on a model of disturbances that would change the motion of the linear equations by the noise floor."""
    # With play and stops a small change can lead to a different motion; then even the true model has a large error on a whole
    # record, whatever its initial state.
    rig = context.rig
    if not rig.is_driven or not rig.inputs:
        return 0.0
    moving = {} if rig.has_one_motion else _sizes_of_inputs(context)
    sizes = moving or {rig.inputs[0].name: context.scales["input"]}
    largest = 0.0
    for index in range(len(context.scoring)):
        for source in list(sizes) * math.ceil(SEARCH.predictability_draws / len(sizes)):
            try:
                grown = _growth(context, reidentified, model, index, source, sizes[source], rng)
            except SimulationError:
                return 0.0
            largest = max(largest, grown)
    return largest


def _sizes_of_inputs(context: FitContext) -> dict[str, float]:
    """Return the spread of each input that moves."""
    shown = {s.name: np.concatenate([r[s.name] for r in context.records]) for s in context.rig.inputs}
    return {name: float(np.std(samples)) for name, samples in shown.items() if not is_constant(samples)}


def _growth(
    context: FitContext,
    reidentified: FittedModel,
    model: FittedModel,
    index: int,
    source: str,
    size: float,
    rng: np.random.Generator,
) -> float:
    rig, record = context.rig, context.scoring[index]
    seen = [signal.name for signal in rig.outputs if signal.name in record]
    if rig.has_one_motion:
        seen = [leading_output(rig, [record])]
    floors = np.array([context.noise[s.name] if s.name in seen else np.inf for s in rig.outputs])
    pole = np.exp(-record.dt / context.scales["time"])
    disturbance = lfilter([1.0 - pole], [1.0, -pole], rng.standard_normal(record.n_samples))
    disturbance *= 1e-3 * size / float(np.std(disturbance))
    through = _change(reidentified, index, record, source, disturbance, floors)
    if through == 0.0:
        return 0.0  # an input that this record's sensors do not see
    return _change(model, index, record, source, disturbance / through, floors)


def _change(
    model: FittedModel,
    index: int,
    record: Record,
    source: str,
    disturbance: Floats,
    floors: Floats,
) -> float:
    """Return the largest RMS change, in noise floors of the outputs, that a disturbance beside an input makes."""
    structure = model.fit.structure
    p = parameter_vector(structure, record_values(structure, model.fit.values, record))
    calm, disturbed = (
        simulate_outputs(
            structure,
            record_input(structure, record.with_signals(**{source: record[source] + extra})),
            p,
            model.initial_states[index],
            record.n_samples,
            _ACCURACY,
        )
        for extra in (0.0, disturbance)
    )
    return float(np.max(np.sqrt(np.mean((disturbed - calm) ** 2, axis=0)) / floors))


def is_predictable(
    context: FitContext,
    reidentified: FittedModel,
    models: Sequence[FittedModel],
    at_floor: float,
    rng: np.random.Generator,
) -> bool:
    """Return False if no model explains the records and the motion of a good one is sensitive to small disturbances."""
    usable = _nearest(models)
    if not usable or usable[0].error_over_noise <= at_floor:
        return True
    near = [
        model for model in usable if model.error_over_noise <= VERDICT.comparable * usable[0].error_over_noise
    ][: SEARCH.most_asked]
    # If the residual is much larger than the effect of a disturbance, sensitivity does not explain it.
    return all(
        growth_of_disturbances(context, reidentified, model, rng)
        <= max(VERDICT.sensitive, VERDICT.larger_part * model.error_over_noise)
        for model in near
    )


def fitted_in_windows(
    context: FitContext, reidentified: FittedModel, singles: Sequence[FittedModel]
) -> list[FittedModel]:
    """Fit the best models in windows; the others are only scored there, with the parameters that they have."""
    nearest = {model.names for model in _nearest(singles)[: SEARCH.most_asked]}

    def one(model: FittedModel) -> FittedModel:
        if not model.residuals:
            return model
        return _fitted(context, reidentified, model) if model.names in nearest else _scored(context, model)

    return list(context.threads.side_by_side(one, singles))


def _nearest(singles: Sequence[FittedModel]) -> list[FittedModel]:
    usable = (model for model in singles if model.residuals and np.isfinite(model.error_over_noise))
    return sorted(usable, key=lambda model: model.error_over_noise)


def _fitted(context: FitContext, reidentified: FittedModel, model: FittedModel) -> FittedModel:
    structure, free = model.fit.structure, model.fit.free
    (effect,) = model.effects
    own = [structure.parameter_name(effect, p.name) for p in effect.parameters if p.null == 0.0]
    declared = list(start_values(context, structure, effect, reidentified.fit, {}))
    starts = [
        model.fit.values,
        *({**s, **{n: f * s[n] for n in own if n in free}} for s in declared for f in SEARCH.smaller_starts),
    ]
    few = context.problem(structure, context.estimation[:: SEARCH.glimpsed_windows])
    glimpses = sorted(
        (few.fit_windows(start, free, SEARCH.window_evaluations, most_rounds=1) for start in starts),
        key=lambda fit: fit.cost,
    )
    # Only a model that can come to the floor is named in windows.
    within_reach = np.sqrt(SEARCH.near) * VERDICT.at_floor
    hopeful = [glimpse for glimpse in glimpses if glimpse.weighted_rms <= within_reach]
    if not hopeful:
        return _scored(context, model)
    problem = context.problem(structure, context.estimation)
    fits = [problem.fit_windows(glimpse.values, free) for glimpse in hopeful[: SEARCH.window_starts]]
    return _best_in_windows(context, model, fits)


def _scored(context: FitContext, model: FittedModel) -> FittedModel:
    structure = model.fit.structure
    there = context.problem(structure, context.estimation).fit_windows(model.fit.values, ())
    fit = replace(
        model.fit,
        residuals=there.residuals,
        initial_states=there.initial_states,
        cost=there.cost,
        substeps=there.substeps,
    )
    return _scored_in_windows(context, replace(model, fit=fit))


def _best_in_windows(context: FitContext, model: FittedModel, fits: Sequence[FitResult]) -> FittedModel:
    """Return a model with the best of its fits, scored on the windows that judge."""
    usable = [fit for fit in fits if fit.residuals]
    if not usable:
        return model.not_simulated()
    return _scored_in_windows(context, replace(model, fit=min(usable, key=lambda fit: fit.cost)))


def _scored_in_windows(context: FitContext, model: FittedModel) -> FittedModel:
    """Return a model scored on the windows that judge, with its numbers and the initial states that suit them."""
    result = context.problem(model.fit.structure, context.scoring).fit_windows(model.fit.values, ())
    error_over_noise = result.weighted_rms if result.residuals else float("inf")
    return replace(model, held_out=result, error_over_noise=error_over_noise)


def pairs_in_windows(
    context: FitContext, windows: FitContext, reidentified: FittedModel, pairs: Sequence[FittedModel]
) -> list[FittedModel]:
    """Return the best pairs, fitted and scored in windows."""
    of_two = [pair for pair in pairs if len(pair.effects) == 2]
    nearest = sorted(of_two, key=lambda pair: pair.error_over_noise)[: SEARCH.most_windowed_pairs]

    def one(pair: FittedModel) -> FittedModel:
        return _pair_in_windows(context, windows, reidentified, pair)

    return list(context.threads.side_by_side(one, nearest))


def _pair_in_windows(
    context: FitContext, windows: FitContext, reidentified: FittedModel, pair: FittedModel
) -> FittedModel:
    structure = pair.fit.structure
    first, second = pair.effects
    alone = context.simplest((first,))
    bases = [
        replace(reidentified.fit, structure=alone, values=values)
        for values in start_values(context, alone, first, reidentified.fit, {})
    ]
    starts = [start for base in bases for start in start_values(context, structure, second, base, {})]
    look = started_from(context, pair.effects, structure, starts)
    problem = windows.problem(structure, windows.estimation)
    fits = [problem.fit_windows(fit.values, pair.fit.free) for fit in (pair.fit, *look.fits)]
    return _best_in_windows(windows, pair, fits)

"""Prediction horizon for rigs that drift: as long as the gap needs to become visible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.fitting.preparation import Prepare, fit_context_of, start_values_of
from rigsight.diagnose.policy import HORIZON, VERDICT
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.errors import SimulationError
from rigsight.identify import DEFAULT_ACCURACY, FitResult, IdleThreads
from rigsight.identify.fit.first_states import first_state
from rigsight.identify.fit.windows import (
    Observer,
    Windowing,
    followed_sensors,
    typical_period,
    window_length,
)
from rigsight.identify.linear_view import longest_free_run, near_rest
from rigsight.records.record import Record
from rigsight.rigs import evaluated
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    record_values,
    simulate_outputs,
    structure_of_fit,
)


def restores(campaign: Campaign) -> bool:
    """Return True if records can be run free: else errors of forces or of initial states accumulate.

    The spring of one mass must be stiffer than the slowest observer. No rig may be unstable near its rest, or leave its records.
    """
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
    """Return how records of a rig that drifts are compared with models: by an observer.

    The bandwidth of the observer is as high as possible while the gap remains clear, so that errors do not accumulate longer than
    necessary, but not so high that the tracked noise shows in the error of a true model. If no sensor reads the motion alone,
    records are cut into windows.
    """
    sensors, poles = followed_sensors(campaign.rig, campaign.records), _poles(campaign)
    limit = longest_free_run(poles, campaign.estimation)
    if not sensors or (limit is not None and not campaign.rig.has_one_motion):
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
    """Return the error of a true model that tracks noisy sensors, by sensor, in units of the noise.

    The true parameters are unknown: the larger of two values, with the given and with the fitted parameters.
    """
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


def preparing(prepare: Prepare | None, records: Sequence[Record]) -> Prepare | None:
    """Return how structures are compiled that are fitted to records: with their free offsets and observers."""
    if prepare is None:
        return None
    return lambda structures: prepare([structure_of_fit(structure, records) for structure in structures])

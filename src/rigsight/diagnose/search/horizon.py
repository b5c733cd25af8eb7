"""Prediction horizon for rigs that drift: as long as the gap needs to become visible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.fitting.observer import Observer, followed_sensors
from rigsight.diagnose.fitting.preparation import Prepare, fit_context_of, start_values_of
from rigsight.diagnose.fitting.windows import Windowing, typical_period, window_length
from rigsight.diagnose.policy import HORIZON, VERDICT
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.errors import SimulationError
from rigsight.identify import DEFAULT_ACCURACY, FitResult, IdleThreads
from rigsight.records.record import Record
from rigsight.rigs import evaluated
from rigsight.simulate import parameter_vector, simulate_outputs, structure_of_fit


def brings_back(campaign: Campaign) -> bool:
    """Return True if the spring of one mass is stiffer than the slowest observer: else force errors accumulate."""
    if not (campaign.rig.has_one_motion and campaign.rig.is_driven):
        return True
    typical = 2.0 * np.pi / typical_period(campaign.rig, campaign.estimation)
    motion, values = campaign.rig.motion, start_values_of(campaign)
    numbers = [evaluated(part, values) for part in (motion.inertia, motion.damping, motion.stiffness)]
    return bool(np.min(np.abs(np.roots(numbers))) >= HORIZON.observer_loose * typical)


def windowing_of(
    campaign: Campaign, noise: Mapping[str, float], n_jobs: int
) -> tuple[Windowing, dict[str, float]]:
    """Return how records of a rig that drifts are compared with models: by an observer.

    The bandwidth of the observer is as high as possible while the gap remains clear, so that errors do not accumulate longer than
    necessary, but not so high that the tracked noise shows in the error of a true model. If no sensor reads the motion alone,
    records are cut into windows.

    Parameters
    ----------
    campaign
        Records and the given simulation.
    noise
        Noise floor of each output.
    n_jobs
        Threads that help with the records of a fit.

    Returns
    -------
    windowing
        How they are compared.
    amplified
        Error of a true model due to the noise, by output, in units of the noise; at least 1.
    """
    sensors = followed_sensors(campaign)
    if not sensors:
        return Windowing(window_length(campaign.rig, campaign.estimation)), dict.fromkeys(noise, 1.0)
    typical = 2.0 * np.pi / typical_period(campaign.rig, campaign.estimation)
    bandwidth = min(
        HORIZON.observer_close * typical,
        HORIZON.observer_sampling / max(record.dt for record in campaign.records),
    )
    start = start_values_of(campaign)
    values: Mapping[str, float] = start
    while True:
        windowing = Windowing(observer=Observer(sensors, bandwidth))
        context = fit_context_of(campaign, noise, windowing, None, IdleThreads(n_jobs), start)
        reidentified = reidentify(context, values)
        amplified = noise_of_following(context, reidentified.fit)
        shows = (
            reidentified.error_over_noise >= HORIZON.clear_gap and max(amplified.values()) <= VERDICT.at_floor
        )
        if shows or bandwidth <= HORIZON.observer_loose * typical:
            return windowing, {name: max(1.0, factor) for name, factor in amplified.items()}
        values = reidentified.fit.values if reidentified.residuals else start
        bandwidth = max(bandwidth / HORIZON.observer_step, HORIZON.observer_loose * typical)


def noise_of_following(context: FitContext, fit: FitResult) -> dict[str, float]:
    """Return the error of a true model that tracks noisy sensors, by sensor, in units of the noise.

    The true parameters are unknown: the larger of two values, with the given and with the fitted parameters.

    Parameters
    ----------
    context
        Records with what models follow, noise of each sensor.
    fit
        The equations without an effect, fitted to the records.
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

    def left(values: Mapping[str, float]) -> dict[str, float]:
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

    fitted, given = left(fit.values), left({**fit.values, **context.given})
    return {name: max(fitted[name], given[name]) for name in added}


def preparing(prepare: Prepare | None, records: Sequence[Record]) -> Prepare | None:
    """Return how structures are compiled that are fitted to records: with their free offsets and observers."""
    if prepare is None:
        return None
    return lambda structures: prepare([structure_of_fit(structure, records) for structure in structures])

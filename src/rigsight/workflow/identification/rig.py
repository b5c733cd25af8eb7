"""The identification of a rig: frequency responses, one fit in the time domain, poles, and identifiability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign, with_weighed_spring
from rigsight.effects import Effect
from rigsight.errors import RigsightError, SimulationError, check_option
from rigsight.identify import (
    FitResult,
    GreyBoxFit,
    OpenFactor,
    characteristic_scales,
    linear_start,
    swallowed_by_offsets,
)
from rigsight.identify.amplitude_dependence import amplitude_dependence
from rigsight.identify.fit.windows import cut, window_length
from rigsight.identify.identifiability import helpful_sensors, identifiability, relative_errors
from rigsight.identify.identification import (
    Identification,
    JointIdentification,
    RecordIdentification,
)
from rigsight.identify.information import POORLY_KNOWN, Information, information, reached_bounds
from rigsight.identify.linear_view import (
    LinearView,
    by_constants,
    linear_view,
    longest_free_run,
    measured_responses,
    near_rest,
)
from rigsight.identify.record_identification import EstimationOptions, identify_record, with_own_fit
from rigsight.identify.transfer.physical_parameters import PhysicalEstimates, form_gives_parameters
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import Model, Structure, compose
from rigsight.simulate.linearization import Linearization
from rigsight.workflow.identification.joint import UNSERVED, held_parameters, identify_jointly
from rigsight.workflow.identification.start_with_effects import start_with_effects
from rigsight.workflow.identification.warnings import (
    beyond_identified_amplitudes,
    identification_warnings,
    offsets_of_records,
)
from rigsight.workflow.run.kernels import prepare_kernels
from rigsight.workflow.run.progress import Listener, Stage, silent

IDENTIFYING = "Identifying"
METHODS_OF_ANY_RIG = ("local_rational", "local_polynomial")
"""Estimators for several inputs."""
_STEPS_AFTER_RECORDS = 3


def _has_forms(campaign: Campaign) -> bool:
    """Return True if each number of the transfer function of one driven mass on a spring gives one parameter."""
    # Not where effects of the simulation bend it, or where the mass is known or the gain of the drive is not.
    rig = campaign.rig
    if campaign.modelled or not (rig.has_one_motion and rig.is_driven) or campaign.given_without_spring:
        return False
    return rig.motion.stiffness != 0 and form_gives_parameters(rig, "pt2")


def identify_rig(
    campaign: Campaign,
    options: EstimationOptions,
    n_jobs: int,
    listener: Listener,
    asked: Sequence[Effect] = (),
) -> Identification:
    """Identify a rig by the estimation records of a campaign; `asked` are those of its effects that have no given numbers."""
    campaign = with_weighed_spring(campaign)
    rig, structure = campaign.rig, compose(campaign.rig, campaign.modelled)
    if not rig.has_one_motion:
        check_option(
            f"The method for the rig '{rig.name}' (h1 and thesis are for rigs of one motion)",
            options.method,
            METHODS_OF_ANY_RIG,
        )
    records = campaign.estimation
    prepare_kernels([structure], n_jobs, listener)
    stage = Stage(IDENTIFYING, len(records) + _STEPS_AFTER_RECORDS, listener)
    found = []
    # Threads suffice: linear algebra releases the GIL. Multithreaded linear algebra would only compete for the same processors.
    with threadpool_limits(limits=1, user_api="blas"):
        factor = campaign.open_factor
        held = held_parameters(campaign, records)
        if factor is not None:
            # Of parameters that are determined up to a common factor, one.
            held[factor.held] = factor.value
        start, length = _begin(campaign, records, held)
        # A rig that drifts or diverges has no break frequency, or none of a stable form.
        has_forms = length is None and _has_forms(campaign)
        parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
        for record in parallel(
            delayed(identify_record)(record, rig, campaign.constants, options, has_forms)
            for record in records
        ):
            found.append(record)
            stage.finished(record.record.name)
        if has_forms and all(record.paths and record.motion.problem for record in found):
            loose = _without_spring(campaign, options, n_jobs)
            if loose is not None:
                return loose
        windows = cut(records, length)
        # The search for a start knows terms of motions, and levels alone have none.
        if campaign.modelled or not rig.mechanism.coordinates:
            start = start_with_effects(campaign, asked, windows, start, held, _sizes(rig, windows))
        # Parameters that cannot be distinguished from sensor offsets that are free in each record.
        values = {**campaign.constants, **start}
        scales = characteristic_scales(rig, windows, values)
        sought = [p.name for p in rig.parameters if p.name not in held]
        swallowed = swallowed_by_offsets(structure, windows, scales, _sizes(rig, windows), values, sought)
        held |= {name: start[name] for name in swallowed}
        joint = identify_jointly(campaign, structure, found, start, held, length)
        stage.finished("one set for all records")
        errors = joint.fit.fit.standard_errors
        known, joint = _with_errors(joint, structure, windows, factor)
        found = [_with_own(record, joint, campaign) for record in found]
        stage.finished("identifiability")
        views = tuple(_views(structure, joint.fit.fit.values, records, options, known))
    units = {p.name: p.unit for p in structure.parameters} | rig.signal_units
    statement, changing = amplitude_dependence(found, units)
    reported = None
    if known is not None:
        fit = joint.fit
        scales = characteristic_scales(rig, windows, fit.fit.values)
        remedies = helpful_sensors(structure, windows, scales, fit.noise, fit.fit)
        reported = replace(identifiability(known), remedies=remedies)
    reached = () if known is None else reached_bounds(known, errors)
    identification = Identification(
        title=campaign.title,
        rig=rig.name,
        method=options.method,
        units=units,
        records=tuple(found),
        amplitude_statement=statement,
        changing=changing,
        joint=joint,
        model=Model.of(structure, joint.fit.fit.values, records[0].hold).to_json(),
        warnings=(
            *(bound.sentence for bound in reached),
            *([] if factor is None else [factor.sentence]),
            *identification_warnings(campaign, found, views, joint),
            *offsets_of_records(campaign, joint, {name: start[name] for name in swallowed}, length),
            *(beyond_identified_amplitudes(campaign) if len(rig.inputs) <= 1 else ()),
        ),
        reached=reached,
        views=views,
        identifiability=reported,
        meanings={parameter.name: parameter.description for parameter in structure.parameters},
    )
    stage.finished("poles and responses")
    return identification


def _without_spring(campaign: Campaign, options: EstimationOptions, n_jobs: int) -> Identification | None:
    """Return the identification of a rig that may have no spring; None if that does not follow the records."""
    # Such a rig has no break frequency in a record. Its stiffness is estimated only if it shows, as one that is given as zero.
    rig = campaign.rig
    absent = {p.name: 0.0 for p in rig.parameters if p.name == str(rig.motion.stiffness) and p.lower <= 0.0}
    if not absent or options.method not in METHODS_OF_ANY_RIG:
        return None
    try:
        found = identify_rig(
            replace(campaign, parameters={**campaign.parameters, **absent}), options, n_jobs, silent
        )
    except RigsightError:
        return None
    scores = [score for score in found.joint.scores if score.role == "estimation"]
    if any(not value < UNSERVED for score in scores for value in score.nrmse.values()):
        return None
    note = "No record shows a transfer function of these equations: all were fitted in the time domain."
    return replace(found, warnings=(note, *found.warnings))


def _begin(
    campaign: Campaign, records: Sequence[Record], held: Mapping[str, float]
) -> tuple[dict[str, float], float | None]:
    """Return start values of the rig without effects, and the length of windows [s] if it drifts or diverges."""
    rig, constants, structure = campaign.rig, campaign.constants, compose(campaign.rig)
    # The search for a start cuts records as it needs them.
    uncut = [replace(record, starting_samples=0) for record in records]
    starts = [linear_start(rig, uncut, constants, held)]
    given = rig.in_own_parameters(campaign.parameters, constants)
    if all(p.name in given for p in rig.parameters):
        starts.append({p.name: given[p.name] for p in rig.parameters})
    lengths = [_window_length(structure, {**constants, **start}, records) for start in starts]
    # A window with no more samples than its own initial state has numbers follows any motion: such a start is no model of it.
    shortest = (len(structure.states) + 1) * max(record.dt for record in records)
    possible = [i for i, length in enumerate(lengths) if length is None or length >= shortest]
    if possible:
        starts, lengths = [starts[i] for i in possible], [lengths[i] for i in possible]
    lengths = [None if length is None else max(length, shortest) for length in lengths]
    if len(starts) == 1:
        return starts[0], lengths[0]
    costs = [
        _cost(structure, {**constants, **start}, cut(records, length))
        for start, length in zip(starts, lengths, strict=True)
    ]
    best = int(np.argmin(costs))
    return starts[best], lengths[best]


def _cost(structure: Structure, values: Mapping[str, float], records: Sequence[Record]) -> float:
    scales = characteristic_scales(structure.rig, records, values)
    fit = GreyBoxFit(structure, records, scales, _sizes(structure.rig, records))
    return fit.fit(values, (), finish=False).cost


def _sizes(rig: Rig, records: Sequence[Record]) -> dict[str, float]:
    """Return how much each output that was measured moves."""
    return {
        signal.name: max(
            float(np.std(np.concatenate([r[signal.name] for r in records if signal.name in r]))), 1e-300
        )
        for signal in rig.outputs
        if any(signal.name in record for record in records)
    }


def _window_length(
    structure: Structure, values: Mapping[str, float], records: Sequence[Record]
) -> float | None:
    """Return the longest possible free run [s]; None if every record can be simulated as a whole, or is asked to be."""
    if any(record.starting_samples for record in records):
        return None
    try:
        linear = near_rest(structure, values, records)
    except SimulationError:
        return None
    limit = longest_free_run(linear.poles, records)
    if limit is not None:
        return min(window_length(structure.rig, records), limit)
    return window_length(structure.rig, records) if _drifts_in_sight(linear, records) else None


def _drifts_in_sight(linear: Linearization, records: Sequence[Record]) -> bool:
    """Return True if a motion without restoring force is measured: the angle of a free shaft drifts, its speed does not."""
    seen = [name for name in linear.outputs if any(name in record for record in records)]
    return linear.stability != "stable" and any(
        np.any(linear.transfer_function(source, response).poles == 0.0)
        for source in linear.inputs
        for response in seen
    )


def _with_errors(
    joint: JointIdentification, structure: Structure, windows: Sequence[Record], factor: OpenFactor | None
) -> tuple[Information | None, JointIdentification]:
    """Return what the records determine, and the fits with infinite standard errors for undetermined parameters."""
    fit = joint.fit

    def corrected(result: FitResult, records: Sequence[Record]) -> tuple[Information | None, FitResult]:
        if not (np.isfinite(result.cost) and result.residuals):
            return None, result
        scales = characteristic_scales(structure.rig, records, result.values)
        known = information(GreyBoxFit(structure, records, scales, fit.noise), result)
        errors = relative_errors(known)
        unknown = [name for name in result.free if errors[name] >= POORLY_KNOWN]
        place = [result.free.index(name) for name in unknown]
        covariance = result.covariance.copy()
        covariance[place, :], covariance[:, place] = 0.0, 0.0
        covariance[place, place] = np.inf
        return known, replace(
            result,
            standard_errors={**result.standard_errors, **dict.fromkeys(unknown, float("inf"))},
            covariance=covariance,
        )

    # Fits of single records hold the same value, so that they can be compared with each other. A value that was given is known.
    whole = fit.fit if factor is None or factor.is_given else _with_unknown(fit.fit, factor.held)
    known, together = corrected(whole, windows)
    kinds = tuple(
        replace(kind, fit=corrected(kind.fit, [w for w in windows if w.origin == kind.kind])[1])
        for kind in fit.kinds
    )
    return known, replace(joint, fit=replace(fit, fit=together, kinds=kinds), names=together.free)


def _with_unknown(result: FitResult, name: str) -> FitResult:
    """Return a fit in which a held parameter counts as fitted, with an infinite standard error."""
    free = tuple(n for n in result.structure.names if n in (*result.free, name))
    place = [free.index(n) for n in result.free]
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(place, place)] = result.covariance
    covariance[free.index(name), free.index(name)] = np.inf
    errors = {**result.standard_errors, name: float("inf")}
    return replace(result, free=free, covariance=covariance, standard_errors={n: errors[n] for n in free})


def _with_own(
    found: RecordIdentification, joint: JointIdentification, campaign: Campaign
) -> RecordIdentification:
    """Give a record the parameters of its own fit."""
    own = next(kind.fit for kind in joint.fit.kinds if kind.kind == found.record.name)
    if not np.isfinite(own.cost):
        return found
    positive = frozenset(p.name for p in own.structure.parameters if p.logarithmic)
    values = {name: own.values[name] for name in own.free}
    estimates = PhysicalEstimates(own.free, values, own.covariance, "fitted over time", positive)
    return with_own_fit(found, campaign.rig, estimates, {**campaign.constants, **found.record.constants})


def _views(
    structure: Structure,
    values: Mapping[str, float],
    records: Sequence[Record],
    options: EstimationOptions,
    known: Information | None,
) -> list[LinearView]:
    if known is None:
        return []
    views = []
    for group in by_constants(records):
        # Responses of all records together are estimated by a local method; those of each record by any.
        measured = None
        if options.method in METHODS_OF_ANY_RIG:
            measured = measured_responses(group, structure.rig, options.method, options.resolution)
        try:
            views.append(linear_view(structure, values, group, measured, known))
        except SimulationError:
            continue
    return views

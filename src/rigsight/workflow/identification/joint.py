"""Fit one parameter set to all estimation records, test whether it agrees with each record, and score free runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from rigsight.campaign import Campaign
from rigsight.identify import GreyBoxFit, PhysicalEstimates, characteristic_scales, estimate_conicity
from rigsight.identify.amplitude_dependence import measured_amplitude
from rigsight.identify.fit.windows import cut
from rigsight.identify.identification import JointIdentification, RecordIdentification, RecordScore
from rigsight.identify.joint import JointFit, fit_jointly
from rigsight.identify.transfer.transfer_function import MISFIT
from rigsight.metrics import nrmse
from rigsight.records import Floats, Record
from rigsight.records.signals import roughness
from rigsight.report.labels import gap_percent, sentence_case
from rigsight.simulate import Structure

_DIFFERENT = 0.01
"""Probability of equally large differences by chance, below which the records do not have a common parameter set."""
_SMALL_LOSS = 0.01
UNSERVED = 0.9
"""NRMSE from which a fit does not follow a motion at all."""
_BELOW = 1e-6


def identify_jointly(
    campaign: Campaign,
    structure: Structure,
    found: Sequence[RecordIdentification],
    start: Mapping[str, float],
    known: Mapping[str, float],
    length: float | None,
) -> JointIdentification:
    """Fit one set of parameters to all estimation records, and one to each; score every record."""
    records = [r.record for r in found]
    windows = cut(records, length)
    fit = fit_jointly(structure, windows, campaign.constants, known, start)
    pooled = _pooled(found, known) if fit.probability < _DIFFERENT else None
    if pooled is not None:
        held, noise, values = {**known, **pooled.values}, fit.noise, fit.fit.values
        fit = fit_jointly(structure, windows, campaign.constants, held, values, noise)
    amplitudes = {r.record.name: r.amplitude for r in found}
    scores = (
        *_estimation_scores(fit, windows, amplitudes),
        *(_validation_score(fit, record, campaign, length) for record in campaign.validation),
    )
    errors = {**fit.fit.standard_errors, **({} if pooled is None else pooled.standard_errors)}
    conicity, constants = None, campaign.constants
    if "c_y" in errors and {"r_0", "b"} <= constants.keys():
        conicity = estimate_conicity(fit.fit.values["c_y"], errors["c_y"], constants["r_0"], constants["b"])
    return JointIdentification(
        fit=fit,
        names=fit.fit.free,
        pooled=pooled,
        statement=_statement(fit, scores, records),
        conicity=conicity,
        scores=scores,
    )


def _pooled(found: Sequence[RecordIdentification], known: Mapping[str, float]) -> PhysicalEstimates | None:
    """Return the mean of the records' own parameters of what follows the motion, weighted by inverse variances."""
    # None if no record shows them, or if they are held.
    own = [path.physical for r in found for path in r.paths[1:] if path.physical is not None]
    if not own or known.keys() & set(own[0].names):
        return None
    values, errors = {}, []
    for name in own[0].names:
        estimates = np.array([[p.values[name], p.standard_errors[name]] for p in own])
        weights = estimates[:, 1] ** -2.0
        values[name] = float(weights @ estimates[:, 0] / weights.sum())
        scatter = float(np.sum(weights * (estimates[:, 0] - values[name]) ** 2)) / max(len(own) - 1, 1)
        errors.append(math.sqrt(max(scatter, 1.0) / weights.sum()))
    method = "mean over the records, with the measured motion as input"
    return PhysicalEstimates(own[0].names, values, np.diag(np.square(errors)), method, own[0].positive)


def held_parameters(campaign: Campaign, records: Sequence[Record]) -> dict[str, float]:
    """Return values for parameters that these records do not determine: no spring, outputs that were not measured."""
    rig = campaign.rig
    if not rig.has_one_motion:
        return {}
    own, known = {p.name: p for p in rig.parameters}, dict[str, float]()
    resting = {str(symbol) for symbol in rig.motion.rest.free_symbols} & own.keys()
    if campaign.absent_spring is not None:
        known |= {campaign.absent_spring: 0.0} | dict.fromkeys(resting, 0.0)
    elif rig.is_driven and resting:
        # With a linear spring, a constant force and a shifted rest position cannot be distinguished.
        known |= {str(symbol): 0.0 for symbol in rig.motion.bias.free_symbols if str(symbol) in own}
    following = [s.name for s in rig.mechanism.sensors if s.reads.free_symbols & rig.downstream.keys()]
    if rig.downstream and not any(name in record for name in following for record in records):
        for name in rig.downstream_parameters:
            default = own[name].default
            known[name] = campaign.given.get(name, 1.0 if default is None else default)
    return known


def errors_by_output(
    residuals: Sequence[Floats], records: Sequence[Record], outputs: Sequence[str]
) -> dict[str, float]:
    """Return the NRMSE of each output that was measured, over all windows of one record."""
    found = {}
    for i, name in enumerate(outputs):
        if all(name in record for record in records) and residuals:
            left = np.concatenate([residual[:, i] for residual in residuals])
            found[name] = nrmse(left, np.concatenate([record[name] for record in records]))
    return found


def _estimation_scores(
    fit: JointFit, windows: Sequence[Record], amplitudes: Mapping[str, float]
) -> list[RecordScore]:
    outputs = [signal.name for signal in fit.fit.structure.rig.outputs]
    scores = []
    for own in fit.kinds:
        places = [i for i, window in enumerate(windows) if window.origin == own.kind]
        records = [windows[i] for i in places]
        joint = [fit.fit.residuals[i] for i in places] if fit.fit.residuals else []
        scores.append(
            RecordScore(
                own.kind,
                "estimation",
                amplitudes[own.kind],
                errors_by_output(joint, records, outputs),
                errors_by_output(own.fit.residuals, records, outputs),
            )
        )
    return scores


def _validation_score(fit: JointFit, record: Record, campaign: Campaign, length: float | None) -> RecordScore:
    windows = cut([record], length)
    scales = characteristic_scales(campaign.rig, windows, fit.fit.values)
    noise = {s.name: fit.noise.get(s.name, 1.0) for s in campaign.rig.outputs}
    # Only initial states are estimated: a record may start away from rest.
    free_run = GreyBoxFit(fit.fit.structure, windows, scales, noise).fit(fit.fit.values, ())
    measured_in_fit = [s.name for s in campaign.rig.outputs if s.name in fit.noise]
    scored = errors_by_output(free_run.residuals, windows, [s.name for s in campaign.rig.outputs])
    amplitude = (
        record.amplitude if record.amplitude is not None else measured_amplitude(record, campaign.rig)[0]
    )
    return RecordScore(
        record.name, "validation", amplitude, {n: v for n, v in scored.items() if n in measured_in_fit}, {}
    )


def _is_unserved(relative: float, samples: Floats) -> bool:
    """Return True if a fit does not follow an output that a fit down to its noise would: at rest there is only noise."""
    return not relative < UNSERVED and roughness(samples) < UNSERVED * float(np.std(samples))


def _leaves_motion(relative: float, samples: Floats) -> bool:
    """Return True if an error, relative to the motion, is above the noise of the samples and not small."""
    return relative > _SMALL_LOSS and relative * float(np.std(samples)) > MISFIT * roughness(samples)


def beyond_noise(scores: Sequence[RecordScore], fitted: Sequence[Record]) -> list[str]:
    """Return what the joint model leaves of each output of the fitted records beyond noise, in words, the most first."""
    return _errors(scores, fitted, _leaves_motion)


def _errors(
    scores: Sequence[RecordScore], fitted: Sequence[Record], is_reported: Callable[[float, Floats], bool]
) -> list[str]:
    by_name = {record.name: record for record in fitted}
    found = [
        (error, f"{gap_percent(error)} of {name} in '{score.record}'")
        for score in scores
        if score.role == "estimation"
        for name, error in score.nrmse.items()
        if is_reported(error, by_name[score.record][name])
    ]
    return [words for _, words in sorted(found, reverse=True)]


def _statement(fit: JointFit, scores: Sequence[RecordScore], fitted: Sequence[Record]) -> str:
    if not fit.fit.success:
        return f"The joint fit did not converge: {fit.fit.message.rstrip('.')}. Its parameter values are not reliable."
    if len(fitted) < 2:
        return (
            "Only one estimation record was fitted, so its parameters cannot be compared with others. Another kind of record, "
            "such as a step beside a sweep, or another amplitude would test them."
        )
    unserved = _errors(scores, fitted, _is_unserved)
    if unserved and not fit.probability < _DIFFERENT:
        return (
            "The joint fit is too poor to judge whether one parameter set fits all records: its error is "
            f"{', '.join(unserved[:3])}. Its parameter values are not reliable; check signals for wrong sign, unit or column."
        )
    if not math.isfinite(fit.probability):
        return "There is no parameter that every record determines, so the records cannot be compared."
    if fit.probability >= _DIFFERENT:
        agree = f"equally large differences arise by chance with probability {fit.probability:.2g}"
        left = beyond_noise(scores, fitted)
        if not left:
            return f"One parameter set fits all {len(fitted)} estimation records: {agree}."
        return (
            f"The {len(fitted)} estimation records agree on one parameter set, but it does not fit them: it leaves "
            f"{', '.join(left[:3])}, more than noise. ({sentence_case(agree)}; a poor fit hides differences.) "
            "'rigsight diagnose' finds missing effects."
        )
    chance = f"below {_BELOW:g}" if fit.probability < _BELOW else f"{fit.probability:.1g}"
    text = (
        f"No single parameter set fits all {len(fitted)} estimation records (probability of chance {chance})."
    )
    return f"{text} {_pull(fit, scores)}"


def _pull(fit: JointFit, scores: Sequence[RecordScore]) -> str:
    """Name the record whose error grows most with the common set, and its own parameter values."""
    losses = [
        (score.nrmse[name] - score.own_nrmse[name], score, name)
        for score in scores
        if score.role == "estimation"
        for name in score.nrmse
        if name in score.own_nrmse
    ]
    loss, worst, output = max(losses, key=lambda item: item[0])
    own = next(kind for kind in fit.kinds if kind.kind == worst.record)
    shifts = {name: shift for name, shift in own.shift.items() if math.isfinite(shift)}
    joint_left, own_left = gap_percent(worst.nrmse[output]), gap_percent(worst.own_nrmse[output])
    left = f"the error of {output} is {joint_left} with the common set, {own_left} with its own"
    if loss < _SMALL_LOSS:
        return f"The differences are small, though: they are largest for '{worst.record}', where {left}."
    if not shifts:
        return f"The difference is largest for '{worst.record}': {left}."
    name = max(shifts, key=lambda key: abs(shifts[key]))
    return (
        f"The difference is largest for '{worst.record}': {left}; a simulation fitted to it alone has "
        f"{name} = {own.fit.values[name]:.3g} instead of {fit.fit.values[name]:.3g}."
    )

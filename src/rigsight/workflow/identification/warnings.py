"""Warnings of `rigsight identify`, besides the parameter values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.data_quality.checks import sensor_faults
from rigsight.identify import OFFSETS_MEND, differing_means
from rigsight.identify.amplitude_dependence import measured_amplitude
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.fit.windows import cut
from rigsight.identify.identification import JointIdentification, RecordIdentification
from rigsight.identify.linear_view import LinearView
from rigsight.identify.transfer.transfer_function import MISFIT
from rigsight.records import Record
from rigsight.units import behind

_TOLERANCE = 0.02
"""Relative tolerance with which an amplitude counts as inside the identified range."""
_OF_EACH_RECORD = (
    "It serves as instrumental variable for the frequency responses of each record, unless a note below says otherwise, so that "
    "noise on the input, fed back or not, does not bias them."
)
_NOT_OF_ANY_RIG = (
    "It is not used: the frequency responses are estimated from all records and inputs together, and noise on a measured input "
    "makes them too small."
)


def identification_warnings(
    campaign: Campaign,
    found: Sequence[RecordIdentification],
    views: Sequence[LinearView],
    joint: JointIdentification,
) -> list[str]:
    """Return the notes on records, responses, poles and fit, a sentence each."""
    rig = campaign.rig
    reported = list(campaign.notes)
    reported += [f"Record '{r.name}': {note}" for r in campaign.records for note in r.notes]
    reported += [
        f"{fault.sentence} {fault.remedy}" for fault in sensor_faults(rig, campaign.records) if fault.serious
    ]
    used = _OF_EACH_RECORD if rig.has_one_motion else _NOT_OF_ANY_RIG
    reported += closed_loop_notes(campaign.records, rig, used)
    reported += [f"Record '{r.record.name}': {text}" for r in found for text in r.warnings]
    for view in views:
        reported += _of_view(view, campaign)
    names = [p.name for p in rig.parameters if rig.has_one_motion and p.name in rig.downstream_parameters]
    if rig.downstream and joint.pooled is None and names and not set(names) & set(joint.names):
        missing = ", ".join(symbol.name for symbol in rig.downstream)
        reported.append(
            f"No estimation record has {missing}: {', '.join(names)} in the model are given or placeholders, not identified."
        )
    if not joint.fit.fit.success:
        reported.append(joint.statement)
    return list(dict.fromkeys(reported))


def offsets_of_records(
    campaign: Campaign, joint: JointIdentification, held: Mapping[str, float], length: float | None = None
) -> list[str]:
    """Return the sensor offsets that were estimated in each record, or a hint that they should be estimated."""
    fit, rig = joint.fit.fit, campaign.rig
    fitted = cut(campaign.estimation, length)
    units = {signal.name: signal.unit for signal in rig.outputs}
    names = [record.origin for record in fitted]
    if not fit.offset_names:
        found = differing_means(names, fitted, fit.residuals, list(units))
        return [f"{reported.sentence(units[reported.output])} {OFFSETS_MEND}" for reported in found]
    reported = []
    for output in fit.offset_names:
        own: dict[str, list[float]] = {}
        for index, record in enumerate(fitted):
            if output in record:
                own.setdefault(names[index], []).append(fit.offsets(index)[output])
        listed = ", ".join(f"'{name}' {np.mean(values):.4g}" for name, values in own.items())
        reported.append(
            f"Offset of {output} in each record [{units[output]}], estimated and not part of the model: {listed}."
        )
    if held:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in held.items())
        reported.append(
            f"{values} {'are' if len(held) > 1 else 'is'} held: not identifiable if each record has its own offset."
        )
    return reported


def _of_view(view: LinearView, campaign: Campaign) -> list[str]:
    reported, effects = [], [effect.name for effect in campaign.modelled]
    where = f" ({view.constants_text})" if view.constants else ""
    near_rest = view.linearization
    if not near_rest.rests:
        reported.append(
            f"The rig has no equilibrium at the mean input{where}: poles and responses are those of the state closest to rest."
        )
    if near_rest.stability == "unstable":
        reported.append(
            f"The equilibrium of the rig is unstable{where}. Records are fitted in short windows with their own initial states; "
            "frequency responses of an unstable rig are meaningful only if an external controller stabilizes it."
        )
    if view.measured is None:
        return reported
    # The transient of a rig that does not return to rest does not decay within a record: its responses are no evidence.
    returns = near_rest.stability == "stable"
    if not campaign.rig.has_one_motion:
        # The responses along one motion are read, and their problems told, record by record.
        reported += [
            f"{source} -> {response}{where}: {problem}"
            for (source, response), problem in view.measured.problems.items()
        ]
    off = {pair: view.misfit(*pair) for pair in view.measured.found}
    beside = [
        f"{source} -> {response} ({off[source, response]:.2g})"
        for source, response in off
        if returns and off[source, response] > MISFIT
    ]
    if beside:
        why = (
            f"Linear equations leave out what is not linear in {' and '.join(effects)}; the fit in the time domain contains it."
            if effects
            else "Either the motion is too large for a linear model, or an effect is missing. The nonlinear fit in the time "
            "domain shows which; 'rigsight diagnose' finds missing effects."
        )
        reported.append(
            f"The residual of the linearized equations is larger than the noise{where}, by these factors: {', '.join(beside)}. "
            f"{why}"
        )
    return reported


def beyond_identified_amplitudes(campaign: Campaign) -> list[str]:
    """Report validation records with an amplitude outside the range of the fitted records."""
    fitted = campaign.estimation
    given = all(record.amplitude is not None for record in (*fitted, *campaign.validation))

    def amplitude(record: Record) -> tuple[float, str]:
        measured, name = measured_amplitude(record, campaign.rig)
        return record.amplitude if given and record.amplitude is not None else measured, name

    identified: dict[str, list[float]] = {}
    for size, name in map(amplitude, fitted):
        identified.setdefault(name, []).append(size)
    reported = []
    for record in campaign.validation:
        size, name = amplitude(record)
        unit = behind(campaign.rig.signal_units[name])
        low, high = min(identified.get(name, [size])), max(identified.get(name, [size]))
        if (1.0 - _TOLERANCE) * low <= size <= (1.0 + _TOLERANCE) * high:
            continue
        one = math.isclose(low, high, rel_tol=_TOLERANCE)
        span = f"{low:.3g}{unit}" if one else f"{low:.3g} to {high:.3g}{unit}"
        than = "smaller" if size < low else "larger"
        reported.append(
            f"Validation record '{record.name}' has an amplitude of {size:.3g}{unit}, {than} than in the fitted records "
            f"({span}): its score shows how well the model extrapolates, not how well it was identified."
        )
    return reported

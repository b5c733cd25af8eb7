"""What must a user of `rigsight identify` be told about the records beside the numbers?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.diagnose.fitting.windows import cut
from rigsight.identify import OFFSETS_MEND, differing_means
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.identification import JointIdentification, RecordIdentification
from rigsight.identify.linear_view import LinearView
from rigsight.identify.record_identification import MISFIT, measured_amplitude
from rigsight.identify.transfer.record_response import driven_band
from rigsight.records import Record
from rigsight.rigs import evaluated
from rigsight.workflow.identification.joint import parent

_TOLERANCE = 0.02
"""Share by which an amplitude may lie outside the identified ones and still count as one of them."""
_OF_EACH_RECORD = (
    "It is the instrument of the frequency response of the motion to its input, record by record where nothing else is said "
    "below: noise on the input, fed back or not, does not bias it."
)
_NOT_OF_ANY_RIG = (
    "It is not used: the frequency responses are those of all records and inputs together, and noise on a measured input makes "
    "them too small."
)


def out_of_band(
    found: RecordIdentification, campaign: Campaign, joint: JointIdentification
) -> RecordIdentification:
    """Say of a record that could not be identified if it never drove the resonance that the others show."""
    motion = found.motion
    omega_0 = _resonance(campaign, joint)
    if not motion.problem or motion.measured is None or omega_0 is None:
        return found
    low, high = driven_band(found.record, motion.source)
    if low <= omega_0 <= high:
        return found
    told = (
        f"this record drives '{motion.source}' from {low:.3g} to {high:.3g} rad/s, and the resonance lies at {omega_0:.3g} "
        "rad/s, as the other records show. Record it again with excitation there."
    )
    path = replace(motion, problem=told)
    rest = tuple(text for text in found.warnings if motion.problem not in text)
    return replace(
        found,
        paths=(path, *found.paths[1:]),
        warnings=(f"{motion.source} -> {motion.response}: {told}", *rest),
    )


def _resonance(campaign: Campaign, joint: JointIdentification) -> float | None:
    motion, values = campaign.rig.motion, joint.fit.fit.values
    if motion.inertia is None:
        return None
    stiffness, inertia = (evaluated(part, values) for part in (motion.stiffness, motion.inertia))
    return math.sqrt(stiffness / inertia) if stiffness > 0.0 else None


def campaign_warnings(
    campaign: Campaign,
    found: Sequence[RecordIdentification],
    joint: JointIdentification,
    has_stiffness: bool,
) -> list[str]:
    """Return what the records' own identifications, the joint fit and the reading have to tell, a sentence each."""
    told = list(campaign.notes)
    told += [f"Record '{r.name}': {note}" for r in campaign.records for note in r.notes]
    told += closed_loop_notes(campaign.records, campaign.rig, _OF_EACH_RECORD)
    told += [f"Record '{r.record.name}': {text}" for r in found for text in r.warnings]
    told += _not_the_whole(found)
    told += [f"Record '{name}' was left out of the joint fit." for name in joint.left_out]
    if not has_stiffness:
        told.append(
            "The campaign sets k = 0: the axis has no spring and no resonance, so m and d are fitted to the velocity, and "
            "the axis is simulated over windows with their own initial states."
        )
    if joint.pooled is None and campaign.rig.downstream and "c_y" not in joint.names:
        missing = ", ".join(symbol.name for symbol in campaign.rig.downstream)
        names = ", ".join(
            p.name for p in campaign.rig.parameters if p.name in campaign.rig.downstream_parameters
        )
        told.append(
            f"No estimation record has {missing}: {names} in the model are given or "
            "placeholders, not identified."
        )
    if not joint.fit.fit.success:
        told.append(joint.statement)
    return told


def any_rig_warnings(
    campaign: Campaign, views: Sequence[LinearView], joint: JointIdentification
) -> list[str]:
    """Return what reading, responses, poles and the fit of a rig of any shape have to tell, a sentence each.

    Parameters
    ----------
    campaign
        The campaign.
    views
        The rig close to its rest.
    joint
        The fit.
    """
    told = list(campaign.notes)
    told += [f"Record '{r.name}': {note}" for r in campaign.records for note in r.notes]
    told += closed_loop_notes(campaign.records, campaign.rig, _NOT_OF_ANY_RIG)
    for view in views:
        told += _of_view(view)
    if not joint.fit.fit.success:
        told.append(joint.statement)
    return list(dict.fromkeys(told))


def offsets_of_records(
    campaign: Campaign, joint: JointIdentification, held: Mapping[str, float], length: float | None = None
) -> list[str]:
    """Return the offsets of sensors that were estimated in each record, or that they should be where they were not.

    Parameters
    ----------
    campaign
        The campaign.
    joint
        The fit.
    held
        Parameters that say the same as such offsets, and the values at which they were held.
    length
        Of the windows into which records were cut [s]; None where they were fitted whole.
    """
    fit, rig = joint.fit.fit, campaign.rig
    fitted = cut([r for r in campaign.estimation if r.name not in joint.left_out], length)
    units = {signal.name: signal.unit for signal in rig.outputs}
    names = [parent(record) for record in fitted]
    if not fit.offset_names:
        found = differing_means(names, fitted, fit.residuals, list(units))
        return [f"{told.sentence(units[told.output])} {OFFSETS_MEND}" for told in found]
    told = []
    for output in fit.offset_names:
        own: dict[str, list[float]] = {}
        for index, record in enumerate(fitted):
            if output in record:
                own.setdefault(names[index], []).append(fit.offsets(index)[output])
        listed = ", ".join(f"'{name}' {np.mean(values):.4g}" for name, values in own.items())
        told.append(
            f"Offset of {output} by record [{units[output]}], estimated and no part of the model: {listed}."
        )
    if held:
        values = ", ".join(f"{name} = {value:.4g}" for name, value in held.items())
        told.append(
            f"{values} {'are' if len(held) > 1 else 'is'} held: with an offset in each record nothing tells it."
        )
    return told


def _of_view(view: LinearView) -> list[str]:
    told = []
    where = (
        f" ({', '.join(f'{name} = {value:g}' for name, value in view.constants.items())})"
        if view.constants
        else ""
    )
    near_rest = view.linearization
    if not near_rest.rests:
        told.append(
            f"Nothing balances the mean input{where}: poles and responses are those of the place that comes nearest to rest."
        )
    if near_rest.stability == "unstable":
        told.append(
            f"The rig is unstable where it rests{where}. Records are fitted in short windows with initial states of their own; "
            "frequency responses of an unstable rig mean something only if a controller outside the rig keeps it there."
        )
    if view.measured is None:
        return told
    told += [
        f"{source} -> {response}{where}: {problem}"
        for (source, response), problem in view.measured.problems.items()
    ]
    off = {pair: view.misfit(*pair) for pair in view.measured.found}
    beside = [
        f"{source} -> {response} ({off[source, response]:.2g})"
        for source, response in off
        if off[source, response] > MISFIT
    ]
    if beside:
        told.append(
            f"The linearized equations leave more than noise explains{where}, as multiples of it: {', '.join(beside)}. Either "
            "the motion is too large for one linear picture, or something is missing. The fit over time, which is not linear, "
            "tells which; 'rigsight diagnose' looks for what is missing."
        )
    return told


def _not_the_whole(found: Sequence[RecordIdentification]) -> list[str]:
    """Say of which paths the form leaves far more than noise."""
    told = []
    for first in {(path.source, path.response): path for r in found for path in r.paths}.values():
        misfits = [
            path.fit.misfit
            for r in found
            for path in r.paths
            if path.fit is not None and path.response == first.response and path.fit.misfit > MISFIT
        ]
        if misfits:
            form = "PT1" if first.response == "y" else "linear equation"
            span = f"{min(misfits):.3g} to {max(misfits):.3g}" if len(misfits) > 1 else f"{misfits[0]:.3g}"
            told.append(
                f"{first.source} -> {first.response}: the {form} is not the whole of the rig. In {len(misfits)} of {len(found)} "
                f"records it leaves {span} times what noise explains. 'rigsight diagnose' looks for what is missing."
            )
    return told


def beyond_identified_amplitudes(campaign: Campaign, joint: JointIdentification) -> list[str]:
    """Say which validation records have an amplitude that no fitted record of the same signal had."""
    fitted = [r for r in campaign.estimation if r.name not in joint.left_out]
    given = all(record.amplitude is not None for record in (*fitted, *campaign.validation))
    units = {signal.name: signal.unit for signal in (*campaign.rig.inputs, *campaign.rig.outputs)}

    def amplitude(record: Record) -> tuple[float, str]:
        measured, name = measured_amplitude(record, campaign.rig)
        return record.amplitude if given and record.amplitude is not None else measured, name

    identified: dict[str, list[float]] = {}
    for size, name in map(amplitude, fitted):
        identified.setdefault(name, []).append(size)
    told = []
    for record in campaign.validation:
        size, name = amplitude(record)
        unit = units[name]
        low, high = min(identified.get(name, [size])), max(identified.get(name, [size]))
        if (1.0 - _TOLERANCE) * low <= size <= (1.0 + _TOLERANCE) * high:
            continue
        one = math.isclose(low, high, rel_tol=_TOLERANCE)
        span = f"{low:.3g} {unit}" if one else f"{low:.3g} to {high:.3g} {unit}"
        told.append(
            f"Validation record '{record.name}' has an amplitude of {size:.3g} {unit}, outside what was identified ({span}): its "
            "score tells how far the model reaches, not how well it was identified."
        )
    return told

"""Can the records be trusted, or would a fault of the data explain the gap before any effect does?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rigsight.diagnose.data_quality.amplitude_response import amplitude_dependences
from rigsight.diagnose.data_quality.finding import DataQuality, Finding
from rigsight.diagnose.data_quality.input_timing import input_timing, without_short_delays
from rigsight.diagnose.data_quality.offsets_by_record import levels_apart, means_of
from rigsight.diagnose.data_quality.sensor_faults import sensor_faults
from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.identify import OFFSETS_MEND
from rigsight.records.record import Record


def data_quality(context: FitContext, records: Sequence[Record], reidentified: FittedModel) -> DataQuality:
    """Check the records before an effect is tried."""
    # A wrong hold that a strong effect hides shows only with that effect in the model, see `with_best_model`.
    timing = input_timing(context, (), reidentified.fit)
    faults = [finding for record in records for finding in sensor_faults(context.rig, record)]
    return DataQuality(
        findings=(
            *levels_apart(context, records),
            *(timing.findings() if timing is not None else ()),
            *faults,
        ),
        amplitudes=amplitude_dependences(
            context.rig, records, {(f.record or "", f.signal or "") for f in faults}
        ),
    )


def with_offsets_told(quality: DataQuality, context: FitContext, model: FittedModel) -> DataQuality:
    """Add the note if the mean residual of the best model differs between records, as with offsets that differ."""
    units = {signal.name: signal.unit for signal in context.rig.outputs}
    known = {finding.signal for finding in quality.findings if finding.kind == "offset"}
    found = [
        Finding(
            "offset",
            reported.sentence(units[reported.output]),
            OFFSETS_MEND,
            serious=False,
            signal=reported.output,
        )
        for reported in means_of(context, model)
        if reported.output not in known
    ]
    return replace(quality, findings=(*found, *quality.findings)) if found else quality


def with_best_model(quality: DataQuality, context: FitContext, model: FittedModel) -> DataQuality:
    """Test the hold of the input again with the effects in the model that may have hidden its part of the gap."""
    # A delay that is shorter than a sample is left out for it: a wrong hold looks like half a sample of delay.
    if not model.effects or any(finding.kind == "time_shift" for finding in quality.findings):
        return quality
    effects, base = without_short_delays(context, model)
    timing = input_timing(context, effects, base, with_shift=False)
    if timing is None:
        return quality
    others = tuple(finding for finding in quality.findings if finding.kind != "hold")
    if not timing.findings():
        # What looked like a wrong hold without the effects was their work.
        return quality if others == quality.findings else replace(quality, findings=others)
    # A delay may explain as much; it is worth its fit only now.
    timing = input_timing(context, effects, base) or timing
    named = " and ".join(effect.name for effect in effects)
    # A hold that makes a named delay superfluous changes the verdict.
    replaces_delay = effects != model.effects
    found = [
        replace(
            finding,
            sentence=f"With {named} in the model: {_inside_a_sentence(finding.sentence)}"
            if named
            else finding.sentence,
            serious=finding.serious or replaces_delay,
        )
        for finding in timing.findings()
    ]
    return replace(quality, findings=(*found, *others))


def _inside_a_sentence(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]

"""Can the records be trusted, or would a fault of the data explain the gap before any effect does?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.data_quality.amplitude_response import amplitude_dependences
from rigsight.diagnose.data_quality.finding import DataQuality, Finding
from rigsight.diagnose.data_quality.input_timing import input_timing, without_short_delays
from rigsight.diagnose.data_quality.offsets_by_record import levels_apart, means_of
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import NOTES
from rigsight.identify import OFFSETS_MEND
from rigsight.records.record import Floats, Record
from rigsight.records.sensor_signs import begins_again
from rigsight.records.signals import clipping
from rigsight.records.stamps import written_span, written_stamp
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.units import behind


def data_quality(context: FitContext, records: Sequence[Record], reidentified: FittedModel) -> DataQuality:
    """Check the records before an effect is tried."""
    # A wrong hold that a strong effect hides shows only with that effect in the model, see `with_best_model`.
    timing = input_timing(context, (), reidentified.fit)
    faults = sensor_faults(context.rig, records)
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
            sentence=f"With {named} in the model: {finding.sentence[:1].lower()}{finding.sentence[1:]}"
            if named
            else finding.sentence,
            serious=finding.serious or replaces_delay,
        )
        for finding in timing.findings()
    ]
    return replace(quality, findings=(*found, *others))


def sensor_faults(rig: Rig, records: Sequence[Record]) -> list[Finding]:
    """Return what is wrong with the channels of records."""
    return [finding for record in records for finding in _sensor_faults(rig, record, records)]


def _sensor_faults(rig: Rig, record: Record, records: Sequence[Record]) -> list[Finding]:
    found = []
    signals = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs) if signal.name in record}
    outputs = [signal.name for signal in rig.outputs if signal.name in record]
    smooth = _of_displacement(rig) if rig.is_driven else frozenset()
    for name, unit in signals.items():
        found += _clipped(record, name, unit, [other[name] for other in records if name in other])
    given = max((np.unique(record[s.name]).size for s in rig.inputs if s.name in record), default=0)
    most_levels = given if given <= NOTES.fewest_levels else 0
    for name in outputs:
        samples = record[name]
        if np.ptp(samples) == 0.0:
            continue
        coarse = _quantized(record, name, signals[name], most_levels)
        found += coarse
        # A coarse channel stands still and jumps by itself; a force may do both, and a pressure or a speed when an input steps.
        if not coarse and name in smooth:
            # A stuck channel jumps where it comes loose.
            found += _stuck(record, name) or _jumping(record, name, signals[name])
    return found


def _of_displacement(rig: Rig) -> frozenset[str]:
    """Return the sensors whose rate of change no input can set at once: those that read coordinates, or what follows them."""
    structure = compose(rig)
    tree = structure.tree
    following = {*tree.motion.coordinates, *structure.parameter_symbols}
    moving = {*following, *tree.motion.velocities, *(state.symbol for state in tree.states)}
    following |= {state.symbol for state in tree.states if tree.flattened(state.rate).free_symbols <= moving}
    return frozenset(
        sensor.name
        for sensor, reading in zip(rig.mechanism.sensors, structure.outputs, strict=True)
        if reading.free_symbols <= following
    )


def _clipped(record: Record, name: str, unit: str, recorded: Sequence[Floats]) -> list[Finding]:
    # A level that the channel exceeds in another record is none of its range: a servo rests at its target, too.
    ends = {min(map(np.min, recorded)), max(map(np.max, recorded))}
    return [
        Finding(
            "clipping",
            f"Record {record.name}: {name} is clipped at {level:.4g}{behind(unit)} ({count} samples).",
            "Record again with a wider range, or leave the record out.",
            record=record.name,
            signal=name,
        )
        for level, count in clipping(record[name])
        if level in ends
    ]


def _quantized(record: Record, name: str, unit: str, n_given: int) -> list[Finding]:
    """Find a channel whose values lie on so few levels that rounding is a good part of its noise."""
    # An output that has no more levels than the input, `n_given`, may follow a staircase without noise.
    levels = np.unique(record[name])
    span = float(levels[-1] - levels[0])
    if not n_given < levels.size <= NOTES.fewest_levels:
        return []
    gaps = np.diff(levels)
    step = float(np.min(gaps))
    # Levels of a converter are multiples of one step; few samples, or a rig that mostly rests, are not.
    if step < span / NOTES.fewest_levels or np.max(np.abs(gaps / step - np.round(gaps / step))) > 0.05:
        return []
    return [
        Finding(
            "quantization",
            f"Record {record.name}: {name} moves in steps of {step:.3g}{behind(unit)} ({levels.size} levels); rounding alone "
            f"causes noise of {step / np.sqrt(12.0):.2g}{behind(unit)}.",
            "Record with a finer resolution; smaller errors cannot be resolved.",
            serious=False,
            record=record.name,
            signal=name,
        )
    ]


def _stuck(record: Record, name: str) -> list[Finding]:
    """Find stretches in which a channel that moves elsewhere stands exactly still, entered or left abruptly."""
    steps = np.diff(record[name])
    still = steps == 0.0
    edges = np.diff(still.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = stops - starts >= NOTES.shortest_stuck
    if not long.any() or np.mean(still) > NOTES.longest_share_still:
        return []
    typical = float(np.sqrt(np.mean(steps[~still] ** 2)))
    before = np.abs(steps[np.maximum(starts - 1, 0)]) * (starts > 0)
    after = np.abs(steps[np.minimum(stops, steps.size - 1)]) * (stops < steps.size)
    # An encoder leaves its rest by a whole step however gently the mass does.
    broken_off = max(NOTES.abrupt * typical, NOTES.one_step * float(np.min(np.abs(steps[~still]))))
    stuck = np.flatnonzero(long & (np.maximum(before, after) > broken_off))
    if stuck.size == 0:
        return []
    reported = [
        written_span(float(record.t[starts[i]]), float(record.t[min(stops[i], record.n_samples - 1)]))
        for i in stuck[: NOTES.first_reported]
    ]
    return [
        Finding(
            "stuck",
            f"Record {record.name}: {name} is exactly constant from {', '.join(reported)}{_more(stuck.size)} "
            "and jumps at its end.",
            "Check the sensor and its transmission; cut these stretches out.",
            record=record.name,
            signal=name,
        )
    ]


def _jumping(record: Record, name: str, unit: str) -> list[Finding]:
    """Find samples at which the displacement of a mass jumps, alone (a spike) or for good (lost counts)."""
    samples = record[name]
    third = np.diff(samples, 3)
    if third.size < NOTES.jump_neighborhood:
        return []
    # The largest of the four third differences that a spike of size h leaves is 3 h, of a lasting jump 2 h.
    size = np.abs(third) / 2.0
    power = uniform_filter1d(size**2, NOTES.jump_neighborhood, mode="nearest") * NOTES.jump_neighborhood
    near = uniform_filter1d(size**2, 9, mode="nearest") * 9
    around = np.sqrt(np.maximum(power - near, 0.0) / (NOTES.jump_neighborhood - 9))
    large = np.flatnonzero((size > NOTES.jump_size * np.std(samples)) & (size > NOTES.jump_contrast * around))
    if large.size == 0:
        return []
    places = [
        group[np.argmax(size[group])] for group in np.split(large, np.flatnonzero(np.diff(large) > 4) + 1)
    ]
    # A third difference reaches over four samples; the jump lies at the largest step among them.
    steps = [np.abs(np.diff(samples[place : place + 4])) for place in places]
    # An encoder at rest on an edge toggles by one count.
    changes = np.abs(np.diff(samples))
    count = float(np.min(changes[changes > NOTES.rounding * np.ptp(samples)], initial=np.inf))
    kept = [i for i, step in enumerate(steps) if np.max(step) > NOTES.one_step * count]
    if not kept:
        return []
    places, steps = [places[i] for i in kept], [steps[i] for i in kept]
    reported = ", ".join(
        f"{written_stamp(float(record.t[place + 1 + np.argmax(step)]), record.dt)} s"
        for place, step in zip(places[: NOTES.first_reported], steps, strict=False)
    )
    largest = max(float(np.max(step)) for step in steps)
    why, remedy = (
        "no mass can move like that",
        "Check for interference or lost counts; repair the samples or leave the record out.",
    )
    if begins_again(samples):
        why = "it goes on from the other end of its range, as an encoder does after a turn"
        remedy = (
            f'Write {name} = {{ name = "...", unwrap = N }} in the columns of the record, where N is its period, about '
            f"{np.ptp(samples) + count:.4g}{behind(unit)}, in the numbers of the column."
        )
    return [
        Finding(
            "jump",
            f"Record {record.name}: {name} jumps by about {largest:.3g}{behind(unit)} at {reported}"
            f"{_more(len(places))}; {why}.",
            remedy,
            record=record.name,
            signal=name,
        )
    ]


def _more(count: int) -> str:
    return f" and {count - NOTES.first_reported} more times" if count > NOTES.first_reported else ""

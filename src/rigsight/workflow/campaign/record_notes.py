"""Checks of the records of a campaign before any fit: units and sample times, and independent validation records."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from rigsight.errors import InputError
from rigsight.records import Floats, Record, is_constant
from rigsight.records.channel_units import UnknownUnitError, conversion, has_si, is_a
from rigsight.rigs import Rig, rotational

_SEGMENTS = 8
"""Non-overlapping segments of a spectrum: enough for a median over frequencies."""
_DRIVEN = 1e-2
"""Share of the largest power of an input from which a frequency counts as driven."""
_LEAST_RATIO = 30.0
"""Ratio of gains from which a unit is asked about: below degrees for radians (57). That no amplitude changes a gain so much is an
assumption; on nine campaigns, and 24 drawn ones of development seeds, ratios reached 6."""
_Gain = tuple[Floats, Floats]
"""Frequencies at which an input drives, and the gains there."""
_SMALLEST_SHARE, _LARGEST_SHARE = 200.0, 4.0
"""Factors by which a stated amplitude may lie below and above half the input's range (one line of many; a step from rest)."""
_RATES_APART = 100.0
"""Ratio of sample times from which a note asks about their units."""


def record_notes(called: str, rig: Rig, records: Sequence[Record]) -> tuple[str, ...]:
    """Return a sentence for each finding."""
    found = [
        *_sensors_missing(rig, records),
        *_rates_apart(records),
        *_other_units(rig, records),
        *(note for record in records for note in _other_amplitude(record, rig)),
        *_fitted_again(called, records),
        *_other_holds(records),
    ]
    if all(record.role != "validation" for record in records):
        found.append(
            f'{called}: no record has role = "validation"; errors of models that were fitted to these records are too small.'
        )
    return tuple(found)


def _sensors_missing(rig: Rig, records: Sequence[Record]) -> Iterator[str]:
    """Ask about a sensor that only some records hold: its column may have another name in the others."""
    for sensor in rig.outputs:
        without = [record.name for record in records if sensor.name not in record]
        if 0 < len(without) < len(records):
            listed = ", ".join(f"'{name}'" for name in without)
            yield (
                f"{sensor.name} is missing in {listed}, or never changes there: nothing is compared with it. If its column has "
                f'another name, write columns = {{ {sensor.name} = "..." }} for that record.'
            )


def _fitted_again(file: str, records: Sequence[Record]) -> Iterator[str]:
    for scored in (record for record in records if record.role == "validation"):
        for fitted in (record for record in records if record.role == "estimation"):
            same = scored.signals.keys() == fitted.signals.keys()
            if same and all(np.array_equal(own, fitted[name]) for name, own in scored.signals.items()):
                yield (
                    f"{file}: the validation record '{scored.name}' has exactly the samples of '{fitted.name}', which is fitted: "
                    "it validates nothing. Name another file."
                )


def _other_holds(records: Sequence[Record]) -> Iterator[str]:
    holds = list(dict.fromkeys(record.hold for record in records if record.role == "estimation"))
    if len(holds) > 1:
        yield (
            f"The estimation records differ in hold ({', '.join(holds)}): each is fitted with its own; models are written with "
            f"that of the first, {holds[0]}."
        )


def _rates_apart(records: Sequence[Record]) -> Iterator[str]:
    """Ask about sample times that differ so much that the time of one record is probably in another unit."""
    finest, coarsest = (choose(records, key=lambda record: record.dt) for choose in (min, max))
    if coarsest.dt >= _RATES_APART * finest.dt:
        yield (
            f"Warning: The sample times of the records differ by a factor of {coarsest.dt / finest.dt:.3g}: '{finest.name}' "
            f"has {finest.dt:.3g} s, '{coarsest.name}' {coarsest.dt:.3g} s. Is the time of one of them in ms? Then write "
            't = { name = "...", unit = "ms" } for it.'
        )


def _other_units(rig: Rig, records: Sequence[Record]) -> Iterator[str]:
    """Ask about a signal whose gain differs so much between records that it is probably in another unit in one of them."""
    for output in rig.outputs:
        for source in rig.inputs:
            # The gain of one input is seen where the others rest.
            others = [signal.name for signal in rig.inputs if signal is not source]
            alone = [r for r in records if all(is_constant(r[name]) for name in others if name in r)]
            found = unit_mismatch(alone, source.name, output.name)
            if found is not None:
                larger, smaller, ratio = found
                yield (
                    f"Warning: At the same frequencies '{output.name}' moves {ratio:.3g} times as far per unit of "
                    f"'{source.name}' in record '{larger.name}' as in '{smaller.name}'. Is one of the two signals in another "
                    f'unit there? Then give its unit, for instance {output.name} = {{ name = "...", unit = "..." }}.'
                )
                break


def _other_amplitude(record: Record, rig: Rig) -> Iterator[str]:
    """Ask about a stated amplitude that fits neither the peak nor the RMS nor a line of the input."""
    stated, halves = record.amplitude, {s.name: 0.5 * float(np.ptp(record[s.name])) for s in rig.inputs}
    moving = {name: half for name, half in halves.items() if half > 0.0}
    if stated is None or not moving:
        return
    if not any(half / _SMALLEST_SHARE <= abs(stated) <= _LARGEST_SHARE * half for half in moving.values()):
        listed = " and ".join(f"half the range of '{name}' is {half:.3g}" for name, half in moving.items())
        yield f"Record '{record.name}': amplitude = {stated:g}, but {listed}. Is one of them in another unit?"


def unit_mismatch(
    records: Sequence[Record], source: str, response: str
) -> tuple[Record, Record, float] | None:
    """Return the two records whose gains differ most, and by what factor; None where no unit explains it."""
    # Gains are compared at frequencies that drive both, so that it does not matter which band a record sweeps.
    gains = [
        (record, gain)
        for record in records
        if source in record and response in record
        if (gain := _gain(record, source, response)) is not None
    ]
    found: tuple[Record, Record, float] | None = None
    for (one, first), (other, second) in combinations(gains, 2):
        ratio = _ratio(first, second)
        larger, smaller = (one, other) if ratio > 1.0 else (other, one)
        ratio = max(ratio, 1.0 / ratio)
        if ratio >= _LEAST_RATIO and (found is None or ratio > found[2]):
            found = larger, smaller, ratio
    return found


def _gain(record: Record, source: str, response: str) -> _Gain | None:
    # Loaded where it is used: the process that reads a file imports this package and needs none of it.
    from scipy.signal import welch

    if np.ptp(record[source]) == 0.0 or np.ptp(record[response]) == 0.0:
        return None
    length = max(record.n_samples // _SEGMENTS, min(record.n_samples, 64))
    f, driving = welch(record[source], 1.0 / record.dt, nperseg=length)
    _, responding = welch(record[response], 1.0 / record.dt, nperseg=length)
    driven = (driving > _DRIVEN * np.max(driving[1:], initial=0.0)) & (f > 0.0) & (responding > 0.0)
    return (f[driven], np.sqrt(responding[driven] / driving[driven])) if driven.any() else None


def _ratio(one: _Gain, other: _Gain) -> float:
    """Return the median ratio of two gains at frequencies that both have; 1 where they have none in common."""
    (f, gain), (g, second) = one, other
    inside = (f >= g[0]) & (f <= g[-1])
    if not inside.any():
        return 1.0
    return float(np.median(gain[inside] / np.interp(f[inside], g, second)))


def is_in_units_of(rig: Rig, record: Record) -> bool:
    """Return True if all signals of a record have the units of a rig."""
    return all(record.units.get(name) == unit for name, unit in rig.signal_units.items() if name in record)


def rig_in_units_of(rig: Rig, records: Sequence[Record]) -> Rig:
    """Return a built-in rig in the units that its records state; any other rig as it is."""
    other = rotational(rig)
    if other is None:
        return rig
    stated = [
        (name, unit) for record in records for name, unit in record.units.items() if unit and name in record
    ]
    own, turned = rig.signal_units, other.signal_units
    turns = any(
        not is_a(unit, own[name]) and is_a(unit, turned[name])
        for name, unit in stated
        if name in own and own[name] != turned[name]
    )
    return other if turns else rig


def in_units_of(rig: Rig, record: Record) -> Record:
    """Return a record with its signals in the units of a rig, with a note for each that was converted."""
    # A signal without a unit is taken to be in that of the rig.
    units, signals, notes = dict(record.units), dict(record.signals), list(record.notes)
    amplitude = record.amplitude
    for signal in (*rig.inputs, *rig.outputs):
        stated = record.units.get(signal.name, "")
        if signal.name not in record or (stated and not has_si(signal.unit)):
            continue
        units[signal.name] = signal.unit
        if not stated or stated == signal.unit or {stated, signal.unit} == {"", "1"}:
            continue
        try:
            scale, offset = conversion(stated, signal.unit)
        except UnknownUnitError as error:
            raise InputError(
                f"Record '{record.name}': the unit '{stated}' of {signal.name} {error}; {signal.name} is in {signal.unit}. Give "
                f'the right unit, or units = {{"{signal.name}": "{signal.unit}"}} to take the values without conversion.'
            ) from None
        if (scale, offset) == (1.0, 0.0):
            continue
        signals[signal.name] = scale * record[signal.name] + offset
        added = f"; {offset:.6g} {signal.unit} was added, as for an absolute temperature" if offset else ""
        notes.append(
            f"Record '{record.name}': {signal.name} was converted from {stated}, the unit of the record, to {signal.unit}{added}."
        )
        if amplitude is not None and [source.name for source in rig.inputs] == [signal.name]:
            amplitude *= scale
    return replace(record, units=units, signals=signals, notes=tuple(notes), amplitude=amplitude)

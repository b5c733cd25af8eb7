"""What is, or may be, wrong with the records of a campaign, each with what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigsight.campaign import Campaign
from rigsight.check.channels import CheckedRecord
from rigsight.diagnose.data_quality.checks import sensor_faults
from rigsight.diagnose.data_quality.finding import Finding
from rigsight.diagnose.data_quality.offsets_by_record import levels_apart
from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.noise.detection import NoiseFloor
from rigsight.identify import OFFSETS_MEND, differing_means
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.start.linear_start import moves_against
from rigsight.records import Floats, Record
from rigsight.records.signals import instrument_of, is_constant, moves_beyond_noise
from rigsight.rigs import Rig, evaluated
from rigsight.simulate import compose
from rigsight.simulate.linearization import Linearization

Severity = Literal["fault", "warning", "note"]
WARNING = "Warning: "
"""Before a note of the reading that asks for attention."""
_NOISY_INPUT = 0.02
"""Noise of an input over its standard deviation from which estimates suffer, most at high frequencies (a convention)."""
_LASTS = 0.995
"""Mean amplitude of the later swings of a free motion over that of the earlier ones from which it does not decay (an
assumption): a rig that is damped so weakly is called the same."""
_RESTS = 0.05
"""The same over the largest amplitude below which the motion has come to rest (a convention)."""
_FEWEST_SWINGS = 8
"""Half periods of the last two thirds of a record from which it is seen to decay or not (a convention)."""
_UNSTABLE = 1e-6
"""Real part of a pole over its size below which it is rounding."""
_PAST = 12
"""Samples of the past that predict an input (an assumption): a controller of some rows reacts within them."""
_BETTER = 0.8
"""Share of the squared error of this prediction that is left with the past of the readings, below which they act on the input (an
assumption)."""


@dataclass(frozen=True)
class Remark:
    """One thing to know before a fit."""

    severity: Severity  # a fault makes numbers wrong, a warning may, a note says what was done or assumed
    sentence: str
    remedy: str = ""
    record: str | None = None
    signal: str | None = None


def remarks(
    campaign: Campaign,
    short: Sequence[Record],
    long: Sequence[Record],
    records: Sequence[CheckedRecord],
    floors: Sequence[NoiseFloor],
    linear: Linearization | None,
) -> tuple[Remark, ...]:
    """Return what is to be known, the gravest first; short and long are stretches of the estimation and of all records."""
    found = [
        Remark(
            "fault" if f.serious and f.kind != "clipping" else "warning",
            f.sentence,
            f.remedy,
            f.record,
            f.signal,
        )
        for f in (*_levels_apart(campaign), *sensor_faults(campaign.rig, campaign.records))
    ]
    found += _of_reading(campaign)
    found += _noisy_inputs(campaign, records)
    found += _reversed(campaign, long)
    found += _lasting(campaign)
    found += _unstable(linear)
    found += _feedback(campaign, short)
    found += _floors(floors)
    found += _at_bounds(campaign)
    return by_gravity(found)


def by_gravity(found: Iterable[Remark]) -> tuple[Remark, ...]:
    """Return remarks, the gravest first."""
    order = ("fault", "warning", "note")
    return tuple(sorted(found, key=lambda one: order.index(one.severity)))


def with_offsets(
    found: Sequence[Remark], rig: Rig, records: Sequence[Record], residuals: Sequence[Floats]
) -> tuple[Remark, ...]:
    """Return remarks with the sensors whose mean residual of a rough fit, by record or window, differs between records."""
    units = {signal.name: signal.unit for signal in rig.outputs}
    differing = differing_means([record.origin for record in records], records, residuals, list(units))
    # Means that differ by more than the motion are reported already.
    reported = {one.signal for one in found if one.remedy == OFFSETS_MEND}
    offsets = [
        Remark("warning", one.sentence(units[one.output]), OFFSETS_MEND, signal=one.output)
        for one in differing
        if one.output not in reported
    ]
    return by_gravity([*found, *offsets])


def _levels_apart(campaign: Campaign) -> list[Finding]:
    records, held = campaign.records, frozenset(filter(None, [campaign.absent_spring]))
    known = {**campaign.constants, **campaign.given}
    return levels_apart(
        FitContext(campaign.rig, records, records, records, {}, {}, held, given=known), records
    )


def _of_reading(campaign: Campaign) -> Iterator[Remark]:
    notes: list[tuple[str, str | None]] = [(note, None) for note in campaign.notes]
    notes += [(note, record.name) for record in campaign.records for note in record.notes]
    for note, record in notes:
        severity: Severity = "warning" if note.startswith(WARNING) else "note"
        yield Remark(severity, note.removeprefix(WARNING), record=record)


def _noisy_inputs(campaign: Campaign, records: Sequence[CheckedRecord]) -> Iterator[Remark]:
    driving = _driving(campaign)
    # What is held between samples has no noise that its differences would show.
    held = {record.name for record in campaign.records if record.hold == "zoh"}
    for record in records:
        for channel in record.channels:
            measured = channel.name in driving and record.name not in held
            if measured and channel.noise > _NOISY_INPUT * channel.std > 0.0:
                yield Remark(
                    "warning",
                    f"Record {record.name}: {channel.name} has noise of {channel.noise:.2g} {channel.unit}, "
                    f"{channel.noise / channel.std:.1%} of its motion. Fits take it for a drive that moves the rig.",
                    "Record the command, or filter the channel before it is sampled.",
                    record.name,
                    channel.name,
                )


def _reversed(campaign: Campaign, records: Sequence[Record]) -> Iterator[Remark]:
    """Yield records that move against their drive: one of the signals has the opposite sign."""
    rig, known = campaign.rig, {**campaign.constants, **campaign.given}
    if not (rig.has_one_motion and rig.is_driven) or rig.controllers:
        return
    if not {symbol.name for symbol in rig.motion.drive_gain.free_symbols} <= known.keys():
        return
    source, response = rig.inputs[0].name, rig.outputs[0].name
    for record in records:
        still = response not in record or is_constant(record[source]) or is_constant(record[response])
        if still or instrument_of(record, rig.signal_units):
            continue
        gain = evaluated(rig.motion.drive_gain, {**known, **record.constants})
        if moves_against(record, source, response, gain, campaign.absent_spring is None):
            yield Remark(
                "fault",
                f"Record {record.name}: {response} moves against {source}, which no rig with these equations does: one of the "
                "signals has the opposite sign.",
                f'Change the sign of that signal: {response} = {{ name = "...", scale = -1.0 }}.',
                record.name,
                response,
            )


def _driving(campaign: Campaign) -> list[str]:
    """Return the inputs that drive the rig; a prescribed motion is measured like a reading."""
    mechanism = campaign.rig.mechanism
    return [signal.name for signal in campaign.rig.inputs if signal.name not in mechanism.prescribing]


def _lasting(campaign: Campaign) -> Iterator[Remark]:
    """Yield free motions that do not decay: something drives them."""
    for record in campaign.records:
        if not all(is_constant(record[s.name]) for s in campaign.rig.inputs if s.name in record):
            continue
        for sensor in (s.name for s in campaign.rig.outputs if s.name in record):
            rest = _RESTS * float(np.ptp(record[sensor])) / 2.0
            swings = _amplitudes(record[sensor][record.n_samples // 3 :], rest)
            if len(swings) < _FEWEST_SWINGS:
                continue
            # The same number of swings to both sides.
            half = len(swings) // 4 * 2
            before, last = float(np.mean(swings[-2 * half : -half])), float(np.mean(swings[-half:]))
            if last > _LASTS * before and moves_beyond_noise(record[sensor]):
                yield Remark(
                    "warning",
                    f"Record {record.name}: {sensor} does not decay while nothing drives the rig (mean amplitude of its last "
                    f"{half} half periods {last:.3g}, of the {half} before {before:.3g}). Its damping is negative at some "
                    "amplitude, or something drives it that was not recorded.",
                    "Allow a negative damping, or record what drives it.",
                    record.name,
                    sensor,
                )


def _amplitudes(samples: Floats, rest: float) -> list[float]:
    """Return the largest deviation from the mean of whole half periods; noise that crosses the mean within `rest` ends none."""
    deviation = samples - np.mean(samples)
    moving = np.flatnonzero(np.abs(deviation) > rest)
    crossings = moving[np.flatnonzero(np.diff(deviation[moving] >= 0.0)) + 1]
    return [float(np.max(np.abs(part))) for part in np.split(deviation, crossings)[1:-1]]


def _unstable(linear: Linearization | None) -> Iterator[Remark]:
    worst = max(linear.poles, key=lambda pole: float(pole.real), default=0.0) if linear else 0.0
    if worst.real > _UNSTABLE * abs(worst):
        yield Remark(
            "warning",
            f"At these numbers the equations are unstable near rest: a pole at {worst.real:+.3g} rad/s. A simulation without the "
            "loop that held the rig leaves the records.",
            "Record the reference of the loop as well. Models are compared along the measured motion.",
        )


def _feedback(campaign: Campaign, short: Sequence[Record]) -> Iterator[Remark]:
    """Yield whether the readings act on an input: known from the reference or the rig, else tested.

    C. W. J. Granger, Econometrica 37 (1969) 424: they do if their past predicts the input beyond its own past.
    """
    rig = campaign.rig
    for note in closed_loop_notes(campaign.records, rig, ""):
        yield Remark("note", note)
        return
    if rig.controllers:
        yield Remark("note", "The rig file closes the loop itself: its drives read sensors.")
        return
    for record in short:
        outputs = [s.name for s in rig.outputs if s.name in record]
        for source in (
            name for name in _driving(campaign) if name in record and not is_constant(record[name])
        ):
            left = _left_by_readings(record, source, outputs)
            if left < _BETTER:
                yield Remark(
                    "note",
                    f"Record {record.name}: the past of the readings predicts {source} better than its own past (squared error "
                    f"{left:.0%}). Either a loop is closed around the rig, or {source} is measured with noise.",
                    "Record the reference of the loop as a column 'reference'.",
                    record.name,
                    source,
                )


def _left_by_readings(record: Record, source: str, outputs: Sequence[str]) -> float:
    """Return the squared error of an input's prediction with the past of the readings over that without, on the second half."""
    n = record.n_samples - _PAST

    def past(name: str) -> list[np.ndarray]:
        samples = (record[name] - np.mean(record[name])) / (np.std(record[name]) or 1.0)
        return [samples[_PAST - lag : _PAST - lag + n] for lag in range(1, _PAST + 1)]

    target = (record[source] - np.mean(record[source]))[_PAST:] / np.std(record[source])
    own = np.column_stack(past(source))
    both = np.column_stack([own, *(column for name in outputs for column in past(name))])
    half, errors = n // 2, []
    for matrix in (own, both):
        x = np.linalg.lstsq(matrix[:half], target[:half], rcond=1e-9)[0]
        errors.append(float(np.mean((target[half:] - matrix[half:] @ x) ** 2)))
    return errors[1] / errors[0] if errors[0] > 1e-12 else 1.0


def _floors(floors: Sequence[NoiseFloor]) -> Iterator[Remark]:
    for floor in floors:
        if floor.lower_bound:
            yield Remark(
                "note",
                f"The noise floor of {floor.output} is a lower bound ({floor.method}): {floor.std:.2g} {floor.unit}.",
                "Begin a record with a second of rest, or repeat one.",
                signal=floor.output,
            )


def _at_bounds(campaign: Campaign) -> Iterator[Remark]:
    """Yield numbers of modelled effects that are given as zero: such an effect is not there."""
    structure = compose(campaign.rig, campaign.modelled)
    of_rig = {p.name for p in campaign.rig.parameters}
    for parameter in structure.parameters:
        given = campaign.given.get(parameter.name)
        if given is not None and parameter.name not in of_rig and given in (parameter.lower, parameter.null):
            yield Remark(
                "warning",
                f"{parameter.name} = {given:g} is given at the end of its range: the modelled effect does nothing there.",
                "Give the value it has, or leave the effect out.",
            )

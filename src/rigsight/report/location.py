"""Section "Where the gap lies": its rows and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigsight import plot
from rigsight.diagnose.location.gap_parts import AmplitudePart, BandPart, GapPart, StatePart
from rigsight.diagnose.result import Diagnosis
from rigsight.records.stamps import written_span
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.labels import gap_percent, listed, percent, rig_of, sentence_case
from rigsight.report.sections import output_label
from rigsight.report.wording import stage_names, stages_reported
from rigsight.units import behind

if TYPE_CHECKING:
    from rigsight.plot import Figure

_JOINTS_SHOWN = 3


@dataclass(frozen=True)
class OutputMaps:
    """The figures of one output: its name for people, and its anchor."""

    key: str
    title: str
    figures: list[PageFigure]


def all_maps(diagnosis: Diagnosis) -> list[OutputMaps]:
    """Return all figures of the section: the missing force, each output, the joints."""
    return [*force_maps(diagnosis), *output_maps(diagnosis), *joint_maps(diagnosis)]


def output_maps(diagnosis: Diagnosis) -> list[OutputMaps]:
    """Return the figures that show where the gap of each output lies."""
    maps = []
    for number, output in enumerate(diagnosis.gap, start=1):
        figures = _figures(diagnosis, output, f"where-{number}")
        if figures:
            label = output_label(diagnosis, output)
            # A bare name of a column is written as it is.
            title = label if label == output else sentence_case(label)
            maps.append(OutputMaps(f"where-{number}", title, figures))
    return maps


def joint_maps(diagnosis: Diagnosis) -> list[OutputMaps]:
    """Return maps over the planes of the joints that the verdict names, else of all, for the output with the largest gap."""
    parts = [
        part for part in diagnosis.localization.by_state if part.joint and math.isfinite(part.force_mean)
    ]
    if not parts:
        return []
    named = [part for part in parts if part.joint in diagnosis.where]
    parts = named or parts
    shown = {part.output for part in parts}
    output = max(
        (name for name in diagnosis.gap if name in shown),
        key=lambda name: diagnosis.gap[name].reidentified / diagnosis.gap[name].noise_floor,
    )
    figures = []
    for number, joint in enumerate(dict.fromkeys(part.joint for part in parts), start=1):
        own = [part for part in parts if part.joint == joint and part.output == output]
        rest = stage_names(diagnosis)["reidentified"]
        figures.append(_states_figure(own, output, joint, f"where-joint-{number}", rest))
    return [OutputMaps("where-joints", "Joint by joint", figures)]


def force_maps(diagnosis: Diagnosis) -> list[OutputMaps]:
    """Return the figures of the missing force along the measured motion, the joint that explains most first."""
    if diagnosis.missing_force is None:
        return []
    figures = [
        page_figure(
            plot.missing_force(force),
            f"missing-force-{number}",
            f"Missing force at {force.where} over velocity, displacement and time",
            f"{sentence_case(force.where)}: the force that the equations leave along the measured motion if it is missing here "
            f"alone, positive where it resists, with its mean and two standard errors (RMS {force.rms:.3g} {force.unit}; "
            f"{percent(force.share)} of the squared residual of all equations).",
        )
        for number, force in enumerate(diagnosis.missing_force.forces[:_JOINTS_SHOWN], start=1)
    ]
    return [OutputMaps("where-missing-force", "Missing force, before any law", figures)]


def _figures(diagnosis: Diagnosis, output: str, key: str) -> list[PageFigure]:
    where = diagnosis.localization
    stages = stage_names(diagnosis)
    rest = stages["reidentified"]
    bands = [part for part in where.by_band if part.output == output]
    states = [part for part in where.by_state if part.output == output and not part.joint]
    times = [part for part in where.by_time if part.output == output]
    records = [part for part in where.by_record if part.output == output]
    amplitudes = sorted(
        (part for part in where.by_amplitude if part.output == output), key=lambda p: (p.amplitude, p.scored)
    )
    one_record_each = 1 < len(amplitudes) == len(records) and all(len(p.records) == 1 for p in amplitudes)
    figures: list[PageFigure] = []

    def add(drawing: Figure, of: str, alt: str, caption: str) -> None:
        figures.append(page_figure(drawing, f"{key}-{of}", alt, caption))

    if bands:
        spread = (
            "spread over frequency as in the stretches that contain only noise"
            if where.noise_shape.get(output) == "measured"
            else "assumed to be white"
        )
        limits = [
            f"{p.omega_low:.3g} to {p.omega_high:.3g}" if p.excited else f"above {p.omega_low:.3g}"
            for p in bands
        ]
        named = [(f"{limit} rad/s", part) for limit, part in zip(limits, bands, strict=True)]
        add(
            plot.gap_bars(
                bands, [_band(p) for p in bands], stages, "frequency [rad/s]", "gap in the band [%]"
            ),
            "bands",
            f"Bars of the gap by band of frequency. {_reported(named, diagnosis)}",
            f"By frequency. {_largest(named, rest)} The squares of the bars add up to the square of the gap; the noise floor is "
            f"{spread}.",
        )
    if states:
        figures.append(_states_figure(states, output, _motion(diagnosis), key, rest))
    if len({p.amplitude for p in amplitudes}) > 1:
        labels = [f"{_size(p)}\n{'scored' if p.scored else 'fitted'}" for p in amplitudes]
        spoken = list(zip((label.replace("\n", " ") for label in labels), amplitudes, strict=True))
        which = "; ".join(f"{_size(p)} {p.records[0]}" for p in amplitudes)
        add(
            plot.gap_bars(amplitudes, labels, stages, "amplitude of the input"),
            "amplitudes",
            f"Bars of the gap by amplitude of the input. {_reported(spoken, diagnosis)}",
            f"By amplitude of the input, each relative to the motion there{f': {which}' if one_record_each else ''}.",
        )
    # Where each amplitude is one record, the picture is the same.
    if len(records) > 1 and not one_record_each:
        labels = [str(i) for i, _ in enumerate(records, start=1)]
        which = "; ".join(f"{i} {p.record} ({p.role})" for i, p in enumerate(records, start=1))
        add(
            plot.gap_bars(records, labels, stages, "record"),
            "records",
            f"Bars of the gap by record. {_reported([(p.record, p) for p in records], diagnosis)}",
            f"By record, each relative to its own motion: {which}.",
        )
    if times:
        worst_time = max(times, key=lambda p: p.reidentified)
        add(
            plot.gap_times(times, stages),
            "times",
            f"Steps of the gap over time, {rest} largest with {gap_percent(worst_time.reidentified)} from "
            f"{written_span(worst_time.t_start, worst_time.t_end)} of {worst_time.record}; noise floor "
            f"{gap_percent(worst_time.noise_floor)}.",
            "Over time within each scored record, relative to the motion of all of them.",
        )
    return figures


def _band(part: BandPart) -> str:
    if not part.excited:
        return f"above\n{part.omega_low:.3g}"
    low = "up" if part.omega_low == 0.0 else f"{part.omega_low:.3g}"
    return f"{low}\nto {part.omega_high:.3g}"


def _states_figure(states: Sequence[StatePart], output: str, motion: str, key: str, rest: str) -> PageFigure:
    worst = max(states, key=lambda p: p.reidentified)
    place = _place(worst, motion)
    lacking = any(math.isfinite(p.force_mean) for p in states)
    joint = states[0].joint
    if joint:
        whose = f"By state of {joint}, along the motion that follows all sensors, {rest}"
        there = f", if everything missing acts at {joint}" if lacking else ""
    else:
        whose, there = f"By state of the measured motion, {rest}", ""
    return page_figure(
        plot.gap_states(states, output, motion),
        f"{key}-states",
        f"Map of the error, {rest}, over the plane of states, largest with {gap_percent(worst.reidentified)} at "
        f"{place}; noise floor {gap_percent(worst.noise_floor)}. {_lacking(states)}",
        f"{whose}; the error is largest at {place}; the noise floor is at {gap_percent(worst.noise_floor)}."
        + (
            f" Right: the mean force missing in the equations there, with its sign{there}." if lacking else ""
        ),
    )


def _reported(parts: Sequence[tuple[str, GapPart]], diagnosis: Diagnosis) -> str:
    """Return the bars in words, for who cannot see them."""
    return " ".join(
        f"{sentence_case(name)}: {stages_reported(diagnosis, part)}, noise floor {gap_percent(part.noise_floor)}."
        for name, part in parts
    )


def _largest(parts: Sequence[tuple[str, GapPart]], rest: str) -> str:
    name, part = max(parts, key=lambda entry: entry[1].share)
    return f"{percent(part.share)} of the gap ({rest}) lies at {name}."


def _lacking(states: Sequence[StatePart]) -> str:
    """Return the force that the equations lack, in words for who cannot see the map."""
    known = [part for part in states if math.isfinite(part.force_mean)]
    if not known:
        return ""
    forward = [part for part in known if part.v_low + part.v_high > 0.0]
    back = [part for part in known if part.v_low + part.v_high <= 0.0]
    unit = known[0].units["force_mean"]
    means = [
        f"{sum(p.force_mean * p.n_samples for p in half) / sum(p.n_samples for p in half):.3g}{behind(unit)} {words}"
        for half, words in ((forward, "forward"), (back, "backward"))
        if half
    ]
    return f"Mean force missing in the equations while moving: {listed(means)}."


def _motion(diagnosis: Diagnosis) -> str:
    """Return the name of the signal that is the displacement."""
    rig = rig_of(diagnosis)
    if rig is None or not rig.has_one_motion:
        return "x"
    return (rig.outputs if rig.is_driven else rig.inputs)[0].name


def _place(part: StatePart, motion: str) -> str:
    scale = plot.display_scale(part.units["x_low"], max(abs(part.x_low), abs(part.x_high)))
    low, high = part.x_low * scale.factor, part.x_high * scale.factor
    place = f"{motion} {low:.3g} to {high:.3g} {scale.unit} and rate {part.v_low:.3g} to {part.v_high:.3g} {part.units['v_low']}"
    return place.replace(" -", " \u2212")


def _size(part: AmplitudePart) -> str:
    scale = plot.display_scale(part.units["amplitude"], part.amplitude)
    return f"{part.amplitude * scale.factor:.4g}{behind(scale.unit)}"

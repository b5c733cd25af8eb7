"""Records in the page: description, errors of the simulations, curves over time, and frequency responses by one estimator."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from rigsight import plot
from rigsight.compare.response_error import (
    measured_responses,
    response_error,
    signal_paths,
    simulated_response,
    without_shares,
)
from rigsight.diagnose.location.trace import STAGES, Stage, Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse
from rigsight.identify.transfer.record_response import Method
from rigsight.metrics import TWO_SIDED, nrmse
from rigsight.plot.frequency_responses import decibel, thinned
from rigsight.records import Floats, Hold, Kind, Record
from rigsight.records.stamps import time_label, time_origin
from rigsight.report import figures
from rigsight.report.labels import gap_percent, rig_of, sentence_case
from rigsight.report.sections import output_label
from rigsight.report.wording import stage_names
from rigsight.units import behind

if TYPE_CHECKING:
    from rigsight.plot import Figure

_METHOD: Method = "local_rational"
_MOST_PATHS = 6
"""Paths of a rig with many inputs and sensors that a page shows per record."""
_FEWEST_LINES = 8
"""Lines below which there is no curve to look at."""
_INTERVAL = "95 % interval"
_DRAWN_LINES = 200
"""Lines of a response in a drawing that does not zoom."""
_BELOW = 3.0
"""Decibel below the lowest measured line that are still shown, and above the highest."""


def record_charts(
    diagnosis: Diagnosis, responses: Mapping[str, tuple[PathResponse, ...]]
) -> Iterator[tuple[Trace, list[figures.Chart]]]:
    """Yield the records, those that were scored first: each output over time, then each signal path over frequency."""
    names = figures.curve_names(diagnosis)
    n_pictures = sum(len(trace.measured) for trace in diagnosis.traces)
    most_points = figures.points_per_curve(2 * len(names) * n_pictures)
    ordered = sorted(diagnosis.traces, key=lambda trace: trace.role != diagnosis.scored_on)
    for index, trace in enumerate(ordered, start=1):
        charts = [
            _time_chart(diagnosis, trace, output, names, most_points, f"record-{index}-output-{i}")
            for i, output in enumerate(trace.measured, start=1)
        ]
        charts += [
            response_chart(trace.record, response, names, f"record-{index}-path-{i}")
            for i, response in enumerate(responses.get(trace.record, ()), start=1)
        ]
        yield trace, charts


def record_errors(trace: Trace, output: str, stages: Mapping[Stage, str]) -> str:
    """Return the error of each stage in words."""
    return ", ".join(
        f"{name} {gap_percent(nrmse(-trace.residual(stage, output), trace.measured[output]))}"
        for stage, name in stages.items()
    )


def _time_chart(
    diagnosis: Diagnosis, trace: Trace, output: str, names: Mapping[str, str], most_points: int, key: str
) -> figures.Chart:
    measured = np.asarray(trace.measured[output], dtype=np.float64)
    stages = [stage for stage in STAGES if stage in names]
    errors = {stage: -trace.residual(stage, output) for stage in stages}
    unit = diagnosis.units.get(output, "")
    scale = plot.display_scale(unit, float(np.max(np.abs(measured[np.isfinite(measured)]), initial=0.0)))
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    span = high - low
    # A simulation that left the record by more than this is off the picture.
    worst = max((_largest(error, 2.0 * span) for error in errors.values()), default=0.0)
    error_scale = plot.display_scale(unit, worst)
    floor = 2.0 * next((f.std for f in diagnosis.noise_floors if f.output == output), math.nan)
    kept = _kept([measured, errors[stages[0]], errors[stages[-1]]], most_points)
    far = error_scale.factor * 2.0 * span
    above = [figures.Curve("measured", names["measured"], scale.factor * measured[kept])]
    below = []
    if math.isfinite(floor):
        reach = error_scale.factor * floor
        below.append(figures.Curve("floor", "twice the noise floor", low=-reach, high=reach))
    for stage, error in errors.items():
        above.append(figures.Curve(stage, names[stage], scale.factor * (measured + error)[kept]))
        below.append(figures.Curve(stage, names[stage], error_scale.factor * error[kept]))
    panels = [
        figures.ChartPanel(
            plot.with_unit(output, scale.unit),
            3,
            above,
            (scale.factor * (low - span), scale.factor * (high + span)),
        ),
        figures.ChartPanel(plot.with_unit("error", error_scale.unit), 2, below, (-far, far)),
    ]
    label = output_label(diagnosis, output)
    thinned = (
        f" Of {measured.size} samples {kept.size} are drawn, peaks among them."
        if kept.size < measured.size
        else ""
    )
    return figures.Chart(
        key,
        figures.chart_data(
            f"Measured and simulated {label}, record {trace.record}",
            time_label(trace.t),
            (trace.t - time_origin(trace.t))[kept],
            panels,
            detail=_detail(trace, output, names[stages[0]]),
        ),
        sentence_case(f"{label} over time; below, simulated minus measured.{thinned}"),
        figures.page_figure(
            record_drawing(diagnosis, trace, output), f"{key}-still", f"Measured and simulated {label}.", ""
        )
        if trace.role == diagnosis.scored_on
        else None,
    )


def _detail(trace: Trace, output: str, first: str) -> dict[str, Any]:
    """Return the part worth looking at: its limits in time, what the button that shows it is called, and what it does."""
    window = plot.detail_window(trace, output)
    begin, end = (float(trace.t[i]) - time_origin(trace.t) for i in (window.start, window.stop - 1))
    label, title = "Largest error", f"Show where the error is largest, {first}"
    if plot.step_window(trace, output) is not None:
        label, title = "Step", "Show the step"
    return {"low": begin, "high": end, "label": label, "title": title}


def _kept(series: Sequence[Floats], most_points: int) -> NDArray[np.int64]:
    """Return the samples of a shorter line that keeps the peaks of these."""
    places = np.arange(series[0].size, dtype=np.float64)
    if places.size <= most_points:
        return places.astype(np.int64)
    n_bins = max(1, most_points // (2 * len(series)))
    return np.unique(np.concatenate([plot.envelope(places, one, n_bins)[0] for one in series])).astype(
        np.int64
    )


def _largest(values: Floats, limit: float) -> float:
    return min(limit, float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)))


def record_drawing(diagnosis: Diagnosis, trace: Trace, output: str) -> Figure:
    """Return measured and simulated output of a whole record, the first and the last simulation, with the errors below."""
    names = stage_names(diagnosis)
    # First and last alone: on paper nothing can be taken away.
    drawn = {stage: names[stage] for stage in (next(iter(names)), list(names)[-1])}
    return plot.comparison(diagnosis, trace, output, stages=drawn)


def record_facts(diagnosis: Diagnosis, trace: Trace) -> str:
    """Return role, kind, amplitude and length in words."""
    inputs = list(trace.inputs)
    unit = diagnosis.units.get(inputs[0], "") if inputs else ""
    scale = plot.display_scale(unit, abs(trace.amplitude or 0.0))
    facts = [f"{trace.role} record", trace.kind]
    if trace.amplitude is not None:
        facts.append(f"amplitude {trace.amplitude * scale.factor:.4g}{behind(scale.unit)}")
    length = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    return ", ".join([*facts, f"{length:.4g} s", f"{trace.t.size} samples"])


@dataclass(frozen=True, eq=False)
class PathResponse:
    """One signal path of one record."""

    path: str  # as in ``"u -> psi"``
    measured: FrequencyResponse  # at the lines that stand out of their noise
    # Stage of the diagnosis -> its response at lines of the measured one.
    simulated: Mapping[str, FrequencyResponse]
    decibel: Mapping[str, float]  # stage -> RMS of the ratio of the magnitudes, measured over simulated [dB]


def record_responses(diagnosis: Diagnosis, trace: Trace) -> tuple[PathResponse, ...]:
    """Return the responses of one record, path by path; none of a step, of an element, or where nothing stands out."""
    # Of a rig with several inputs and sensors they are those to each input beside the others; of very many those of the sensors
    # with the largest gaps.
    # There are none of a rig that drifts: what follows the measured motion has the measured response.
    rig = rig_of(diagnosis)
    signals = {*trace.inputs, *trace.measured}
    if rig is None or not rig.is_driven or diagnosis.bandwidth is not None:
        return ()
    if rig.has_one_motion and not {rig.inputs[0].name, rig.outputs[0].name} <= signals:
        return ()
    paths = signal_paths(rig)
    if not rig.has_one_motion:
        gaps = {output: float(np.nan_to_num(gap.reidentified)) for output, gap in diagnosis.gap.items()}
        ranked = sorted(paths, key=lambda path: -gaps.get(path.response, 0.0))[:_MOST_PATHS]
        paths = tuple(path for path in paths if path in ranked)
    found = []
    measured, _ = measured_responses(_record(diagnosis, trace, trace.measured), paths, _METHOD)
    stages = stage_names(diagnosis)
    for path in paths:
        own = measured.get(path.name)
        if own is None or own.omega.size < _FEWEST_LINES:
            continue
        simulated: dict[str, FrequencyResponse] = {}
        distances: dict[str, float] = {}
        for stage in stages:
            outputs: Mapping[str, Floats] = getattr(trace, stage)
            try:
                record = _record(diagnosis, trace, outputs)
                response = simulated_response(record, path, _METHOD, own)
                distances[stage] = response_error(own, response).decibel
            except InputError:
                # A simulation that left the numbers, or does not move: the other stages are still worth seeing.
                continue
            simulated[stage] = without_shares(response)
        found.append(PathResponse(path.name, without_shares(own), simulated, distances))
    return tuple(found)


def _record(diagnosis: Diagnosis, trace: Trace, outputs: Mapping[str, Floats]) -> Record:
    hold = diagnosis.model.get("hold")
    return Record(
        name=trace.record,
        dt=trace.dt,
        signals={**trace.inputs, **outputs},
        units=diagnosis.units,
        kind=cast("Kind", trace.kind),
        hold=cast("Hold", hold) if hold in get_args(Hold) else "foh",
    )


def response_chart(record: str, response: PathResponse, names: Mapping[str, str], key: str) -> figures.Chart:
    """Return magnitude and phase of one path of one record, measured and at each stage."""
    path = response.path.replace("->", "\u2192")
    stages = [stage for stage in STAGES if stage in names and stage in response.simulated]
    errors = [f"{names[stage]} {response.decibel[stage]:.2g} dB" for stage in stages]
    distances = (
        f" RMS distance of the magnitudes from the measured ones: {', '.join(errors)}." if errors else ""
    )
    measured = thinned(response.measured)
    phase = np.degrees(np.unwrap(np.angle(measured.values)))
    magnitudes = [figures.Curve("measured", names["measured"], measured.magnitude_db)]
    phases = [figures.Curve("measured", names["measured"], phase)]
    for stage in stages:
        own = response.simulated[stage]
        magnitudes.append(figures.Curve(stage, names[stage], _at(measured, own, own.magnitude_db)))
        turned = np.degrees(own.phase_next_to(measured.omega, measured.phase))
        phases.append(figures.Curve(stage, names[stage], _at(measured, own, turned)))
    in_magnitude, in_phase = _bands(measured, phase)
    low, high = map(float, np.percentile(measured.magnitude_db, [0.5, 100.0]))
    reach = _BELOW + 0.5 * (high - low)
    cap, turns = (low - reach, high + reach), (float(phase.min()) - 90.0, float(phase.max()) + 90.0)
    panels = [
        figures.ChartPanel(f"magnitude [dB, {measured.unit}]", 3, [*in_magnitude, *magnitudes], cap),
        figures.ChartPanel("phase [deg]", 2, [*in_phase, *phases], turns, degrees=True),
    ]
    title = f"Frequency response {path} on record {record}, measured and simulated"
    return figures.Chart(
        key,
        figures.chart_data(title, "angular frequency [rad/s]", measured.omega, panels, log=True),
        f"Frequency response {path}, measured and simulated by the same estimator.{distances}",
    )


def amplitude_figures(
    diagnosis: Diagnosis, responses: Mapping[str, tuple[PathResponse, ...]]
) -> list[tuple[str, list[figures.PageFigure]]]:
    """Return, for each path, the magnitudes at all amplitudes over each other: one figure per stage."""
    names = figures.curve_names(diagnosis)
    found = []
    paths = list(dict.fromkeys(response.path for own in responses.values() for response in own))
    for number, path in enumerate(paths, start=1):
        labeled = _by_amplitude(diagnosis, responses, path)
        stages = [s for s in STAGES if s in names and all(s in response.simulated for _, response in labeled)]
        if len({label.split(" (")[0] for label, _ in labeled}) > 1 and stages:
            arrow = path.replace("->", "\u2192")
            overlaid = [
                _overlaid(labeled, stage, names[stage], arrow, f"figure-responses-{number}-{stage}")
                for stage in stages
            ]
            found.append((arrow, overlaid))
    return found


def _overlaid(
    labeled: list[tuple[str, PathResponse]], stage: Stage, name: str, arrow: str, key: str
) -> figures.PageFigure:
    reported = ", ".join(f"{response.decibel[stage]:.2g} dB at {label}" for label, response in labeled)
    panels = []
    for label, response in labeled:
        simulated = thinned(response.simulated[stage], _DRAWN_LINES)
        fitted = plot.FittedCurve(simulated.omega, simulated.values, np.zeros(simulated.omega.size), "")
        panels.append(
            plot.Panel(sentence_case(name), thinned(response.measured, _DRAWN_LINES), fitted, label)
        )
    return figures.page_figure(
        plot.overlaid_responses([panels], "simulated"),
        key,
        f"Magnitude of {arrow} at each amplitude, measured against {name}. RMS distance: {reported}.",
        f"Measured (solid) against {name} (dashed). RMS distance: {reported}.",
    )


def _by_amplitude(
    diagnosis: Diagnosis, responses: Mapping[str, tuple[PathResponse, ...]], path: str
) -> list[tuple[str, PathResponse]]:
    """Return the records that show a path and have an amplitude, smallest first, with their labels."""
    unit = diagnosis.units.get(next((name for trace in diagnosis.traces for name in trace.inputs), ""), "")
    known = sorted(
        (trace.amplitude, trace.record) for trace in diagnosis.traces if trace.amplitude is not None
    )
    labels: list[str] = []
    found: list[tuple[str, PathResponse]] = []
    for amplitude, record in known:
        for response in responses.get(record, ()):
            if response.path == path:
                label = f"{amplitude:.4g}{behind(unit)}"
                again = sum(own.split(" (")[0] == label for own in labels) + 1
                labels.append(label if again == 1 else f"{label} ({again})")
                found.append((labels[-1], response))
    return found


def _at(measured: FrequencyResponse, simulated: FrequencyResponse, values: Floats) -> Floats:
    """Return values at the lines of a measured response; a simulated one may lack some of them."""
    found = np.full(measured.omega.size, np.nan)
    kept = np.isin(simulated.omega, measured.omega)
    found[np.searchsorted(measured.omega, simulated.omega[kept])] = values[kept]
    return found


def _bands(measured: FrequencyResponse, phase: Floats) -> tuple[list[figures.Curve], list[figures.Curve]]:
    """Return the 95 % intervals of magnitude and phase."""
    if measured.variance is None:
        return [], []
    # Half of the variance of a complex value lies along it, half across.
    reach = TWO_SIDED * np.sqrt(0.5 * measured.variance)
    size = measured.magnitude
    turn = np.degrees(np.minimum(reach / size, np.pi))
    # The lower limit of a line that drowns is zero, which no axis in decibels holds.
    low = np.maximum(decibel(size - reach), measured.magnitude_db - 40.0)
    return (
        [figures.Curve("measured", _INTERVAL, low=low, high=decibel(size + reach))],
        [figures.Curve("measured", _INTERVAL, low=phase - turn, high=phase + turn)],
    )

"""Frequency responses of the records, measured and simulated, by one estimator: their values, charts, and overlaid amplitudes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast, get_args

import numpy as np

from rigsight import plot
from rigsight.compare.response_error import (
    SignalPath,
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
from rigsight.plot.drawing import TWO_SIDED
from rigsight.plot.frequency_responses import decibel, thinned
from rigsight.records import Record
from rigsight.records.record import Floats, Hold, Kind
from rigsight.report.figures import Chart, ChartPanel, Curve, PageFigure, chart_data, curve_names, page_figure
from rigsight.report.labels import rig_of, sentence_case, unit_text
from rigsight.report.wording import stage_names

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
    paths = signal_paths(rig) if rig.has_one_motion else _worst(diagnosis, signal_paths(rig))
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


def _worst(diagnosis: Diagnosis, paths: Sequence[SignalPath]) -> tuple[SignalPath, ...]:
    """Return as many paths as a page can show, those to the sensors with the largest gaps, in their order."""
    gaps = {output: float(np.nan_to_num(gap.reidentified)) for output, gap in diagnosis.gap.items()}
    ranked = sorted(paths, key=lambda path: -gaps.get(path.response, 0.0))[:_MOST_PATHS]
    return tuple(path for path in paths if path in ranked)


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


def response_chart(record: str, response: PathResponse, names: Mapping[str, str], key: str) -> Chart:
    """Return magnitude and phase of one path of one record, measured and at each stage."""
    path = response.path.replace("->", "\u2192")
    stages = [stage for stage in STAGES if stage in names and stage in response.simulated]
    errors = [f"{names[stage]} {response.decibel[stage]:.2g} dB" for stage in stages]
    distances = (
        f" RMS distance of the magnitudes from the measured ones: {', '.join(errors)}." if errors else ""
    )
    measured = thinned(response.measured)
    phase = np.degrees(np.unwrap(np.angle(measured.values)))
    magnitudes = [Curve("measured", names["measured"], measured.magnitude_db)]
    phases = [Curve("measured", names["measured"], phase)]
    for stage in stages:
        own = response.simulated[stage]
        magnitudes.append(Curve(stage, names[stage], _at(measured, own, own.magnitude_db)))
        turned = np.degrees(own.phase_next_to(measured.omega, measured.phase))
        phases.append(Curve(stage, names[stage], _at(measured, own, turned)))
    in_magnitude, in_phase = _bands(measured, phase)
    reach = (float(phase.min()) - 90.0, float(phase.max()) + 90.0)
    panels = [
        ChartPanel(
            f"magnitude [dB, {measured.unit}]", 3, [*in_magnitude, *magnitudes], _cap(measured.magnitude_db)
        ),
        ChartPanel("phase [deg]", 2, [*in_phase, *phases], reach, degrees=True),
    ]
    title = f"Frequency response {path} on record {record}, measured and simulated"
    return Chart(
        key,
        chart_data(title, "angular frequency [rad/s]", measured.omega, panels, log=True),
        f"Frequency response {path}, measured and simulated by the same estimator.{distances}",
    )


def amplitude_figures(
    diagnosis: Diagnosis, responses: Mapping[str, tuple[PathResponse, ...]]
) -> list[tuple[str, list[PageFigure]]]:
    """Return, for each path, the magnitudes at all amplitudes over each other: one figure per stage."""
    names = curve_names(diagnosis)
    found = []
    paths = list(dict.fromkeys(response.path for own in responses.values() for response in own))
    for number, path in enumerate(paths, start=1):
        labeled = _by_amplitude(diagnosis, responses, path)
        stages = [s for s in STAGES if s in names and all(s in response.simulated for _, response in labeled)]
        if len({label.split(" (")[0] for label, _ in labeled}) > 1 and stages:
            arrow = path.replace("->", "\u2192")
            figures = [
                _overlaid(labeled, stage, names[stage], arrow, f"figure-responses-{number}-{stage}")
                for stage in stages
            ]
            found.append((arrow, figures))
    return found


def _overlaid(
    labeled: list[tuple[str, PathResponse]], stage: Stage, name: str, arrow: str, key: str
) -> PageFigure:
    reported = ", ".join(f"{response.decibel[stage]:.2g} dB at {label}" for label, response in labeled)
    panels = []
    for label, response in labeled:
        simulated = thinned(response.simulated[stage], _DRAWN_LINES)
        fitted = plot.FittedCurve(simulated.omega, simulated.values, np.zeros(simulated.omega.size), "")
        panels.append(
            plot.Panel(sentence_case(name), thinned(response.measured, _DRAWN_LINES), fitted, label)
        )
    return page_figure(
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
                label = f"{amplitude:.4g} {unit_text(unit)}".strip()
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


def _bands(measured: FrequencyResponse, phase: Floats) -> tuple[list[Curve], list[Curve]]:
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
        [Curve("measured", _INTERVAL, low=low, high=decibel(size + reach))],
        [Curve("measured", _INTERVAL, low=phase - turn, high=phase + turn)],
    )


def _cap(values: Floats) -> tuple[float, float]:
    low, high = np.percentile(values, [0.5, 100.0])
    reach = _BELOW + 0.5 * (high - low)
    return float(low - reach), float(high + reach)

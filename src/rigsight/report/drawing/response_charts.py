"""Drawings of the frequency responses of the records: each alone, and all amplitudes together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.location.trace import STAGES, Stage
from rigsight.diagnose.result import Diagnosis
from rigsight.frequency import FrequencyResponse
from rigsight.plot.frequency_responses import TWO_SIDED, decibel, thinned
from rigsight.report.drawing.charts import Chart, ChartPanel, Curve, chart_data, curve_names
from rigsight.report.drawing.figures import PageFigure
from rigsight.report.drawing.record_drawings import overlaid_drawing, response_drawing
from rigsight.report.responses import PathResponse
from rigsight.report.wording import sentence_case, unit_text

_BELOW = 3.0
"""Decibel below the lowest measured line that are still shown, and above the highest."""


def response_chart(record: str, response: PathResponse, names: Mapping[str, str], key: str) -> Chart:
    """Return magnitude and phase of one path of one record, measured and at each stage."""
    path = response.path.replace("->", "\u2192")
    stages = [stage for stage in STAGES if stage in names and stage in response.simulated]
    errors = [f"{names[stage]} {response.decibel[stage]:.2g} dB" for stage in stages]
    said = f"RMS distance of the magnitudes from the measured ones: {', '.join(errors)}." if errors else ""
    measured = thinned(response.measured)
    phase = np.degrees(np.unwrap(np.angle(measured.values)))
    panels = [
        ChartPanel(
            f"magnitude [dB, {measured.unit}]",
            3,
            [
                *_band(measured, measured.magnitude_db, degrees=False),
                Curve("measured", measured.omega, measured.magnitude_db),
                *(
                    Curve(stage, curve.omega, curve.magnitude_db)
                    for stage in stages
                    for curve in (thinned(response.simulated[stage]),)
                ),
            ],
            cap=_cap(measured.magnitude_db),
        ),
        ChartPanel(
            "phase [deg]",
            2,
            [
                *_band(measured, phase, degrees=True),
                Curve("measured", measured.omega, phase),
                *(_phase(stage, response.simulated[stage], measured) for stage in stages),
            ],
            cap=(float(phase.min()) - 90.0, float(phase.max()) + 90.0),
            degrees=True,
        ),
    ]
    title = f"Frequency response {path} on record {record}, measured and simulated"
    drawing = response_drawing(
        path, response, {stage: names[stage] for stage in stages}, f"{key}-drawing", f"{title}. {said}"
    )
    return Chart(
        key,
        (PageFigure(f"{key}-drawing", drawing, f"{title}."),),
        chart_data(title, ("\u03c9", "rad/s"), panels, names, log=True),
        f"Frequency response {path}, measured and simulated by the same estimator; the band is the 95 % interval of the "
        f"measured one. {said}",
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
    alt = f"Magnitude of {arrow} at each amplitude, measured against {name}. RMS distance: {reported}."
    return PageFigure(
        key,
        overlaid_drawing(sentence_case(name), labeled, stage, key, alt),
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


def _band(measured: FrequencyResponse, middle: NDArray[np.float64], *, degrees: bool) -> list[Curve]:
    if measured.variance is None:
        return []
    # Half of the variance of a complex value lies along it, half across.
    reach = TWO_SIDED * np.sqrt(0.5 * measured.variance)
    size = measured.magnitude
    if degrees:
        turn = np.degrees(np.minimum(reach / size, np.pi))
        return [Curve("measured", measured.omega, low=middle - turn, high=middle + turn)]
    # The lower limit of a line that drowns is zero, which no axis in decibels holds.
    low = np.maximum(decibel(size - reach), middle - 40.0)
    return [Curve("measured", measured.omega, low=low, high=decibel(size + reach))]


def _cap(values: NDArray[np.float64]) -> tuple[float, float]:
    low, high = np.percentile(values, [0.5, 100.0])
    reach = _BELOW + 0.5 * (high - low)
    return float(low - reach), float(high + reach)


def _phase(stage: Stage, simulated: FrequencyResponse, measured: FrequencyResponse) -> Curve:
    curve = thinned(simulated)
    return Curve(stage, curve.omega, np.degrees(curve.phase_next_to(measured.omega, measured.phase)))

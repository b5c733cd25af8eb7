"""Static drawings of the curves of a record, for print and without script."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rigsight.diagnose.location.trace import Stage, Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.frequency import FrequencyResponse
from rigsight.plot.diagnosis import printed
from rigsight.plot.drawing import FLOOR, MEASURED, STAGE_STYLES, shown_in
from rigsight.plot.frequency_responses import (
    TWO_SIDED,
    amplitude_colors,
    decibel,
    measured_label,
    seen,
    thinned,
)
from rigsight.records.stamps import time_label, time_origin
from rigsight.report.drawing.line_drawing import Area, DrawnPanel, Line, around, line_drawing
from rigsight.report.responses import PathResponse

_PRINTED_LINES = 200
"""Lines of a response on paper."""
_WHOLE, _DETAIL = (6.6, 3.9), (3.5, 3.9)
_RESPONSE, _OVERLAID = (6.0, 5.0), (6.0, 3.8)
"""Width and height [inch]."""
_FAR = 10.0
"""Spans of the measured output beyond which a simulation leaves the picture rather than press the rest flat."""
_FITTED_DASHES = (4.0, 2.0)


def time_drawing(
    diagnosis: Diagnosis,
    trace: Trace,
    output: str,
    stages: Mapping[Stage, str],
    key: str,
    alt: str,
    *,
    window: slice | None = None,
    marked: slice | None = None,
) -> Markup:
    """Return measured against simulated over time, with the errors and a band of twice the noise floor below."""
    shown = window or slice(None)
    since_origin = trace.t - time_origin(trace.t)
    t, measured = since_origin[shown], np.asarray(trace.measured[output][shown], dtype=np.float64)
    errors = {stage: -trace.residual(stage, output)[shown] for stage in stages}
    unit = diagnosis.units.get(output, "")
    factor, shown_unit = shown_in(unit, measured)
    error_factor, error_unit = shown_in(unit, *errors.values())
    # A detail stands beside the whole record, which names the lines.
    names: dict[str, str] = (
        {} if window else {"measured": "measured", **{str(s): n for s, n in stages.items()}}
    )
    lines = [
        Line(*printed(t, factor * measured), MEASURED, 2.6, opacity=0.55, label=names.get("measured", ""))
    ]
    left: list[Line] = []
    for stage, error in errors.items():
        color = str(STAGE_STYLES[stage]["color"])
        lines.append(
            Line(
                *printed(t, factor * (measured + error)),
                color,
                1.0,
                stage_dashes(stage),
                label=names.get(stage, ""),
            )
        )
        left.append(Line(*printed(t, error_factor * error), color, 0.8))
    floor = 2.0 * error_factor * next((f.std for f in diagnosis.noise_floors if f.output == output), math.nan)
    ends, reach = t[[0, -1]], np.full(2, floor)
    low, high = factor * float(np.nanmin(measured)), factor * float(np.nanmax(measured))
    far = _FAR * (high - low)
    most = far * error_factor / factor
    panels = [
        DrawnPanel(
            with_unit(output, shown_unit), 3, around([line.y for line in lines], (low - far, high + far)), lines
        ),
        DrawnPanel(
            with_unit("error", error_unit), 2, around([line.y for line in left] + [reach, -reach], (-most, most)), left,
            [Area(ends, -reach, reach, FLOOR, 0.12)] if math.isfinite(floor) else [],
        ),
    ]  # fmt: skip
    at = None if marked is None else (float(since_origin[marked.start]), float(since_origin[marked.stop - 1]))
    return line_drawing(panels, time_label(trace.t), key, alt, _DETAIL if window else _WHOLE, marked=at)


def response_drawing(
    path: str, response: PathResponse, stages: Mapping[Stage, str], key: str, alt: str
) -> Markup:
    """Return magnitude above phase of one path: measured as points with its 95 % band, each stage as a line."""
    measured = thinned(response.measured, _PRINTED_LINES)
    omega, size, phase = measured.omega, measured.magnitude_db, np.degrees(measured.phase)
    simulated = {stage: thinned(response.simulated[stage], _PRINTED_LINES) for stage in stages}
    above = [Line(omega, size, MEASURED, 2.6, label=measured_label(measured), as_points=True)]
    below = [Line(omega, phase, MEASURED, 2.6, as_points=True)]
    for stage, curve in simulated.items():
        color, dashes = str(STAGE_STYLES[stage]["color"]), stage_dashes(stage)
        above.append(Line(curve.omega, curve.magnitude_db, color, 1.3, dashes, label=stages[stage]))
        turned = np.degrees(curve.phase_next_to(omega, measured.phase))
        below.append(Line(curve.omega, turned, color, 1.3, dashes))
    low, high = np.percentile(np.concatenate([line.y for line in below]), [1.0, 99.0])
    turns = (45.0 * math.floor(low / 45.0) - 20.0, 45.0 * math.ceil(high / 45.0) + 20.0)
    in_size, in_phase = _bands(measured, phase)
    panels = [
        DrawnPanel(
            f"magnitude [dB re 1 {measured.unit}]",
            3,
            seen(np.concatenate([line.y for line in above])),
            above,
            in_size,
        ),
        DrawnPanel("phase [deg]", 2, turns, below, in_phase, turns=True),
    ]
    return line_drawing(panels, "angular frequency [rad/s]", key, alt, _RESPONSE, log=True, title=path)


def overlaid_drawing(
    title: str, labeled: Sequence[tuple[str, PathResponse]], stage: Stage, key: str, alt: str
) -> Markup:
    """Return the magnitudes of one path over each other: measured solid, simulated dashed."""
    lines: list[Line] = []
    for color, (label, response) in zip(amplitude_colors(len(labeled)), labeled, strict=True):
        measured, simulated = (
            thinned(own, _PRINTED_LINES) for own in (response.measured, response.simulated[stage])
        )
        lines.append(Line(measured.omega, measured.magnitude_db, color, 1.1, opacity=0.7, label=label))
        lines.append(Line(simulated.omega, simulated.magnitude_db, color, 1.4, _FITTED_DASHES))
    nothing = np.zeros(0)
    lines.append(Line(nothing, nothing, FLOOR, 1.4, _FITTED_DASHES, label="simulated"))
    limits = seen(np.concatenate([line.y for line in lines if line.label and line.y.size]))
    unit = labeled[0][1].measured.unit
    return line_drawing(
        [DrawnPanel(f"magnitude [dB re 1 {unit}]", 1, limits, lines)],
        "angular frequency [rad/s]", key, alt, _OVERLAID, log=True, title=title,
    )  # fmt: skip


def stage_dashes(stage: Stage) -> tuple[float, ...]:
    """Return the dashes by which the lines of a stage are known."""
    look = STAGE_STYLES[stage]["linestyle"]
    return tuple(look[1]) if isinstance(look, tuple) else ()


def _bands(measured: FrequencyResponse, phase: NDArray[np.float64]) -> tuple[list[Area], list[Area]]:
    """Return the 95 % bands of magnitude and phase."""
    if measured.variance is None:
        return [], []
    # A component of the complex error has half of its variance.
    reach = TWO_SIDED * np.sqrt(0.5 * measured.variance)
    size, turn = measured.magnitude, np.degrees(reach / measured.magnitude)
    return (
        [Area(measured.omega, decibel(size - reach), decibel(size + reach), MEASURED, 0.25)],
        [Area(measured.omega, phase - turn, phase + turn, MEASURED, 0.25)],
    )


def with_unit(name: str, unit: str) -> str:
    """Return the label of a quantity."""
    return name if unit in ("", "1") else f"{name} [{unit}]"

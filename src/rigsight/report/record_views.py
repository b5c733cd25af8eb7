"""Records in the page: description, errors of the simulations, curves over time and frequency."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight import plot
from rigsight.diagnose.location.trace import STAGES, Stage, Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.metrics import nrmse
from rigsight.records.stamps import time_label, time_origin, written_span
from rigsight.report.drawing.charts import (
    Chart,
    ChartPanel,
    Curve,
    Detail,
    chart_data,
    curve_names,
    points_per_curve,
)
from rigsight.report.drawing.figures import PageFigure
from rigsight.report.drawing.record_drawings import time_drawing, with_unit
from rigsight.report.drawing.response_charts import response_chart
from rigsight.report.quantities import gap_percent
from rigsight.report.responses import PathResponse
from rigsight.report.sections import output_label
from rigsight.report.wording import sentence_case, stage_names, unit_text

if TYPE_CHECKING:
    from rigsight.plot import Figure


@dataclass(frozen=True)
class RecordView:
    """One record."""

    key: str  # anchor in the page
    # Name, and role, kind, amplitude, length in words.
    title: str
    facts: str
    rows: list[tuple[str, str]]  # output, and the error of each stage in words
    charts: list[Chart]  # each output over time, then each signal path over frequency
    missing: list[str] = field(default_factory=list)  # outputs that the record lacks
    is_open: bool = True  # false for records that are folded away at first


def record_views(
    diagnosis: Diagnosis, responses: Mapping[str, tuple[PathResponse, ...]]
) -> Iterator[RecordView]:
    """Yield the records, those that were scored first and open."""
    names = curve_names(diagnosis)
    stages = stage_names(diagnosis)
    n_pictures = sum(len(trace.measured) for trace in diagnosis.traces)
    most_points = points_per_curve((2 * len(names) - 1) * n_pictures)
    ordered = sorted(diagnosis.traces, key=lambda trace: trace.role != diagnosis.scored_on)
    for index, trace in enumerate(ordered, start=1):
        key = f"record-{index}"
        yield RecordView(
            key=key,
            title=trace.record,
            facts=_facts(diagnosis, trace),
            rows=[
                (output_label(diagnosis, output), _left(trace, output, stages)) for output in trace.measured
            ],
            charts=[
                *(
                    _time_chart(diagnosis, trace, output, names, most_points, f"{key}-output-{i}")
                    for i, output in enumerate(trace.measured, start=1)
                ),
                *(
                    response_chart(trace.record, response, names, f"{key}-path-{i}")
                    for i, response in enumerate(responses.get(trace.record, ()), start=1)
                ),
            ],
            missing=[
                output_label(diagnosis, output) for output in diagnosis.gap if output not in trace.measured
            ],
            is_open=trace.role == diagnosis.scored_on,
        )


def _left(trace: Trace, output: str, stages: Mapping[Stage, str]) -> str:
    return ", ".join(
        f"{name} {gap_percent(nrmse(-trace.residual(stage, output), trace.measured[output]))}"
        for stage, name in stages.items()
    )


def _time_chart(
    diagnosis: Diagnosis, trace: Trace, output: str, names: Mapping[str, str], most_points: int, key: str
) -> Chart:
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
    floor = next((f.std for f in diagnosis.noise_floors if f.output == output), math.nan)
    panels = [
        ChartPanel(
            with_unit(output, scale.unit),
            3,
            [
                _curve("measured", trace, measured * scale.factor, most_points),
                *(_curve(s, trace, (measured + errors[s]) * scale.factor, most_points) for s in stages),
            ],
            cap=(scale.factor * (low - span), scale.factor * (high + span)),
        ),
        ChartPanel(
            with_unit("error", error_scale.unit),
            2,
            [_curve(s, trace, errors[s] * error_scale.factor, most_points) for s in stages],
            cap=(-2.0 * span * error_scale.factor, 2.0 * span * error_scale.factor),
            band=2.0 * floor * error_scale.factor if math.isfinite(floor) else None,
        ),
    ]
    window = plot.detail_window(trace, output)
    is_step = plot.step_window(trace, output) is not None
    origin = time_origin(trace.t)
    begin, end = float(trace.t[window.start]) - origin, float(trace.t[window.stop - 1]) - origin
    first = names[stages[0]]
    detail = (
        Detail(begin, end, "Step", "Show the step")
        if is_step
        else Detail(begin, end, "Largest error", f"Show where the error is largest, {first}")
    )
    title = f"Measured and simulated {output_label(diagnosis, output)}, record {trace.record}"
    data = chart_data(
        title,
        ("t", "s"),
        panels,
        names,
        detail=detail,
        label=time_label(trace.t),
    )
    thinned = ""
    if measured.size > most_points:
        thinned = (
            f" Shown are the minimum and maximum of every {-(-measured.size // (most_points // 2))} samples."
        )
    caption = (
        f"{output_label(diagnosis, output)} over time; below, simulated minus measured, with a band of twice the noise "
        "floor."
    )
    return Chart(
        key,
        _drawings(diagnosis, trace, output, window, detail, key),
        data,
        f"{sentence_case(caption)}{thinned}",
    )


def _curve(of: str, trace: Trace, values: NDArray[np.float64], most_points: int) -> Curve:
    x, y = plot.envelope(
        trace.t - time_origin(trace.t), np.where(np.isfinite(values), values, np.nan), most_points // 2
    )
    return Curve(of, x, y)


def _largest(values: NDArray[np.float64], limit: float) -> float:
    return min(limit, float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)))


def _drawings(
    diagnosis: Diagnosis, trace: Trace, output: str, window: slice, detail: Detail, key: str
) -> tuple[PageFigure, ...]:
    """Return the static drawings: the whole record and, of steps and of records that were scored, a detail."""
    drawn = _stages_drawn(diagnosis)
    has_detail = trace.role == diagnosis.scored_on or plot.step_window(trace, output) is not None
    what = f"{output_label(diagnosis, output)}, record {trace.record}"
    whole = PageFigure(
        f"{key}-whole",
        time_drawing(
            diagnosis, trace, output, drawn, f"{key}-whole",
            f"Measured and simulated {what}, {' and '.join(drawn.values())}, with the errors below.",
            marked=window if has_detail else None,
        ),
        "The black bar marks the detail." if has_detail else "",
    )  # fmt: skip
    if not has_detail:
        return (whole,)
    span = written_span(float(trace.t[window.start]), float(trace.t[window.stop - 1]))
    near = PageFigure(
        f"{key}-detail",
        time_drawing(
            diagnosis, trace, output, drawn, f"{key}-detail", f"Detail of {what} from {span}.", window=window
        ),
        sentence_case(f"{detail.title.removeprefix('Show ')}: {span}."),
    )
    return whole, near


def record_drawing(diagnosis: Diagnosis, trace: Trace, output: str) -> Figure:
    """Return measured and simulated output of a whole record, the first and the last simulation, with the errors below."""
    return plot.comparison(diagnosis, trace, output, stages=_stages_drawn(diagnosis))


def _stages_drawn(diagnosis: Diagnosis) -> dict[Stage, str]:
    names = stage_names(diagnosis)
    # First and last alone: on paper nothing can be taken away.
    return {stage: names[stage] for stage in (next(iter(names)), list(names)[-1])}


def _facts(diagnosis: Diagnosis, trace: Trace) -> str:
    inputs = list(trace.inputs)
    unit = diagnosis.units.get(inputs[0], "") if inputs else ""
    scale = plot.display_scale(unit, abs(trace.amplitude or 0.0))
    facts = [f"{trace.role} record", trace.kind]
    if trace.amplitude is not None:
        facts.append(f"amplitude {trace.amplitude * scale.factor:.4g} {unit_text(scale.unit)}".strip())
    length = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    return ", ".join([*facts, f"{length:.4g} s", f"{trace.t.size} samples"])

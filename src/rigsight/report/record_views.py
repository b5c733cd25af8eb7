"""Records in the page: description, errors of the simulations, curves over time and frequency."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight import plot
from rigsight.diagnose.location.trace import STAGES, Stage, Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.metrics import nrmse
from rigsight.records.record import Floats
from rigsight.records.stamps import time_label, time_origin
from rigsight.report.figures import (
    Chart,
    ChartPanel,
    Curve,
    Detail,
    chart_data,
    curve_names,
    page_figure,
    points_per_curve,
)
from rigsight.report.labels import gap_percent, sentence_case, unit_text
from rigsight.report.responses import PathResponse, response_chart
from rigsight.report.sections import output_label
from rigsight.report.wording import stage_names

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
    most_points = points_per_curve(2 * len(names) * n_pictures)
    ordered = sorted(diagnosis.traces, key=lambda trace: trace.role != diagnosis.scored_on)
    for index, trace in enumerate(ordered, start=1):
        key = f"record-{index}"
        yield RecordView(
            key=key,
            title=trace.record,
            facts=_facts(diagnosis, trace),
            rows=[
                (output_label(diagnosis, output), _errors(trace, output, stages)) for output in trace.measured
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


def _errors(trace: Trace, output: str, stages: Mapping[Stage, str]) -> str:
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
    floor = 2.0 * next((f.std for f in diagnosis.noise_floors if f.output == output), math.nan)
    kept = _kept([measured, errors[stages[0]], errors[stages[-1]]], most_points)
    far = error_scale.factor * 2.0 * span
    above = [Curve("measured", names["measured"], scale.factor * measured[kept])]
    below = []
    if math.isfinite(floor):
        reach = error_scale.factor * floor
        below.append(Curve("floor", "twice the noise floor", low=-reach, high=reach))
    for stage, error in errors.items():
        above.append(Curve(stage, names[stage], scale.factor * (measured + error)[kept]))
        below.append(Curve(stage, names[stage], error_scale.factor * error[kept]))
    panels = [
        ChartPanel(
            plot.with_unit(output, scale.unit),
            3,
            above,
            (scale.factor * (low - span), scale.factor * (high + span)),
        ),
        ChartPanel(plot.with_unit("error", error_scale.unit), 2, below, (-far, far)),
    ]
    label = output_label(diagnosis, output)
    thinned = (
        f" Of {measured.size} samples {kept.size} are drawn, peaks among them."
        if kept.size < measured.size
        else ""
    )
    return Chart(
        key,
        chart_data(
            f"Measured and simulated {label}, record {trace.record}",
            time_label(trace.t),
            (trace.t - time_origin(trace.t))[kept],
            panels,
            detail=_detail(trace, output, names[stages[0]]),
        ),
        sentence_case(f"{label} over time; below, simulated minus measured.{thinned}"),
        page_figure(
            record_drawing(diagnosis, trace, output), f"{key}-still", f"Measured and simulated {label}.", ""
        )
        if trace.role == diagnosis.scored_on
        else None,
    )


def _detail(trace: Trace, output: str, first: str) -> Detail:
    window = plot.detail_window(trace, output)
    begin, end = (float(trace.t[i]) - time_origin(trace.t) for i in (window.start, window.stop - 1))
    if plot.step_window(trace, output) is not None:
        return Detail(begin, end, "Step", "Show the step")
    return Detail(begin, end, "Largest error", f"Show where the error is largest, {first}")


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


def _facts(diagnosis: Diagnosis, trace: Trace) -> str:
    inputs = list(trace.inputs)
    unit = diagnosis.units.get(inputs[0], "") if inputs else ""
    scale = plot.display_scale(unit, abs(trace.amplitude or 0.0))
    facts = [f"{trace.role} record", trace.kind]
    if trace.amplitude is not None:
        facts.append(f"amplitude {trace.amplitude * scale.factor:.4g} {unit_text(scale.unit)}".strip())
    length = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    return ", ".join([*facts, f"{length:.4g} s", f"{trace.t.size} samples"])

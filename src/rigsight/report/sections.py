"""What stands in the page, in which order? From a diagnosis to the rows and figures of each section."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from rigsight import plot
from rigsight.diagnose.result import Diagnosis, Estimate, Trace
from rigsight.effects import CATALOGUE, Effect
from rigsight.metrics import nrmse
from rigsight.parameters import Parameter
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.quantities import UNDETERMINED, Written, gap_percent, written
from rigsight.report.wording import (
    TIMES,
    after_label,
    effect_label,
    effects_label,
    named_candidate,
    percent,
    sentence_case,
)
from rigsight.rigs import RIGS


@dataclass(frozen=True)
class ParameterRow:
    """One number of the diagnosed simulation."""

    name: str
    description: str
    number: Written
    unit: str
    remark: str


@dataclass(frozen=True)
class RecordView:
    """One record: what it is, what the simulations leave of it, figures.

    Attributes
    ----------
    key
        Anchor in the page.
    title, facts
        Name, and role, kind, amplitude, length in words.
    rows
        Output, gap given, gap after.
    pairs
        Whole record and detail of each output.
    missing
        Outputs that the record lacks.
    is_open
        False for records that are folded away at first.
    """

    key: str
    title: str
    facts: str
    rows: list[tuple[str, str, str]]
    pairs: list[tuple[PageFigure, PageFigure]]
    missing: list[str] = field(default_factory=list)
    is_open: bool = True


def effect_summaries(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return label, catalogue name and summary of every effect named; the summary of a user's effect is empty."""
    return [
        (sentence_case(effect_label(name)), name, effect.summary if (effect := _effect(name)) else "")
        for name in diagnosis.effects
    ]


def budget_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the gap budget of all outputs as a waterfall."""
    label = (
        f"Adding {effects_label(diagnosis.effects)}" if len(diagnosis.effects) == 1 else "Adding the effects"
    )
    alt = " ".join(
        f"{output}: given {gap_percent(gap.before)}, re-identified {gap_percent(gap.reidentified)}, "
        f"{after_label(diagnosis)} {gap_percent(gap.after)}, noise floor {gap_percent(gap.noise_floor)}."
        for output, gap in diagnosis.gap.items()
    )
    titles = {output: output_label(diagnosis, output) for output in diagnosis.gap}
    return page_figure(
        plot.gap_budget(diagnosis, label, titles),
        "figure-budget",
        f"Waterfall of the gap. {alt}",
        "How the gap shrinks, step by step. The dashed line is what a perfect model would leave.",
    )


def budget_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the gap budget as text, one row per output."""
    return [
        {
            "output": output_label(diagnosis, output),
            "before": gap_percent(gap.before),
            "reidentified": gap_percent(gap.reidentified),
            "after": gap_percent(gap.after),
            "noise_floor": gap_percent(gap.noise_floor),
            "closed": percent(gap.closed),
            "intervals": {stage: interval_text(limits, stage) for stage, limits in gap.intervals.items()},
        }
        for output, gap in diagnosis.gap.items()
    ]


def interval_text(limits: tuple[float, float], stage: str) -> str:
    """Return a 95 % interval of a stage as text, ``"9.1 % to 9.9 %"``; empty where it is not finite."""
    if not all(map(math.isfinite, limits)):
        return ""
    low, high = map(percent if stage == "closed" else gap_percent, limits)
    return f"{low} to {high}"


def ranking_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the candidates as bars."""
    names = [effects_label(candidate.effects) for candidate in diagnosis.candidates]
    scored = [
        f"{name} {c.excess:.3g}"
        for name, c in zip(names, diagnosis.candidates, strict=True)
        if math.isfinite(c.excess)
    ]
    hatched = " Hatched: cannot be told from it by these records." if diagnosis.ambiguous_with else ""
    named = " Blue: the one named." if diagnosis.effects else ""
    return page_figure(
        plot.ranking(diagnosis, names),
        "figure-ranking",
        f"Bars of what each candidate leaves in units of the noise floor: {', '.join(scored[:16])}.",
        f"What each candidate leaves; shorter is better.{named}{hatched}",
    )


def ranking_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the candidates as text, best first."""
    return [
        {
            "effects": sentence_case(effects_label(candidate.effects)),
            "names": ", ".join(candidate.effects),
            "is_named": bool(diagnosis.effects) and candidate.effects == diagnosis.effects,
            "is_tied": candidate.effects in diagnosis.ambiguous_with,
            "probability": percent(candidate.probability),
            "errors": [
                gap_percent(candidate.validation_nrmse[output])
                if output in candidate.validation_nrmse
                else "not scored"
                for output in diagnosis.gap
            ],
            "excess": f"{candidate.excess:.3g} {TIMES}" if math.isfinite(candidate.excess) else "not scored",
            "converged": "yes" if candidate.success else "no",
            "message": candidate.message,
        }
        for candidate in diagnosis.candidates
    ]


def parameter_rows(diagnosis: Diagnosis) -> list[ParameterRow]:
    """Return the numbers of the diagnosed simulation: fitted ones with their errors, else those of the model file."""
    known = {p.name: p for p in _parameters(diagnosis)}
    candidate = named_candidate(diagnosis)
    if candidate is not None and diagnosis.verdict in ("effect", "parameters"):
        return [
            _parameter_row(name, estimate, known.get(name)) for name, estimate in candidate.parameters.items()
        ]
    model, units = diagnosis.model, diagnosis.model.get("units", {})
    values = {**model.get("parameters", {}), **model.get("effect_parameters", {})}
    return [
        ParameterRow(
            name, known[name].description if name in known else "", written(value), units.get(name, ""), ""
        )
        for name, value in values.items()
        if isinstance(value, int | float)
    ]


def _parameter_row(name: str, estimate: Estimate, parameter: Parameter | None) -> ParameterRow:
    remark = "" if math.isfinite(estimate.std) else UNDETERMINED
    description = parameter.description if parameter else ""
    return ParameterRow(name, description, written(estimate.value, estimate.std), estimate.unit, remark)


def record_views(diagnosis: Diagnosis) -> Iterator[RecordView]:
    """Yield the records, those that were scored first and open."""
    ordered = sorted(diagnosis.traces, key=lambda trace: trace.role != diagnosis.scored_on)
    for index, trace in enumerate(ordered, start=1):
        yield RecordView(
            key=f"record-{index}",
            title=trace.record,
            facts=_facts(diagnosis, trace),
            rows=[
                (
                    output_label(diagnosis, output),
                    gap_percent(nrmse(trace.before[output] - trace.measured[output], trace.measured[output])),
                    gap_percent(nrmse(trace.after[output] - trace.measured[output], trace.measured[output])),
                )
                for output in trace.measured
            ],
            pairs=[
                _pair(diagnosis, trace, output, f"record-{index}-output-{i}")
                for i, output in enumerate(trace.measured, start=1)
            ],
            missing=[
                output_label(diagnosis, output) for output in diagnosis.gap if output not in trace.measured
            ],
            is_open=trace.role == diagnosis.scored_on,
        )


def _pair(diagnosis: Diagnosis, trace: Trace, output: str, key: str) -> tuple[PageFigure, PageFigure]:
    label = after_label(diagnosis)
    window = plot.detail_window(trace, output)
    begin, end = trace.t[window.start], trace.t[window.stop - 1]
    what = f"{output_label(diagnosis, output)}, record {trace.record}"
    whole = page_figure(
        plot.comparison(diagnosis, trace, output, after_label=label),
        f"{key}-whole",
        f"Measured and simulated {what}, given and {label}, with the errors below.",
        "Measured against simulated; below, what is left, with a band of twice the noise floor. "
        "The black bar marks the detail.",
    )
    detail = page_figure(
        plot.comparison(diagnosis, trace, output, window),
        f"{key}-detail",
        f"Detail of {what} from {begin:.4g} s to {end:.4g} s.",
        f"Where the given simulation errs most: {begin:.4g} s to {end:.4g} s.",
    )
    return whole, detail


def _facts(diagnosis: Diagnosis, trace: Trace) -> str:
    inputs = list(trace.inputs)
    unit = diagnosis.units.get(inputs[0], "") if inputs else ""
    scale = plot.display_scale(unit, abs(trace.amplitude or 0.0))
    facts = [f"{trace.role} record", trace.kind]
    if trace.amplitude is not None:
        facts.append(f"amplitude {trace.amplitude * scale.factor:.4g} {scale.unit}".strip())
    length = float(trace.t[-1] - trace.t[0]) if trace.t.size else 0.0
    return ", ".join([*facts, f"{length:.4g} s", f"{trace.t.size} samples"])


def floor_rows(diagnosis: Diagnosis) -> list[dict[str, str]]:
    """Return the noise floor of each output in display units, and how it was found."""
    rows = []
    for floor in diagnosis.noise_floors:
        scale = plot.display_scale(floor.unit, floor.std)
        rows.append(
            {
                "output": output_label(diagnosis, floor.output),
                "std": f"{floor.std * scale.factor:.3g}" if math.isfinite(floor.std) else "not finite",
                "unit": scale.unit,
                "method": floor.method,
            }
        )
    return rows


def output_label(diagnosis: Diagnosis, output: str) -> str:
    """Return an output for people: ``"yaw angle psi"``; the bare name on a rig that is not ours."""
    rig = RIGS.get(diagnosis.rig)
    meaning = next((s.description for s in rig.outputs if s.name == output), "") if rig else ""
    return meaning if meaning.startswith(output) else f"{meaning} {output}".strip()


def _effect(name: str) -> Effect | None:
    return next((effect for effect in CATALOGUE if effect.name == name), None)


def _parameters(diagnosis: Diagnosis) -> Iterator[Parameter]:
    rig = RIGS.get(diagnosis.rig)
    if rig:
        yield from rig.parameters
    for name in diagnosis.effects:
        effect = _effect(name)
        if effect:
            yield from effect.parameters

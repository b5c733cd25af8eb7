"""Rows and figures of each section of the page, in order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from rigsight import plot
from rigsight.diagnose.location.trace import STAGES
from rigsight.diagnose.noise.noise_floor import NoiseFloor
from rigsight.diagnose.result import Diagnosis, Estimate
from rigsight.effects import Effect
from rigsight.parameters import Parameter
from rigsight.report.drawing.figures import PageFigure, page_figure
from rigsight.report.quantities import (
    UNDETERMINED,
    Written,
    effect_of,
    gap_percent,
    rig_of,
    written,
    written_limits,
)
from rigsight.report.wording import (
    TIMES,
    effect_label,
    effects_label,
    family_label,
    forms_label,
    given_text,
    is_given,
    named_candidate,
    percent,
    sentence_case,
    share_label,
    stages_reported,
)

if TYPE_CHECKING:
    from rigsight.plot import Figure

_TWO_SIDED = 1.96
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class ParameterRow:
    """One parameter of the diagnosed simulation."""

    # What it is; the remark stands where the records do not determine it.
    name: str
    description: str
    number: Written
    unit: str
    remark: str
    interval: tuple[Written, ...] = ()  # its 95 % interval, empty where it was not fitted
    given: str = ""  # its value in the given simulation, empty where that has none


@dataclass(frozen=True)
class FindingRow:
    """One thing that the records themselves say: where, what, what to do, and whether the gap may come from it."""

    where: str
    kind: str
    sentence: str
    remedy: str
    serious: bool
    explained: str


def effect_summaries(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> list[tuple[str, str, str]]:
    """Return label, name and summary of every effect named; the summary of one that is not among the known is empty."""
    return [
        (sentence_case(effect_label(name)), name, effect.summary if effect is not None else "")
        for name, effect in ((name, effect_of(name, known)) for name in diagnosis.effects)
    ]


def budget_drawing(diagnosis: Diagnosis) -> Figure:
    """Return the gap budget of all outputs as a waterfall."""
    label = (
        f"Adding {effects_label(diagnosis.effects)}" if len(diagnosis.effects) == 1 else "Adding the effects"
    )
    titles = {output: output_label(diagnosis, output) for output in diagnosis.gap}
    return plot.gap_budget(diagnosis, label, titles, is_given(diagnosis))


def budget_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the gap budget with its caption."""
    alt = " ".join(
        f"{output}: {stages_reported(diagnosis, gap)}, noise floor {gap_percent(gap.noise_floor)}."
        for output, gap in diagnosis.gap.items()
    )
    meaning = (
        " Refitting its parameters leads to the re-identified equations."
        if is_given(diagnosis)
        else " No parameters were given: the first bar is the rig's own equations with fitted parameters."
    )
    return page_figure(
        budget_drawing(diagnosis),
        "figure-budget",
        f"Waterfall of the gap. {alt}",
        f"How the gap shrinks, step by step; the dashed line is the error of a perfect model.{meaning}",
    )


def budget_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the gap budget as text, one row per output."""
    return [
        {
            "output": output_label(diagnosis, output),
            **{stage: gap_percent(getattr(gap, stage)) for stage in STAGES},
            "noise_floor": gap_percent(gap.noise_floor),
            "closed": percent(gap.closed),
            "intervals": {stage: interval_text(limits, stage) for stage, limits in gap.intervals.items()},
        }
        for output, gap in diagnosis.gap.items()
    ]


def interval_text(limits: tuple[float, float], stage: str) -> str:
    """Return a 95 % interval of a stage as text, ``"9.1 % to 9.9 %"``; one number for equal ends, empty if not finite."""
    if not all(map(math.isfinite, limits)):
        return ""
    low, high = map(percent if stage == "closed" else gap_percent, limits)
    return low if low == high else f"{low} to {high}"


def ranking_drawing(diagnosis: Diagnosis) -> Figure:
    """Return the candidates as bars."""
    return plot.ranking(diagnosis, [effects_label(candidate.effects) for candidate in diagnosis.candidates])


def ranking_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the ranking with its caption."""
    names = [effects_label(candidate.effects) for candidate in diagnosis.candidates]
    scored = [
        f"{name} {c.error_over_noise:.3g}"
        for name, c in zip(names, diagnosis.candidates, strict=True)
        if math.isfinite(c.error_over_noise)
    ]
    hatched = (
        " Hatched: these records cannot distinguish it from the named one."
        if diagnosis.ambiguous_with
        else ""
    )
    named = " Blue: the named cause." if diagnosis.effects else ""
    return page_figure(
        ranking_drawing(diagnosis),
        "figure-ranking",
        f"Bars of the error of each candidate in units of the noise floor: {', '.join(scored[:16])}.",
        f"Error of each candidate; shorter is better.{named}{hatched}",
    )


def family_rows(diagnosis: Diagnosis) -> list[tuple[str, str, str, str, str]]:
    """Return each family with its probability, its shares of the gap and along the motion, and its forms; then the rest."""
    rows = [
        (
            sentence_case(family_label(own)),
            percent(own.probability),
            share_label(own),
            "" if own.along_motion is None else percent(own.along_motion),
            forms_label(own),
        )
        for own in diagnosis.families
    ]
    if rows and diagnosis.shares is not None:
        rows.append(("Remainder", "", percent(diagnosis.shares.remainder), "", "explained by none of them"))
        rows.append(("Noise and disturbance", "", percent(diagnosis.shares.noise), "", ""))
    return rows


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
            "error_over_noise": f"{candidate.error_over_noise:.3g} {TIMES}"
            if math.isfinite(candidate.error_over_noise)
            else "not scored",
            "converged": "yes" if candidate.success else "no",
            "message": candidate.message,
        }
        for candidate in diagnosis.candidates
    ]


def parameter_rows(diagnosis: Diagnosis, effects: Mapping[str, Effect]) -> list[ParameterRow]:
    """Return the numbers of the diagnosed simulation: fitted ones with their errors, else those of the model file."""
    known = {p.name: p for p in _parameters(diagnosis, effects)}
    candidate = named_candidate(diagnosis)
    if candidate is not None and diagnosis.verdict in ("effect", "parameters"):
        return [
            replace(_parameter_row(name, estimate, known.get(name)), given=given_text(diagnosis, name))
            for name, estimate in candidate.parameters.items()
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


def errors_reported(diagnosis: Diagnosis) -> str:
    """Return in a sentence where the standard errors of the numbers come from; empty where no number was fitted."""
    candidate = named_candidate(diagnosis)
    if candidate is None or not candidate.parameters or diagnosis.verdict not in ("effect", "parameters"):
        return ""
    if candidate.std_method == "bootstrap":
        return (
            "Standard errors from simulations of this model with random disturbance forces and sensor noise as large as its "
            "residual (parametric bootstrap)."
        )
    return (
        "Standard errors from the covariance of the fit, because this model could not be simulated with random forces. They may "
        "be too small if disturbances decide when friction sticks or slips."
    )


def _parameter_row(name: str, estimate: Estimate, parameter: Parameter | None) -> ParameterRow:
    remark = "" if math.isfinite(estimate.std) else UNDETERMINED
    description = parameter.description if parameter else ""
    number = written(estimate.value, estimate.std)
    return ParameterRow(name, description, number, estimate.unit, remark, _interval(estimate, parameter))


def _interval(estimate: Estimate, parameter: Parameter | None) -> tuple[Written, ...]:
    """Return the 95 % limits, cut where the parameter's own range ends."""
    if not (math.isfinite(estimate.value) and math.isfinite(estimate.std) and estimate.std > 0.0):
        return ()
    low, high = estimate.value - _TWO_SIDED * estimate.std, estimate.value + _TWO_SIDED * estimate.std
    if parameter is not None:
        low, high = max(low, parameter.lower), min(high, parameter.upper)
    return tuple(written_limits(low, high, estimate.std))


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
                "method": floor.method + _disturbing(floor),
            }
        )
    return rows


def _disturbing(floor: NoiseFloor) -> str:
    found = floor.disturbance
    if found is None:
        return ""
    return (
        f". The error of the model above it corresponds to a random force of {found.std:.2g} {found.unit} added to the drive, up "
        f"to {found.below:.3g} rad/s"
    )


def output_label(diagnosis: Diagnosis, output: str) -> str:
    """Return an output for people: ``"yaw angle psi"``; the bare name on a rig that is not ours."""
    rig = rig_of(diagnosis)
    meaning = next((s.description for s in rig.outputs if s.name == output), "") if rig else ""
    return meaning if meaning.startswith(output) else f"{meaning} {output}".strip()


def finding_rows(diagnosis: Diagnosis) -> list[FindingRow]:
    """Return what the records themselves say, in the order in which it is worth reading."""
    if diagnosis.data_quality is None:
        return []
    return [
        FindingRow(
            where=", ".join(part for part in (finding.record or "all records", finding.signal) if part),
            kind=finding.kind.replace("_", " "),
            sentence=finding.sentence,
            remedy=finding.remedy,
            serious=finding.serious,
            explained="not measured" if finding.explained is None else percent(finding.explained),
        )
        for finding in diagnosis.data_quality.findings
    ]


def other_notes(diagnosis: Diagnosis) -> list[str]:
    """Return the notes that do not stand under data quality already."""
    reported = () if diagnosis.data_quality is None else diagnosis.data_quality.notes
    return [note for note in diagnosis.notes if note not in reported]


def _parameters(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> Iterator[Parameter]:
    rig = rig_of(diagnosis)
    if rig:
        yield from rig.parameters
    for name in (*diagnosis.model.get("effects", ()), *diagnosis.effects):
        effect = effect_of(name, known)
        for parameter in () if effect is None else effect.parameters:
            yield parameter
            # Where two effects share a name, theirs is in front of it.
            yield replace(parameter, name=f"{name}.{parameter.name}")

"""Rows and figures of the sections of the page, and the line on trust in parameters for a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rigsight import plot
from rigsight.diagnose.result import Diagnosis
from rigsight.diagnose.trust.estimates import PORTION, RECORD, WINDOW_LENGTH
from rigsight.diagnose.trust.patterns import Pattern
from rigsight.diagnose.trust.statement import ParameterTrust
from rigsight.effects import Effect
from rigsight.errors import InputError
from rigsight.parameters import Parameter
from rigsight.report import labels
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.wording import given_text, is_given, named_candidate, stages_reported

if TYPE_CHECKING:
    from rigsight.plot import Figure

TRUST_COLUMNS = ("parameter", "by", "group", "value", "std", "unit", "pattern", "p_value")
"""Columns of the table."""
_BY = {PORTION: "part of the records", WINDOW_LENGTH: "window length"}
_MOST_PANELS = 6
_NAMED_IN_A_LINE = 3


def budget_drawing(diagnosis: Diagnosis) -> Figure:
    """Return the gap budget of all outputs as a waterfall."""
    label = (
        f"Adding {labels.effects_label(diagnosis.effects)}"
        if len(diagnosis.effects) == 1
        else "Adding the effects"
    )
    titles = {output: output_label(diagnosis, output) for output in diagnosis.gap}
    return plot.gap_budget(diagnosis, label, titles, is_given(diagnosis))


def budget_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the gap budget with its caption."""
    alt = " ".join(
        f"{output}: {stages_reported(diagnosis, gap)}, noise floor {labels.gap_percent(gap.noise_floor)}."
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


def interval_text(limits: tuple[float, float], stage: str) -> str:
    """Return a 95 % interval of a stage as text, ``"9.1 % to 9.9 %"``; one number for equal ends, empty if not finite."""
    if not all(map(math.isfinite, limits)):
        return ""
    low, high = map(labels.percent if stage == "closed" else labels.gap_percent, limits)
    return low if low == high else f"{low} to {high}"


def ranking_drawing(diagnosis: Diagnosis) -> Figure:
    """Return the candidates as bars."""
    return plot.ranking(
        diagnosis, [labels.effects_label(candidate.effects) for candidate in diagnosis.candidates]
    )


def ranking_figure(diagnosis: Diagnosis) -> PageFigure:
    """Return the ranking with its caption."""
    names = [labels.effects_label(candidate.effects) for candidate in diagnosis.candidates]
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
        f"Error of each candidate; shorter is better. Dashed: the noise floor, which a perfect model leaves.{named}{hatched}",
    )


def parameter_rows(diagnosis: Diagnosis, effects: Mapping[str, Effect]) -> list[labels.ParameterRow]:
    """Return the numbers of the diagnosed simulation: fitted ones with their errors, else those of the model file."""
    known = {p.name: p for p in _parameters(diagnosis, effects)}
    candidate = named_candidate(diagnosis)
    if candidate is not None and diagnosis.verdict in ("effect", "parameters"):
        return [
            labels.parameter_row(name, estimate, known.get(name), given_text(diagnosis, name))
            for name, estimate in candidate.parameters.items()
        ]
    model, units = diagnosis.model, diagnosis.model.get("units", {})
    values = {**model.get("parameters", {}), **model.get("effect_parameters", {})}
    return [
        labels.ParameterRow(
            name, labels.written(value), units.get(name, ""), known[name].description if name in known else ""
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


def output_label(diagnosis: Diagnosis, output: str) -> str:
    """Return an output for people: ``"yaw angle psi"``; the bare name on a rig that is not ours."""
    rig = labels.rig_of(diagnosis)
    meaning = next((s.description for s in rig.outputs if s.name == output), "") if rig else ""
    return meaning if meaning.startswith(output) else f"{meaning} {output}".strip()


def _parameters(diagnosis: Diagnosis, known: Mapping[str, Effect]) -> Iterator[Parameter]:
    rig = labels.rig_of(diagnosis)
    if rig:
        yield from rig.parameters
    for name in (*diagnosis.model.get("effects", ()), *diagnosis.effects):
        effect = labels.effect_of(name, known)
        for parameter in () if effect is None else effect.parameters:
            yield parameter
            # Where two effects share a name, theirs is in front of it.
            yield replace(parameter, name=f"{name}.{parameter.name}")


def trust_figure(diagnosis: Diagnosis) -> PageFigure | None:
    """Return the numbers by group; None where none was estimated in two groups."""
    drawn = _drawn(diagnosis)
    if not drawn:
        return None
    reported = "; ".join(f"{number.name}: {how(number)}" for number in drawn)
    return page_figure(
        trust_drawing(diagnosis),
        "figure-trust",
        f"Parameters estimated from single groups of records, with 95 % intervals. {reported}.",
        "Each parameter as estimated from one record, level or window alone, with 95 % intervals. Dashed line with band: the "
        "common fit.",
    )


def trust_drawing(diagnosis: Diagnosis) -> Figure:
    """Return the numbers by group: those that differ and those of the effects, six at most."""
    drawn = _drawn(diagnosis)
    if not drawn:
        raise InputError("No parameter of this diagnosis could be estimated from two groups of records.")
    return plot.parameters_by_group(
        [
            plot.GroupPanel(
                number.name,
                number.unit,
                _BY.get(_shown(number), _shown(number)),
                tuple((one.group, one.value, one.std) for one in number.groups[_shown(number)]),
                (number.value, number.std),
                not number.stable,
            )
            for number in drawn
        ]
    )


def trust_line(diagnosis: Diagnosis) -> str:
    """Return one line: that all numbers are the same, or which are not; empty where that was not asked."""
    if diagnosis.trust is None or not diagnosis.trust.parameters:
        return ""
    differing = [number for number in diagnosis.trust.parameters if not number.stable]
    if not differing:
        return f"Trust: {diagnosis.trust.statement}"
    reported = [f"{number.name} {how(number)}" for number in differing[:_NAMED_IN_A_LINE]]
    more = len(differing) - len(reported)
    rest = f"; {more} more {'differs' if more == 1 else 'differ'}" if more > 0 else ""
    first = differing[0].points_to
    return f"Trust: {'; '.join(reported)}{rest}. {labels.sentence_case(first.cause) if first else ''}."


def trust_rows(diagnosis: Diagnosis) -> Iterator[dict[str, Any]]:
    """Yield a row per number and group, with the columns `TRUST_COLUMNS`."""
    for number in () if diagnosis.trust is None else diagnosis.trust.parameters:
        for kind, groups in number.groups.items():
            for one in groups:
                estimate = (number.name, kind, one.group, one.value, one.std, number.unit)
                row = (*estimate, str(number.pattern), number.p_value)
                yield dict(zip(TRUST_COLUMNS, row, strict=True))


def _drawn(diagnosis: Diagnosis) -> list[ParameterTrust]:
    numbers = () if diagnosis.trust is None else diagnosis.trust.parameters
    reported = [n for n in numbers if (not n.stable or n.of_effect) and len(n.groups.get(_shown(n), ())) > 1]
    return reported[:_MOST_PANELS]


def _shown(number: ParameterTrust) -> str:
    """Return by which groups a number is drawn: those in which it differs, else by record."""
    if number.pattern in (Pattern.AMPLITUDE, Pattern.CONSTANT):
        return number.goes_with[0]
    by_pattern = {Pattern.PORTION: PORTION, Pattern.WINDOW: WINDOW_LENGTH}
    return by_pattern.get(number.pattern, RECORD if RECORD in number.groups else WINDOW_LENGTH)


def how(number: ParameterTrust) -> str:
    """Return how a number differs between groups, in words."""
    if number.pattern is Pattern.UNKNOWN:
        return "not compared"
    if number.stable:
        return "the same"
    words = {
        Pattern.RECORD: "differs from record to record",
        Pattern.PORTION: f"{number.moves} along the records",
        Pattern.WINDOW: f"{number.moves} when windows get shorter",
        Pattern.TIME: f"{number.moves} from record to record",
    }
    return words.get(number.pattern, f"{number.moves} with {' and '.join(number.goes_with)}")

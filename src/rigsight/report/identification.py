"""An identification on a terminal, in a notebook, and as one self-contained HTML page without a script."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table

from rigsight.diagnose.result import Estimate
from rigsight.identify import FitResult, PhysicalEstimates
from rigsight.identify.fit.covariance import LEVEL
from rigsight.identify.hysteresis.derived import Derived
from rigsight.identify.identification import (
    HysteresisIdentification,
    Identification,
    RecordIdentification,
    RecordScore,
)
from rigsight.identify.linear_view import LinearView
from rigsight.plot import with_unit
from rigsight.records.record import Floats
from rigsight.report import labels
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.labels import (
    ERRORS_HOLD,
    UNDETERMINED,
    ParameterRow,
    estimate_text,
    gap_percent,
    parameter_row,
    plain,
    written,
)
from rigsight.report.page import NotebookTable, notebook_html, rendered
from rigsight.report.terminal import Summary, Writer, pairs, worth_knowing
from rigsight.simulate.linearization import Linearization
from rigsight.units import behind

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HEADING = "Hysteresis"
_WIDTHS = 3.92
"""Standard deviations between the ends of a 95 % interval."""
ERROR_HEADS = ("record", "role", "NRMSE without the effects", "with the effects")
_MOST_WARNINGS = 12
_WORSE = 1.05
"""Ratio from which a record's own fit is worth naming beside the joint one."""
_NAME_WIDTH, _RECORD_WIDTH = 22, 20
_STABLE = {
    "stable": "stable",
    "drifts": "stable except for free rigid-body motion",
    "undamped": "not damped in all of its motions",
    "unstable": "unstable",
}


def identification_summary(found: Identification) -> Summary:
    """Return a table over amplitudes, the joint set, the scores, and what must be known of an identification."""

    def lines(text: Writer, width: int) -> Iterator[RenderableType]:
        yield text(f"Identified: {found.title}", "bold green")
        yield from _amplitude_tables(found, text, width)
        yield text(ERRORS_HOLD, "dim")
        yield text(found.amplitude_statement, "bold yellow" if found.changing else "")
        parts = [("One set for all estimation records", found.joint.statement, joint_rows(found))]
        if found.identifiability is not None:
            statement = found.identifiability.sentence
            parts.append(("What these records determine", statement, linear_rows(found)))
        if found.hysteresis is not None:
            parts.append((HEADING, found.hysteresis.statement, hysteresis_rows(found.hysteresis)))
        for heading, statement, rows in parts:
            yield text("")
            yield text(heading, "bold")
            yield text(statement)
            yield pairs(rows, text)
        if found.hysteresis is not None:
            errors = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
            for head in ERROR_HEADS:
                errors.add_column(text(head))
            for row in error_rows(found.hysteresis):
                errors.add_row(*map(text, row))
            yield Padding(errors, (0, 0, 0, 2), expand=False)
        if found.warnings:
            n_more = len(found.warnings) - _MOST_WARNINGS
            yield text("")
            yield from worth_knowing(found.warnings[:_MOST_WARNINGS], text, n_more, "identification.json")

    return Summary(lines)


def _amplitude_tables(found: Identification, text: Writer, width: int) -> Iterator[Table]:
    """Yield a column per record in the order of amplitudes, in as many tables as the terminal's width asks for."""
    records = _by_amplitude(found)
    at_once = max(1, (width - _NAME_WIDTH) // _RECORD_WIDTH)
    for first in range(0, len(records), at_once):
        part = records[first : first + at_once]
        table = Table(box=None, padding=(0, 1), pad_edge=False, header_style="bold")
        table.add_column(text("record"))
        for record in part:
            table.add_column(text(record.record.name), justify="right", overflow="fold")
        for row in record_rows(found, part):
            table.add_row(*map(text, row))
        if any(record.resonance is not None for record in records):
            seen = ("-" if r.resonance is None else f"{r.resonance:.3g}" for r in part)
            table.add_row(text("resonance [rad/s]"), *map(text, seen))
        yield table


def record_rows(found: Identification, records: Sequence[RecordIdentification]) -> Iterator[list[str]]:
    """Yield head and cells of the amplitudes of records, and of each parameter with its standard error."""
    # The unit of amplitudes is in the head, or in each cell where sources differ.
    units = [found.units.get(record.source, "") for record in records]
    if len({found.units.get(record.source, "") for record in found.records}) == 1:
        yield [with_unit("amplitude", units[0]), *(f"{record.amplitude:.4g}" for record in records)]
    else:
        sizes = zip(records, units, strict=True)
        yield ["amplitude", *(f"{record.amplitude:.4g}{behind(unit)}" for record, unit in sizes)]
    for name in dict.fromkeys(name for record in _by_amplitude(found) for name in record.estimates):
        cells = []
        for record in records:
            value, std = record.estimates.get(name, (math.nan, math.nan))
            text = plain(written(value, std)) if math.isfinite(std) else "not determined"
            cells.append(text if name in record.estimates else "-")
        yield [with_unit(name, found.units.get(name, "")), *cells]


def _by_amplitude(found: Identification) -> list[RecordIdentification]:
    return sorted(found.records, key=lambda record: record.amplitude)


def joint_estimates(found: Identification) -> dict[str, Estimate]:
    """Return the numbers of the joint fit, then those that are the mean of the records' own."""
    joint, units = found.joint, found.units
    pooled = {} if joint.pooled is None else _estimates(joint.pooled.values, joint.pooled, units)
    return _estimates(joint.names, joint.fit.fit, units) | pooled


def joint_rows(found: Identification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the numbers of the joint fit, and how it follows each record."""
    remarks = {bound.name: f", at its {bound.side} bound" for bound in found.reached}
    remarks |= dict.fromkeys(
        found.joint.pooled.values if found.joint.pooled else (), ", mean of the records' own"
    )
    for name, estimate in joint_estimates(found).items():
        yield name, f"{estimate_text(estimate)}{remarks.get(name, '')}"
    if found.joint.conicity is not None:
        yield "delta_0", found.joint.conicity.statement
    for score in found.joint.scores:
        yield score.record, f"{score.role}, NRMSE {_score_text(score)}"


def linear_rows(found: Identification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: combinations that are determined, and the poles of the rig close to its rest."""
    if found.identifiability is not None:
        for c in found.identifiability.combinations:
            yield c.text, estimate_text(Estimate(c.value, c.std, c.unit))
    for view in found.views:
        at = view.constants_text
        for mode in view.modes:
            frequency = estimate_text(Estimate(mode.natural_frequency, mode.frequency_std, "rad/s"))
            damping = estimate_text(Estimate(mode.damping_ratio, mode.damping_std, "1"))
            kind = f"damping ratio {damping}" if math.isfinite(mode.damping_ratio) else "free motion"
            yield f"pole{f' ({at})' if at else ''}", f"{frequency}, {kind}"


def _score_text(score: RecordScore) -> str:
    joint = ", ".join(f"{name} {gap_percent(value)}" for name, value in score.nrmse.items())
    alone = ", ".join(
        f"{name} {gap_percent(own)}"
        for name, own in score.own_nrmse.items()
        if score.nrmse.get(name, own) > _WORSE * own
    )
    return f"{joint} (by itself {alone})" if alone else joint


def hysteresis_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: parameters with their standard errors, and what follows from them."""
    fit = found.calibration.fit
    for name, estimate in _estimates(fit.free, fit, found.units).items():
        yield name, estimate_text(estimate)
    for name, value in found.held.items():
        yield name, f"{value:.4g}{behind(found.units[name])}, held"
    yield from derived_rows(found)


def derived_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield name and value with interval of each quantity that follows from the parameters."""
    derived = found.calibration.derived
    for pair in derived.pairs:
        yield pair.name, derived_text(pair)
    if derived.saturation is not None:
        yield derived.saturation.name, derived.saturation_in_words
    for area in derived.loop_areas:
        yield area.energy.name, derived_text(area.energy)


def error_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str, str, str]]:
    """Yield record, role, and the errors of its outputs without and with the effects."""
    for score in found.scores:
        without, with_effects = (
            ", ".join(f"{name} {gap_percent(value)}" for name, value in errors.items()) or "-"
            for errors in (score.without, score.nrmse)
        )
        yield score.record, score.role, without, with_effects


def derived_text(one: Derived) -> str:
    """Return a value with its interval, e.g. ``"0.0318 J (95 %: 0.0316 to 0.0320)"``."""
    if not (math.isfinite(one.lower) and math.isfinite(one.upper)):
        return UNDETERMINED
    spread = (one.upper - one.lower) / _WIDTHS
    value, lower, upper = (plain(written(number, spread)) for number in (one.value, one.lower, one.upper))
    return f"{value}{behind(one.unit)} ({100.0 * LEVEL:.0f} %: {lower} to {upper})"


def render_identification(
    identification: Identification,
    drawings: Sequence[Figure],
    amplitudes: Figure | None,
    command: str,
    versions: Mapping[str, str],
    seed: int | None = None,
) -> str:
    """Return the page of an identification."""
    reported = identification.identifiability
    assert reported is not None
    joint, names = identification.joint, identification.joint.names
    fit, hysteresis = joint.fit.fit, identification.hysteresis
    figure = None
    if amplitudes is not None:
        caption = "Parameters fitted to each record alone, over its amplitude, with 95 % intervals; dashed: the common set."
        figure = page_figure(amplitudes, "amplitudes-figure", identification.amplitude_statement, caption)
    return rendered(
        "identification.html.jinja",
        command or "from Python",
        versions,
        seed,
        identification=identification,
        sentence=reported.sentence,
        all_determined=len(reported.determined) == len(names) and fit.success,
        n_determined=len(reported.determined),
        n_parameters=len(names),
        views=list(zip(identification.views, _figures(identification.views, drawings), strict=True)),
        labels=labels,
        stable=_STABLE,
        place=_place,
        polynomial=_polynomial,
        parameters=_parameters(names, fit, identification.units, identification.meanings),
        combinations=[
            parameter_row(c.text, Estimate(c.value, c.std, c.unit), description=f"of {', '.join(c.members)}")
            for c in reported.combinations
        ],
        errors_hold=ERRORS_HOLD,
        outputs=list(dict.fromkeys(name for score in joint.scores for name in score.nrmse)),
        hysteresis=hysteresis,
        of_hysteresis=_parameters(
            hysteresis.calibration.fit.free, hysteresis.calibration.fit, hysteresis.units, hysteresis.meanings
        )
        if hysteresis
        else [],
        derived_rows=derived_rows,
        error_rows=error_rows,
        amplitudes=figure,
    )


def _parameters(
    names: Iterable[str], fit: FitResult, units: Mapping[str, str], meanings: Mapping[str, str]
) -> list[ParameterRow]:
    return [
        parameter_row(name, estimate, description=meanings.get(name, ""))
        for name, estimate in _estimates(names, fit, units).items()
    ]


def _estimates(
    names: Iterable[str], fit: FitResult | PhysicalEstimates, units: Mapping[str, str]
) -> dict[str, Estimate]:
    return {
        name: Estimate(fit.values[name], fit.standard_errors[name], units.get(name, "")) for name in names
    }


def _figures(views: Sequence[LinearView], drawings: Sequence[Figure]) -> Iterator[PageFigure | None]:
    remaining = iter(drawings)
    for number, view in enumerate(views, 1):
        if view.measured is None or not view.has_responses:
            yield None
            continue
        shown = "; ".join(
            f"{source} to {response}: peak {20.0 * math.log10(float(curve.magnitude.max())):.3g} dB at "
            f"{float(curve.omega[int(np.argmax(curve.magnitude))]):.3g} rad/s"
            for (source, response), curve in view.measured.found.items()
        )
        yield page_figure(
            next(remaining),
            f"responses-{number}",
            shown,
            "Magnitude and phase of each sensor's response to each input: measured from all records together (gray, with 95 % "
            "bands), and that of the fitted equations, linearized at equilibrium (blue).",
        )


def _place(linear: Linearization) -> str:
    pairs = [
        *zip(linear.inputs, linear.at_inputs, strict=True),
        *zip(linear.states, linear.at_state, strict=True),
    ]
    return ", ".join(f"{name} = {float(value):.4g}" for name, value in pairs if value != 0.0) or "all at zero"


def _polynomial(coefficients: Floats) -> str:
    degree = coefficients.size - 1
    parts = [
        (value, f"{abs(value):.4g}{' s' if power else ''}{f'^{power}' if power > 1 else ''}")
        for power, value in zip(range(degree, -1, -1), map(float, coefficients), strict=True)
        if value != 0.0
    ]
    if not parts:
        return "0"
    signs = ["\u2212" if value < 0.0 else "+" for value, _ in parts]
    first = f"{signs[0].replace('+', '')}{parts[0][1]}"
    return first + "".join(f" {sign} {text}" for sign, (_, text) in zip(signs[1:], parts[1:], strict=True))


def identification_html(identification: Identification) -> str:
    """Return the parameters of each record in the order of amplitudes, and those of all records together."""
    records = _by_amplitude(identification)
    tables: list[NotebookTable] = [
        (
            ("record", *(record.record.name for record in records)),
            list(record_rows(identification, records)),
        ),
        (("all records", ""), list(joint_rows(identification))),
    ]
    reported = identification.identifiability
    sentences = [
        identification.amplitude_statement,
        identification.joint.statement,
        "" if reported is None else reported.sentence,
    ]
    if (hysteresis := identification.hysteresis) is not None:
        sentences.append(hysteresis.statement)
        tables.append(((HEADING, ""), list(hysteresis_rows(hysteresis))))
        tables.append((ERROR_HEADS, list(error_rows(hysteresis))))
    return notebook_html(f"Identified: {identification.title}", sentences, tables, identification.warnings)

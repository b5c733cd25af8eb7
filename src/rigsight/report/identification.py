"""An identification for a terminal: a table over amplitudes, the joint set, the scores, and what must be known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table

from rigsight.diagnose.result import Estimate
from rigsight.identify.hysteresis.derived import LEVEL, Derived
from rigsight.identify.identification import (
    HysteresisIdentification,
    Identification,
    RecordIdentification,
    RecordScore,
)
from rigsight.plot import with_unit
from rigsight.report.quantities import (
    ERRORS_HOLD,
    UNDETERMINED,
    behind,
    estimate_text,
    gap_percent,
    plain,
    written,
)
from rigsight.report.terminal import Summary, Writer, pairs, worth_knowing

HEADING = "Hysteresis"
_WIDTHS = 3.92
"""Standard deviations between the ends of a 95 % interval."""
ERROR_HEADS = ("record", "role", "NRMSE without the effects", "with the effects")


_MOST_WARNINGS = 12
_WORSE = 1.05
"""Ratio from which a record's own fit is worth naming beside the joint one."""
_NAME_WIDTH, _RECORD_WIDTH = 22, 20


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
    records = sorted(found.records, key=lambda r: r.amplitude)
    names = dict.fromkeys(name for record in records for name in record.estimates)
    at_once = max(1, (width - _NAME_WIDTH) // _RECORD_WIDTH)
    for first in range(0, len(records), at_once):
        part = records[first : first + at_once]
        table = Table(box=None, padding=(0, 1), pad_edge=False, header_style="bold")
        table.add_column(text("record"))
        for record in part:
            table.add_column(text(record.record.name), justify="right", overflow="fold")
        table.add_row(*map(text, amplitude_row(found, part)))
        for name in names:
            head = text(with_unit(name, found.units.get(name, "")))
            table.add_row(head, *(text(estimate_cell(record, name)) for record in part))
        if any(record.resonance is not None for record in records):
            seen = ("-" if r.resonance is None else f"{r.resonance:.3g}" for r in part)
            table.add_row(text("resonance [rad/s]"), *map(text, seen))
        yield table


def amplitude_row(found: Identification, records: Sequence[RecordIdentification]) -> list[str]:
    """Return head and cells of the amplitudes of records; the unit is in the head, or in each cell where sources differ."""
    units = [found.units.get(record.source, "") for record in records]
    if len({found.units.get(record.source, "") for record in found.records}) == 1:
        return [with_unit("amplitude", units[0]), *(f"{record.amplitude:.4g}" for record in records)]
    return [
        "amplitude",
        *(f"{record.amplitude:.4g} {unit}".rstrip() for record, unit in zip(records, units, strict=True)),
    ]


def estimate_cell(record: RecordIdentification, name: str) -> str:
    """Return a parameter of one record with its standard error, a dash where the record does not show it."""
    if name not in record.estimates:
        return "-"
    value, std = record.estimates[name]
    if not math.isfinite(std):
        return f"{value:.3g}"
    return plain(written(value, std))


def joint_rows(found: Identification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: the numbers of the joint fit, and how it follows each record."""
    fit, reached = found.joint.fit.fit, {bound.name: bound.side for bound in found.reached}
    for name in found.joint.names:
        reported = estimate_text(
            Estimate(fit.values[name], fit.standard_errors[name], found.units.get(name, ""))
        )
        yield name, f"{reported}, at its {reached[name]} bound" if name in reached else reported
    if found.joint.pooled is not None:
        errors = found.joint.pooled.standard_errors
        for name, value in found.joint.pooled.values.items():
            estimate = Estimate(value, errors[name], found.units.get(name, ""))
            yield name, f"{estimate_text(estimate)}, mean of the records' own"
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
        at = ", ".join(f"{name} = {value:g}" for name, value in view.constants.items())
        for mode in view.modes:
            frequency = estimate_text(Estimate(mode.natural_frequency, mode.frequency_std, "rad/s"))
            damping = (
                estimate_text(Estimate(mode.damping_ratio, mode.damping_std, "1"))
                if math.isfinite(mode.damping_ratio)
                else "none"
            )
            yield f"pole{f' ({at})' if at else ''}", f"{frequency}, damping ratio {damping}"


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
    for name in fit.free:
        yield name, estimate_text(Estimate(fit.values[name], fit.standard_errors[name], found.units[name]))
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

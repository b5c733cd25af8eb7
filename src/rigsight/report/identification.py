"""An identification for a terminal: a table over amplitudes, the joint set, the scores, and what must be known."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from rigsight.diagnose.result import Estimate
from rigsight.identify.hysteresis.derived import LEVEL, Derived
from rigsight.identify.identification import (
    HysteresisIdentification,
    Identification,
    RecordIdentification,
    RecordScore,
)
from rigsight.report.quantities import ERRORS_HOLD, UNDETERMINED, Written, estimate_text, gap_percent, written
from rigsight.report.terminal import plain_text

HEADING = "Hysteresis"
_WIDTHS = 3.92
"""Standard deviations between the ends of a 95 % interval."""
ERROR_HEADS = ("record", "role", "NRMSE without the effects", "with the effects")


_MOST_WARNINGS = 12
_WORSE = 1.05
"""Ratio from which a record's own fit is worth naming beside the joint one."""
_NAME_WIDTH, _RECORD_WIDTH = 22, 20


@dataclass(frozen=True)
class IdentificationSummary:
    """A rich renderable of an identification."""

    identification: Identification

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines, in characters that the terminal's encoding has."""

        def text(words: str, style: str = "") -> Text:
            return plain_text(words, options.encoding, style)

        found = self.identification
        yield text(f"Identified: {found.title}", "bold green")
        yield from _amplitude_tables(found, text, options.max_width)
        yield text(ERRORS_HOLD, "dim")
        yield text(found.amplitude_statement, "bold yellow" if found.changing else "")
        yield text("")
        yield text("One set for all estimation records", "bold")
        yield text(found.joint.statement)
        table = Table.grid(padding=(0, 2))
        for subject, words in joint_rows(found):
            table.add_row(text(subject, "bold"), text(words))
        yield Padding(table, (0, 0, 0, 2), expand=False)
        if found.identifiability is not None:
            yield text("")
            yield text("What these records determine", "bold")
            yield text(found.identifiability.sentence)
            rows = Table.grid(padding=(0, 2))
            for subject, words in linear_rows(found):
                rows.add_row(text(subject, "bold"), text(words))
            yield Padding(rows, (0, 0, 0, 2), expand=False)
        if found.hysteresis is not None:
            yield text("")
            yield text(HEADING, "bold")
            yield text(found.hysteresis.statement)
            rows = Table.grid(padding=(0, 2))
            for subject, words in hysteresis_rows(found.hysteresis):
                rows.add_row(text(subject, "bold"), text(words))
            yield Padding(rows, (0, 0, 0, 2), expand=False)
            errors = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
            for head in ERROR_HEADS:
                errors.add_column(text(head))
            for row in error_rows(found.hysteresis):
                errors.add_row(*map(text, row))
            yield Padding(errors, (0, 0, 0, 2), expand=False)
        if found.warnings:
            yield text("")
            yield text("Worth knowing", "bold yellow")
            for warning in found.warnings[:_MOST_WARNINGS]:
                yield text(f"- {warning}")
            if len(found.warnings) > _MOST_WARNINGS:
                yield text(
                    f"- and {len(found.warnings) - _MOST_WARNINGS} more in identification.json.", "dim"
                )


def identification_summary(identification: Identification) -> IdentificationSummary:
    """Return the identification as a rich renderable."""
    return IdentificationSummary(identification)


def _amplitude_tables(found: Identification, text: Callable[..., Text], width: int) -> Iterator[Table]:
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
            head = text(f"{name}{unit_in_brackets(found.units.get(name, ''))}")
            table.add_row(head, *(text(estimate_cell(record, name)) for record in part))
        if any(record.resonance is not None for record in records):
            seen = ("-" if r.resonance is None else f"{r.resonance:.3g}" for r in part)
            table.add_row(text("resonance [rad/s]"), *map(text, seen))
        yield table


def amplitude_row(found: Identification, records: Sequence[RecordIdentification]) -> list[str]:
    """Return the head and the cells of the amplitudes of records; the unit stands once, or in each cell where sources differ."""
    units = [found.units.get(record.source, "") for record in records]
    if len({found.units.get(record.source, "") for record in found.records}) == 1:
        return [f"amplitude{unit_in_brackets(units[0])}", *(f"{record.amplitude:.4g}" for record in records)]
    return [
        "amplitude",
        *(f"{record.amplitude:.4g} {unit}".rstrip() for record, unit in zip(records, units, strict=True)),
    ]


def unit_in_brackets(unit: str) -> str:
    """Return a unit as it stands behind a name, nothing for a dimensionless one."""
    return f" [{unit}]" if unit not in ("", "1") else ""


def estimate_cell(record: RecordIdentification, name: str) -> str:
    """Return a parameter of one record with its standard error, a dash where the record does not show it."""
    if name not in record.estimates:
        return "-"
    value, std = record.estimates[name]
    if not math.isfinite(std):
        return f"{value:.3g}"
    number = written(value, std)
    power = f"e{number.exponent:+d}" if number.exponent else ""
    return f"({number.value} +/- {number.std}){power}" if power else f"{number.value} +/- {number.std}"


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
    """Yield subject and words: parameters, and what follows from them."""
    yield from parameter_rows(found)
    yield from derived_rows(found)


def parameter_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield name and value with standard error of each parameter."""
    fit = found.calibration.fit
    for name in fit.free:
        yield name, estimate_text(Estimate(fit.values[name], fit.standard_errors[name], found.units[name]))
    for name, value in found.held.items():
        unit = found.units[name]
        yield name, f"{value:.4g}{'' if unit in ('', '1') else f' {unit}'}, held"


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
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    spread = (one.upper - one.lower) / _WIDTHS
    value, lower, upper = (_plain(written(number, spread)) for number in (one.value, one.lower, one.upper))
    return f"{value}{unit} ({100.0 * LEVEL:.0f} %: {lower} to {upper})"


def _plain(number: Written) -> str:
    return f"{number.value}e{number.exponent:+d}" if number.exponent else number.value

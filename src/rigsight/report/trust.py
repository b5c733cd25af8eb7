"""Section on the trust in parameters: its figure and table, and one line for a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from rigsight import plot
from rigsight.diagnose.result import Diagnosis
from rigsight.diagnose.trust.patterns import Pattern
from rigsight.diagnose.trust.result import ParameterTrust
from rigsight.diagnose.trust.views import PORTION, RECORD, WINDOW_LENGTH
from rigsight.errors import InputError
from rigsight.report.figures import page_figure
from rigsight.report.quantities import written
from rigsight.report.wording import sentence_case

if TYPE_CHECKING:
    from rigsight.plot import Figure

TRUST_COLUMNS = ("parameter", "by", "group", "value", "std", "unit", "pattern", "p_value")
"""Columns of the table."""
_BY = {PORTION: "part of the records", WINDOW_LENGTH: "window length"}
_MOST_PANELS = 6
_NAMED_IN_A_LINE = 3


def trust_view(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """Return figure and rows of the section; None where the question was not asked.

    There is no figure where no number was estimated in two groups.
    """
    if diagnosis.trust is None:
        return None
    figure = None
    if drawn := _drawn(diagnosis):
        reported = "; ".join(f"{number.name}: {_how(number)}" for number in drawn)
        figure = page_figure(
            trust_drawing(diagnosis),
            "figure-trust",
            f"Parameters estimated from single groups of records, with 95 % intervals. {reported}.",
            "Each parameter as estimated from one record, level or window alone, with 95 % intervals. Dashed line with band: the "
            "common fit.",
        )
    return {"figure": figure, "rows": [_row(number) for number in diagnosis.trust.parameters]}


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
    reported = [f"{number.name} {_how(number)}" for number in differing[:_NAMED_IN_A_LINE]]
    more = len(differing) - len(reported)
    rest = f"; {more} more {'differs' if more == 1 else 'differ'}" if more > 0 else ""
    first = differing[0].points_to
    return f"Trust: {'; '.join(reported)}{rest}. {sentence_case(first.cause) if first else ''}."


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


def _how(number: ParameterTrust) -> str:
    if number.pattern is Pattern.UNKNOWN:
        return "not compared"
    if number.stable:
        return "the same"
    if number.pattern is Pattern.RECORD:
        return "differs from record to record"
    if number.pattern is Pattern.PORTION:
        return f"{number.moves} along the records"
    if number.pattern is Pattern.WINDOW:
        return f"{number.moves} when windows get shorter"
    if number.pattern is Pattern.TIME:
        return f"{number.moves} from record to record"
    return f"{number.moves} with {' and '.join(number.goes_with)}"


def _row(number: ParameterTrust) -> dict[str, Any]:
    p_value = f"{number.p_value:.2g}" if number.p_value > 1e-6 else "< 1e-6"
    found = number.points_to
    return {
        "name": number.name,
        "number": written(number.value, number.std),
        "unit": number.unit,
        "same": sentence_case(_how(number)),
        "p_value": "" if number.pattern is Pattern.UNKNOWN else p_value,
        "cause": "" if found is None else f"{sentence_case(found.cause)}. Next: {found.experiment}",
    }

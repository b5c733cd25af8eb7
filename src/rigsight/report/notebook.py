"""Results in a notebook: the terminal output as a small self-contained piece of HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rigsight.compare import Comparison
from rigsight.diagnose.result import Diagnosis
from rigsight.discover import Discovery
from rigsight.identify.identification import Identification
from rigsight.plot import with_unit
from rigsight.report import wording
from rigsight.report.comparison import comparison_view
from rigsight.report.identification import (
    ERROR_HEADS,
    HEADING,
    amplitude_row,
    error_rows,
    estimate_cell,
    hysteresis_rows,
    joint_rows,
)
from rigsight.report.render import environment
from rigsight.report.sections import trust_line
from rigsight.report.terminal import diagnosis_rows, discovery_rows

_Table = tuple[Sequence[str], Sequence[Sequence[str]]]
"""Heads, which may be none, and rows of texts; the first cell of a row is its label."""


def diagnosis_html(diagnosis: Diagnosis) -> str:
    """Return verdict, gap, ranking and the numbers of the effect."""
    sentences = [
        wording.verdict_sentence(diagnosis),
        *wording.fault_sentences(diagnosis),
        wording.missing_force_sentence(diagnosis),
        wording.remainder_sentence(diagnosis),
        trust_line(diagnosis),
        wording.ambiguity_sentence(diagnosis),
        *wording.advice_sentences(diagnosis),
        wording.basis_sentence(diagnosis),
    ]
    rows = ((), list(diagnosis_rows(diagnosis)))
    return _html(f"{wording.verdict_name(diagnosis)}: {diagnosis.title}", sentences, [rows])


def identification_html(identification: Identification) -> str:
    """Return the parameters of each record in the order of amplitudes, and those of all records together."""
    records = sorted(identification.records, key=lambda record: record.amplitude)
    names = dict.fromkeys(name for record in records for name in record.estimates)
    alone = (
        ("record", *(record.record.name for record in records)),
        [
            tuple(amplitude_row(identification, records)),
            *(
                (
                    with_unit(name, identification.units.get(name, "")),
                    *(estimate_cell(record, name) for record in records),
                )
                for name in names
            ),
        ],
    )
    together = (("all records", ""), list(joint_rows(identification)))
    reported = identification.identifiability
    sentences = [
        identification.amplitude_statement,
        identification.joint.statement,
        "" if reported is None else reported.sentence,
    ]
    tables: list[_Table] = [alone, together]
    if (hysteresis := identification.hysteresis) is not None:
        sentences.append(hysteresis.statement)
        tables.append(((HEADING, ""), list(hysteresis_rows(hysteresis))))
        tables.append((ERROR_HEADS, list(error_rows(hysteresis))))
    return _html(f"Identified: {identification.title}", sentences, tables, identification.warnings)


def discovery_html(discovery: Discovery) -> str:
    """Return the equations, their numbers and terms, and the error on the held-out records."""
    rows = ((), list(discovery_rows(discovery)))
    return _html(f"Discovered: {discovery.title}", discovery.equations, [rows], discovery.warnings)


def comparison_html(comparison: Comparison) -> str:
    """Return the errors of all models over all records, the smallest of each column marked with a star."""
    overall = comparison_view(comparison, None)
    rows = [
        (name, *(f"{cell.text}{' *' if cell.is_best else ''}" for cell in cells))
        for name, cells in overall.rows.items()
    ]
    table = (("model", *overall.heads), [*rows, ("noise floor", *overall.floor)])
    sentence = f"Errors over {overall.title}; * smallest of its column."
    return _html(f"Compared: {comparison.title}", [sentence], [table], comparison.notes)


def _html(
    title: str, sentences: Iterable[str], tables: Sequence[_Table], warnings: Sequence[str] = ()
) -> str:
    return (
        environment()
        .get_template("notebook.html.jinja")
        .render(title=title, sentences=[s for s in sentences if s], tables=tables, warnings=warnings)
    )

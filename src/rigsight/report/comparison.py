"""A comparison of models: tables on a terminal, its figures, and one self-contained HTML page with them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from rigsight.compare import Comparison, RecordComparison
from rigsight.compare.comparison import best
from rigsight.plot import (
    ErrorPanel,
    ResponsesPanel,
    StepPanel,
    model_errors,
    model_responses,
    model_steps,
    model_styles,
)
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.labels import column_label, error_text
from rigsight.report.page import notebook_html, rendered
from rigsight.report.terminal import Summary, Writer, worth_knowing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ALL = "all records, root mean square"
_FLOOR = "noise floor"
_NAME_WIDTH, _CELL_WIDTH = 24, 13
_MOST_FAILURES = 12
_MOST_CURVES = 10
"""Models that an eye can follow in one picture."""
_OVERALL_FILE = "errors.svg"


@dataclass(frozen=True)
class View:
    """A table of one record, or of all."""

    # Anchor in the page, and what the table is of.
    key: str
    title: str
    facts: str  # role, kind and amplitude of the record
    heads: list[str]  # label of each column
    floor: list[str]  # noise floor of each column
    rows: dict[
        str, list[tuple[str, bool]]
    ]  # model -> each error, and whether it is the smallest of its column
    figures: list[PageFigure]  # what goes with it
    notes: list[str]  # what is to be known about it


def render_comparison(
    comparison: Comparison, figures: Sequence[ComparisonFigure], command: str, versions: Mapping[str, str]
) -> str:
    """Return the comparison as one HTML page: no script, no network, nothing beside the file."""
    overall, *records = _views(comparison, figures)
    sentences = _sentences(comparison)
    return rendered(
        "comparison.html.jinja", command, versions, comparison=comparison, overall=overall, records=records, sentences=sentences
    )  # fmt: skip


def comparison_summary(comparison: Comparison) -> Summary:
    """Return the tables of a comparison: the best of each column in bold green, with a star where there is no color."""

    def lines(text: Writer, width: int) -> Iterator[RenderableType]:
        overall, *records = _views(comparison)
        yield text(f"Compared: {comparison.title}", "bold green")
        for view in (*records, overall):
            yield text("")
            yield text(f"{view.title}{f' ({view.facts})' if view.facts else ''}", "bold")
            yield from _tables(view, text, width)
            for note in view.notes:
                yield text(f"- {note}", "dim")
        yield text("")
        yield text("* smallest of its column")
        failures = _failures(comparison)
        if notes := [*comparison.notes, *failures[:_MOST_FAILURES]]:
            yield text("")
            yield from worth_knowing(notes, text, len(failures) - _MOST_FAILURES, "comparison.json")

    return Summary(lines)


def _views(comparison: Comparison, figures: Sequence[ComparisonFigure] = ()) -> list[View]:
    """Return the table of all records, then of each one."""
    return [_view(comparison, number, figures) for number in range(len(comparison.records) + 1)]


def _view(comparison: Comparison, number: int, figures: Sequence[ComparisonFigure]) -> View:
    """Return the table of one record by its number, from 1; of all of them for 0."""
    record, facts, notes = None, "", []
    if number:
        found = comparison.records[number - 1]
        own, notes = found.record, list(found.notes)
        amplitude = "" if own.amplitude is None else f", amplitude {own.amplitude:g}"
        record, facts = own.name, f"{own.role}, {own.kind}{amplitude}"
    columns = comparison.columns(record)
    table = comparison.overall() if record is None else comparison.table(record)
    winners = {column: best(table, column) for column in columns}
    return View(
        key=f"record-{number}" if number else "overall",
        title=_ALL if record is None else record,
        facts=facts,
        heads=[column_label(column) for column in columns],
        floor=[error_text(comparison.floor(column, record), column.quantity) for column in columns],
        rows={
            name: [
                (error_text(row.get(column), column.quantity), name in winners[column]) for column in columns
            ]
            for name, row in table.items()
        },
        figures=[
            page_figure(figure.drawing, f"figure-{i}", figure.caption, figure.caption)
            for i, figure in enumerate(figures)
            if figure.record == record
        ],
        notes=notes,
    )


def _tables(view: View, text: Writer, width: int) -> Iterator[Table]:
    """Yield the columns in as many tables as the terminal's width asks for."""
    at_once = max(1, (width - _NAME_WIDTH) // _CELL_WIDTH)
    for first in range(0, len(view.heads), at_once):
        part = slice(first, first + at_once)
        table = Table(box=None, padding=(0, 1), pad_edge=False, header_style="bold")
        table.add_column(text("model"))
        for head in view.heads[part]:
            table.add_column(text(head), justify="right", max_width=_CELL_WIDTH - 1)
        for name, cells in view.rows.items():
            shown = [
                text(f"{error}{'*' if is_best else ' '}", "bold green" if is_best else "")
                for error, is_best in cells[part]
            ]
            table.add_row(text(name), *shown)
        table.add_row(text(_FLOOR, "dim"), *(text(f"{floor} ", "dim") for floor in view.floor[part]))
        yield table


def _failures(comparison: Comparison) -> list[str]:
    return [
        f"{failure.model} on '{failure.record}'"
        f"{f', {column_label(failure.column)}' if failure.column else ' cannot be simulated'}: {failure.reason}"
        for failure in comparison.failures
    ]


def _sentences(comparison: Comparison) -> list[str]:
    """Return what the page says about the reading of its numbers."""
    windows = (
        "Free runs start from an initial state estimated from the record."
        if comparison.window_length is None
        else f"The rig drifts, so free runs are split into windows of {comparison.window_length:.3g} s, each with its own "
        f"initial state."
    )
    floors = [
        f"Noise of {floor.output}: {floor.std:.3g} {floor.unit}, from {floor.method}"
        f"{'; a lower bound' if floor.lower_bound else ''}."
        for floor in comparison.floors
    ]
    return [
        f"All frequency responses, measured and simulated, come from the same estimator: {comparison.method.replace('_', ' ')}.",
        "The noise floor of a frequency response is what noise of the size and spectrum below would change in the measured one.",
        f"Steps are compared for {comparison.step_seconds:g} s, with the mean before the step subtracted.",
        windows,
        *floors,
        *comparison.notes,
        *_failures(comparison),
    ]


@dataclass(frozen=True, eq=False)
class ComparisonFigure:
    """A figure with the file it goes into, what it shows, and the record it is of (None for all)."""

    file: str
    caption: str
    drawing: Figure
    record: str | None = None


def comparison_figures(comparison: Comparison) -> list[ComparisonFigure]:
    """Return the figures: errors over all records first, then responses or steps, record by record."""
    found = [overall_figure(comparison)]
    for number in range(len(comparison.records)):
        found += record_figures(comparison, number)
    return found


def record_figures(comparison: Comparison, index: int) -> list[ComparisonFigure]:
    """Return the figures of one record: its responses or its step, or none."""
    record = comparison.records[index]
    styles = model_styles([c.name for c in comparison.competitors])
    stem = f"{index + 1:02d}_{re.sub(r'[^A-Za-z0-9.-]+', '_', record.record.name)}"
    found = []
    if record.measured:
        names, which = _drawn(comparison, record, tuple(record.measured))
        panels = [
            ResponsesPanel(
                path.replace("->", "\u2192"),
                measured,
                {name: own[path] for name in names if path in (own := record.simulated[name])},
            )
            for path, measured in record.measured.items()
        ]
        caption = f"Frequency responses on '{record.record.name}', measured against simulated, by one estimator.{which}"
        drawing = model_responses(panels, styles)
        found.append(ComparisonFigure(f"responses_{stem}.svg", caption, drawing, record.record.name))
    if record.step is not None and record.moved:
        names, which = _drawn(comparison, record, tuple(record.moved))
        caption = f"Step on '{record.record.name}', offsets before it removed.{which}"
        drawing = model_steps(_step_panels(comparison, record, names), styles)
        found.append(ComparisonFigure(f"step_{stem}.svg", caption, drawing, record.record.name))
    return found


def overall_figure(comparison: Comparison) -> ComparisonFigure:
    """Return the errors of all models over all records."""
    overall = comparison.overall()
    panels = []
    for column in comparison.columns():
        single: dict[str, list[float]] = {c.name: [] for c in comparison.competitors}
        for score in comparison.scores:
            if score.column == column:
                single[score.model].append(score.value)
        values = {name: row[column] for name, row in overall.items() if column in row}
        panels.append(
            ErrorPanel(column_label(column), values, single, best(overall, column), comparison.floor(column))
        )
    caption = (
        "Errors of all models: bars are root mean squares over the records, points the single records, the best is blue. "
        "Dashed: noise floor."
    )
    return ComparisonFigure(
        _OVERALL_FILE, caption, model_errors(panels, [c.name for c in comparison.competitors])
    )


def _drawn(
    comparison: Comparison, record: RecordComparison, signals: tuple[str, ...]
) -> tuple[list[str], str]:
    """Return the models that are drawn, and a sentence where these are not all: the best by the first signal."""
    rows = comparison.table(record.record.name)
    shapes = [
        c for c in comparison.columns(record.record.name) if c.quantity in ("magnitude_db", "step_rmse")
    ]
    first = next((column for column in shapes if column.signal in signals), None)
    names = [name for name, row in rows.items() if first in row]
    if first is None or len(names) <= _MOST_CURVES:
        return names, ""
    kept = set(sorted(names, key=lambda name: rows[name][first])[:_MOST_CURVES])
    drawn = [name for name in names if name in kept]
    return drawn, f" The {_MOST_CURVES} best of {len(names)} models are drawn."


def _step_panels(comparison: Comparison, record: RecordComparison, names: list[str]) -> list[StepPanel]:
    assert record.step is not None
    units = {floor.output: floor.unit for floor in comparison.floors}
    return [
        StepPanel(
            title=output,
            unit=units[output],
            t=record.record.dt * np.arange(next(iter(moved.values())).size, dtype=np.float64),
            measured=record.step.moved(record.record[output]),
            simulated={name: moved[name] for name in names if name in moved},
        )
        for output, moved in record.moved.items()
    ]


def comparison_html(comparison: Comparison) -> str:
    """Return the errors of all models over all records, the smallest of each column marked with a star."""
    overall = _view(comparison, 0, ())
    rows = [
        (name, *(f"{error}{' *' if is_best else ''}" for error, is_best in cells))
        for name, cells in overall.rows.items()
    ]
    table = (("model", *overall.heads), [*rows, ("noise floor", *overall.floor)])
    sentence = f"Errors over {overall.title}; * smallest of its column."
    return notebook_html(f"Compared: {comparison.title}", [sentence], [table], comparison.notes)

"""Report of a comparison of models: tables on a terminal, and one self-contained HTML page with figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

from rigsight.compare import Column, Comparison
from rigsight.compare.comparison import best
from rigsight.report.drawing.comparison_figures import ComparisonFigure
from rigsight.report.drawing.figures import PageFigure, page_figure
from rigsight.report.quantities import column_label, error_text
from rigsight.report.render import environment
from rigsight.report.terminal import plain_text

_ALL = "all records, root mean square"
_FLOOR = "noise floor"
_NAME_WIDTH, _CELL_WIDTH = 24, 13
_MOST_FAILURES = 12


@dataclass(frozen=True)
class Cell:
    """One error as text, and whether it is the smallest of its column."""

    text: str
    is_best: bool


@dataclass(frozen=True)
class View:
    """A table of one record, or of all."""

    # Anchor in the page, and what the table is of.
    key: str
    title: str
    facts: str  # role, kind and amplitude of the record
    heads: list[str]  # label of each column
    floor: list[str]  # noise floor of each column
    rows: dict[str, list[Cell]]  # model -> cells
    figures: list[PageFigure]  # what goes with it
    notes: list[str]  # what is to be known about it


def render_comparison(
    comparison: Comparison, figures: Sequence[ComparisonFigure], command: str, versions: Mapping[str, str]
) -> str:
    """Return the comparison as one HTML page: no script, no network, nothing beside the file."""
    overall, *records = _views(comparison, figures)
    return environment().get_template("comparison.html.jinja").render(
        comparison=comparison,
        overall=overall,
        records=records,
        sentences=_sentences(comparison),
        command=command,
        versions=versions,
        seed=None,
        made=datetime.now(UTC),
    )  # fmt: skip


@dataclass(frozen=True)
class ComparisonSummary:
    """A rich renderable of a comparison: the best of each column in bold green, with a star where there is no color."""

    comparison: Comparison

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the lines, in characters that the terminal's encoding has."""

        def text(words: str, style: str = "") -> Text:
            return plain_text(words, options.encoding, style)

        overall, *records = _views(self.comparison, ())
        yield text(f"Compared: {self.comparison.title}", "bold green")
        for view in (*records, overall):
            yield text("")
            yield text(f"{view.title}{f' ({view.facts})' if view.facts else ''}", "bold")
            yield from _tables(view, text, options.max_width)
            for note in view.notes:
                yield text(f"- {note}", "dim")
        yield text("")
        yield text("* smallest of its column")
        failures = self.comparison.failures
        if failures or self.comparison.notes:
            yield text("")
            yield text("Worth knowing", "bold yellow")
            for words in [*self.comparison.notes, *_failures(self.comparison)[:_MOST_FAILURES]]:
                yield text(f"- {words}")
            if len(failures) > _MOST_FAILURES:
                yield text(f"- and {len(failures) - _MOST_FAILURES} more in comparison.json.", "dim")


def comparison_summary(comparison: Comparison) -> ComparisonSummary:
    """Return the comparison as a rich renderable."""
    return ComparisonSummary(comparison)


def _views(comparison: Comparison, figures: Sequence[ComparisonFigure]) -> Iterator[View]:
    yield comparison_view(comparison, None, figures)
    for record in comparison.records:
        yield comparison_view(comparison, record.record.name, figures)


def comparison_view(
    comparison: Comparison, record: str | None, figures: Sequence[ComparisonFigure] = ()
) -> View:
    """Return the table of one record, or of all of them where `record` is None."""
    columns = comparison.columns(record)
    table = comparison.overall() if record is None else comparison.table(record)
    winners = {column: best(table, column) for column in columns}
    facts, notes, number = "", [], 0
    for i, own in enumerate(comparison.records, 1):
        if own.record.name == record:
            amplitude = "" if own.record.amplitude is None else f", amplitude {own.record.amplitude:g}"
            facts, notes, number = f"{own.record.role}, {own.record.kind}{amplitude}", list(own.notes), i
    return View(
        key="overall" if record is None else f"record-{number}",
        title=_ALL if record is None else record,
        facts=facts,
        heads=[column_label(column) for column in columns],
        floor=[error_text(comparison.floor(column, record), column.quantity) for column in columns],
        rows={
            name: [_cell(row, column, name in winners[column]) for column in columns]
            for name, row in table.items()
        },
        figures=[
            page_figure(figure.drawing, f"figure-{i}", figure.caption, figure.caption)
            for i, figure in enumerate(figures)
            if figure.record == record
        ],
        notes=notes,
    )


def _cell(row: Mapping[Column, float], column: Column, is_best: bool) -> Cell:
    return Cell(error_text(row.get(column), column.quantity), is_best)


def _tables(view: View, text: Callable[..., Text], width: int) -> Iterator[Table]:
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
                text(f"{cell.text}{'*' if cell.is_best else ' '}", "bold green" if cell.is_best else "")
                for cell in cells[part]
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

"""Figures of a comparison of models, and the choice of models to draw if there are too many."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.compare import Column, Comparison, RecordComparison
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
from rigsight.report.quantities import column_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_CURVES = 10
"""Models that an eye can follow in one picture."""
_OVERALL_FILE = "errors.svg"


@dataclass(frozen=True, eq=False)
class ComparisonFigure:
    """A figure with the file it goes into, what it shows, and the record it is of (None for all)."""

    file: str
    caption: str
    drawing: Figure
    record: str | None = None


def comparison_figures(comparison: Comparison) -> list[ComparisonFigure]:
    """Return the figures: errors over all records first, then responses or steps, record by record.

    Parameters
    ----------
    comparison
        The result.
    """
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
    first = next((c for c in _by_shape(comparison.columns(record.record.name)) if c.signal in signals), None)
    names = [name for name, row in rows.items() if first in row]
    if first is None or len(names) <= _MOST_CURVES:
        return names, ""
    kept = set(sorted(names, key=lambda name: rows[name][first])[:_MOST_CURVES])
    return [
        name for name in names if name in kept
    ], f" The {_MOST_CURVES} best of {len(names)} models are drawn."


def _by_shape(columns: tuple[Column, ...]) -> list[Column]:
    return [c for c in columns if c.quantity in ("magnitude_db", "step_rmse")]


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

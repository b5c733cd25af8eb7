"""Grid of the responses of every sensor to every input, measured and of a model: inputs across, sensors down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.frequency import FrequencyResponse
from rigsight.plot.drawing import WITH_EFFECT, in_style, new_figure
from rigsight.plot.frequency_responses import (
    FittedCurve,
    Panel,
    decibel,
    draw_magnitude,
    draw_phase,
    limit,
    log_axis_over,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_LINES = 250
"""As many points as a small panel can show."""


@dataclass(frozen=True, eq=False)
class ResponseCell:
    """One path of a grid."""

    # Input, sensor, and the unit of their ratio.
    source: str
    response: str
    unit: str
    measured: FrequencyResponse | None  # None where the records do not show it
    model: FittedCurve | None  # None where there is none
    remark: str = ""  # stands in an empty panel


@in_style
def response_grid(cells: Sequence[Sequence[ResponseCell]]) -> Figure:
    """Draw magnitude over phase of every path, with 95 % bands."""
    n_rows, n_columns = len(cells), len(cells[0])
    figure = new_figure(max(3.9 * n_columns, 6.0), 3.9 * n_rows + 0.3)
    axes = figure.subplots(2 * n_rows, n_columns, squeeze=False, height_ratios=[3, 2] * n_rows)
    curves = [
        curve for row in cells for cell in row for curve in (cell.measured, cell.model) if curve is not None
    ]
    left = min((float(curve.omega[0]) for curve in curves), default=0.1)
    right = max((float(curve.omega[-1]) for curve in curves), default=10.0)
    has_legend = False
    for i, row in enumerate(cells):
        for j, cell in enumerate(row):
            top, bottom = axes[2 * i, j], axes[2 * i + 1, j]
            _draw(top, bottom, cell)
            top.set_title(f"{cell.source} \u2192 {cell.response}")
            for ax in (top, bottom):
                log_axis_over(ax, left, right)
                ax.grid()
                ax.set_axisbelow(True)
            top.tick_params(labelbottom=False)
            if j == 0:
                bottom.set_ylabel("phase [deg]")
            top.set_ylabel(f"magnitude [dB re 1 {cell.unit}]" if cell.unit != "1" else "magnitude [dB]")
            if i == n_rows - 1:
                bottom.set_xlabel("angular frequency [rad/s]")
            if cell.measured is not None and not has_legend:
                top.legend(loc="lower left", fontsize=8.0)
                has_legend = True
    figure.align_ylabels(axes)
    return figure


def _draw(top: Axes, bottom: Axes, cell: ResponseCell) -> None:
    if cell.measured is not None:
        panel = Panel("", thinned(cell.measured, _MOST_LINES), cell.model)
        draw_magnitude(top, panel)
        draw_phase(bottom, panel)
        return
    if cell.model is not None:
        size = decibel(np.abs(cell.model.values))
        top.plot(cell.model.omega, size, color=WITH_EFFECT, linewidth=1.3)
        limit(top, size)
        phase = np.degrees(np.unwrap(np.angle(cell.model.values)))
        bottom.plot(cell.model.omega, phase, color=WITH_EFFECT, linewidth=1.3)
    top.text(0.03, 0.05, cell.remark, transform=top.transAxes, fontsize=8.0)

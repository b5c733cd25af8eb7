"""Figures that compare several models: responses and steps with the measured ones, and errors as bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigsight.frequency import FrequencyResponse
from rigsight.plot.drawing import (
    FLOOR,
    MEASURED,
    OTHER,
    WITH_EFFECT,
    new_figure,
    panel_grid,
    plain_log_ticks,
    set_margins,
    shown_in,
    style,
)
from rigsight.plot.frequency_responses import draw_measured, label_bode, limit, span, thinned
from rigsight.records.record import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#000000")
"""Okabe and Ito's palette, its yellow darkened for white paper."""
_MOST_TICKS = 5
_LEGEND_COLUMNS = 4
_MOST_COLUMNS = 3
"""Panels side by side that a page can show."""
_GAP = 0.9
"""Height of the empty row between two lines of panels, where a magnitude has 3."""
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.2, 1, 1.2)))


@dataclass(frozen=True, eq=False)
class ResponsesPanel:
    """One signal path: measured, and as each model has it."""

    title: str  # which path
    measured: FrequencyResponse  # the measured response
    simulated: Mapping[str, FrequencyResponse]  # model -> its response at lines of the measured one


@dataclass(frozen=True, eq=False)
class StepPanel:
    """One output after a step, offsets removed."""

    # Which output.
    title: str
    unit: str
    t: Floats  # time from the step [s], shape (n_samples,)
    measured: Floats  # shape (n_samples,)
    simulated: Mapping[str, Floats]  # model -> shape (n_samples,)


@dataclass(frozen=True)
class ErrorPanel:
    """One column of a comparison."""

    title: str  # what was compared, with the unit
    # Model -> root mean square over records; a model without one is said to lack it.
    overall: Mapping[str, float]
    single: Mapping[str, Sequence[float]]  # model -> error on each record
    best: frozenset[str]  # models with the smallest root mean square
    floor: float | None  # noise floor over all records, None if unknown


def model_styles(names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return color and dashes of each model: the same in every figure that is given the same names."""
    return {
        name: {"color": _COLORS[i % len(_COLORS)], "linestyle": _DASHES[i // len(_COLORS) % len(_DASHES)]}
        for i, name in enumerate(names)
    }


@style()
def model_responses(panels: Sequence[ResponsesPanel], styles: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw magnitude above phase, one column per path: measured as points with its 95 % band, each model as a line."""
    figure, axes = _responses_grid(2, len(panels), len(styles), 5.2)
    for place, panel in enumerate(panels):
        row, column = divmod(place, axes.shape[1])
        top, bottom = axes[2 * row : 2 * row + 2, column]
        top.sharex(bottom)
        top.tick_params(labelbottom=False)
        measured = thinned(panel.measured)
        phase = np.degrees(measured.phase)
        draw_measured(top, bottom, measured, phase, markersize=4.0)
        shown, turns = [measured.magnitude_db], [phase]
        for name, response in panel.simulated.items():
            curve = thinned(response)
            top.plot(curve.omega, curve.magnitude_db, label=name, linewidth=1.3, **styles[name])
            own = np.degrees(curve.phase_next_to(measured.omega, measured.phase))
            bottom.plot(curve.omega, own, linewidth=1.3, **styles[name])
            shown.append(curve.magnitude_db)
            turns.append(own)
        limit(top, np.concatenate(shown))
        low, high = np.percentile(np.concatenate(turns), [1.0, 99.0])
        bottom.set_ylim(45.0 * np.floor(low / 45.0) - 20.0, 45.0 * np.ceil(high / 45.0) + 20.0)
        span(bottom, [measured.omega])
        label_bode(top, bottom, panel.title, measured.unit)
    _legend(figure, list(axes.flat))
    return figure


def _responses_grid(rows: int, panels: int, n_models: int, height: float) -> tuple[Figure, NDArray[Any]]:
    """Return a figure, this high [inch] for each line of panels, and below a legend of these models its axes."""
    # Each panel has its rows below each other, the upper one taller; panels that find no room begin a line of their own.
    legend_rows = -(-(n_models + 1) // _LEGEND_COLUMNS)
    lines = -(-panels // _MOST_COLUMNS)
    columns = -(-panels // lines)
    width = 4.6 * columns + (1.4 if columns == 1 else 0.0)
    figure = new_figure(width, height * lines + 0.2 * legend_rows, layout=None)
    # Between two lines there is an empty row, for the labels of one and the titles of the next.
    heights = [*[3.0, 2.0][:rows], _GAP]
    axes = figure.subplots(
        (rows + 1) * lines - 1, columns, squeeze=False, height_ratios=(heights * lines)[:-1]
    )
    set_margins(figure, 0.78, 0.1, 0.48, 0.35 + 0.2 * legend_rows, between=(0.85, 0.15))
    kept = [i for i in range(axes.shape[0]) if i % (rows + 1) < rows]
    for i in range(axes.shape[0]):
        for j in range(columns):
            axes[i, j].set_visible(i in kept and i // (rows + 1) * columns + j < panels)
    return figure, axes[kept]


@style()
def model_steps(panels: Sequence[StepPanel], styles: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw each output after a step, offsets removed: measured as a wide gray line, each model over it."""
    figure, axes = _responses_grid(1, len(panels), len(styles), 3.4)
    for ax, panel in zip(axes.flat, panels, strict=False):
        factor, unit = shown_in(panel.unit, panel.measured)
        ax.plot(panel.t, factor * panel.measured, color=MEASURED, linewidth=3.0, alpha=0.55, label="measured")
        for name, samples in panel.simulated.items():
            ax.plot(panel.t, factor * samples, label=name, linewidth=1.2, **styles[name])
        low, high = factor * float(panel.measured.min()), factor * float(panel.measured.max())
        # A model with large errors leaves the axes, so that the other curves stay readable.
        ax.set_ylim(low - 0.7 * (high - low), high + 0.7 * (high - low))
        ax.set_xlim(float(panel.t[0]), float(panel.t[-1]))
        title = panel.title
        ax.set(title=title, xlabel="time from the step [s]", ylabel=f"change of {title} [{unit}]")
        ax.grid()
    _legend(figure, list(axes.flat))
    return figure


@style()
def model_errors(panels: Sequence[ErrorPanel], names: Sequence[str]) -> Figure:
    """Draw the errors of all models as bars on logarithmic axes, each record as a point, the noise floor as a dashed line."""
    columns = min(3, len(panels))
    figure = new_figure(2.0 + 2.9 * columns, -(-len(panels) // columns) * (0.9 + 0.24 * len(names)))
    for ax, panel in zip(panel_grid(figure, len(panels), columns, sharey=True), panels, strict=True):
        values = [v for single in panel.single.values() for v in single if v > 0.0]
        values += [v for v in (*panel.overall.values(), panel.floor) if v is not None and v > 0.0]
        left, right = 0.6 * min(values, default=1.0), 1.6 * max(values, default=1.0)
        for row, name in enumerate(names):
            if name in panel.overall:
                color = WITH_EFFECT if name in panel.best else OTHER
                ax.barh(row, panel.overall[name] - left, left=left, height=0.66, color=color)
            elif not panel.single.get(name):
                ax.text(1.05 * left, row, "failed", va="center", fontsize=8, color=MEASURED)
            points = [value for value in panel.single.get(name, ()) if value > 0.0]
            ax.plot(points, np.full(len(points), row), ".", color=FLOOR, markersize=3.5, alpha=0.7)
        if panel.floor is not None:
            ax.axvline(panel.floor, color=FLOOR, linestyle=(0, (4, 2)), linewidth=1.1)
        ax.set_xscale("log")
        ax.set_xlim(left, right)
        _decade_ticks(ax, left, right)
        ax.set_ylim(len(names) - 0.4, -0.6)
        ax.set_yticks(range(len(names)), names)
        ax.tick_params(axis="y", length=0)
        ax.set_title(panel.title)
        ax.grid(axis="x")
    return figure


def _decade_ticks(ax: Axes, left: float, right: float) -> None:
    """Label whole decades, as few as fit into a narrow panel."""
    from matplotlib.ticker import NullLocator

    decades = np.arange(np.ceil(np.log10(left)), np.floor(np.log10(right)) + 1.0)
    if decades.size < 2:
        plain_log_ticks(ax, left, right)
        return
    shown = 10.0 ** decades[:: -(-decades.size // _MOST_TICKS)]
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticks(shown, [f"{tick:g}" for tick in shown])


def _legend(figure: Figure, axes: Sequence[Axes]) -> None:
    """Name every line once, whichever panel it is in."""
    entries: dict[str, Any] = {}
    for ax in axes:
        handles, labels = ax.get_legend_handles_labels()
        for handle, label in zip(handles, labels, strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="upper left", ncols=_LEGEND_COLUMNS, fontsize=8)

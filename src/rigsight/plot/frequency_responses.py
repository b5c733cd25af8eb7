"""Figures of frequency responses: measured and fitted, and several amplitudes in one plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight.frequency import FrequencyResponse
from rigsight.plot.drawing import (
    FLOOR,
    MEASURED,
    WITH_EFFECT,
    in_style,
    new_figure,
    plain_log_ticks,
    set_margins,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TWO_SIDED = 1.96
"""Standard deviations of a 95 % interval."""
_MOST_LINES = 800
_LEGEND_COLUMNS = 6
_FACES = ("#440154", "#3b528b", "#21918c", "#5ec962", "#d8b40a", "#d55e00")
"""Viridis, its yellow darkened for white paper: in order also in gray, and for color-blind readers."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A fitted frequency response."""

    omega: NDArray[np.float64]  # angular frequencies [rad/s], shape (n,)
    values: NDArray[np.complex128]  # complex response, shape (n,)
    std: NDArray[np.float64]  # ``sqrt(E |error|^2)``, shape (n,)
    label: str  # what it is called


@dataclass(frozen=True, eq=False)
class Panel:
    """One signal path of a Bode plot."""

    title: str  # which path
    measured: FrequencyResponse  # the frequency response
    fitted: FittedCurve | None = None  # the fit, None where there is none
    label: str = ""  # name in a plot of several, e.g. the amplitude


@in_style
def bode(panels: Sequence[Panel]) -> Figure:
    """Draw measured against fitted as magnitude and phase, one column per path, with 95 % bands."""
    figure = new_figure(4.6 * len(panels) + (1.4 if len(panels) == 1 else 0.0), 4.9)
    axes = figure.subplots(2, len(panels), squeeze=False, sharex="col", height_ratios=[3, 2])
    for column, whole in enumerate(panels):
        panel = replace(whole, measured=thinned(whole.measured))
        top, bottom = axes[0, column], axes[1, column]
        draw_magnitude(top, panel)
        draw_phase(bottom, panel)
        top.set_title(panel.title)
        top.set_ylabel(f"magnitude [dB re 1 {panel.measured.unit}]")
        bottom.set_ylabel("phase [deg]")
        bottom.set_xlabel("angular frequency [rad/s]")
        log_axis(bottom, [panel.measured])
        for ax in (top, bottom):
            ax.grid()
            ax.set_axisbelow(True)
        rises = panel.measured.magnitude[-1] > panel.measured.magnitude[0]
        top.legend(loc="upper left" if rises else "lower left", fontsize=8.5)
    figure.align_ylabels(axes)
    return figure


@in_style
def overlaid_responses(columns: Sequence[Sequence[Panel]], fitted_label: str = "fitted") -> Figure:
    """Draw the magnitudes of several records over each other: measured as lines, fitted dashed in the same color."""
    labels = list(dict.fromkeys(panel.label for panels in columns for panel in panels))
    legend_rows = -(-(len(labels) + 1) // _LEGEND_COLUMNS)
    width, height = 4.6 * len(columns) + (1.4 if len(columns) == 1 else 0.0), 3.8 + 0.2 * legend_rows
    figure = new_figure(width, height, layout=None)
    axes = figure.subplots(1, len(columns), squeeze=False)[0]
    set_margins(figure, 0.72, 0.12, 0.48, 0.35 + 0.2 * legend_rows, between=(0.75, 0.0))
    colors = dict(zip(labels, amplitude_colors(len(labels)), strict=True))
    for ax, panels in zip(axes, columns, strict=True):
        values = []
        for panel in panels:
            color = colors[panel.label]
            ax.plot(
                panel.measured.omega,
                panel.measured.magnitude_db,
                color=color,
                linewidth=1.1,
                alpha=0.7,
                label=panel.label,
            )
            values.append(panel.measured.magnitude_db)
            if panel.fitted is not None:
                values.append(decibel(np.abs(panel.fitted.values)))
                ax.plot(
                    panel.fitted.omega,
                    values[-1],
                    color=color,
                    linewidth=1.4,
                    linestyle=(0, (4, 2)),
                )
        limit(ax, np.concatenate(values))
        log_axis(ax, [panel.measured for panel in panels])
        ax.set_title(panels[0].title)
        ax.set_ylabel(f"magnitude [dB re 1 {panels[0].measured.unit}]")
        ax.set_xlabel("angular frequency [rad/s]")
        ax.grid()
    axes[0].plot([], [], color=FLOOR, linewidth=1.4, linestyle=(0, (4, 2)), label=fitted_label)
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="upper left", ncols=min(len(names), _LEGEND_COLUMNS), fontsize=8.5)
    return figure


def thinned(measured: FrequencyResponse, most_lines: int = _MOST_LINES) -> FrequencyResponse:
    """Return at most this many lines, by default about as many as the eye can resolve on a logarithmic axis."""
    if measured.omega.size <= most_lines:
        return measured
    wished = np.geomspace(measured.omega[0], measured.omega[-1], most_lines)
    kept = np.zeros(measured.omega.size, dtype=np.bool_)
    kept[np.minimum(np.searchsorted(measured.omega, wished), measured.omega.size - 1)] = True
    return measured.at(kept)


def amplitude_colors(count: int) -> list[str]:
    """Return as many colors in order, from the smallest amplitude to the largest."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    scale = LinearSegmentedColormap.from_list("amplitudes", _FACES)
    return [to_hex(scale(i / max(count - 1, 1))) for i in range(count)]


def decibel(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return magnitudes in dB of one unit; zero is far below any axis."""
    return np.asarray(20.0 * np.log10(np.maximum(values, 1e-300)))


def draw_magnitude(ax: Axes, panel: Panel) -> None:
    """Draw the magnitude of a path [dB] with its bands."""
    measured = panel.measured
    size = measured.magnitude
    shown = measured.magnitude_db
    if measured.variance is not None:
        # A component of the complex error has half of its variance.
        reach = TWO_SIDED * np.sqrt(0.5 * measured.variance)
        ax.fill_between(
            measured.omega, decibel(size - reach), decibel(size + reach), color=MEASURED, alpha=0.25, linewidth=0
        )  # fmt: skip
    ax.plot(
        measured.omega, shown, color=MEASURED, linestyle="none", marker=".", markersize=3.5, label=measured_label(measured)
    )  # fmt: skip
    values = [shown]
    if panel.fitted is not None:
        fitted = panel.fitted
        size, reach = np.abs(fitted.values), TWO_SIDED * np.sqrt(0.5) * fitted.std
        ax.fill_between(
            fitted.omega, decibel(size - reach), decibel(size + reach), color=WITH_EFFECT, alpha=0.3, linewidth=0
        )  # fmt: skip
        ax.plot(fitted.omega, decibel(size), color=WITH_EFFECT, linewidth=1.3, label=fitted.label)
        values.append(decibel(size))
    limit(ax, np.concatenate(values))


def measured_label(measured: FrequencyResponse) -> str:
    """Return the legend's entry of a measured response, with its band where it has one."""
    return "measured, 95 % band" if measured.variance is not None else "measured"


def draw_phase(ax: Axes, panel: Panel) -> None:
    """Draw the phase of a path [deg] with its bands."""
    from matplotlib.ticker import MultipleLocator

    measured = panel.measured
    phase = np.degrees(measured.phase)
    if panel.fitted is not None:
        fitted = panel.fitted
        branch = np.unwrap(np.angle(fitted.values))
        own = np.degrees(branch)
        # A noisy line cannot turn all that follow by 360 degrees.
        phase = np.degrees(measured.phase_next_to(fitted.omega, branch))
        reach = np.degrees(TWO_SIDED * np.sqrt(0.5) * fitted.std / np.abs(fitted.values))
        ax.fill_between(fitted.omega, own - reach, own + reach, color=WITH_EFFECT, alpha=0.3, linewidth=0)
        ax.plot(fitted.omega, own, color=WITH_EFFECT, linewidth=1.3, zorder=3)
    if measured.variance is not None:
        reach = np.degrees(TWO_SIDED * np.sqrt(0.5 * measured.variance) / measured.magnitude)
        ax.fill_between(measured.omega, phase - reach, phase + reach, color=MEASURED, alpha=0.25, linewidth=0)
    ax.plot(measured.omega, phase, color=MEASURED, linestyle="none", marker=".", markersize=3.5)
    low, high = np.percentile(phase, [1.0, 99.0])
    ax.set_ylim(45.0 * np.floor(low / 45.0) - 10.0, 45.0 * np.ceil(high / 45.0) + 10.0)
    ax.yaxis.set_major_locator(MultipleLocator(45.0 if high - low < 300.0 else 90.0))


def limit(ax: Axes, values: NDArray[np.float64]) -> None:
    """Give an axis limits that are not determined by a few outliers or by a band that reaches zero."""
    low, high = np.percentile(values[np.isfinite(values)], [0.5, 100.0])
    margin = 0.08 * max(high - low, 3.0)
    ax.set_ylim(float(low - margin), float(high + margin))


def log_axis(ax: Axes, responses: Sequence[FrequencyResponse]) -> None:
    """Let the frequency axis span these responses."""
    left = min(float(response.omega[0]) for response in responses)
    right = max(float(response.omega[-1]) for response in responses)
    log_axis_over(ax, left, right)


def log_axis_over(ax: Axes, left: float, right: float) -> None:
    """Let the frequency axis span these limits [rad/s]."""
    ax.set_xscale("log")
    ax.set_xlim(left, right)
    plain_log_ticks(ax, left, right)

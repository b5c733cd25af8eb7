"""Figures of frequency responses: measured and fitted, several amplitudes in one plot, grids of inputs and sensors, variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rigsight.frequency import FrequencyResponse
from rigsight.frequency.signal_pair import ratio_unit
from rigsight.metrics import TWO_SIDED
from rigsight.plot.drawing import (
    FLOOR,
    MEASURED,
    WITH_EFFECT,
    new_figure,
    plain_log_ticks,
    set_margins,
    style,
)
from rigsight.records.record import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_LINES, _MOST_OF_CELL = 800, 250
"""As many points as a panel of a record, and a small one of a grid, can show."""
_LEGEND_COLUMNS = 6
_OMEGA = "angular frequency [rad/s]"
_FACES = ("#440154", "#3b528b", "#21918c", "#5ec962", "#d8b40a", "#d55e00")
"""Viridis, its yellow darkened for white paper: in order also in gray, and for color-blind readers."""
_VARIED = ("-", (0, (6, 1.5)), (0, (3, 1.2)), (0, (5, 1.2, 1, 1.2)), (0, (1, 1.2)))
_LIGHTEST = 0.84
"""Share of the color map that is still seen on white."""
Variant = tuple[str, NDArray[np.complex128], bool]
"""Label and complex response of a variant of a model, and whether it is the model as it is, drawn black and wider."""
Path = tuple[str, str]
"""Input and sensor."""


@dataclass(frozen=True, eq=False)
class FittedCurve:
    """A fitted frequency response."""

    omega: Floats  # angular frequencies [rad/s], shape (n,)
    values: NDArray[np.complex128]  # complex response, shape (n,)
    std: Floats  # ``sqrt(E |error|^2)``, shape (n,)
    label: str  # what it is called


@dataclass(frozen=True, eq=False)
class Panel:
    """One signal path of a Bode plot."""

    title: str  # which path
    measured: FrequencyResponse  # the frequency response
    fitted: FittedCurve | None = None  # the fit, None where there is none
    label: str = ""  # name in a plot of several, e.g. the amplitude


@style()
def bode(panels: Sequence[Panel]) -> Figure:
    """Draw measured against fitted as magnitude and phase, one column per path, with 95 % bands."""
    figure = new_figure(4.6 * len(panels) + (1.4 if len(panels) == 1 else 0.0), 4.9)
    axes = figure.subplots(2, len(panels), squeeze=False, sharex="col", height_ratios=[3, 2])
    for panel, (top, bottom) in zip(panels, axes.T, strict=True):
        measured = thinned(panel.measured)
        _draw_path(top, bottom, measured, panel.fitted)
        label_bode(top, bottom, panel.title, measured.unit)
        span(bottom, [measured.omega])
        rises = measured.magnitude[-1] > measured.magnitude[0]
        top.legend(loc="upper left" if rises else "lower left", fontsize=8.5)
    figure.align_ylabels(axes)
    return figure


@style()
def overlaid_responses(columns: Sequence[Sequence[Panel]], fitted_label: str = "fitted") -> Figure:
    """Draw the magnitudes of several records over each other: measured as lines, fitted dashed in the same color."""
    labels = list(dict.fromkeys(panel.label for panels in columns for panel in panels))
    legend_rows = -(-(len(labels) + 1) // _LEGEND_COLUMNS)
    width, height = 4.6 * len(columns) + (1.4 if len(columns) == 1 else 0.0), 3.8 + 0.2 * legend_rows
    figure = new_figure(width, height, layout=None)
    axes = figure.subplots(1, len(columns), squeeze=False)[0]
    set_margins(figure, 0.72, 0.12, 0.48, 0.35 + 0.2 * legend_rows, between=(0.75, 0.0))
    colors = dict(zip(labels, amplitude_colors(len(labels)), strict=True))
    dashed: dict[str, Any] = {"linewidth": 1.4, "linestyle": (0, (4, 2))}
    for ax, panels in zip(axes, columns, strict=True):
        values = []
        for panel in panels:
            color = colors[panel.label]
            measured, fitted = panel.measured, panel.fitted
            values.append(measured.magnitude_db)
            ax.plot(measured.omega, values[-1], color=color, linewidth=1.1, alpha=0.7, label=panel.label)
            if fitted is not None:
                values.append(decibel(np.abs(fitted.values)))
                ax.plot(fitted.omega, values[-1], color=color, **dashed)
        limit(ax, np.concatenate(values))
        span(ax, [panel.measured.omega for panel in panels])
        ax.set(title=panels[0].title, xlabel=_OMEGA, ylabel=f"magnitude [dB re 1 {panels[0].measured.unit}]")
        ax.grid()
    axes[0].plot([], [], color=FLOOR, label=fitted_label, **dashed)
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


def decibel(values: Floats) -> Floats:
    """Return magnitudes in dB of one unit; zero is far below any axis."""
    return np.asarray(20.0 * np.log10(np.maximum(values, 1e-300)))


def draw_measured(
    top: Axes, bottom: Axes, measured: FrequencyResponse, phase: Floats, markersize: float = 3.5
) -> None:
    """Draw magnitude [dB] and phase [deg] of a measured response as points with 95 % bands."""
    if measured.variance is not None:
        # A component of the complex error has half of its variance.
        size, reach = measured.magnitude, TWO_SIDED * np.sqrt(0.5 * measured.variance)
        band: dict[str, Any] = {"color": MEASURED, "alpha": 0.25, "linewidth": 0}
        turn = np.degrees(reach / size)
        top.fill_between(measured.omega, decibel(size - reach), decibel(size + reach), **band)
        bottom.fill_between(measured.omega, phase - turn, phase + turn, **band)
    points: dict[str, Any] = {"color": MEASURED, "markersize": markersize}
    label = "measured, 95 % band" if measured.variance is not None else "measured"
    top.plot(measured.omega, measured.magnitude_db, ".", label=label, **points)
    bottom.plot(measured.omega, phase, ".", **points)


def _draw_path(top: Axes, bottom: Axes, measured: FrequencyResponse, fitted: FittedCurve | None) -> None:
    """Draw magnitude [dB] and phase [deg] of a path, measured and fitted, with their bands."""
    from matplotlib.ticker import MultipleLocator

    values, phase = [measured.magnitude_db], np.degrees(measured.phase)
    if fitted is not None:
        branch = np.unwrap(np.angle(fitted.values))
        # A noisy line cannot turn all that follow by 360 degrees.
        phase = np.degrees(measured.phase_next_to(fitted.omega, branch))
    draw_measured(top, bottom, measured, phase)
    if fitted is not None:
        size, reach = np.abs(fitted.values), TWO_SIDED * np.sqrt(0.5) * fitted.std
        low, high = decibel(size - reach), decibel(size + reach)
        top.fill_between(fitted.omega, low, high, color=WITH_EFFECT, alpha=0.3, linewidth=0)
        values.append(decibel(size))
        top.plot(fitted.omega, values[1], color=WITH_EFFECT, linewidth=1.3, label=fitted.label)
        own, turn = np.degrees(branch), np.degrees(reach / size)
        # Below the band of the measured phase, which may be narrow.
        band: dict[str, Any] = {"color": WITH_EFFECT, "alpha": 0.3, "linewidth": 0, "zorder": 0.9}
        bottom.fill_between(fitted.omega, own - turn, own + turn, **band)
        bottom.plot(fitted.omega, own, color=WITH_EFFECT, linewidth=1.3, zorder=3)
    limit(top, np.concatenate(values))
    low, high = np.percentile(phase, [1.0, 99.0])
    bottom.set_ylim(45.0 * np.floor(low / 45.0) - 10.0, 45.0 * np.ceil(high / 45.0) + 10.0)
    bottom.yaxis.set_major_locator(MultipleLocator(45.0 if high - low < 300.0 else 90.0))


def limit(ax: Axes, values: Floats) -> None:
    """Give an axis limits that are not determined by a few outliers or by a band that reaches zero."""
    low, high = np.percentile(values[np.isfinite(values)], [0.5, 100.0])
    margin = 0.08 * max(high - low, 3.0)
    ax.set_ylim(float(low - margin), float(high + margin))


def span(ax: Axes, omegas: Sequence[Floats]) -> None:
    """Let the logarithmic frequency axis span these frequencies [rad/s], each ascending."""
    left, right = min(float(omega[0]) for omega in omegas), max(float(omega[-1]) for omega in omegas)
    ax.set_xscale("log")
    ax.set_xlim(left, right)
    plain_log_ticks(ax, left, right)


def label_bode(top: Axes, bottom: Axes, title: str, unit: str) -> None:
    """Label magnitude above phase."""
    top.set(title=title, ylabel=f"magnitude [dB re 1 {unit}]")
    bottom.set(xlabel=_OMEGA, ylabel="phase [deg]")
    for ax in (top, bottom):
        ax.grid()


@style()
def response_grid(
    measured: Mapping[Path, FrequencyResponse | None],
    models: Mapping[Path, FittedCurve],
    units: Mapping[str, str],
) -> Figure:
    """Draw magnitude over phase of every path, with 95 % bands: sensors are rows, inputs columns.

    A path that the records do not show has no measured response, one without a model none of a model.
    """
    sources = list(dict.fromkeys(source for source, _ in measured))
    responses = list(dict.fromkeys(response for _, response in measured))
    n_rows, n_columns = len(responses), len(sources)
    figure = new_figure(max(3.9 * n_columns, 6.0), 3.9 * n_rows + 0.3)
    axes = figure.subplots(2 * n_rows, n_columns, squeeze=False, height_ratios=[3, 2] * n_rows)
    curves = [*measured.values(), *models.values()]
    omegas = [curve.omega for curve in curves if curve is not None] or [np.array([0.1, 10.0])]
    has_legend = False
    for i, response in enumerate(responses):
        for j, source in enumerate(sources):
            top, bottom = axes[2 * i, j], axes[2 * i + 1, j]
            unit = ratio_unit(units.get(response, ""), units.get(source, ""))
            own = measured[source, response]
            _draw_cell(top, bottom, own, models.get((source, response)))
            top.set_title(f"{source} \u2192 {response}")
            for ax in (top, bottom):
                span(ax, omegas)
                ax.grid()
            top.tick_params(labelbottom=False)
            if j == 0:
                bottom.set_ylabel("phase [deg]")
            top.set_ylabel(f"magnitude [dB re 1 {unit}]" if unit != "1" else "magnitude [dB]")
            if i == n_rows - 1:
                bottom.set_xlabel(_OMEGA)
            if own is not None and not has_legend:
                top.legend(loc="lower left", fontsize=8.0)
                has_legend = True
    figure.align_ylabels(axes)
    return figure


def _draw_cell(top: Axes, bottom: Axes, own: FrequencyResponse | None, model: FittedCurve | None) -> None:
    if own is not None:
        _draw_path(top, bottom, thinned(own, _MOST_OF_CELL), model)
        return
    if model is not None:
        size = decibel(np.abs(model.values))
        top.plot(model.omega, size, color=WITH_EFFECT, linewidth=1.3)
        limit(top, size)
        phase = np.degrees(np.unwrap(np.angle(model.values)))
        bottom.plot(model.omega, phase, color=WITH_EFFECT, linewidth=1.3)
    top.text(0.03, 0.05, "not determined by these records", transform=top.transAxes, fontsize=8.0)


@style()
def varied_responses(omega: Floats, curves: Sequence[Variant], pair: str, unit: str, title: str) -> Figure:
    """Draw magnitude [dB] and phase [deg] over angular frequency, one color and line style per variant of a model."""
    import matplotlib as mpl

    figure = new_figure(7.4, 5.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    colors = mpl.colormaps["cividis"](np.linspace(0.0, _LIGHTEST, max(len(curves), 2)))
    for i, (label, values, is_base) in enumerate(curves):
        look = {"color": colors[i], "linewidth": 1.4, "linestyle": _VARIED[i % len(_VARIED)], "zorder": 2}
        if is_base:
            look = {"color": "black", "linewidth": 2.2, "linestyle": "-", "zorder": 3}
        with np.errstate(divide="ignore"):
            top.plot(omega, 20.0 * np.log10(np.abs(values)), label=label, **look)
        bottom.plot(omega, np.degrees(np.unwrap(np.angle(values))), **look)
    label_bode(top, bottom, title, unit)
    top.set_ylabel(f"magnitude {pair} [dB of 1 {unit}]")
    bottom.set_ylabel("phase [\u00b0]")
    span(bottom, [omega])
    low = float(np.floor(min(line.get_ydata().min() for line in bottom.lines) / 45.0)) * 45.0
    high = float(np.ceil(max(line.get_ydata().max() for line in bottom.lines) / 45.0)) * 45.0
    bottom.set_yticks(np.arange(low, high + 1.0, 45.0 if high - low <= 360.0 else 90.0))
    figure.align_ylabels()
    figure.legend(loc="outside right upper", fontsize=8.5)
    return figure

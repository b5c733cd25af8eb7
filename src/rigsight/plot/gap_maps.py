"""Figures of the gap over frequency, amplitude, records, time and the plane of states, and of the force that is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigsight.diagnose.location.gap_parts import GapPart, StatePart, TimePart
from rigsight.diagnose.location.trace import Stage
from rigsight.inverse import MissingForce
from rigsight.plot.drawing import (
    FLOOR_LINE,
    MEASURED,
    PAGE_WIDTH,
    STAGE_STYLES,
    WITH_EFFECT,
    new_figure,
    set_margins,
    shown_in,
    style,
    with_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEFT, _RIGHT, _LEGEND = 0.78, 0.1, 0.35
"""Room for labels and ticks, and for a line of a legend [inch]."""
_STATES_HEIGHT = 3.0
_BAR_ROOM = 0.84
"""Room beside a map for its color bar with ticks and label [inch]."""
_PERCENT = 100.0
_SHADES = 15
"""Few enough to be drawn as areas; a smooth scale would become an image of its own. Odd, so that zero has a shade."""
_BAND = 2.0
_MOST_POINTS = 1500
_USUAL, _ROOM = (1.0, 99.0), 0.3
"""Percentiles of the force that are shown, with this part of their distance beyond: ends of records spoil single samples."""
_FLOOR_LABEL = "noise floor"


@style()
def gap_bars(
    parts: Sequence[GapPart],
    labels: Sequence[str],
    stages: Mapping[Stage, str],
    xlabel: str,
    ylabel: str = "gap [%]",
) -> Figure:
    """Draw the stages of each part beside each other on a logarithmic axis, the noise floor as a line over each group."""
    figure = new_figure(PAGE_WIDTH, 2.9, layout=None)
    ax = figure.subplots()
    lines = 1 + max(label.count("\n") for label in labels)
    set_margins(figure, _LEFT, _RIGHT, 0.34 + 0.14 * lines, _LEGEND)
    width = 0.8 / len(stages)
    values = [
        getattr(part, name) for part in parts for name in ("before", "reidentified", "after", "noise_floor")
    ]
    finite = [_PERCENT * v for v in values if np.isfinite(v) and v > 0.0]
    top = max(finite, default=1.0)
    # Three and a half decades: smaller values do not matter, and would compress the rest.
    bottom = max(0.6 * min(finite, default=0.1), top / 3e3)
    index = np.arange(len(parts))
    for i, (stage, label) in enumerate(stages.items()):
        heights = [_PERCENT * getattr(part, stage) for part in parts]
        shown = [max(h, bottom) - bottom if np.isfinite(h) else 0.0 for h in heights]
        places, color = index + (i - (len(stages) - 1) / 2.0) * width, STAGE_STYLES[stage]["color"]
        ax.bar(places, shown, width, bottom=bottom, color=color, label=label)
    for i, part in enumerate(parts):
        if np.isfinite(part.noise_floor):
            level = max(_PERCENT * part.noise_floor, bottom)
            named = _FLOOR_LABEL if i == 0 else None
            ax.plot([i - 0.44, i + 0.44], [level, level], **{**FLOOR_LINE, "linewidth": 1.3}, label=named)
    ax.set_yscale("log")
    ax.set_ylim(bottom, 1.5 * top)
    ax.set_xlim(-0.6, len(parts) - 0.4)
    _percent_ticks(ax, bottom, top)
    ax.tick_params(axis="x", length=0)
    ax.grid(axis="y")
    ax.set_xticks(index, labels, fontsize=8)
    ax.set(xlabel=xlabel, ylabel=ylabel)
    _legend(figure, ax)
    return figure


def _percent_ticks(ax: Axes, bottom: float, top: float) -> None:
    from matplotlib.ticker import FixedLocator, NullLocator

    decades = range(int(np.floor(np.log10(bottom))), int(np.ceil(np.log10(top))) + 1)
    multiples = (1,) if np.log10(top / bottom) > 2.0 else (1, 2, 5)
    ticks = [m * 10.0**d for d in decades for m in multiples if bottom <= m * 10.0**d <= 1.5 * top]
    ax.yaxis.set_major_locator(FixedLocator(ticks))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda i: labels[i] == _FLOOR_LABEL)
    figure.legend(
        [handles[i] for i in order], [labels[i] for i in order], loc="upper left", ncols=4, fontsize=8.5,
        handlelength=1.8, columnspacing=1.4,
    )  # fmt: skip


@style()
def gap_times(parts: Sequence[TimePart], stages: Mapping[Stage, str]) -> Figure:
    """Draw the error of each stage over time, one panel per scored record, with the noise floor."""
    records = list(dict.fromkeys(part.record for part in parts))
    figure = new_figure(PAGE_WIDTH, 0.5 + 1.6 * len(records), layout=None)
    axes = figure.subplots(len(records), 1, squeeze=False)[:, 0]
    set_margins(figure, _LEFT, _RIGHT, 0.45, 0.55, between=(0.0, 0.5))
    for ax, record in zip(axes, records, strict=True):
        own = [part for part in parts if part.record == record]
        edges = [*(part.t_start for part in own), own[-1].t_end]
        for stage, label in stages.items():
            levels = [_PERCENT * getattr(part, stage) for part in own]
            ax.stairs(levels, edges, label=label, linewidth=1.4, baseline=None, **STAGE_STYLES[stage])
        ax.axhline(_PERCENT * own[0].noise_floor, label=_FLOOR_LABEL, **FLOOR_LINE)
        ax.set_yscale("log")
        ax.set_title(record, fontsize=8.5)
        ax.set_ylabel("gap [%]")
        ax.grid(axis="y")
        ax.margins(x=0.0)
        low, high = ax.get_ylim()
        _percent_ticks(ax, low, high / 1.5)
        ax.set_ylim(low, high)
    axes[-1].set_xlabel("time [s]")
    _legend(figure, axes[0])
    return figure


@style()
def gap_states(parts: Sequence[StatePart], output: str, motion: str) -> Figure:
    """Draw the error over the plane of displacement and velocity and, where it is known, the missing force."""
    with_force = any(np.isfinite(part.force_mean) for part in parts)
    figure = new_figure(PAGE_WIDTH, _STATES_HEIGHT, layout=None)
    axes = figure.subplots(1, 2 if with_force else 1, squeeze=False, sharey=True)[0]
    set_margins(figure, 0.7, _BAR_ROOM, 0.46, 0.3, between=(_BAR_ROOM + 0.12, 0.0))
    _plane(axes[0], parts, [_PERCENT * part.reidentified for part in parts], "viridis", False, "error [%]")
    axes[0].set_title(f"error of {output}")
    if with_force:
        force_unit = parts[0].units["force_mean"]
        forces = np.array([part.force_mean for part in parts])
        factor, shown = shown_in(force_unit, forces)
        _plane(axes[1], parts, list(forces * factor), "RdBu_r", True, with_unit("mean force", shown))
        axes[1].set_title("force missing in the equations")
    x_unit, v_unit = parts[0].units["x_low"], parts[0].units["v_low"]
    factor, shown = shown_in(x_unit, np.array([edge for part in parts for edge in (part.x_low, part.x_high)]))
    for ax in axes:
        ax.set_xlabel(f"{motion} [{shown}]")
        ticks = [
            t for t in ax.get_xticks() if min(p.x_low for p in parts) <= t <= max(p.x_high for p in parts)
        ]
        ax.set_xticks(ticks, [f"{t * factor:.3g}" for t in ticks])
    axes[0].set_ylabel(f"rate of {motion} [{v_unit}]")
    return figure


def _plane(
    ax: Axes, parts: Sequence[StatePart], values: Sequence[float], colors: str, signed: bool, label: str
) -> None:
    from matplotlib import colormaps
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    cells = [
        Rectangle((part.x_low, part.v_low), part.x_high - part.x_low, part.v_high - part.v_low)
        for part in parts
    ]
    collection = PatchCollection(
        cells, cmap=colormaps[colors].resampled(_SHADES), edgecolor="white", linewidth=0.6
    )
    numbers = np.asarray(values, dtype=np.float64)
    collection.set_array(np.ma.masked_invalid(numbers))
    size = float(np.max(np.abs(numbers[np.isfinite(numbers)]), initial=0.0)) or 1.0
    collection.set_clim(-size if signed else 0.0, size)
    ax.add_collection(collection)
    ax.set_xlim(min(p.x_low for p in parts), max(p.x_high for p in parts))
    ax.set_ylim(min(p.v_low for p in parts), max(p.v_high for p in parts))
    ax.locator_params(nbins=5)
    ax.set_facecolor("#f1f3f4")
    box = ax.get_position()
    beside = ax.figure.add_axes((box.x1 + 0.07 / PAGE_WIDTH, box.y0, 0.11 / PAGE_WIDTH, box.height))
    bar = ax.figure.colorbar(collection, cax=beside)
    bar.set_label(label)
    bar.outline.set_visible(False)
    bar.ax.tick_params(color=MEASURED)


@style()
def missing_force(force: MissingForce) -> Figure:
    """Draw a missing force over velocity and displacement, each with its mean and two standard errors, and over time."""
    figure = new_figure(PAGE_WIDTH, 3.9)
    panels = figure.subplot_mosaic("vx;tt", sharey=True)
    over_v, over_x, over_t = panels["v"], panels["x"], panels["t"]
    factor, unit = shown_in(force.unit, force.force)
    every = max(1, force.force.size // _MOST_POINTS)
    for ax, signal, name, signal_unit in (
        (over_v, force.velocity, "velocity", f"{force.motion_unit}/s"),
        (over_x, force.displacement, "displacement", force.motion_unit),
    ):
        x_factor, x_unit = shown_in(signal_unit, signal)
        x, y = x_factor * signal[::every], factor * force.force[::every]
        ax.plot(x, y, ".", color=MEASURED, markersize=2.0, alpha=0.35)
        mean = force.over(signal)
        at, line, band = (np.array(own) for own in (mean.signal, mean.force, mean.std))
        low, high = factor * (line - _BAND * band), factor * (line + _BAND * band)
        ax.fill_between(x_factor * at, low, high, color=WITH_EFFECT, alpha=0.3, linewidth=0.0)
        ax.plot(x_factor * at, factor * line, color=WITH_EFFECT, linewidth=1.4)
        ax.set_xlabel(f"{name} [{x_unit}]")
    low, high = factor * np.percentile(force.force, _USUAL)
    if high > low:
        over_v.set_ylim(low - _ROOM * (high - low), high + _ROOM * (high - low))
    first = np.array(force.records) == force.records[0]
    over_t.plot(force.time[first], factor * force.force[first], color=MEASURED, linewidth=0.8)
    over_t.set_xlabel(f"time in {force.records[0]} [s]")
    for ax in (over_v, over_t):
        ax.set_ylabel(f"missing force [{unit}]")
    return figure

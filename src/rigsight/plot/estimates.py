"""Figures of parameters estimated several times: over the amplitude, and by group of records, beside the common estimate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.plot.drawing import (
    GIVEN,
    MEASURED,
    OTHER,
    PAGE_WIDTH,
    TWO_SIDED,
    WITH_EFFECT,
    display_scale,
    new_figure,
    panel_grid,
    style,
    with_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COMMON: dict[str, Any] = {"color": MEASURED, "linewidth": 1.2, "linestyle": (0, (4, 2))}
"""The line of the common estimate."""
_MARKERS = {"sweep": "o", "multisine": "D", "step": "s", "operation": "^"}
_LONGEST_LABEL = 16
_STYLES = {False: (WITH_EFFECT, "o", "the same within errors"), True: (GIVEN, "D", "differs")}
"""Color, marker and label by whether a number differs between groups."""


@dataclass(frozen=True)
class AmplitudePoint:
    """A parameter estimated from one record; `std` is NaN if it is not known."""

    amplitude: float
    kind: str
    value: float
    std: float


@dataclass(frozen=True)
class AmplitudePanel:
    """One parameter over the amplitude."""

    name: str
    unit: str
    points: tuple[AmplitudePoint, ...]  # one per record
    # Value and standard error of the joint set; None where there is none.
    common: tuple[float, float] | None = None


@dataclass(frozen=True)
class GroupPanel:
    """One parameter in several groups of records."""

    name: str
    unit: str
    by: str  # what groups are of, such as ``"record"``
    groups: tuple[tuple[str, float, float], ...]  # label, value and standard error of each group, in order
    common: tuple[float, float]  # value and standard error of the common fit
    differs: bool  # whether groups differ beyond chance


@style()
def amplitude_dependence(panels: Sequence[AmplitudePanel], input_label: str) -> Figure:
    """Draw each parameter over the amplitude with 95 % intervals, and the joint set as a line."""
    columns = min(3, len(panels))
    figure = new_figure(3.05 * columns, 0.55 + 2.15 * -(-len(panels) // columns))
    axes = panel_grid(figure, len(panels), columns)
    for ax, panel in zip(axes, panels, strict=True):
        _draw_over_amplitude(ax, panel)
        ax.set_xlabel(input_label)
    handles, labels = [], []
    for kind in dict.fromkeys(point.kind for panel in panels for point in panel.points):
        handles += axes[0].plot([], [], color=WITH_EFFECT, marker=_MARKERS.get(kind, "o"), linestyle="none")
        labels.append(f"{kind}, 95 % interval")
    if any(panel.common is not None for panel in panels):
        handles += axes[0].plot([], [], **_COMMON)
        labels.append("one set for all records")
    figure.legend(handles, labels, loc="outside upper left", ncols=len(handles), fontsize=8.5)
    return figure


def _draw_over_amplitude(ax: Axes, panel: AmplitudePanel) -> None:
    from matplotlib.ticker import MaxNLocator

    scale = display_scale(panel.unit, max(abs(point.value) for point in panel.points))
    for kind in dict.fromkeys(point.kind for point in panel.points):
        own = sorted((p for p in panel.points if p.kind == kind), key=lambda p: p.amplitude)
        x = np.array([point.amplitude for point in own])
        values = scale.factor * np.array([point.value for point in own])
        reach = TWO_SIDED * scale.factor * np.array([p.std if math.isfinite(p.std) else 0.0 for p in own])
        ax.plot(x, values, color=OTHER, linewidth=0.8, zorder=1)
        ax.errorbar(
            x, values, reach, color=WITH_EFFECT, linestyle="none", marker=_MARKERS.get(kind, "o"), markersize=5, capsize=3
        )  # fmt: skip
    if panel.common is not None:
        ax.axhline(scale.factor * panel.common[0], **_COMMON)
    ax.set_title(with_unit(panel.name, scale.unit))
    ax.margins(x=0.12, y=0.15)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    # The offset text would overlap the title.
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.grid()


@style()
def parameters_by_group(panels: Sequence[GroupPanel]) -> Figure:
    """Draw each parameter as groups alone have it, with 95 % intervals, against the common estimate."""
    columns = min(2, len(panels))
    in_row = [panels[first : first + columns] for first in range(0, len(panels), columns)]
    heights = [max(len(panel.groups) for panel in row) for row in in_row]
    figure = new_figure(PAGE_WIDTH, 0.45 + sum(0.75 + 0.2 * height for height in heights))
    axes = panel_grid(figure, len(panels), columns, height_ratios=[3.5 + height for height in heights])
    for ax, panel in zip(axes, panels, strict=True):
        _draw_groups(ax, panel)
    handles, labels = [], []
    for differs, (color, marker, label) in _STYLES.items():
        if any(panel.differs is differs for panel in panels):
            handles += axes[0].plot([], [], color=color, marker=marker, linestyle="none")
            labels.append(label)
    handles += axes[0].plot([], [], **_COMMON)
    figure.legend(handles, [*labels, "common fit"], loc="outside upper left", ncols=3, fontsize=8.5)
    return figure


def _draw_groups(ax: Axes, panel: GroupPanel) -> None:
    from matplotlib.ticker import MaxNLocator

    scale = display_scale(panel.unit, max(abs(value) for _, value, _ in panel.groups))
    color, marker = _STYLES[panel.differs][:2]
    places = np.arange(len(panel.groups))
    values = scale.factor * np.array([value for _, value, _ in panel.groups])
    reach = TWO_SIDED * scale.factor * np.array([std for _, _, std in panel.groups])
    common, error = (scale.factor * number for number in panel.common)
    if np.isfinite(error):
        half = TWO_SIDED * error
        ax.axvspan(common - half, common + half, color=MEASURED, alpha=0.15, linewidth=0)
    ax.axvline(common, **_COMMON)
    ax.errorbar(
        values, places, xerr=reach, color=color, linestyle="none", marker=marker, markersize=4.5, capsize=3
    )
    ax.set_yticks(
        places,
        [
            label if len(label) <= _LONGEST_LABEL else f"{label[: _LONGEST_LABEL - 1]}\u2026"
            for label, _, _ in panel.groups
        ],
    )
    ax.set_ylim(len(panel.groups) - 0.4, -0.6)
    ax.set_title(f"{with_unit(panel.name, scale.unit)} by {panel.by}")
    ax.margins(x=0.08)
    ax.xaxis.set_major_locator(MaxNLocator(2))
    # The offset text would be away from the values it belongs to.
    ax.ticklabel_format(axis="x", useOffset=False)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x")

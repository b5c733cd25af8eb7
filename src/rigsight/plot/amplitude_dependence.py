"""Figure of identified parameters over the amplitude."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.plot.drawing import MEASURED, OTHER, WITH_EFFECT, display_scale, in_style, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TWO_SIDED = 1.96
_COLUMNS = 3
_MARKERS = {"sweep": "o", "multisine": "D", "step": "s", "operation": "^"}


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

    # Of the parameter.
    name: str
    unit: str
    points: tuple[AmplitudePoint, ...]  # one per record
    # Value and standard error of the joint set; None where there is none.
    common: tuple[float, float] | None = None


@in_style
def amplitude_dependence(panels: Sequence[AmplitudePanel], input_label: str) -> Figure:
    """Draw each parameter over the amplitude with 95 % intervals, and the joint set as a line."""
    columns = min(_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(3.05 * columns, 0.55 + 2.15 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    kinds = list(dict.fromkeys(point.kind for panel in panels for point in panel.points))
    for ax, panel in zip(axes, panels, strict=False):
        _draw(ax, panel)
        ax.set_xlabel(input_label)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    handles = [
        axes[0].plot([], [], color=WITH_EFFECT, marker=_MARKERS.get(k, "o"), linestyle="none")[0]
        for k in kinds
    ]
    labels = [f"{kind}, 95 % interval" for kind in kinds]
    if any(panel.common is not None for panel in panels):
        handles.append(axes[0].plot([], [], color=MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))[0])
        labels.append("one set for all records")
    figure.legend(handles, labels, loc="outside upper left", ncols=len(handles), fontsize=8.5)
    return figure


def _draw(ax: Axes, panel: AmplitudePanel) -> None:
    from matplotlib.ticker import MaxNLocator

    size = max(abs(point.value) for point in panel.points)
    scale = display_scale(panel.unit, size)
    for kind in dict.fromkeys(point.kind for point in panel.points):
        own = sorted((p for p in panel.points if p.kind == kind), key=lambda p: p.amplitude)
        x = np.array([point.amplitude for point in own])
        values = scale.factor * np.array([point.value for point in own])
        reach = _TWO_SIDED * scale.factor * np.array([p.std if math.isfinite(p.std) else 0.0 for p in own])
        ax.plot(x, values, color=OTHER, linewidth=0.8, zorder=1)
        ax.errorbar(
            x, values, reach, color=WITH_EFFECT, linestyle="none", marker=_MARKERS.get(kind, "o"), markersize=5, capsize=3
        )  # fmt: skip
    if panel.common is not None:
        ax.axhline(scale.factor * panel.common[0], color=MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))
    unit = "" if scale.unit in ("", "1") else f" [{scale.unit}]"
    ax.set_title(f"{panel.name}{unit}")
    ax.margins(x=0.12, y=0.15)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    # The offset text would overlap the title.
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.grid()
    ax.set_axisbelow(True)

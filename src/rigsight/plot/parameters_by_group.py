"""Figure of a parameter estimated from groups of records, against the common estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.plot.drawing import GIVEN, MEASURED, WITH_EFFECT, display_scale, in_style, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TWO_SIDED = 1.96
_COLUMNS = 2
_WIDTH = 5.4
"""Inch; on a phone, where it is scaled to the screen, letters stay readable."""
_LONGEST_LABEL = 16
_STYLES = {False: (WITH_EFFECT, "o", "the same within errors"), True: (GIVEN, "D", "differs")}
"""Color, marker and label by whether a number differs between groups."""


@dataclass(frozen=True)
class GroupPanel:
    """One number in several groups."""

    # Of the number.
    name: str
    unit: str
    by: str  # what groups are of, such as ``"record"``
    groups: tuple[tuple[str, float, float], ...]  # label, value and standard error of each group, in order
    common: tuple[float, float]  # value and standard error of the common fit
    differs: bool  # whether groups differ beyond chance


@in_style
def parameters_by_group(panels: Sequence[GroupPanel]) -> Figure:
    """Draw each number as groups alone have it, with 95 % intervals, against the common estimate."""
    columns = min(_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    heights = [
        max(len(panel.groups) for panel in panels[row * columns : (row + 1) * columns]) for row in range(rows)
    ]
    figure = new_figure(_WIDTH, 0.45 + sum(0.75 + 0.2 * height for height in heights))
    axes = figure.subplots(rows, columns, squeeze=False, height_ratios=[3.5 + h for h in heights]).ravel()
    for ax, panel in zip(axes, panels, strict=False):
        _draw(ax, panel)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    handles, labels = [], []
    for differs, (color, marker, label) in _STYLES.items():
        if any(panel.differs is differs for panel in panels):
            handles.append(axes[0].plot([], [], color=color, marker=marker, linestyle="none")[0])
            labels.append(label)
    handles.append(axes[0].plot([], [], color=MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))[0])
    figure.legend(handles, [*labels, "common fit"], loc="outside upper left", ncols=3, fontsize=8.5)
    return figure


def _draw(ax: Axes, panel: GroupPanel) -> None:
    from matplotlib.ticker import MaxNLocator

    scale = display_scale(panel.unit, max(abs(value) for _, value, _ in panel.groups))
    color, marker = _STYLES[panel.differs][:2]
    places = np.arange(len(panel.groups))
    values = scale.factor * np.array([value for _, value, _ in panel.groups])
    reach = _TWO_SIDED * scale.factor * np.array([std for _, _, std in panel.groups])
    common, error = (scale.factor * number for number in panel.common)
    if np.isfinite(error):
        ax.axvspan(
            common - _TWO_SIDED * error, common + _TWO_SIDED * error, color=MEASURED, alpha=0.15, linewidth=0
        )
    ax.axvline(common, color=MEASURED, linewidth=1.2, linestyle=(0, (4, 2)))
    ax.errorbar(
        values, places, xerr=reach, color=color, linestyle="none", marker=marker, markersize=4.5, capsize=3
    )
    ax.set_yticks(places, [_short(label) for label, _, _ in panel.groups])
    ax.set_ylim(len(panel.groups) - 0.4, -0.6)
    unit = "" if scale.unit in ("", "1") else f" [{scale.unit}]"
    ax.set_title(f"{panel.name}{unit} by {panel.by}")
    ax.margins(x=0.08)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    # The offset text would be away from the values it belongs to.
    ax.ticklabel_format(axis="x", useOffset=False)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x")
    ax.set_axisbelow(True)


def _short(label: str) -> str:
    return label if len(label) <= _LONGEST_LABEL else f"{label[: _LONGEST_LABEL - 1]}\u2026"

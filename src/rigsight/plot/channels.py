"""Plots of all channels of a measured file, one above the other, as they stand in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.plot.drawing import MEASURED, in_style, line, new_figure, panel_grid, with_unit
from rigsight.records.record import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 8.0, 1.1
"""Of one plot [inch]."""


@dataclass(frozen=True, eq=False)
class ChannelPlot:
    """What is drawn of one channel."""

    name: str
    unit: str | None
    values: Floats  # shape (n_samples,)
    stamps: Floats | None  # shape (n_samples,); None for the number of the sample
    axis: str  # what the stamps are


@in_style
def channel_plots(channels: Sequence[ChannelPlot]) -> Figure:
    """Draw channels over their stamps, each in a plot of its own."""
    figure = new_figure(_WIDTH, _HEIGHT * len(channels) + 0.3)
    for ax, channel in zip(panel_grid(figure, len(channels), 1), channels, strict=True):
        stamps = np.arange(float(channel.values.size)) if channel.stamps is None else channel.stamps
        line(ax, stamps, channel.values, color=MEASURED, linewidth=0.8)
        ax.set_title(with_unit(channel.name, channel.unit or ""))
        ax.grid(visible=True)
        ax.margins(x=0.0)
    ax.set_xlabel(channels[-1].axis)
    return figure

"""Plots of all channels of a measured file, one above the other, as they stand in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigsight.plot.drawing import MEASURED, line, new_figure, panel_grid, style, with_unit
from rigsight.records.formats.channel import Channel, as_floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 8.0, 1.1
"""Of one plot [inch]."""


@style()
def channel_plots(channels: Sequence[Channel], time: Channel | None) -> Figure:
    """Draw channels over their own time, over the channel that is time, or over their samples, each in a plot of its own."""
    figure = new_figure(_WIDTH, _HEIGHT * len(channels) + 0.3)
    for ax, channel in zip(panel_grid(figure, len(channels), 1), channels, strict=True):
        values = as_floats(channel.load())
        stamps, label = np.arange(float(values.size)), "sample"
        if channel.axis is not None:
            stamps, label = channel.axis.stamps(), f"time [{channel.axis.unit}]"
        elif time is not None and time.n_samples == values.size:
            stamps, label = as_floats(time.load()), time.name
        line(ax, stamps, values, color=MEASURED, linewidth=0.8)
        ax.set_title(with_unit(channel.name, channel.unit or ""))
        ax.grid(visible=True)
        ax.margins(x=0.0)
    ax.set_xlabel(label)
    return figure

"""Figures of signals over time: the channels of a measured file as they stand in it, and a planned experiment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rigsight.plan.planning import Plan
from rigsight.plot.drawing import (
    GIVEN,
    MEASURED,
    OTHER,
    REIDENTIFIED,
    WITH_EFFECT,
    line,
    new_figure,
    panel_grid,
    shown_in,
    style,
    with_unit,
)
from rigsight.records.formats.channel import Channel, as_floats
from rigsight.units import INPUT_UNIT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CHANNEL_WIDTH, _CHANNEL = 8.0, 1.1
_WIDTH, _PANEL = 7.0, 1.7
"""Of one plot [inch]."""
_COLORS = (WITH_EFFECT, GIVEN, REIDENTIFIED, OTHER)


@style()
def channel_plots(channels: Sequence[Channel], time: Channel | None) -> Figure:
    """Draw channels over their own time, over the channel that is time, or over their samples, each in a plot of its own."""
    figure = new_figure(_CHANNEL_WIDTH, _CHANNEL * len(channels) + 0.3)
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


@style()
def planned_experiment(plan: Plan) -> Figure:
    """Draw a planned experiment."""
    record, others = plan.record, plan.rivals[1:]
    inputs, outputs = list(record.signals), list(plan.errors)
    n_panels = len(inputs) + 2 * len(outputs)
    figure = new_figure(_WIDTH, 0.5 + _PANEL * n_panels)
    panels = list(figure.subplots(n_panels, 1, sharex=True, squeeze=False).flat)
    for name in inputs:
        ax = panels.pop(0)
        unit = record.units.get(name, "")
        factor, unit = shown_in("" if unit == INPUT_UNIT else unit, record[name])
        line(ax, record.t, factor * record[name], color=MEASURED, lw=0.9)
        ax.set_ylabel(with_unit(name, unit))
        if name == inputs[0]:
            ax.set_title(f"Play: {plan.what}")
    columns = {name: i for i, name in enumerate(outputs)}
    for name, i in columns.items():
        readings, left = panels.pop(0), panels.pop(0)
        factor, unit = shown_in(record.units.get(name, ""), *(one.readings[name] for one in plan.rivals))
        for one, color in zip(plan.rivals, _COLORS, strict=False):
            label = one.effects.replace("_", " ")
            line(readings, record.t, factor * one.readings[name], color=color, lw=0.9, label=label)
        for one, color in zip(others, _COLORS[1:], strict=False):
            line(left, record.t, one.left[:, i], color=color, lw=0.9)
        left.axhspan(-2.0, 2.0, color=OTHER, alpha=0.3, lw=0.0)
        readings.set_ylabel(with_unit(name, unit))
        readings.set_title("Readings that each rival predicts with the numbers so far")
        left.set_ylabel(f"residual of {name} [errors]")
        left.set_title("Residual of the other rivals, fitted again; gray: 2 standard errors")
        if name == outputs[0]:
            readings.legend(ncols=len(plan.rivals), fontsize=8.0, loc="upper left")
            top = np.max(np.abs([factor * one.readings[name] for one in plan.rivals]))
            readings.set_ylim(-1.1 * top, 1.5 * top)
    figure.axes[-1].set_xlabel("time [s]")
    return figure

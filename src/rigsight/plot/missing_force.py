"""The force that the equations leave at a joint: over velocity, displacement and time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigsight.inverse import MissingForce
from rigsight.plot.drawing import MEASURED, WITH_EFFECT, in_style, new_figure, set_margins, shown_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BAND = 2.0
_MOST_POINTS = 1500
_USUAL, _ROOM = (1.0, 99.0), 0.3
"""Percentiles of the force that are shown, with this part of their distance beyond: ends of records spoil single samples."""


@in_style
def missing_force(force: MissingForce) -> Figure:
    """Draw a missing force over velocity and displacement, each with its mean and two standard errors, and over time."""
    figure = new_figure(8.4, 2.5, layout=None)
    over_v, over_x, over_t = figure.subplots(1, 3, sharey=True)
    set_margins(figure, 0.75, 0.12, 0.5, 0.12, between=(0.18, 0.0))
    factor, unit = shown_in(force.unit, force.force)
    every = max(1, force.force.size // _MOST_POINTS)
    for ax, signal, name, signal_unit in (
        (over_v, force.velocity, "velocity", f"{force.motion_unit}/s"),
        (over_x, force.displacement, "displacement", force.motion_unit),
    ):
        x_factor, x_unit = shown_in(signal_unit, signal)
        ax.plot(
            x_factor * signal[::every],
            factor * force.force[::every],
            ".",
            color=MEASURED,
            markersize=2.0,
            alpha=0.35,
        )
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
    over_v.set_ylabel(f"missing force [{unit}]")
    return figure

"""Figure of a force element: its force over the prescribed motion, measured and simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.location.trace import Stage
from rigsight.plot.drawing import MEASURED, STAGE_STYLES, in_style, new_figure, set_margins, shown_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH = 5.4
"""Inch; on a phone, where it is scaled to the screen, letters stay readable."""


@dataclass(frozen=True, eq=False)
class ForceLoop:
    """A stretch of motion and the force over it."""

    # Names of the signals.
    motion: str
    force: str
    # SI units.
    motion_unit: str
    force_unit: str
    # Shape (n_samples,).
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    measured: NDArray[np.float64]
    simulated: Mapping[Stage, NDArray[np.float64]]  # stage -> its force, shape (n_samples,)


@in_style
def force_loops(loop: ForceLoop, stages: Mapping[Stage, str]) -> Figure:
    """Draw the force over displacement and, beside it, over velocity: measured, and each stage."""
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(_WIDTH, 2.9, layout=None)
    axes = figure.subplots(1, 2, sharey=True)
    set_margins(figure, 0.75, 0.15, 0.46, 0.36, between=(0.18, 0.0))
    factor, unit = shown_in(loop.force_unit, loop.measured)
    # A diverging simulation leaves the axes, so that the other curves stay readable.
    low, high = factor * float(np.nanmin(loop.measured)), factor * float(np.nanmax(loop.measured))
    reach = 0.3 * (high - low) or 1.0
    simulated = [factor * force[np.isfinite(force)] for force in loop.simulated.values()]
    bottom = max(low - reach, min([low, *(float(np.min(own, initial=low)) for own in simulated)]))
    top = min(high + reach, max([high, *(float(np.max(own, initial=high)) for own in simulated)]))
    rate_unit = f"{loop.motion_unit}/s"
    across = (
        (loop.displacement, loop.motion, loop.motion_unit),
        (loop.velocity, f"rate of {loop.motion}", rate_unit),
    )
    for ax, (places, name, places_unit) in zip(axes, across, strict=True):
        scale, shown = shown_in(places_unit, places)
        ax.plot(
            scale * places,
            factor * loop.measured,
            color=MEASURED,
            linewidth=2.6,
            alpha=0.55,
            label="measured",
        )
        for stage, label in stages.items():
            # Points that are not finite leave a gap.
            force = np.where(np.isfinite(loop.simulated[stage]), loop.simulated[stage], np.nan)
            ax.plot(scale * places, factor * force, linewidth=1.1, label=label, **STAGE_STYLES[stage])
        ax.set_xlabel(f"{name} [{shown}]" if shown not in ("", "1") else name)
        ax.xaxis.set_major_locator(MaxNLocator(4))
        ax.grid()
        ax.set_axisbelow(True)
    axes[0].set_ylim(bottom - 0.05 * (top - bottom), top + 0.05 * (top - bottom))
    axes[0].set_ylabel(f"{loop.force} [{unit}]" if unit not in ("", "1") else loop.force)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="upper left", ncols=4, fontsize=8.5, handlelength=2.2, columnspacing=1.4
    )
    return figure

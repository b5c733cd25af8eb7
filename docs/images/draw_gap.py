"""Draw the README's picture from the results of the demo: python docs/images/draw_gap.py [demo folder].

Measured, as the given simulation has it, and as the diagnosed model has it: the validation sweep where the given simulation
errs most, and the validation step.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rigsight.plot.drawing import GIVEN, MEASURED, WITH_EFFECT, style
from rigsight.records import Record
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.model_file import read_model
from rigsight.workflow.campaign.read_campaign import read_campaign

PANELS = {"sweep_0.75A": (19.0, 25.0), "step_0.60A": (9.5, 13.5)}
TITLES = {"sweep_0.75A": "Sweep, 0.75 A (not fitted)", "step_0.60A": "Step, 0.6 A (not fitted)"}
PICTURE = Path(__file__).with_name("gap.svg")


def draw(demo: Path) -> None:
    campaign = read_campaign(demo / "campaign")
    defaults = {p.name: p.default for p in campaign.rig.parameters if p.default is not None}
    given = {**defaults, **campaign.constants, **campaign.given}
    model = read_model(demo)
    with style():
        figure = Figure(figsize=(7.6, 2.7), layout="constrained")
        axes = figure.subplots(1, 2)
        for ax, (name, window) in zip(axes, PANELS.items(), strict=True):
            (record,) = [record for record in campaign.records if record.name == name]
            before = simulate(compose(campaign.rig, campaign.modelled), given, record)
            after = simulate(model.structure, model.values, record)
            panel(ax, record, before, after, window)
            ax.set_title(TITLES[name])
        axes[0].set_ylabel("yaw angle [mrad]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        # No date and no random ids, so that drawing it again changes nothing.
        figure.savefig(PICTURE, metadata={"Date": None})


def panel(ax: Axes, record: Record, before: Record, after: Record, window: tuple[float, float]) -> None:
    shown = (record.t >= window[0]) & (record.t <= window[1])
    t = record.t[shown]
    lines = (
        (record, "measured", {"color": MEASURED, "linewidth": 4.0, "alpha": 0.45}),
        (before, "simulation as given", {"color": GIVEN, "linewidth": 1.2, "linestyle": "--"}),
        (after, "with the diagnosed effect", {"color": WITH_EFFECT, "linewidth": 1.2}),
    )
    for simulated, label, look in lines:
        ax.plot(t, 1e3 * np.asarray(simulated["psi"])[shown], label=label, **look)
    ax.set_xlabel("time [s]")
    ax.grid(visible=True)


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))

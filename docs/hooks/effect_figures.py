"""How are the pictures of an effect drawn, for light pages and for dark ones?"""

from __future__ import annotations

import io
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sine_tests import Panel, panels

from rigsight.effects import Effect
from rigsight.plot.drawing import style


@dataclass(frozen=True)
class Scheme:
    """Colors of one kind of page."""

    name: str
    ink: str
    grid: str
    linear: str
    levels: tuple[str, str, str]


# Light to dark on white, dark to light on black: the larger the amplitude, the farther from the page.
SCHEMES = (
    Scheme("light", "#1d2126", "#e3e7ea", "#6c757d", ("#e69f00", "#d55e00", "#0072b2")),
    Scheme("dark", "#dfe3e8", "#3a4048", "#9aa4ae", ("#f0c15a", "#ff8c42", "#56b4e9")),
)
WIDTH, HEIGHT = 7.4, 3.2
STYLES = ((0, (1, 1)), (0, (4, 1.2)), "-")


def figures(effect: Effect) -> dict[str, str]:
    """Return the figure of an effect as SVG by the name of the scheme."""
    shown = panels(effect)
    return {scheme.name: _svg(shown, scheme) for scheme in SCHEMES}


def _svg(shown: tuple[Panel, Panel], scheme: Scheme) -> str:
    with style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        figure.patch.set_alpha(0.0)
        axes = figure.subplots(1, 2)
        handles = {}
        for ax, panel in zip(axes, shown, strict=True):
            _draw(ax, panel, scheme)
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
                handles.setdefault(label, handle)
        figure.legend(
            handles.values(), handles.keys(), loc="outside lower center", ncols=2, labelcolor=scheme.ink
        )
        buffer = io.StringIO()
        # No date and no random ids, so that drawing it again changes nothing.
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return buffer.getvalue()


def _draw(ax: Axes, panel: Panel, scheme: Scheme) -> None:
    for line in panel.lines:
        if line.level is None:
            look = {"color": scheme.linear, "linewidth": 2.6, "alpha": 0.6}
        else:
            look = {"color": scheme.levels[line.level], "linestyle": STYLES[line.level], "linewidth": 1.5}
        ax.plot(line.x, line.y, label=line.label, **look)
    ax.set_xscale("log" if panel.logarithmic[0] else "linear")
    ax.set_yscale("log" if panel.logarithmic[1] else "linear")
    ax.set_title(panel.title, color=scheme.ink)
    ax.set_xlabel(panel.across, color=scheme.ink)
    ax.set_ylabel(panel.up, color=scheme.ink)
    ax.patch.set_alpha(0.0)
    ax.tick_params(which="both", colors=scheme.ink)
    ax.grid(visible=True, color=scheme.grid)
    ax.set_axisbelow(True)

"""How are the pictures of an effect drawn, for light pages and for dark ones?"""

from __future__ import annotations

import io
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
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
WIDTH, HEIGHT = 3.9, 3.3
"""Inch; each panel is a picture of its own, so that a phone shows one below the other at full width."""
STYLES = ((0, (1, 1)), (0, (4, 1.2)), "-")


def figures(effect: Effect) -> dict[str, str]:
    """Return the pictures of an effect as SVG, by the end of their file's name: ``"1-light"`` to ``"2-dark"``."""
    return {
        f"{number}-{scheme.name}": _svg(panel, scheme)
        for number, panel in enumerate(panels(effect), start=1)
        for scheme in SCHEMES
    }


def _svg(panel: Panel, scheme: Scheme) -> str:
    with style():
        figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        ax = figure.subplots()
        _draw(ax, panel, scheme)
        handles, labels = ax.get_legend_handles_labels()
        once = dict(zip(labels, handles, strict=True))
        figure.legend(once.values(), once.keys(), loc="outside lower left", ncols=1, labelcolor=scheme.ink)
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
    scales = ((ax.xaxis, ax.set_xscale), (ax.yaxis, ax.set_yscale))
    for (axis, set_scale), logarithmic in zip(scales, panel.logarithmic, strict=True):
        if not logarithmic:
            axis.set_major_locator(MaxNLocator(5))
            continue
        set_scale("log")
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        # Plain numbers: powers of ten would need formulas, which the style does not read.
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    ax.set_title(panel.title, color=scheme.ink)
    ax.set_xlabel(panel.across, color=scheme.ink)
    ax.set_ylabel(panel.up, color=scheme.ink)
    ax.tick_params(which="both", colors=scheme.ink)
    ax.grid(visible=True, color=scheme.grid)
    ax.set_axisbelow(True)

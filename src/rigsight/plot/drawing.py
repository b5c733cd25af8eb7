"""Style of all figures: colors, units shown, lines of many samples.

Nothing here touches pyplot: figures carry their own canvas, so that they can be drawn in any thread and are freed with
their last reference.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rigsight.records.record import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rigsight.diagnose.location.trace import Stage

MEASURED = "#5f6770"
GIVEN = "#d55e00"
REIDENTIFIED = "#cc79a7"
WITH_EFFECT = "#0072b2"
FLOOR = "#1d2126"
OTHER = "#9aa4ae"
"""Okabe and Ito's palette: distinguishable for color-blind readers, and in gray by line style."""
STAGE_STYLES: Mapping[Stage, Mapping[str, Any]] = {
    "before": {"color": GIVEN, "linestyle": (0, (5, 1.6))},
    "reidentified": {"color": REIDENTIFIED, "linestyle": (0, (2, 1))},
    "after": {"color": WITH_EFFECT, "linestyle": "-"},
}
"""How the lines of each stage of a diagnosis are drawn."""

STYLE: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#8a939c",
    "axes.labelcolor": "#1d2126",
    "axes.titlelocation": "left",
    # No tick label is above an axis here; looking for one takes a tenth of the drawing time.
    "axes.titley": 1.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "xtick.color": "#3b434b",
    "ytick.color": "#3b434b",
    "grid.color": "#e3e7ea",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "lines.solid_joinstyle": "round",
    "svg.fonttype": "none",
    # A dollar sign in the name of a signal or effect does not start a formula.
    "text.parse_math": False,
}

FLOOR_LINE: dict[str, Any] = {"color": FLOOR, "linestyle": (0, (4, 2)), "linewidth": 1.2}
PAGE_WIDTH = 5.4
"""Of a figure in a page [inch]; on a phone, where it is scaled to the screen, letters stay readable."""
_PREFIXES = {6: "M", 3: "k", 0: "", -3: "m", -6: "\u00b5", -9: "n"}
_PREFIXED = ("rad", "m", "N", "N m", "A", "V", "Pa", "W", "K")
_ENVELOPE_BINS = 600
_DPI = 200
_POINTS = 72.0
"""In an inch."""
_LABEL = 0.17
"""From the edge of a figure to where the label of an axis ends [inch]."""


@contextmanager
def style() -> Iterator[None]:
    """Draw and save in the style of these figures, whatever the notebook around it has set; a context and a decorator."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        for name, value in STYLE.items():
            mpl.rcParams[name] = value
        yield


@dataclass(frozen=True)
class DisplayScale:
    """Factor from SI to what is shown, and the unit shown."""

    factor: float
    unit: str


def display_scale(unit: str, size: float) -> DisplayScale:
    """Return the scale by which a quantity of typical `size` is shown, e.g. mrad for 0.01 rad."""
    if unit not in _PREFIXED or not np.isfinite(size) or size <= 0.0:
        return DisplayScale(1.0, unit)
    exponent = int(np.clip(3 * np.floor(np.log10(size) / 3.0), -9, 6))
    # 0.5 m reads better than 500 mm.
    if -9 <= exponent < 0 and size * 10.0**-exponent >= 200.0:
        exponent += 3
    return DisplayScale(10.0**-exponent, _PREFIXES[exponent] + unit)


def envelope(t: Floats, values: Floats, n_bins: int = _ENVELOPE_BINS) -> tuple[Floats, Floats]:
    """Return a shorter line with the same picture: lowest and highest finite sample of each bin, in their order in time."""
    if values.size <= 2 * n_bins:
        return t, values
    size = -(-values.size // n_bins)
    padded = np.full(-(-values.size // size) * size, np.nan)
    padded[: values.size] = values
    bins = padded.reshape(-1, size)
    finite = np.isfinite(bins)
    # Of a bin without a number the first sample stays: the gap is seen.
    low = np.where(finite, bins, np.inf).argmin(axis=1)
    high = np.where(finite, bins, -np.inf).argmax(axis=1)
    keep = np.unique(size * np.arange(low.size)[:, None] + np.column_stack([low, high]))
    return t[keep], values[keep]


def plain_log_ticks(ax: Axes, left: float, right: float) -> None:
    """Label decades and, where they are few, numbers between, as people write them; scientific notation beyond 10^5."""
    from matplotlib.ticker import FixedLocator, NullLocator

    decades = range(int(np.floor(np.log10(left))), int(np.ceil(np.log10(right))) + 1)
    span = np.log10(right / left)
    multiples = (1, 1.1, 1.2, 1.5, 2, 3, 5) if span < 0.7 else ((1, 2, 5) if span < 2.5 else (1,))
    ticks = [m * 10.0**d for d in decades for m in multiples]
    ticks = [tick for tick in ticks if left <= tick <= 1.15 * right]
    ticks = ticks[:: max(1, len(ticks) // 8)]
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticks(ticks, [f"{tick:g}" if tick < 1e5 else f"1e{int(np.log10(tick))}" for tick in ticks])


def line(ax: Axes, t: Floats, values: Floats, n_bins: int = _ENVELOPE_BINS, **style: Any) -> None:
    """Draw a line over time with all its peaks; where it is not finite, there is a gap."""
    ax.plot(*envelope(t, np.where(np.isfinite(values), values, np.nan), n_bins), **style)


def shown_in(unit: str, *series: Floats) -> tuple[float, str]:
    """Return factor and unit in which all of these series are shown."""
    peaks = [float(np.max(np.abs(s[np.isfinite(s)]), initial=0.0)) for s in series]
    scale = display_scale(unit, max(peaks))
    return scale.factor, scale.unit


def with_unit(name: str, unit: str) -> str:
    """Return a name with its unit in brackets, if it has one."""
    return name if unit in ("", "1") else f"{name} [{unit}]"


def new_figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """Return an empty figure of this size [inch] with a canvas of its own."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def panel_grid(figure: Figure, count: int, columns: int, **options: Any) -> list[Axes]:
    """Return the axes of so many panels, row by row; the places that remain in the last row stay empty."""
    axes = list(figure.subplots(-(-count // columns), columns, squeeze=False, **options).flat)
    for ax in axes[count:]:
        ax.set_visible(False)
    return axes[:count]


def set_margins(
    figure: Figure,
    left: float,
    right: float,
    bottom: float,
    top: float,
    between: tuple[float, float] = (0.0, 0.0),
) -> None:
    """Place axes and their labels by the room around them; to find it by drawing takes as long as the drawing itself."""
    width, height = (float(size) for size in figure.get_size_inches())
    shape = figure.axes[0].get_subplotspec()
    assert shape is not None
    rows, columns, _, _ = shape.get_geometry()
    each_width = (width - left - right - (columns - 1) * between[0]) / columns
    each_height = (height - bottom - top - (rows - 1) * between[1]) / rows
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        bottom=bottom / height,
        top=1.0 - top / height,
        wspace=between[0] / each_width,
        hspace=between[1] / each_height,
    )
    for ax in figure.axes:
        ax.yaxis.set_label_coords((_LABEL - left) / each_width, 0.5)
        ax.xaxis.set_label_coords(0.5, (_LABEL - bottom) / (ax.get_position().height * height))


def text_width(texts: Iterable[str], size: float) -> float:
    """Return the width of the longest of some texts [inch] in letters of this size [points]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(family=STYLE["font.family"], size=size)
    widths = (text_to_path.get_text_width_height_descent(text, font, ismath=False)[0] for text in texts)
    return max(widths, default=0.0) / _POINTS


def svg_text(figure: Figure, key: str) -> str:
    """Return a figure as SVG, the same text for the same figure; `key` makes its ids."""
    import matplotlib as mpl

    stream = io.StringIO()
    engine = figure.get_layout_engine()
    with style():
        mpl.rcParams["svg.hashsalt"] = key
        if engine is not None:
            # matplotlib would draw the whole figure once more, only to lay it out.
            engine.execute(figure)
            figure.set_layout_engine(None)
        try:
            figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        finally:
            figure.set_layout_engine(engine)
    return stream.getvalue()


def encoded(figure: Figure, suffix: str, key: str) -> str | bytes:
    """Return a figure as the contents of a file of this suffix, ``".svg"`` or ``".png"``."""
    return svg_text(figure, key) if suffix == ".svg" else png_bytes(figure, _DPI)


def png_bytes(figure: Figure, dpi: int) -> bytes:
    """Return a figure as PNG."""
    stream = io.BytesIO()
    with style():
        figure.savefig(stream, format="png", dpi=dpi)
    return stream.getvalue()

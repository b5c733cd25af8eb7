"""Symbols of springs, dampers, walls and blocks. Lengths in inch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.plot.drawing import text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "#1d2126"
FAINT = "#5f6770"
SUSPECTED = "#d55e00"
"""Vermilion of Okabe and Ito's palette; nothing else in the picture has a color as strong."""
TITLE, TEXT = 8.5, 7.2
"""Sizes of letters [points]."""
TITLE_HEIGHT, LINE_HEIGHT, PAD = 0.155, 0.13, 0.08
_BOLD = 1.12
"""Width of bold letters relative to plain ones."""
_APART = 0.085
"""Half the distance of a spring from the damper beside it."""
_SYMBOL = 0.44
"""Length of a spring's coils or a damper's pot."""

Point = tuple[float, float]
_Draw = Callable[[Sequence[np.ndarray]], None]


def block_size(title: str, lines: Sequence[str], marked: str | None = None) -> tuple[float, float]:
    """Return width and height of what `write_block` writes, with a margin."""
    bold = [] if marked is None else [marked]
    widths = (_BOLD * text_width([title], TITLE), text_width(lines, TEXT), _BOLD * text_width(bold, TEXT))
    return max(widths) + 2.0 * PAD, TITLE_HEIGHT + LINE_HEIGHT * (len(lines) + len(bold)) + 2.0 * PAD


def write(ax: Axes, x: float, y: float, words: str, color: str = INK, **style: Any) -> None:
    """Write words of the usual size about a height, by default from the left."""
    ax.text(x, y, words, **{"size": TEXT, "color": color, "va": "center_baseline", **style})


def write_block(
    ax: Axes, left: float, middle: float, title: str, lines: Sequence[str], marked: str | None = None
) -> None:
    """Write a title and lines, with what a place is suspected of as the last line, from the left about a height."""
    height = TITLE_HEIGHT + LINE_HEIGHT * (len(lines) + (marked is not None))
    y = middle + height / 2.0 - TITLE_HEIGHT / 2.0
    write(ax, left, y, title, size=TITLE, weight="bold")
    y -= (TITLE_HEIGHT + LINE_HEIGHT) / 2.0
    for line in lines:
        write(ax, left, y, line, FAINT)
        y -= LINE_HEIGHT
    if marked is not None:
        write(ax, left, y, marked, SUSPECTED, weight="bold")


def box(ax: Axes, corner: Point, size: Point, fill: str, edge: str = INK, **style: Any) -> None:
    """Draw a rectangle with rounded corners."""
    from matplotlib.patches import FancyBboxPatch

    look = {"boxstyle": "round,pad=0,rounding_size=0.05", "facecolor": fill, "edgecolor": edge, **style}
    ax.add_patch(FancyBboxPatch(corner, *size, **look))


def flag(ax: Axes, corner: Point, size: Point, edge: str) -> None:
    """Draw a pennant: a rectangle with a notch at its free end."""
    from matplotlib.patches import Polygon

    (x, y), (width, height) = corner, size
    notch = min(0.07, height / 4.0)
    right, top = x + width, y + height
    outline = [(x, y), (right, y), (right, top), (x, top), (x + notch, y + height / 2.0)]
    ax.add_patch(Polygon(outline, closed=True, facecolor="#eef6ee", edgecolor=edge, linewidth=0.9))


def halo(ax: Axes, corner: Point, size: Point, strength: float) -> None:
    """Color the background of a suspected place, the more the stronger the suspicion."""
    style = {"boxstyle": "round,pad=0.05,rounding_size=0.08", "alpha": 0.08 + 0.2 * strength, "zorder": 0.5}
    box(ax, corner, size, SUSPECTED, "none", **style)


def joint(ax: Axes, start: Point, end: Point, spring: bool, damper: bool, color: str) -> None:
    """Draw what stands between two points on one level or one above the other: spring, damper, both, or a bearing."""
    a, b = np.array(start), np.array(end)
    along = (b - a) / np.hypot(*(b - a))
    across = np.array([-along[1], along[0]])
    middle, half = (a + b) / 2.0, min(_SYMBOL, 0.8 * float(np.hypot(*(b - a)))) / 2.0
    style: dict[str, Any] = {"color": color, "linewidth": 1.2, "solid_capstyle": "round"}

    def draw(points: Sequence[np.ndarray]) -> None:
        ax.plot(*np.transpose(points), **style)

    head, tail = middle - half * along, middle + half * along
    draw([a, head])
    draw([tail, b])
    if spring and damper:
        for end_point in (head, tail):
            draw([end_point - _APART * across, end_point + _APART * across])
    shift = _APART * across if spring and damper else 0.0 * across
    if spring:
        _spring(draw, head + shift, tail + shift, across)
    if damper:
        _damper(draw, head - shift, tail - shift, across)
    if not spring and not damper:
        draw([head, tail])
        ax.plot(*middle, marker="o", markersize=5.0, markerfacecolor="white", markeredgecolor=color)


def _spring(draw: _Draw, head: np.ndarray, tail: np.ndarray, across: np.ndarray) -> None:
    steps = np.linspace(0.0, 1.0, 12)[:, None]
    swing = np.array([0, 0, 1, -1, 1, -1, 1, -1, 1, -1, 0, 0])[:, None]
    draw(list(head + steps * (tail - head) + 0.05 * swing * across))


def _damper(draw: _Draw, head: np.ndarray, tail: np.ndarray, across: np.ndarray) -> None:
    way = tail - head
    piston, bottom = head + 0.55 * way, head + 0.35 * way
    draw([head, bottom])
    side, open_end = 0.055 * across, head + 0.75 * way
    draw([open_end + side, bottom + side, bottom - side, open_end - side])
    draw([piston - 0.035 * across, piston + 0.035 * across])
    draw([piston, tail])


def wall(ax: Axes, x: float, bottom: float, top: float) -> None:
    """Draw the ground as a wall that stands right of what it holds."""
    ax.plot([x, x], [bottom, top], color=INK, linewidth=1.6)
    for y in np.arange(bottom, top - 0.02, 0.09):
        ax.plot([x, x + 0.09], [y, y + 0.09], color=FAINT, linewidth=0.7)


def arrow(ax: Axes, points: Sequence[Point], color: str, dashed: bool = False, width: float = 1.2) -> None:
    """Draw a line through points with a head at its end."""
    style = (0, (3, 2)) if dashed else "-"
    ax.plot(*np.transpose(points), color=color, linewidth=width, linestyle=style, solid_capstyle="butt")
    (x_0, y_0), (x, y) = points[-2:]
    length = float(np.hypot(x - x_0, y - y_0)) or 1.0
    head = {"arrowstyle": "-|>,head_length=0.35,head_width=0.17", "color": color, "linewidth": width}
    start = (x - 0.02 * (x - x_0) / length, y - 0.02 * (y - y_0) / length)
    ax.annotate("", xy=(x, y), xytext=start, arrowprops={**head, "shrinkA": 0, "shrinkB": 0})

"""Static drawing of lines over a shared axis, in the style of the other figures and without matplotlib.

matplotlib takes a tenth of a second for a figure, whatever is in it, and a report has several of every record. A drawing here
takes some milliseconds. Lengths are points, of which 72 make an inch, as in matplotlib.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from rigsight.plot.drawing import STYLE, log_ticks

_POINTS = 72.0
_TEXT, _SMALL, _TITLE = 9.0, 8.5, 9.5
_LETTER = 0.57
"""Mean width of a letter of a legend in units of its size: that of DejaVu Sans and Verdana, which are wide."""
_LEFT, _RIGHT, _BOTTOM, _TOP, _BETWEEN = 52.0, 10.0, 34.0, 8.0, 11.0
"""Room for ticks and labels around the panels, and between two of them."""
_NAMED, _TITLED = 15.0, 16.0
"""Height of a line of the legend, and of the title."""
_TICK = 3.5
_GRID = str(STYLE["grid.color"])
_EDGE, _TICKS, _INK = str(STYLE["axes.edgecolor"]), str(STYLE["xtick.color"]), str(STYLE["axes.labelcolor"])
_ROUND = 'style="stroke-linecap:round"'
"""As a style: matplotlib's figures bring a rule for everything in the page, which goes before an attribute."""
_MOST_TICKS = 9
_PER_TICK = 24.0
"""Height of a panel for each of its ticks, at least."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line, or points without one."""

    # Shape (n,); where `y` is not finite, there is a gap.
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    color: str  # as in ``"#0072b2"``
    width: float = 1.0  # of the line, or of each point
    dashes: tuple[float, ...] = ()  # lengths of dashes and gaps in units of the width; empty for a solid line
    opacity: float = 1.0  # 1 for a line that hides what is below
    label: str = ""  # its name in the legend; empty for none
    as_points: bool = False  # true for points


@dataclass(frozen=True, eq=False)
class Area:
    """The area between two limits, both of shape (n,)."""

    x: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    color: str
    opacity: float


@dataclass(frozen=True, eq=False)
class DrawnPanel:
    """One of the panels over each other."""

    label: str  # quantity and unit
    share: int  # height relative to the other panels
    limits: tuple[float, float]  # lowest and highest value that is seen
    # What is drawn; areas lie below.
    lines: Sequence[Line]
    areas: Sequence[Area] = ()
    turns: bool = False  # true for angles in degrees, whose ticks are parts of a turn


def around(
    series: Sequence[NDArray[np.float64]], cap: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Return limits with a little air around all that is finite, and nothing beyond a cap."""
    low, high = math.inf, -math.inf
    for values in series:
        finite = values[np.isfinite(values)]
        low, high = (
            min(low, float(finite.min(initial=math.inf))),
            max(high, float(finite.max(initial=-math.inf))),
        )
    if cap is not None:
        low, high = max(low, cap[0]), min(high, cap[1])
    if not low <= high:
        return -1.0, 1.0
    air = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - air, high + air


def line_drawing(
    panels: Sequence[DrawnPanel],
    axis: str,
    key: str,
    alt: str,
    size: tuple[float, float],
    *,
    log: bool = False,
    marked: tuple[float, float] | None = None,
    title: str = "",
) -> Markup:
    """Return panels over each other as SVG."""
    width, height = _POINTS * size[0], _POINTS * size[1]
    named, legend_height = _legend([line for panel in panels for line in panel.lines if line.label], width)
    top = _TOP + legend_height + (_TITLED if title else 0.0)
    across = _Axis(*_range(panels, log), _LEFT, width - _RIGHT, log)
    free = height - top - _BOTTOM - _BETWEEN * (len(panels) - 1)
    parts = [*named]
    if title:
        parts.append(_text(_LEFT, top - 6.0, title, _TITLE, _INK, "start", bold=True))
    for number, panel in enumerate(panels):
        tall = free * panel.share / sum(one.share for one in panels)
        parts += _panel(panel, across, top, tall, f"{key}-panel-{number}", width, size[0])
        if marked is not None and number == 0:
            begin, end = across.place(np.array(marked))
            parts.append(
                f'<rect x="{begin:.1f}" y="{top + 0.975 * tall:.1f}" width="{end - begin:.1f}" height="{0.025 * tall:.1f}" '
                f'fill="{_INK}"/>'
            )
        top += tall + _BETWEEN
    bottom = height - _BOTTOM
    for place, label in across.ticks(size[0]):
        parts.append(f'<path d="M{place:.1f} {bottom:.1f}v{_TICK}" stroke="{_TICKS}" stroke-width="0.8"/>')
        parts.append(_text(place, bottom + _TICK + 10.0, label, _TEXT, _TICKS, "middle"))
    parts.append(_text((across.first + across.last) / 2.0, height - 5.0, axis, _TEXT, _INK, "middle"))
    return Markup(
        f'<svg role="img" aria-label="{escape(alt)}" viewBox="0 0 {width:g} {height:g}" fill="none" '
        f"font-family=\"'DejaVu Sans', Verdana, sans-serif\">{''.join(parts)}</svg>"
    )


@dataclass(frozen=True)
class _Axis:
    """From values to places along one direction of the picture."""

    low: float
    high: float
    first: float
    last: float
    log: bool = False

    def place(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        low, high = (math.log10(end) for end in (self.low, self.high)) if self.log else (self.low, self.high)
        known = np.log10(values) if self.log else values
        share = (known - low) / ((high - low) or 1.0)
        return np.asarray(self.first + share * (self.last - self.first))

    def ticks(self, inches: float) -> list[tuple[float, str]]:
        """Return the places of ticks with what stands at them."""
        if self.log:
            values, labels = log_ticks(self.low, self.high)
        else:
            values, labels = _plain_ticks(self.low, self.high, min(_MOST_TICKS, round(1.4 * inches)))
        places = self.place(np.array(values)) if values else np.zeros(0)
        inside = (min(self.first, self.last) - 0.5, max(self.first, self.last) + 0.5)
        return [
            (float(p), text) for p, text in zip(places, labels, strict=True) if inside[0] <= p <= inside[1]
        ]


def _range(panels: Sequence[DrawnPanel], log: bool) -> tuple[float, float]:
    ends = [float(line.x[i]) for panel in panels for line in panel.lines if line.x.size for i in (0, -1)]
    low, high = min(ends, default=1.0), max(ends, default=2.0)
    if high > low:
        return low, high
    return (low / 1.1, high * 1.1) if log else (low - 0.5, high + 0.5)


def _plain_ticks(low: float, high: float, most: int) -> tuple[list[float], list[str]]:
    """Return round numbers inside a range, at most so many steps of them, as people write them."""
    rough = (high - low) / max(1, most)
    if not (math.isfinite(rough) and rough > 0.0):
        return [], []
    power = math.floor(math.log10(rough))
    multiple = next(m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * 10.0**power >= rough * (1.0 - 1e-9))
    step = multiple * 10.0**power
    digits = max(0, -power + (multiple == 2.5) - (multiple == 10.0))
    values = [
        number * step for number in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    ]
    return values, [_written(value, digits) for value in values]


def _written(value: float, digits: int) -> str:
    if digits > 5 or abs(value) >= 1e6:
        return f"{value:.4g}".replace("-", "\u2212")
    # Rounded first, so that no zero has a sign.
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "\u2212")


def _panel(
    panel: DrawnPanel, across: _Axis, top: float, tall: float, key: str, width: float, inches: float
) -> Iterator[str]:
    up = _Axis(*panel.limits, top + tall, top)
    if panel.turns:
        step = 45.0 if panel.limits[1] - panel.limits[0] < 300.0 else 90.0
        values = [step * n for n in range(math.ceil(up.low / step), math.floor(up.high / step) + 1)]
        marks = [(float(up.place(np.array(v))), _written(v, 0)) for v in values]
    else:
        values, labels = _plain_ticks(up.low, up.high, max(3, round(tall / _PER_TICK)))
        marks = [(float(up.place(np.array(v))), label) for v, label in zip(values, labels, strict=True)]
    right = width - _RIGHT
    grid = [f"M{_LEFT} {place:.1f}H{right}" for place, _ in marks]
    grid += [f"M{place:.1f} {top:.1f}v{tall:.1f}" for place, _ in across.ticks(inches)]
    yield f'<path d="{"".join(grid)}" stroke="{_GRID}" stroke-width="0.8"/>'
    yield (
        f'<clipPath id="{key}"><rect x="{_LEFT}" y="{top:.1f}" width="{right - _LEFT:.1f}" height="{tall:.1f}"/></clipPath>'
        f'<g clip-path="url(#{key})" stroke-linejoin="round">'
    )
    for area in panel.areas:
        yield _area(area, across, up)
    for line in panel.lines:
        yield _line(line, across, up)
    yield "</g>"
    yield f'<path d="M{_LEFT} {top:.1f}v{tall:.1f}H{right}" stroke="{_EDGE}" stroke-width="0.8"/>'
    for place, label in marks:
        yield f'<path d="M{_LEFT} {place:.1f}h-{_TICK}" stroke="{_TICKS}" stroke-width="0.8"/>'
        yield _text(_LEFT - _TICK - 3.5, place + 3.3, label, _TEXT, _TICKS, "end")
    middle = top + tall / 2.0
    yield _text(11.0, middle, panel.label, _TEXT, _INK, "middle", turned=True)


def _line(line: Line, across: _Axis, up: _Axis) -> str:
    x, y = across.place(line.x), _within(up, line.y)
    finite = np.isfinite(x) & np.isfinite(y)
    if not finite.any():
        return ""
    if line.as_points:
        marks = "".join(
            f"M{a:.1f} {b:.1f}h0" for a, b in zip(x[finite].tolist(), y[finite].tolist(), strict=True)
        )
        return f'<path d="{marks}" stroke="{line.color}" stroke-width="{line.width:g}" {_ROUND}/>'
    ends = np.flatnonzero(np.diff(finite.astype(np.int8), prepend=0, append=0))
    runs = [
        "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x[i:j].tolist(), y[i:j].tolist(), strict=True))
        for i, j in zip(ends[::2], ends[1::2], strict=True)
    ]
    return f'<path d="{"".join(runs)}" {_stroke(line)}/>'


def _stroke(line: Line) -> str:
    dashes = ",".join(f"{length * line.width:.3g}" for length in line.dashes)
    return (
        f'stroke="{line.color}" stroke-width="{line.width:g}"'
        + (f' stroke-dasharray="{dashes}"' if dashes else "")
        + (f' stroke-opacity="{line.opacity:g}"' if line.opacity < 1.0 else "")
    )


def _area(area: Area, across: _Axis, up: _Axis) -> str:
    x = across.place(area.x)
    low, high = _within(up, area.low), _within(up, area.high)
    kept = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    ring = zip(
        np.concatenate([x[kept], x[kept][::-1]]).tolist(),
        np.concatenate([high[kept], low[kept][::-1]]).tolist(),
        strict=True,
    )
    corners = "L".join(f"{a:.1f} {b:.1f}" for a, b in ring)
    return f'<path d="M{corners}Z" fill="{area.color}" fill-opacity="{area.opacity:g}"/>' if corners else ""


def _within(up: _Axis, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places no farther off than a panel's height: what left the picture needs no numbers of twenty digits."""
    span = up.high - up.low
    return up.place(np.clip(values, up.low - span, up.high + span))


def _legend(lines: Sequence[Line], width: float) -> tuple[list[str], float]:
    """Return the names of all lines in as many rows as they need, and their height.

    Without a name there is an empty row, so that drawings beside each other keep in line.
    """
    named: dict[str, Line] = {}
    for line in lines:
        named.setdefault(line.label, line)
    parts: list[str] = []
    left, row = 8.0, 0
    for line in named.values():
        long = 18.0 + 6.0 + _LETTER * _SMALL * len(line.label)
        if left > 8.0 and left + long > width:
            left, row = 8.0, row + 1
        middle = 11.0 + _NAMED * row
        if line.as_points:
            shown = f'stroke="{line.color}" stroke-width="{1.3 * line.width:g}" {_ROUND}'
            parts.append(f'<path d="M{left + 9.0:.1f} {middle}h0" {shown}/>')
        else:
            parts.append(f'<path d="M{left:.1f} {middle}h18" {_stroke(line)}/>')
        parts.append(_text(left + 24.0, middle + 3.0, line.label, _SMALL, _INK, "start"))
        left += long + 10.0
    return parts, _NAMED * (row + 1)


def _text(
    x: float,
    y: float,
    text: str,
    size: float,
    color: str,
    anchor: str,
    *,
    turned: bool = False,
    bold: bool = False,
) -> str:
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    weight = ' font-weight="bold"' if bold else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" fill="{color}" text-anchor="{anchor}"{turn}{weight}>'
        f"{escape(text)}</text>"
    )

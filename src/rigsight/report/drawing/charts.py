"""Curves in the page that its script can draw and zoom: packed numbers next to a static drawing."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rigsight.diagnose.result import Diagnosis
from rigsight.report.drawing.figures import PageFigure
from rigsight.report.wording import stage_names

_LEVELS = 65_534
"""Steps of a 16 bit number over a curve's range; the lowest number is left for values that are not finite."""
_PAGE_POINTS = 170_000
"""Points of all curves over time in a page: about 0.9 MB as text."""
_MOST_POINTS, _FEWEST_POINTS = 6_000, 600


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a chart, or the area between two."""

    of: str  # what it shows: ``"measured"``, or a stage of the diagnosis
    x: NDArray[np.float64]  # shape (n,); increasing and finite
    y: NDArray[np.float64] | None = None  # shape (n,), None for an area
    # Limits of an area, shape (n,), None for a line.
    low: NDArray[np.float64] | None = None
    high: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class ChartPanel:
    """One of the panels that share an axis."""

    label: str  # quantity and unit
    share: int  # height relative to the other panels
    curves: Sequence[Curve]  # what is drawn
    cap: tuple[float, float] | None = None  # values beyond which nothing needs to be seen; None for no limit
    band: float | None = None  # half-width of a band about zero, None for none
    degrees: bool = False  # true if the values are angles in degrees


@dataclass(frozen=True)
class Detail:
    """A part worth looking at: its limits on the shared axis, what the button that shows it is called, and what it does."""

    low: float
    high: float
    label: str
    title: str


@dataclass(frozen=True)
class Chart:
    """A figure that reacts: its static drawing, which is printed and stands in where no script runs, and its curves."""

    key: str  # its id, unique in the page
    drawings: tuple[PageFigure, ...]  # static figures of the same curves
    data: Markup  # the curves as JSON that is safe inside a script element
    caption: str  # what it shows, for everyone


def curve_names(diagnosis: Diagnosis) -> dict[str, str]:
    """Return what is drawn of each record, with its name for people: measured, and the stages that differ."""
    return {"measured": "measured", **{str(stage): name for stage, name in stage_names(diagnosis).items()}}


def points_per_curve(n_curves: int) -> int:
    """Return how many points each of this many curves may have, so that the page stays light."""
    return int(np.clip(_PAGE_POINTS // max(1, n_curves), _FEWEST_POINTS, _MOST_POINTS))


def packed(values: NDArray[np.float64]) -> dict[str, Any]:
    """Return numbers as 16 bit steps of their range, in base64; what is not finite has a number of its own."""
    finite = np.isfinite(values)
    low = float(values[finite].min()) if finite.any() else 0.0
    high = float(values[finite].max()) if finite.any() else 0.0
    middle, step = 0.5 * (low + high), (high - low) / _LEVELS or 1.0
    whole = np.full(values.shape, -32768, dtype="<i2")
    whole[finite] = np.round((values[finite] - middle) / step)
    return {
        "data": base64.b64encode(whole.tobytes()).decode("ascii"),
        "middle": _short(middle),
        "step": _short(step),
    }


def chart_data(
    title: str,
    axis: tuple[str, str],
    panels: Sequence[ChartPanel],
    names: Mapping[str, str],
    *,
    log: bool = False,
    detail: Detail | None = None,
    label: str = "",
) -> Markup:
    """Return a chart's curves as JSON for the page's script."""
    symbol, unit = axis
    ends = [float(curve.x[i]) for panel in panels for curve in panel.curves for i in (0, -1)]
    content = {
        "title": title,
        "symbol": symbol,
        "unit": unit,
        "label": label or f"{'angular frequency' if log else 'time'} [{unit}]",
        "log": log,
        "range": [_short(min(ends)), _short(max(ends))],
        "detail": None
        if detail is None
        else {
            "range": [_short(detail.low), _short(detail.high)],
            "label": detail.label,
            "title": detail.title,
        },
        "names": dict(names),
        "panels": [_panel(panel, log) for panel in panels],
    }
    # Inside a script element only "<" could end it.
    return Markup(json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def _panel(panel: ChartPanel, log: bool) -> dict[str, Any]:
    return {
        "label": panel.label,
        "share": panel.share,
        "cap": None if panel.cap is None else [_short(limit) for limit in panel.cap],
        "band": None if panel.band is None else _short(panel.band),
        "degrees": panel.degrees,
        "curves": [_curve(curve, log) for curve in panel.curves],
    }


def _curve(curve: Curve, log: bool) -> dict[str, Any]:
    lines = {"y": curve.y, "low": curve.low, "high": curve.high}
    return {
        "of": curve.of,
        "x": _places(curve.x, log),
        **{name: packed(line) for name, line in lines.items() if line is not None},
    }


def _places(x: NDArray[np.float64], log: bool) -> dict[str, Any] | list[float]:
    """Return first and step where places are equally spaced, else all of them; of frequencies the logarithms."""
    if log:
        return packed(np.log10(x))
    step = float(x[-1] - x[0]) / max(1, x.size - 1)
    if np.allclose(np.diff(x), step, rtol=1e-6, atol=0.0):
        return [_short(float(x[0]), 9), _short(step, 9)]
    return packed(x)


def _short(value: float, digits: int = 7) -> float:
    return float(f"{value:.{digits}g}")

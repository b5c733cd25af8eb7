"""Charts of a page: the curves as numbers, which the page's script draws, zooms and reads."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rigsight.diagnose.result import Diagnosis
from rigsight.report.figures import PageFigure
from rigsight.report.wording import stage_names

_DIGITS = 5
"""Of a curve's range: more than a screen shows."""
_PAGE_NUMBERS = 170_000
"""Of all curves over time in a page: about 1.2 MB as text."""
_MOST_POINTS, _FEWEST_POINTS = 6_000, 600


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a panel, or the area between two."""

    of: str  # what it shows, which decides its color: ``"measured"``, a stage of the diagnosis, or ``"floor"``
    name: str  # in the legend
    y: NDArray[np.float64] | None = None  # None for an area
    # Limits of an area, one for all points or one per point; None for a line.
    low: NDArray[np.float64] | float | None = None
    high: NDArray[np.float64] | float | None = None


@dataclass(frozen=True, eq=False)
class ChartPanel:
    """One of the panels over each other that share an axis."""

    label: str  # quantity and unit
    share: int  # height relative to the other panels
    curves: Sequence[Curve]  # what is drawn; areas first, since they lie below
    cap: tuple[float, float]  # values beyond which nothing needs to be seen
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
    """A figure that reacts, and what stands in for it where no script runs."""

    key: str  # its id, unique in the page
    data: Markup  # the curves as JSON that is safe inside a script element
    caption: str  # what it shows, for everyone
    still: PageFigure | None = None  # None where the numbers of the page must do


def curve_names(diagnosis: Diagnosis) -> dict[str, str]:
    """Return what is drawn of each record, with its name for people: measured, and the stages that differ."""
    return {"measured": "measured", **{str(stage): name for stage, name in stage_names(diagnosis).items()}}


def points_per_curve(n_curves: int) -> int:
    """Return how many points each of this many curves may have, so that the page stays light."""
    return int(np.clip(_PAGE_NUMBERS // max(1, n_curves), _FEWEST_POINTS, _MOST_POINTS))


def chart_data(
    title: str,
    label: str,
    x: NDArray[np.float64],
    panels: Sequence[ChartPanel],
    *,
    log: bool = False,
    detail: Detail | None = None,
) -> Markup:
    """Return curves over an axis as JSON for the page's script."""
    content = {
        "title": title,
        "label": label,
        "log": log,
        "x": [float(f"{place:.9g}") for place in x],
        "detail": detail and asdict(detail),
        "panels": [{**vars(panel), "curves": [_curve(curve) for curve in panel.curves]} for panel in panels],
    }
    # Inside a script element only "<" could end it.
    return Markup(json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))


def _curve(curve: Curve) -> dict[str, Any]:
    return {
        name: _numbers(value) if isinstance(value, np.ndarray) else value
        for name, value in vars(curve).items()
        if value is not None
    }


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Return numbers with the digits that are seen; None for what is not finite, for which JSON has no word."""
    known = values[np.isfinite(values)]
    reach = float(np.ptp(known)) or abs(float(known[0])) if known.size else 0.0
    places = _DIGITS - math.ceil(math.log10(reach)) if reach else 0
    # Numpy multiplies by a power of ten before it rounds, which overflows for the smallest floats.
    shown = np.round(values, places) if places < sys.float_info.max_10_exp else values
    return [value if math.isfinite(value) else None for value in shown.tolist()]

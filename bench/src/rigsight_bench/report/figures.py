"""Figures of a blind bench: stated probabilities against the share of right verdicts, and errors on withheld records."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.plot.drawing import FLOOR, GIVEN, WITH_EFFECT, new_figure, style
from rigsight.report.figures import PageFigure, page_figure
from rigsight.report.labels import percent
from rigsight_bench.report.views import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH = 5.4
"""Inch; on a phone, where it is scaled to the screen, letters stay readable."""


def reliability_figure(content: Mapping[str, Any]) -> PageFigure:
    """Return how often a verdict was right that was stated with this probability."""
    rows = [row for row in content["reliability"] if row["right"]["total"]]
    told = "; ".join(
        f"stated {number(row['stated'], 2)}: right {percent(row['right']['share'])} of {row['right']['total']}"
        for row in rows
    )
    caption = (
        "Share of right verdicts by stated probability; on the dashed line they are right as often as stated. "
        "Bars are 95 % intervals (Wilson), numbers count trials."
    )
    return page_figure(_reliability(rows), "reliability-plot", f"Reliability: {told}.", caption)


@style()
def _reliability(rows: list[Mapping[str, Any]]) -> Figure:
    figure = new_figure(_WIDTH, 3.6)
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [0.0, 1.0], color=FLOOR, linestyle=(0, (4, 2)), linewidth=1.0)
    stated = np.array([row["stated"] for row in rows])
    right = np.array([row["right"]["share"] for row in rows])
    low, high = (np.array([row["right"]["interval"][end] for row in rows]) for end in (0, 1))
    # An interval that ends at a share of 0 or 1 may miss it by rounding.
    ax.errorbar(
        stated, right, yerr=np.maximum([right - low, high - right], 0.0), color=WITH_EFFECT, marker="o", markersize=5,
        linewidth=0.0, elinewidth=1.4, capsize=3,
    )  # fmt: skip
    for x, y, row in zip(stated, right, rows, strict=True):
        ax.annotate(
            str(row["right"]["total"]), (x, y), (-6, 4), textcoords="offset points", fontsize=8, ha="right"
        )
    ax.set_xlim(-0.02, 1.02)
    ax.set_ylim(-0.03, 1.05)
    ax.set_xlabel("probability stated")
    ax.set_ylabel("share of right verdicts")
    ax.grid()
    ax.set_axisbelow(True)
    return figure


def held_out_figure(content: Mapping[str, Any]) -> PageFigure:
    """Return how many models leave how much of the withheld records."""
    bins = [row for row in content["held_out"]["histogram"] if row["right"] + row["wrong"]]
    told = "; ".join(f"{_bin_text(row)}: {row['right'] + row['wrong']} trials" for row in bins)
    caption = (
        "Error of the diagnosed model on withheld records, in units of the true noise floor (1 is perfect), for all trials "
        "except those with an effect from outside the catalogue. Class widths differ."
    )
    return page_figure(
        _held_out(content["held_out"]["histogram"]), "held-out-plot", f"Withheld errors: {told}.", caption
    )


def _bin_text(row: Mapping[str, Any]) -> str:
    if row["to"] is None:
        return f"above {row['from']:g}"
    return f"below {row['to']:g}" if row["from"] == 0.0 else f"{row['from']:g} to {row['to']:g}"


@style()
def _held_out(bins: list[Mapping[str, Any]]) -> Figure:
    figure = new_figure(_WIDTH, 3.1)
    ax = figure.subplots()
    places = np.arange(len(bins))
    right, wrong = (np.array([row[name] for row in bins]) for name in ("right", "wrong"))
    ax.barh(places, right, color=WITH_EFFECT, height=0.75, label="verdict right")
    ax.barh(
        places,
        wrong,
        left=right,
        color=GIVEN,
        hatch="///",
        edgecolor="white",
        height=0.75,
        label="verdict wrong",
    )
    for place, total in zip(places, right + wrong, strict=True):
        if total:
            ax.annotate(
                str(total), (total, place), (3, 0), textcoords="offset points", fontsize=8, va="center"
            )
    ax.set_yticks(places, [_bin_text(row) for row in bins])
    ax.invert_yaxis()
    ax.tick_params(axis="y", length=0)
    ax.set_ylabel("error [noise floors]")
    ax.set_xlabel("trials")
    ax.set_xlim(0.0, 1.12 * max(1, int(np.max(right + wrong))))
    ax.legend(loc="lower right")
    return figure

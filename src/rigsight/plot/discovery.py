"""How does a discovery look? The terms with their intervals and inclusion probabilities, and the free run against the records."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rigsight.discover.result import Discovery, Run, Term
from rigsight.plot.drawing import MEASURED, OTHER, WITH_EFFECT, in_style, line, new_figure, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_TERMS = 12
_MOST_RUNS = 3
_SURE = 0.9


@in_style
def discovery_figure(found: Discovery) -> Figure:
    """Draw the terms and the free runs of a discovery.

    Parameters
    ----------
    found
        The result.
    """
    terms = found.terms[:_MOST_TERMS]
    runs = found.runs[:_MOST_RUNS]
    numbers = _numbers(found)
    top = 0.9 + 0.28 * max(len(terms), len(numbers), 3)
    figure = new_figure(8.4, top + 2.5 * len(runs))
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=[top, 2.5 * len(runs)])[:, 0]
    left, right = parts[0].subplots(1, 2)
    _draw_inclusion(left, terms)
    _draw_coefficients(right, numbers)
    axes = parts[1].subplots(2 * len(runs), 1, squeeze=False, height_ratios=[3, 1.3] * len(runs))[:, 0]
    for index, run in enumerate(runs):
        _draw_run(axes[2 * index], axes[2 * index + 1], run, found)
    return figure


def _draw_inclusion(ax: Axes, terms: tuple[Term, ...]) -> None:
    names = [_spoken(term.name) for term in terms]
    places = list(range(len(names)))
    colors = [WITH_EFFECT if term.kept else OTHER for term in terms]
    ax.barh(places, [term.inclusion for term in terms], color=colors, height=0.6)
    for place, term in zip(places, terms, strict=True):
        ax.text(
            min(term.inclusion, 1.0) + 0.02, place, f"{100 * term.inclusion:.0f} %", va="center", fontsize=8
        )
    ax.axvline(_SURE, color=MEASURED, linewidth=0.8, linestyle=":")
    ax.set_yticks(places, names)
    ax.set_ylim(max(len(names), 1) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.18)
    ax.set_xticks([0.0, 0.5, 1.0])
    ax.set_xlabel("inclusion probability (blue: in the equation)")
    ax.set_title("Terms offered by the regression" if names else "No term beside the rig's own")


def _numbers(found: Discovery) -> list[tuple[str, float]]:
    """Return name and relative standard error of every coefficient."""
    terms = [pair for term in found.kept for pair in term.coefficients.items()]
    pairs = [*found.rig_parameters.items(), *terms]
    unique = dict(pairs)
    return [
        (f"{name} = {c.value:.4g} {c.unit if c.unit != '1' else ''}".rstrip(), abs(c.std / c.value))
        for name, c in unique.items()
        if c.value != 0.0
    ]


def _draw_coefficients(ax: Axes, numbers: list[tuple[str, float]]) -> None:
    """Draw 95 % intervals relative to the values; of one that holds zero only that is said."""
    places = list(range(len(numbers)))
    known = [1.96 * error for _, error in numbers if 1.96 * error < 1.0]
    reach = max([*known, 1e-4]) * 1.2
    for place, (_, error) in zip(places, numbers, strict=True):
        width = 1.96 * error
        if not width < 1.0:
            words = "cannot be told from zero" if math.isfinite(width) else "not determined"
            ax.text(0.02 * reach * 100, place, words, va="center", fontsize=8, color=MEASURED)
            continue
        ax.plot([-100 * width, 100 * width], [place, place], color=WITH_EFFECT, linewidth=2.0)
        ax.plot(0.0, place, "o", color=WITH_EFFECT, markersize=4)
    ax.axvline(0.0, color=MEASURED, linewidth=0.8, linestyle=":")
    ax.set_yticks(places, [name for name, _ in numbers])
    ax.set_ylim(len(numbers) - 0.4, -0.6)
    ax.set_xlim(-100 * reach, 100 * reach)
    ax.set_xlabel("95 % interval [% of the value]")
    ax.set_title("Coefficients after the free-run fit")


def _draw_run(upper: Axes, lower: Axes, run: Run, found: Discovery) -> None:
    factor, unit = shown_in(found.unit, run.measured)
    line(upper, run.t, factor * run.measured, MEASURED, "measured", linewidth=1.6)
    line(upper, run.t, factor * run.simulated, WITH_EFFECT, "free run", linewidth=0.9)
    upper.set_ylabel(f"{found.output} [{unit}]")
    upper.set_title(
        f"Free run on {run.record} (held out)" if run.role == "validation" else f"Free run on {run.record}"
    )
    upper.legend(loc="upper right", ncols=2, fontsize=8)
    upper.tick_params(labelbottom=False)
    error = run.measured - run.simulated
    error_factor, error_unit = shown_in(found.unit, error)
    line(lower, run.t, error_factor * error, WITH_EFFECT, linewidth=0.7)
    lower.set_ylabel(f"error [{error_unit}]")
    lower.set_xlabel("time [s]")
    for ax in (upper, lower):
        ax.set_xlim(float(run.t[0]), float(run.t[-1]))
        ax.grid()


def _spoken(name: str) -> str:
    return name.replace("_", " ")

"""Figures of a discovery: the terms with the error without each and their intervals, and the free run against the records."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rigsight.discover import JointForce
from rigsight.discover.result import Discovery, Run, Term
from rigsight.plot.drawing import (
    MEASURED,
    OTHER,
    TWO_SIDED,
    WITH_EFFECT,
    line,
    new_figure,
    plain_log_ticks,
    shown_in,
    style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_TERMS = 12
_MOST_RUNS = 3
_MOST_JOINTS = 4
_POINTS = 4000
"""Samples of a missing force that are drawn."""


@style()
def discovery_figure(found: Discovery) -> Figure:
    """Draw the terms and the free runs of a discovery."""
    terms = [term for term in found.terms if math.isfinite(term.otherwise)][:_MOST_TERMS]
    runs = found.runs[:_MOST_RUNS]
    numbers = _numbers(found)
    joints = [(joint, "") for joint in found.joints[:_MOST_JOINTS]]
    if found.offered is not None:
        joints.append((found.offered.force, f", fitted with {found.offered.effect.name}"))
    top = 0.9 + 0.28 * max(len(terms), len(numbers), 3)
    heights = [top, 2.5 * len(runs), *(2.3 for _ in joints)]
    figure = new_figure(8.4, sum(heights))
    parts = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    left, right = parts[0].subplots(1, 2)
    _draw_terms(left, terms, found.held_out_error)
    _draw_coefficients(right, numbers)
    axes = parts[1].subplots(2 * len(runs), 1, squeeze=False, height_ratios=[3, 1.3] * len(runs))[:, 0]
    for index, run in enumerate(runs):
        _draw_run(axes[2 * index], axes[2 * index + 1], run)
    for part, (joint, fitted) in zip(parts[2:], joints, strict=True):
        _draw_joint(part.subplots(1, 2, sharey=True), joint, _spoken(fitted))
    return figure


def _draw_joint(axes: Sequence[Axes], joint: JointForce, fitted: str) -> None:
    """Draw the missing force of a joint over its displacement and its velocity, with the identified law."""
    missing = joint.missing
    some = slice(None, None, max(1, missing.force.size // _POINTS))
    factor, unit = shown_in(missing.unit, missing.force)
    motions = (
        (missing.displacement, missing.motion_unit, "x"),
        (missing.velocity, f"{missing.motion_unit}/s", "v"),
    )
    drawn = [(missing.force, MEASURED, "missing"), (joint.law, WITH_EFFECT, "law")][: 2 if joint.terms else 1]
    for ax, (motion, motion_unit, symbol) in zip(axes, motions, strict=True):
        scale, shown_unit = shown_in(motion_unit, motion)
        for values, color, label in drawn:
            ax.plot(
                scale * motion[some], factor * values[some], ".", color=color, markersize=1.0, label=label
            )
        ax.set_xlabel(f"{symbol} of {_spoken(joint.joint)} [{shown_unit}]")
        ax.grid()
    axes[0].set_ylabel(f"force [{unit}]")
    axes[0].legend(loc="upper left", fontsize=8, markerscale=6.0)
    explained = f": the law explains {joint.share_of_force:.0%}" if joint.terms else ""
    axes[0].set_title(f"Missing at {_spoken(joint.joint)}{fitted}{explained}")


def _draw_terms(ax: Axes, terms: Sequence[Term], error: float) -> None:
    """Draw the held-out error without each term of the equation, and with each other one, beside that of the equation."""
    names = [_spoken(f"{term.name} at {term.where}" if term.where else term.name) for term in terms]
    for place, term in enumerate(terms):
        word, color = ("without", WITH_EFFECT) if term.kept else ("with", OTHER)
        where = (max(term.otherwise, error), place)
        ax.plot([error, term.otherwise], [place, place], color=color, linewidth=2.0)
        ax.plot(term.otherwise, place, "o", color=color, markersize=4)
        ax.annotate(
            f"{word} {term.otherwise:.3g}", where, (5, 0), textcoords="offset points", va="center", fontsize=8
        )
    ax.axvline(error, color=MEASURED, linewidth=0.8, linestyle=":")
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(max(len(names), 1) - 0.4, -0.6)
    left, largest = 0.8 * error, max([error, *(term.otherwise for term in terms)])
    right = largest * (largest / left) ** 0.35
    ax.set_xscale("log")
    ax.set_xlim(left, right)
    plain_log_ticks(ax, left, right)
    ax.set_xlabel("held-out error [noise floors]")
    ax.set_title("Terms: error without it, or with it" if names else "No term beside the rig's own")


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
    """Draw 95 % intervals relative to the values; an interval that contains zero is replaced by a note."""
    places = list(range(len(numbers)))
    known = [TWO_SIDED * error for _, error in numbers if TWO_SIDED * error < 1.0]
    reach = max([*known, 1e-4]) * 1.2
    for place, (_, error) in zip(places, numbers, strict=True):
        width = TWO_SIDED * error
        if not width < 1.0:
            words = "not distinguishable from zero" if math.isfinite(width) else "not determined"
            ax.text(0.02 * reach * 100, place, words, va="center", fontsize=8, color=MEASURED)
            continue
        ax.plot([-100 * width, 100 * width], [place, place], color=WITH_EFFECT, linewidth=2.0)
        ax.plot(0.0, place, "o", color=WITH_EFFECT, markersize=4)
    ax.axvline(0.0, color=MEASURED, linewidth=0.8, linestyle=":")
    ax.set_yticks(places, [name for name, _ in numbers])
    ax.set_ylim(len(numbers) - 0.4, -0.6)
    ax.set_xlim(-100 * reach, 100 * reach)
    ax.set_xlabel("95 % interval [% of the value]")
    ax.set_title("Coefficients")


def _draw_run(upper: Axes, lower: Axes, run: Run) -> None:
    factor, unit = shown_in(run.unit, run.measured)
    line(upper, run.t, factor * run.measured, color=MEASURED, label="measured", linewidth=1.6)
    line(upper, run.t, factor * run.simulated, color=WITH_EFFECT, label="free run", linewidth=0.9)
    held_out = " (held out)" if run.role == "validation" else ""
    upper.set(title=f"Free run on {run.record}{held_out}", ylabel=f"{run.output} [{unit}]")
    upper.legend(loc="upper right", ncols=2, fontsize=8)
    upper.tick_params(labelbottom=False)
    error = run.measured - run.simulated
    error_factor, error_unit = shown_in(run.unit, error)
    line(lower, run.t, error_factor * error, color=WITH_EFFECT, linewidth=0.7)
    lower.set(xlabel="time [s]", ylabel=f"error [{error_unit}]")
    for ax in (upper, lower):
        ax.set_xlim(float(run.t[0]), float(run.t[-1]))
        ax.grid()


def _spoken(name: str) -> str:
    return name.replace("_", " ")

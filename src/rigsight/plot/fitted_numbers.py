"""Figures of what was fitted: parameters over the amplitude and by group of records, and the equations of a discovery."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.discover.result import Discovery, JointForce, Run, Term
from rigsight.metrics import TWO_SIDED
from rigsight.plot.drawing import (
    GIVEN,
    MEASURED,
    OTHER,
    PAGE_WIDTH,
    WITH_EFFECT,
    display_scale,
    line,
    new_figure,
    panel_grid,
    plain_log_ticks,
    shown_in,
    style,
    with_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COMMON: dict[str, Any] = {"color": MEASURED, "linewidth": 1.2, "linestyle": (0, (4, 2))}
"""The line of the common estimate."""
_MARKERS = {"sweep": "o", "multisine": "D", "step": "s", "operation": "^"}
_LONGEST_LABEL = 16
_STYLES = {False: (WITH_EFFECT, "o", "the same within errors"), True: (GIVEN, "D", "differs")}
"""Color, marker and label by whether a number differs between groups."""
_MOST_TERMS = 12
_MOST_RUNS = 3
_MOST_JOINTS = 4
_POINTS = 4000
"""Samples of a missing force that are drawn."""


@dataclass(frozen=True)
class AmplitudePoint:
    """A parameter estimated from one record; `std` is NaN if it is not known."""

    amplitude: float
    kind: str
    value: float
    std: float


@dataclass(frozen=True)
class AmplitudePanel:
    """One parameter over the amplitude."""

    name: str
    unit: str
    points: tuple[AmplitudePoint, ...]  # one per record
    # Value and standard error of the joint set; None where there is none.
    common: tuple[float, float] | None = None


@dataclass(frozen=True)
class GroupPanel:
    """One parameter in several groups of records."""

    name: str
    unit: str
    by: str  # what groups are of, such as ``"record"``
    groups: tuple[tuple[str, float, float], ...]  # label, value and standard error of each group, in order
    common: tuple[float, float]  # value and standard error of the common fit
    differs: bool  # whether groups differ beyond chance


@style()
def amplitude_dependence(panels: Sequence[AmplitudePanel], input_label: str) -> Figure:
    """Draw each parameter over the amplitude with 95 % intervals, and the joint set as a line."""
    columns = min(3, len(panels))
    figure = new_figure(3.05 * columns, 0.55 + 2.15 * -(-len(panels) // columns))
    axes = panel_grid(figure, len(panels), columns)
    for ax, panel in zip(axes, panels, strict=True):
        _draw_over_amplitude(ax, panel)
        ax.set_xlabel(input_label)
    handles, labels = [], []
    for kind in dict.fromkeys(point.kind for panel in panels for point in panel.points):
        handles += axes[0].plot([], [], color=WITH_EFFECT, marker=_MARKERS.get(kind, "o"), linestyle="none")
        labels.append(f"{kind}, 95 % interval")
    if any(panel.common is not None for panel in panels):
        handles += axes[0].plot([], [], **_COMMON)
        labels.append("one set for all records")
    figure.legend(handles, labels, loc="outside upper left", ncols=len(handles), fontsize=8.5)
    return figure


def _draw_over_amplitude(ax: Axes, panel: AmplitudePanel) -> None:
    from matplotlib.ticker import MaxNLocator

    scale = display_scale(panel.unit, max(abs(point.value) for point in panel.points))
    for kind in dict.fromkeys(point.kind for point in panel.points):
        own = sorted((p for p in panel.points if p.kind == kind), key=lambda p: p.amplitude)
        x = np.array([point.amplitude for point in own])
        values = scale.factor * np.array([point.value for point in own])
        reach = TWO_SIDED * scale.factor * np.array([p.std if math.isfinite(p.std) else 0.0 for p in own])
        ax.plot(x, values, color=OTHER, linewidth=0.8, zorder=1)
        ax.errorbar(
            x, values, reach, color=WITH_EFFECT, linestyle="none", marker=_MARKERS.get(kind, "o"), markersize=5, capsize=3
        )  # fmt: skip
    if panel.common is not None:
        ax.axhline(scale.factor * panel.common[0], **_COMMON)
    ax.set_title(with_unit(panel.name, scale.unit))
    ax.margins(x=0.12, y=0.15)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    # The offset text would overlap the title.
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.grid()


@style()
def parameters_by_group(panels: Sequence[GroupPanel]) -> Figure:
    """Draw each parameter as groups alone have it, with 95 % intervals, against the common estimate."""
    columns = min(2, len(panels))
    in_row = [panels[first : first + columns] for first in range(0, len(panels), columns)]
    heights = [max(len(panel.groups) for panel in row) for row in in_row]
    figure = new_figure(PAGE_WIDTH, 0.45 + sum(0.75 + 0.2 * height for height in heights))
    axes = panel_grid(figure, len(panels), columns, height_ratios=[3.5 + height for height in heights])
    for ax, panel in zip(axes, panels, strict=True):
        _draw_groups(ax, panel)
    handles, labels = [], []
    for differs, (color, marker, label) in _STYLES.items():
        if any(panel.differs is differs for panel in panels):
            handles += axes[0].plot([], [], color=color, marker=marker, linestyle="none")
            labels.append(label)
    handles += axes[0].plot([], [], **_COMMON)
    figure.legend(handles, [*labels, "common fit"], loc="outside upper left", ncols=3, fontsize=8.5)
    return figure


def _draw_groups(ax: Axes, panel: GroupPanel) -> None:
    from matplotlib.ticker import MaxNLocator

    scale = display_scale(panel.unit, max(abs(value) for _, value, _ in panel.groups))
    color, marker = _STYLES[panel.differs][:2]
    places = np.arange(len(panel.groups))
    values = scale.factor * np.array([value for _, value, _ in panel.groups])
    reach = TWO_SIDED * scale.factor * np.array([std for _, _, std in panel.groups])
    common, error = (scale.factor * number for number in panel.common)
    if np.isfinite(error):
        half = TWO_SIDED * error
        ax.axvspan(common - half, common + half, color=MEASURED, alpha=0.15, linewidth=0)
    ax.axvline(common, **_COMMON)
    ax.errorbar(
        values, places, xerr=reach, color=color, linestyle="none", marker=marker, markersize=4.5, capsize=3
    )
    ax.set_yticks(
        places,
        [
            label if len(label) <= _LONGEST_LABEL else f"{label[: _LONGEST_LABEL - 1]}\u2026"
            for label, _, _ in panel.groups
        ],
    )
    ax.set_ylim(len(panel.groups) - 0.4, -0.6)
    ax.set_title(f"{with_unit(panel.name, scale.unit)} by {panel.by}")
    ax.margins(x=0.08)
    ax.xaxis.set_major_locator(MaxNLocator(2))
    # The offset text would be away from the values it belongs to.
    ax.ticklabel_format(axis="x", useOffset=False)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x")


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

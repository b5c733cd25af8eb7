"""Figures of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.diagnose.location.trace import Stage, Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.plot.drawing import (
    FLOOR,
    FLOOR_LINE,
    GIVEN,
    MEASURED,
    OTHER,
    PAGE_WIDTH,
    REIDENTIFIED,
    STAGE_STYLES,
    WITH_EFFECT,
    line,
    new_figure,
    plain_log_ticks,
    set_margins,
    shown_in,
    style,
    text_width,
    with_unit,
)
from rigsight.records.record import Floats
from rigsight.records.stamps import time_label, time_origin

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = 9.0
"""Size of letters beside bars [points]."""
_ERRORS = 8.5
"""Size of letters of an error at the end of its bar [points]."""
_OFF_BAR = 4.0
"""Distance of an error from the end of its bar [points]."""
_LONGEST_NAME = 42
"""Letters of a name on one line."""
_FURTHER_LINE = 0.5
"""Height of each further line, in rows."""
_DETAIL_PERIODS = 5.0
_DETAIL_SHARE = 1.0 / 12.0
_DETAIL_MIN_SAMPLES = 60
_SETTLED = 0.05
"""Remaining share of the change at which a step counts as settled."""
_RINGING = 5.0
"""Multiple of the measured settling time up to which the ringing of a simulation is shown."""
_NOISE_REACHES = 5.0
"""Standard deviations that noise does not exceed in some thousand samples."""
_BINS = 250
"""Bins of a line in print, where the axis of a whole record is some 110 mm wide."""


def step_window(trace: Trace, output: str) -> slice | None:
    """Return the samples from just before the largest jump of the input until the output has settled; None without a jump."""
    if trace.kind != "step" or not trace.inputs:
        return None
    jumps = np.abs(np.diff(next(iter(trace.inputs.values()))))
    largest = float(np.max(jumps, initial=0.0))
    if not largest > 0.0:
        return None
    start = int(np.argmax(jumps)) + 1
    later = np.flatnonzero(jumps[start:] > 0.5 * largest)
    stop = start + int(later[0]) + 1 if later.size else trace.t.size
    settled = _settling(trace.measured[output][start:stop])
    # A simulation that keeps ringing is shown too, but not so long that the step itself becomes too narrow.
    slowest = max(_settling(source[output][start:stop]) for source in (trace.before, trace.after))
    length = max(_DETAIL_MIN_SAMPLES, round(1.25 * min(max(settled, slowest), _RINGING * settled)))
    return slice(max(0, start - length // 8), min(stop, start + length))


def _settling(after: Floats) -> int:
    """Return the number of samples after a step until what follows stays near its end."""
    known = np.nan_to_num(after)
    rest = known[-max(1, known.size // 10) :]
    away = np.abs(known - np.mean(rest))
    # Differences of neighboring samples are noise even if the rest oscillates slowly.
    noise = float(np.std(np.diff(rest))) / np.sqrt(2.0) if rest.size > 1 else 0.0
    moving = np.flatnonzero(away > max(_SETTLED * float(np.max(away)), _NOISE_REACHES * noise))
    return int(moving[-1]) + 1 if moving.size else 1


def detail_window(trace: Trace, output: str) -> slice:
    """Return the samples for an enlarged view.

    Of a step, the step; of other records those around the largest error of the given simulation: about five periods, or less of a
    short record.
    """
    step = step_window(trace, output)
    if step is not None:
        return step
    residual = trace.measured[output] - trace.before[output]
    n = residual.size
    wide = _largest(residual, min(n, max(_DETAIL_MIN_SAMPLES, round(_DETAIL_SHARE * n))))
    length = wide.stop - wide.start
    part = np.nan_to_num(trace.measured[output][wide])
    power = np.abs(np.fft.rfft((part - np.mean(part)) * np.hanning(part.size))) ** 2
    # A dominant line below the second is a slow wave of which the whole window shows about one period.
    line = int(np.argmax(power)) if power.size else 0
    if line > _DETAIL_PERIODS:
        length = max(_DETAIL_MIN_SAMPLES, round(_DETAIL_PERIODS * length / line))
    return _largest(residual, min(n, length))


def _largest(residual: Floats, length: int) -> slice:
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(residual, posinf=0.0, neginf=0.0) ** 2)])
    start = int(np.argmax(total[length:] - total[: total.size - length]))
    return slice(start, start + length)


@style()
def gap_budget(diagnosis: Diagnosis, after_label: str, labels: Mapping[str, str], is_given: bool) -> Figure:
    """Draw the gap of each output as a waterfall: given, explained by parameters and by the effect, remaining, noise floor."""
    outputs = list(diagnosis.gap)
    figure = new_figure(PAGE_WIDTH, 0.45 + 1.75 * max(1, len(outputs)), layout=None)
    axes = figure.subplots(max(1, len(outputs)), 1, squeeze=False)[:, 0]
    names = ["Refitting its parameters" if is_given else "Identified", after_label]
    margins = 0.14 + text_width(names, _NAMES), 0.1
    for ax, output in zip(axes, outputs, strict=False):
        gap = diagnosis.gap[output]
        steps = [("Identified", 0.0, gap.reidentified, REIDENTIFIED)]
        if is_given:
            steps = [
                ("Given simulation", 0.0, gap.before, GIVEN),
                ("Refitting its parameters", gap.before, gap.reidentified, REIDENTIFIED),
            ]
        if diagnosis.effects:
            steps.append((after_label, gap.reidentified, gap.after, WITH_EFFECT))
        if len(steps) > 1:
            steps.append(("Remaining", 0.0, gap.after if diagnosis.effects else gap.reidentified, MEASURED))
        finite = [100.0 * v for v in (gap.before, gap.reidentified, gap.after) if np.isfinite(v)]
        right = max([*finite, 100.0 * gap.noise_floor if np.isfinite(gap.noise_floor) else 0.0, 1e-12])
        errors = [
            _waterfall_step(
                ax, row, 100.0 * start, 100.0 * stop, color, is_total=row == 0 or name == "Remaining"
            )
            for row, (name, start, stop, color) in enumerate(steps)
        ]
        if np.isfinite(gap.noise_floor):
            ax.axvline(100.0 * gap.noise_floor, **FLOOR_LINE)
            ax.annotate(
                f"noise floor {100.0 * gap.noise_floor:.2g} %",
                (100.0 * gap.noise_floor, 1.0), (3, 1), xycoords=("data", "axes fraction"), textcoords="offset points",
                fontsize=8, color=FLOOR, va="bottom",
            )  # fmt: skip
        ax.set_yticks(range(len(steps)), [step[0] for step in steps])
        ax.set_ylim(len(steps) - 0.45, -0.6)
        ax.set_xlim(0.0, right / (1.0 - _share_of_axis(errors, margins)))
        ax.tick_params(axis="y", length=0)
        ax.set_title(labels[output], pad=14)
        ax.grid(axis="x")
    axes[-1].set_xlabel("gap [% of the measured RMS]")
    set_margins(figure, *margins, 0.48, 0.42, between=(0.0, 0.66))
    return figure


def _waterfall_step(ax: Axes, row: int, start: float, stop: float, color: str, *, is_total: bool) -> str:
    """Draw a bar with its error beside it, and return this."""
    if not (np.isfinite(start) and np.isfinite(stop)):
        _beside_bar(ax, "not finite", 0.0, row)
        return "not finite"
    low, high = sorted((start, stop))
    ax.barh(row, high - low, left=low, height=0.62, color=color)
    text = f"{stop:.3g} %" if is_total else f"{'−' if stop <= start else '+'}{abs(stop - start):.3g} %"
    _beside_bar(ax, text, high, row)
    return text


def _beside_bar(ax: Axes, text: str, end: float, row: float) -> None:
    ax.annotate(
        text,
        (end, row),
        (_OFF_BAR, 0),
        textcoords="offset points",
        va="center",
        fontsize=_ERRORS,
        color=FLOOR,
    )


def _share_of_axis(errors: Sequence[str], margins: tuple[float, float]) -> float:
    """Return the share of an axis that the longest error takes beside its bar; margins [inch]."""
    room = text_width([f"{error} " for error in errors], _ERRORS) + _OFF_BAR / 72.0
    return room / (PAGE_WIDTH - sum(margins))


@style()
def ranking(diagnosis: Diagnosis, names: Sequence[str], limit: int = 16) -> Figure:
    """Draw the error of each candidate on the validation records, in units of the noise floor on a logarithmic axis."""
    candidates = diagnosis.candidates[:limit]
    shown = [fill(name, _LONGEST_NAME) for name in names[: len(candidates)]]
    # A name of several lines needs a higher row; rows are counted from the top edge of the first.
    heights = [1.0 + _FURTHER_LINE * name.count("\n") for name in shown] or [1.0]
    rows = np.cumsum(heights) - 0.5 * np.array(heights)
    figure = new_figure(PAGE_WIDTH, 0.85 + 0.27 * sum(heights), layout=None)
    ax = figure.subplots()
    finite = [
        c.error_over_noise for c in candidates if np.isfinite(c.error_over_noise) and c.error_over_noise > 0.0
    ]
    left, right = min([1.0, *finite]) / 1.04, max([1.5, *finite])
    tied = set(diagnosis.ambiguous_with)
    for row, candidate in zip(rows, candidates, strict=False):
        if not (np.isfinite(candidate.error_over_noise) and candidate.error_over_noise > 0.0):
            ax.annotate("could not be scored", (max(left, 1.0), row), (6, 0), textcoords="offset points",
                        va="center", fontsize=8, color=MEASURED)  # fmt: skip
            continue
        is_named = bool(diagnosis.effects) and candidate.effects == diagnosis.effects
        color = WITH_EFFECT if is_named else OTHER
        hatch = "////" if candidate.effects in tied else None
        error = candidate.error_over_noise
        ax.barh(row, error - left, left=left, height=0.62, color=color, hatch=hatch, edgecolor="white")
        _beside_bar(ax, f"{error:.3g} ×", max(error, left), row)
    ax.set_xscale("log")
    lines = [line for name in shown for line in name.split("\n")]
    margins = 0.14 + text_width(lines, _NAMES), 0.1
    room = _share_of_axis([f"{error:.3g} ×" for error in finite], margins)
    ax.set_xlim(left, right * (right / left) ** (room / (1.0 - room)))
    plain_log_ticks(ax, left, right)
    ax.axvline(1.0, **FLOOR_LINE)
    ax.set_yticks(rows[: len(shown)], shown)
    ax.set_ylim(sum(heights) + 0.05, -0.05)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x")
    ax.set_xlabel("residual RMS / noise floor")
    set_margins(figure, *margins, 0.48, 0.08)
    return figure


@style()
def comparison(diagnosis: Diagnosis, trace: Trace, output: str, stages: Mapping[Stage, str]) -> Figure:
    """Draw measured against simulated at some stages, with the residuals below."""
    from matplotlib.ticker import MaxNLocator

    t = trace.t - time_origin(trace.t)
    measured = np.asarray(trace.measured[output], dtype=np.float64)
    errors: dict[Stage, Floats] = {stage: -trace.residual(stage, output) for stage in stages}
    factor, unit = shown_in(diagnosis.units.get(output, ""), measured)
    error_factor, error_unit = shown_in(diagnosis.units.get(output, ""), *errors.values())

    figure = new_figure(6.6, 3.9, layout=None)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    set_margins(figure, 0.66, 0.14, 0.46, 0.34, between=(0.0, 0.15))
    line(top, t, measured * factor, _BINS, color=MEASURED, label="measured", linewidth=2.6, alpha=0.55)
    for stage, error in errors.items():
        look = STAGE_STYLES[stage]
        line(top, t, (measured + error) * factor, _BINS, label=stages[stage], linewidth=1.0, **look)
        line(bottom, t, error * error_factor, _BINS, color=look["color"], linewidth=0.8)
    floor = next((f.std for f in diagnosis.noise_floors if f.output == output), None)
    if floor is not None and np.isfinite(floor):
        reach = 2 * floor * error_factor
        bottom.axhspan(-reach, reach, color=FLOOR, alpha=0.12, linewidth=0)
    top.set_ylabel(f"{output} [{unit}]")
    bottom.set_ylabel(f"error [{error_unit}]")
    bottom.set_xlabel(time_label(trace.t))
    for ax in (top, bottom):
        ax.grid()
        ax.margins(x=0.0)
        ax.yaxis.set_major_locator(MaxNLocator(5))
        ax.xaxis.set_major_locator(MaxNLocator(9))
    figure.legend(loc="upper left", ncols=3, fontsize=8.5, handlelength=2.2, columnspacing=1.4)
    return figure


@dataclass(frozen=True, eq=False)
class ForceLoop:
    """A stretch of motion and the force over it."""

    # Names of the signals.
    motion: str
    force: str
    # SI units.
    motion_unit: str
    force_unit: str
    # Shape (n_samples,).
    displacement: Floats
    velocity: Floats
    measured: Floats
    simulated: Mapping[Stage, Floats]  # stage -> its force, shape (n_samples,)


@style()
def force_loops(loop: ForceLoop, stages: Mapping[Stage, str]) -> Figure:
    """Draw the force over displacement and, beside it, over velocity: measured, and each stage."""
    from matplotlib.ticker import MaxNLocator

    figure = new_figure(PAGE_WIDTH, 2.9, layout=None)
    axes = figure.subplots(1, 2, sharey=True)
    set_margins(figure, 0.75, 0.15, 0.46, 0.36, between=(0.18, 0.0))
    factor, unit = shown_in(loop.force_unit, loop.measured)
    # A diverging simulation leaves the axes, so that the other curves stay readable.
    low, high = factor * float(np.nanmin(loop.measured)), factor * float(np.nanmax(loop.measured))
    reach = 0.3 * (high - low) or 1.0
    simulated = [factor * force[np.isfinite(force)] for force in loop.simulated.values()]
    bottom = max(low - reach, min([low, *(float(np.min(own, initial=low)) for own in simulated)]))
    top = min(high + reach, max([high, *(float(np.max(own, initial=high)) for own in simulated)]))
    measured: dict[str, Any] = {"color": MEASURED, "linewidth": 2.6, "alpha": 0.55}
    across = (
        (loop.displacement, loop.motion, loop.motion_unit),
        (loop.velocity, f"rate of {loop.motion}", f"{loop.motion_unit}/s"),
    )
    for ax, (places, name, places_unit) in zip(axes, across, strict=True):
        scale, shown = shown_in(places_unit, places)
        ax.plot(scale * places, factor * loop.measured, label="measured", **measured)
        for stage, label in stages.items():
            # Points that are not finite leave a gap.
            force = np.where(np.isfinite(loop.simulated[stage]), loop.simulated[stage], np.nan)
            ax.plot(scale * places, factor * force, linewidth=1.1, label=label, **STAGE_STYLES[stage])
        ax.set_xlabel(with_unit(name, shown))
        ax.xaxis.set_major_locator(MaxNLocator(4))
        ax.grid()
    axes[0].set_ylim(bottom - 0.05 * (top - bottom), top + 0.05 * (top - bottom))
    axes[0].set_ylabel(with_unit(loop.force, unit))
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="upper left", ncols=4, fontsize=8.5, handlelength=2.2, columnspacing=1.4
    )
    return figure

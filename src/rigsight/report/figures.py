"""Figures of the page: pictures as SVG or PNG and charts as data; the rig with suspected places, loops of force over motion."""

from __future__ import annotations

import base64
import json
import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup, escape

from rigsight import plot
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import Place, kind_of
from rigsight.records.record import Floats
from rigsight.records.stamps import written_span
from rigsight.report.labels import effect_label, gap_percent, listed, rig_of, sentence_case
from rigsight.report.wording import stage_names
from rigsight.rigs import Rig, reading_symbol
from rigsight.simulate.prescribed_motion import smooth_motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LARGEST_SVG = 300_000
_PNG_DPI = 220
_ID = re.compile(r' id="([^"]+)"')
_REFERENCE = re.compile(r'(url\(#|xlink:href="#)([^")]+)')
_NOISE = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_NAMESPACES = re.compile(r' xmlns(:xlink)?="[^"]*"')
_SIZE = re.compile(r' (width|height)="[^"]*"')
_PATH = re.compile(r'(?<=\bd=")[^"]+')
_PLACE = re.compile(r'(?<= [xy]=")[^"]+')
_BEFORE_LETTER = re.compile(r" ?([A-Za-z]) ?")
_BETWEEN_TAGS = re.compile(r">\s+<")
_FURTHER_DIGITS = re.compile(r"(\.\d\d)\d+")
_LEAST = 0.05
"""Probability from which another candidate's place is colored; below it, it is no rival (95 % are accounted for)."""
_UNEXPLAINED = "unexplained"
_PERIODS = 4
"""Of the motion in a picture: enough to see whether the loop repeats."""
_MOST_OF_LOOP = 900
"""Points of a curve; a loop of a few periods needs no more."""
_MOST_WITHOUT_AMPLITUDE = 4
"""Records shown where none states its amplitude."""
_DIGITS = 5
"""Of a curve's range: more than a screen shows."""
_PAGE_NUMBERS = 170_000
"""Of all curves over time in a page: about 1.2 MB as text."""
_MOST_POINTS, _FEWEST_POINTS = 6_000, 600


@dataclass(frozen=True)
class PageFigure:
    """A figure in the page."""

    key: str  # its id, unique in the page
    image: Markup  # ``<svg>`` or ``<img>``
    caption: str  # what it shows, for everyone


def page_figure(figure: Figure, key: str, alt: str, caption: str) -> PageFigure:
    """Return a figure for the page."""
    image = _svg(figure, key, alt)
    if len(image) > _LARGEST_SVG:
        data = base64.b64encode(plot.png_bytes(figure, _PNG_DPI)).decode("ascii")
        image = Markup('<img alt="{}" src="data:image/png;base64,{}">').format(alt, data)
    return PageFigure(key, image, caption)


def _svg(figure: Figure, key: str, alt: str) -> Markup:
    text = plot.svg_text(figure, key)
    text = _NOISE.sub("", text[text.index("<svg") :])
    text = _NAMESPACES.sub("", text)
    # Ids of matplotlib repeat from figure to figure; in one page they must not. Most of them nothing refers to.
    needed = {name for _, name in _REFERENCE.findall(text)}
    text = _ID.sub(lambda found: f' id="{key}-{found[1]}"' if found[1] in needed else "", text)
    text = _REFERENCE.sub(rf"\g<1>{key}-\2", text).replace("xlink:href", "href")
    # The page decides how large a figure is: the first two sizes are those of the figure itself.
    text = _SIZE.sub("", text, count=2)
    # A hundredth of a point is finer than any screen or printer; matplotlib writes a millionth.
    text = _PLACE.sub(lambda place: _FURTHER_DIGITS.sub(r"\1", place[0]), _PATH.sub(_short_path, text))
    text = _BETWEEN_TAGS.sub("><", text)
    # The page's own sans serif face, where DejaVu is missing.
    text = text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    label = escape(alt)
    return Markup(text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1).strip())


def _short_path(path: re.Match[str]) -> str:
    return _BEFORE_LETTER.sub(r"\1", _FURTHER_DIGITS.sub(r"\1", " ".join(path[0].split())))


def rig_figure(diagnosis: Diagnosis) -> PageFigure | None:
    """Return the picture of the rig with the suspected places marked; None for a rig that nothing declares."""
    rig = rig_of(diagnosis)
    if rig is None:
        return None
    marks = suspected_places(diagnosis, rig)
    named = [f"{mark.label} at {name}" for name, mark in marks.items() if mark.label]
    return page_figure(
        plot.rig_picture(rig, marks),
        "figure-rig",
        f"Schematic of the rig.{f' Marked: {listed(named)}.' if named else ''}",
        _rig_caption(marks, rig),
    )


def suspected_places(diagnosis: Diagnosis, rig: Rig) -> dict[str, plot.PlaceMark]:
    """Return how strongly each joint, drive, sensor or state of a rig is suspected."""
    # What the verdict names has strength 1; a rival has the probability of the candidates that act there.
    strengths: dict[tuple[str, bool], float] = {}
    labels: dict[tuple[str, bool], dict[str, None]] = {}
    for candidate in diagnosis.candidates:
        for place in {place for where in candidate.where for place in _named(rig, where)}:
            strengths[place] = strengths.get(place, 0.0) + candidate.probability
    causes = [effect_label(kind_of(effect)) for effect in diagnosis.effects]
    if diagnosis.verdict == "unknown":
        causes = [_UNEXPLAINED] * len(diagnosis.where)
    for cause, where in zip(causes, diagnosis.where, strict=False):
        for place in _named(rig, where):
            strengths[place] = 1.0
            labels.setdefault(place, {})[cause] = None
    return {
        name: plot.PlaceMark(min(strength, 1.0), listed(labels.get((name, is_state), ())), is_state)
        for (name, is_state), strength in sorted(strengths.items(), key=lambda item: item[1])
        if strength >= _LEAST
    }


def _named(rig: Rig, where: str) -> list[tuple[str, bool]]:
    """Return what a place in results is in the rig: its own name, or that of the kind of place."""
    for kind in Place:
        names = rig.places(kind)
        if where in names:
            return [(where, kind is Place.LATERAL_DYNAMICS)]
        if where == kind.value and names:
            return [(names[0], kind is Place.LATERAL_DYNAMICS)]
    return []


def _rig_caption(marks: Mapping[str, plot.PlaceMark], rig: Rig) -> str:
    reported = "The rig: drives and sensors on the left, what moves in the middle, joints to the ground on the right."
    laws = [*(drive.signal for drive in rig.mechanism.drives), *rig.mechanism.signals.values()]
    if any(
        reading_symbol(sensor.name) in law.free_symbols for sensor in rig.mechanism.sensors for law in laws
    ):
        reported += " Dashed: read by a control law."
    named = [name for name, mark in marks.items() if mark.label]
    others = [name for name, mark in marks.items() if not mark.label]
    if named:
        reported += f" Marked: {listed(named)}."
    if others:
        reported += f" Paler, also possible: {listed(others)}."
    return reported


def loop_figures(diagnosis: Diagnosis) -> list[PageFigure]:
    """Return the force over displacement and over velocity: a figure per amplitude, none of a rig that is driven."""
    # Of several records with the same amplitude the one that was scored is shown, else the first. Records without an amplitude
    # are shown one by one.
    rig = rig_of(diagnosis)
    if rig is None or rig.is_driven or not rig.has_one_motion or diagnosis.windows is not None:
        return []
    motion, force = rig.inputs[0].name, rig.outputs[0].name
    able = [trace for trace in diagnosis.traces if motion in trace.inputs and force in trace.measured]
    known = sorted(
        (trace for trace in able if trace.amplitude is not None),
        key=lambda trace: (trace.amplitude, trace.role != diagnosis.scored_on),
    )
    shown = list({trace.amplitude: trace for trace in reversed(known)}.values())[::-1]
    shown += [trace for trace in able if trace.amplitude is None][:_MOST_WITHOUT_AMPLITUDE]
    return [
        _loop_figure(diagnosis, trace, motion, force, f"figure-loops-{number}")
        for number, trace in enumerate(shown, start=1)
    ]


def _loops(displacement: Floats, error: Floats) -> slice:
    """Return the few whole periods of the motion in which the error is largest; all samples where there are no more."""
    away = displacement - np.mean(displacement)
    # The sign of the motion with a dead band: noise about the middle is no turn.
    clear = np.flatnonzero(np.abs(away) > 0.3 * float(np.std(away)))
    forward = away[clear] > 0.0
    starts = clear[1:][forward[1:] & ~forward[:-1]]
    if starts.size <= 2 * _PERIODS:
        return slice(0, displacement.size)
    power = np.concatenate([[0.0], np.cumsum(np.nan_to_num(error, posinf=0.0, neginf=0.0) ** 2)])
    first, last = starts[:-_PERIODS], starts[_PERIODS:]
    worst = int(np.argmax((power[last] - power[first]) / (last - first)))
    return slice(int(first[worst]), int(last[worst]) + 1)


def _loop_figure(diagnosis: Diagnosis, trace: Trace, motion: str, force: str, key: str) -> PageFigure:
    stages = stage_names(diagnosis)
    whole = np.asarray(trace.inputs[motion], dtype=np.float64)
    displacement, velocity = smooth_motion(whole, trace.dt)
    window = _loops(displacement, trace.residual(next(iter(stages)), force))
    shown = np.arange(window.start, window.stop)
    shown = shown[:: -(-shown.size // _MOST_OF_LOOP)]
    measured = trace.measured[force]
    loop = plot.ForceLoop(
        motion,
        force,
        diagnosis.units.get(motion, ""),
        diagnosis.units.get(force, ""),
        displacement[shown],
        velocity[shown],
        measured[shown],
        {stage: (measured - trace.residual(stage, force))[shown] for stage in stages},
    )
    part = np.asarray(measured[window], dtype=np.float64)
    spread = float(np.std(part)) or 1.0
    errors = listed(
        f"{name} {gap_percent(float(np.sqrt(np.mean(trace.residual(stage, force)[window] ** 2))) / spread)}"
        for stage, name in stages.items()
    )
    half = 0.5 * float(np.ptp(displacement[window]))
    scale = plot.display_scale(diagnosis.units.get(motion, ""), half)
    what = f"{force} over {motion} and over its rate, record {trace.record}, motion of ±{half * scale.factor:.3g} {scale.unit}"
    place = written_span(float(trace.t[window.start]), float(trace.t[window.stop - 1]))
    if window.stop - window.start < whole.size:
        place += f", where the error is largest, {next(iter(stages.values()))}"
    return page_figure(
        plot.force_loops(loop, stages),
        key,
        f"Loops of {what}, measured and simulated. NRMSE there: {errors}.",
        f"{sentence_case(what)}: {place}. NRMSE there: {errors}.",
    )


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a panel, or the area between two."""

    of: str  # what it shows, which decides its color: ``"measured"``, a stage of the diagnosis, or ``"floor"``
    name: str  # in the legend
    y: Floats | None = None  # None for an area
    # Limits of an area, one for all points or one per point; None for a line.
    low: Floats | float | None = None
    high: Floats | float | None = None


@dataclass(frozen=True, eq=False)
class ChartPanel:
    """One of the panels over each other that share an axis."""

    label: str  # quantity and unit
    share: int  # height relative to the other panels
    curves: Sequence[Curve]  # what is drawn; areas first, since they lie below
    cap: tuple[float, float]  # values beyond which nothing needs to be seen
    degrees: bool = False  # true if the values are angles in degrees


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
    x: Floats,
    panels: Sequence[ChartPanel],
    *,
    log: bool = False,
    detail: Mapping[str, Any] | None = None,
) -> Markup:
    """Return curves over an axis as JSON for the page's script, with limits, label and title of a part worth looking at."""
    content = {
        "title": title,
        "label": label,
        "log": log,
        "x": [float(f"{place:.9g}") for place in x],
        "detail": detail,
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


def _numbers(values: Floats) -> list[float | None]:
    """Return numbers with the digits that are seen; None for what is not finite, for which JSON has no word."""
    known = values[np.isfinite(values)]
    reach = float(np.ptp(known)) or abs(float(known[0])) if known.size else 0.0
    places = _DIGITS - math.ceil(math.log10(reach)) if reach else 0
    # Numpy multiplies by a power of ten before it rounds, which overflows for the smallest floats.
    shown = np.round(values, places) if places < sys.float_info.max_10_exp else values
    return [value if math.isfinite(value) else None for value in shown.tolist()]

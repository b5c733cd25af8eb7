"""Which places of the rig does a diagnosis suspect? The rig's picture with them marked."""

from __future__ import annotations

from collections.abc import Mapping

from rigsight import plot
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import Place, kind_of
from rigsight.report.drawing.figures import PageFigure, page_figure
from rigsight.report.wording import effect_label, listed
from rigsight.rigs import Rig, declared_rig, reading_symbol

_LEAST = 0.05
"""Probability from which another candidate's place is colored; below it, it is no rival (95 % are accounted for)."""
_UNEXPLAINED = "unexplained"


def rig_figure(diagnosis: Diagnosis) -> PageFigure | None:
    """Return the picture of the rig with the suspected places marked; None for a rig that nothing declares."""
    rig = declared_rig(diagnosis.rig, diagnosis.model.get("declaration", {}))
    if rig is None:
        return None
    marks = suspected_places(diagnosis, rig)
    named = [f"{mark.label} at {name}" for name, mark in marks.items() if mark.label]
    return page_figure(
        plot.rig_picture(rig, marks),
        "figure-rig",
        f"Schematic of the rig.{f' Marked: {listed(named)}.' if named else ''}",
        _caption(marks, rig),
    )


def suspected_places(diagnosis: Diagnosis, rig: Rig) -> dict[str, plot.PlaceMark]:
    """Return how strongly each joint, drive, sensor or state of a rig is suspected.

    What the verdict names has strength 1; a rival has the probability of the candidates that act there.
    """
    strengths: dict[tuple[str, bool], float] = {}
    labels: dict[tuple[str, bool], list[str]] = {}
    for candidate in diagnosis.candidates:
        for place in {place for where in candidate.where for place in _named(rig, where)}:
            strengths[place] = strengths.get(place, 0.0) + candidate.probability
    for effect, where in zip(diagnosis.effects, diagnosis.where, strict=False):
        for place in _named(rig, where):
            strengths[place] = 1.0
            labels.setdefault(place, []).append(effect_label(kind_of(effect)))
    if diagnosis.verdict == "unknown":
        for name in diagnosis.where:
            for place in _named(rig, name):
                strengths[place] = 1.0
                labels[place] = [_UNEXPLAINED]
    return {
        name: plot.PlaceMark(min(strength, 1.0), listed(labels.get((name, is_state), [])), is_state)
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


def _caption(marks: Mapping[str, plot.PlaceMark], rig: Rig) -> str:
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

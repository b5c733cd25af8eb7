"""In which section of the signal path does the gap arise? Each section is driven by its measured input.

A delay before the motion does not affect the lateral section. A delay of the motion sensor shifts it the other way: the motion is
measured late, so y seems early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.location.gap_parts import PathPart
from rigsight.diagnose.location.lateral_leg import LateralLeg, fit_lateral_leg
from rigsight.diagnose.policy import NOTES, VERDICT
from rigsight.effects import Place
from rigsight.metrics import rms
from rigsight.records.record import Record
from rigsight.rigs import Rig


def path_parts(
    context: FitContext, before: FittedModel, reidentified: FittedModel, after: FittedModel
) -> tuple[PathPart, ...]:
    """Return the error of every section of the signal path when it is driven by its measured input."""
    rig = context.rig
    source, motion = rig.inputs[0].name, rig.outputs[0].name
    own = _motion_alone(context, reidentified)
    parts = [
        _part(
            context.scoring,
            motion,
            source,
            {"before": _column(before, 0), "reidentified": _column(own, 0), "after": _column(after, 0)},
            context.noise[motion],
        )
    ]
    leg = fit_lateral_leg(context, before.fit.values)
    if leg is not None and rig.follower is not None:
        parts.append(_lateral_part(context, leg, motion, rig.follower.symbol.name))
    return tuple(parts)


def path_sentence(parts: Sequence[PathPart], rig: Rig) -> str:
    """Return a sentence on the sections of the signal path; empty where there is none."""
    if not parts:
        return ""
    first = parts[0]
    motion = f"{first.path} leaves {_times(first.reidentified, first)}"
    if len(parts) == 1:
        return f"One section of the signal path can be checked: {motion} after re-identification."
    lateral = parts[1]
    clean = lateral.reidentified <= VERDICT.at_floor * lateral.noise_floor
    said = (
        f"{lateral.path}, with {lateral.source} as measured, leaves {_times(lateral.reidentified, lateral)}"
    )
    moved = (
        abs(lateral.shift) > NOTES.clearly * lateral.shift_std
        and lateral.shifted * VERDICT.worthwhile < lateral.reidentified
    )
    if clean and first.reidentified > VERDICT.at_floor * first.noise_floor:
        return (
            f"The gap arises before {lateral.source} is measured: {motion}, but {said}. So the cause is the drive or "
            f"{_words(rig)}, not the lateral part and not a delay of the {lateral.source} sensor."
        )
    if clean:
        return f"No section of the signal path has a noticeable gap: {motion}, {said}."
    shifted = _times(lateral.shifted, lateral)
    if moved and lateral.shifted <= VERDICT.at_floor * lateral.noise_floor:
        late, early = (
            (lateral.source, lateral.output) if lateral.shift > 0.0 else (lateral.output, lateral.source)
        )
        return (
            f"The sensors are not synchronous: {said}, but only {shifted} if {late} is assumed to be measured "
            f"{1e3 * abs(lateral.shift):.3g} ms later than {early}; {motion}."
        )
    better = f" ({shifted} with {lateral.source} shifted by {1e3 * lateral.shift:.3g} ms)" if moved else ""
    return f"The lateral part or a sensor has a gap of its own: {said}{better}; {motion}."


def _times(value: float, part: PathPart) -> str:
    return f"{value / part.noise_floor:.3g} times its noise floor"


def _words(rig: Rig) -> str:
    return rig.place_name(Place.DYNAMICS).replace("_", " ")


def _motion_alone(context: FitContext, reidentified: FittedModel) -> FittedModel:
    """Re-identify the motion without what it drives, so that a gap there does not distort these parameters."""
    downstream = context.rig.downstream_parameters
    if not downstream or downstream <= context.held:
        return reidentified
    names = {symbol.name for symbol in context.rig.downstream}
    alone = replace(
        context,
        estimation=tuple(_without(record, names) for record in context.estimation),
        scoring=tuple(_without(record, names) for record in context.scoring),
        held=context.held | downstream,
    )
    structure = reidentified.fit.structure
    fit = alone.problem(structure, alone.estimation).fit(
        reidentified.fit.values, alone.free_parameters(structure)
    )
    return alone.score((), fit) if fit.residuals else reidentified


def _without(record: Record, names: set[str]) -> Record:
    return replace(record, signals={n: s for n, s in record.signals.items() if n not in names})


def _column(model: FittedModel, index: int) -> list[NDArray[np.float64]]:
    return [residual[:, index] for residual in model.residuals]


def _lateral_part(context: FitContext, leg: LateralLeg, motion: str, output: str) -> PathPart:
    records = [record for record in context.scoring if output in record]
    noise = float(np.hypot(context.noise[output], leg.noise_gain * context.noise[motion]))
    part = _part(records, output, motion, {"before": leg.given, "reidentified": leg.fitted}, noise)
    spread = float(np.std(np.concatenate([record[output] for record in records]))) or 1.0
    shifted = rms(np.concatenate(leg.shifted)) / spread
    return replace(part, shift=leg.shift, shift_std=leg.shift_std, shifted=shifted)


def _part(
    records: Sequence[Record],
    output: str,
    source: str,
    residuals: dict[str, Sequence[NDArray[np.float64]]],
    noise: float,
) -> PathPart:
    spread = float(np.std(np.concatenate([record[output] for record in records]))) or 1.0
    remainder = {stage: rms(np.concatenate(list(parts))) / spread for stage, parts in residuals.items()}
    floor = noise / spread
    return PathPart(
        output=output,
        before=remainder["before"],
        reidentified=remainder["reidentified"],
        after=remainder.get("after", float("nan")),
        noise_floor=floor,
        share=1.0,
        noise_share=min(1.0, (floor / remainder["reidentified"]) ** 2)
        if remainder["reidentified"] > 0.0
        else 1.0,
        path=f"{source} -> {output}",
        source=source,
        units={"shift": "s", "shift_std": "s"},
    )

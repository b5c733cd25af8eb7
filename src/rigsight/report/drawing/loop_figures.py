"""How does the force of an element look over its motion, at each amplitude, measured and at each stage?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight import plot
from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.records.stamps import written_span
from rigsight.report.drawing.figures import PageFigure, page_figure
from rigsight.report.quantities import gap_percent, rig_of
from rigsight.report.wording import listed, sentence_case, stage_names
from rigsight.simulate.prescribed_motion import smooth_motion

_PERIODS = 4
"""Of the motion in a picture: enough to see whether the loop repeats."""
_MOST_POINTS = 900
"""Of a curve; a loop of a few periods needs no more."""
_MOST_WITHOUT_AMPLITUDE = 4
"""Records shown where none tells its amplitude."""


def loop_figures(diagnosis: Diagnosis) -> list[PageFigure]:
    """Return the force over displacement and over velocity: a figure per amplitude, none of a rig that is driven.

    Of several records with the same amplitude the one that was scored is shown, else the first. Records that tell no amplitude
    are shown one by one.
    """
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
        _figure(diagnosis, trace, motion, force, f"figure-loops-{number}")
        for number, trace in enumerate(shown, start=1)
    ]


def _loops(displacement: NDArray[np.float64], error: NDArray[np.float64]) -> slice:
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


def _figure(diagnosis: Diagnosis, trace: Trace, motion: str, force: str, key: str) -> PageFigure:
    stages = stage_names(diagnosis)
    whole = np.asarray(trace.inputs[motion], dtype=np.float64)
    displacement, velocity = smooth_motion(whole, trace.dt)
    window = _loops(displacement, trace.residual(next(iter(stages)), force))
    shown = np.arange(window.start, window.stop)
    shown = shown[:: -(-shown.size // _MOST_POINTS)]
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
    left = listed(
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
        f"Loops of {what}, measured and simulated. NRMSE there: {left}.",
        f"{sentence_case(what)}: {place}. NRMSE there: {left}.",
    )

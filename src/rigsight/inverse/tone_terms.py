"""A tone along measured motions: its frequency is that of a line in all residuals, its phase differs from record to record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.frequency.persistent_line import line_power, persistent_line
from rigsight.inverse.equation_fit import EquationFit, per_force
from rigsight.inverse.joint_force import joint_motion
from rigsight.inverse.measured_motion import RecordMotion
from rigsight.inverse.term import Term
from rigsight.rigs.rig import joint_of

Floats = NDArray[np.float64]

_FINER = 8
"""Frequencies tried on either side of a line, up to the next one that the longest record resolves."""
_MOST_PHASES = 12
"""Records up to which each has a tone of its own phase: of more, each is left out as a whole, and its phase is not known."""
_OWN_LINE = 0.5
"""Share of the power of an input and of the speed in one line from which the motion has one frequency (an assumption)."""
_OVERTONES = (1, 2, 3, 4, 5)
"""Overtones of an input's line that laws of the motion make."""


def of_tone(
    effect: Effect, fit: EquationFit, values: Mapping[str, float], rows: Sequence[Floats]
) -> Iterator[Term]:
    """Yield a tone at the line that the residuals along all motions share; nothing where they share none."""
    # Each record has a phase of its own.
    motions, joint = fit.motions, joint_of(fit.rig, effect)
    pushes = [per_force(motion, joint, values) for motion in motions]
    row = int(np.argmax(sum(np.sum(push**2, axis=1) for push in pushes)))
    residuals = [own[row] for own in rows]
    steps = [motion.record.dt * motion.stride for motion in motions]
    line = persistent_line(residuals, steps)
    if line is None or len(motions) > _MOST_PHASES:
        return
    spacing = np.pi / max(r.size * dt for r, dt in zip(residuals, steps, strict=True))
    near = line + spacing * np.arange(-_FINER, _FINER + 1) / _FINER
    power = [sum(line_power(r, dt, w) for r, dt in zip(residuals, steps, strict=True)) for w in near]
    pulsation = float(near[int(np.argmax(power))])
    if any(_is_of_motion(motion, joint_motion(motion, joint, values).v, pulsation) for motion in motions):
        return
    columns = []
    for i, (motion, push) in enumerate(zip(motions, pushes, strict=True)):
        phase = pulsation * motion.record.dt * np.arange(motion.record.n_samples)
        own = np.zeros((2 * len(motions), *push.shape))
        own[2 * i], own[2 * i + 1] = push * np.sin(phase), push * np.cos(phase)
        columns.append(motion.thinned(own))
    parts = 2 * len(motions)
    yield Term(
        effect, {effect.pulsation or "": pulsation}, (), (1.0,) * parts, tuple(columns), (False,) * parts
    )


def _is_of_motion(motion: RecordMotion, speed: Floats, pulsation: float) -> bool:
    """Return whether a drive moves the joint at one frequency of which this is an overtone: its laws make tones.

    A tone that a controller counters is in the input, one that nothing counters in the speed.
    """

    def has_line(signal: Floats, overtone: int) -> bool:
        swing = signal - np.mean(signal)
        return line_power(swing, motion.record.dt, pulsation / overtone) > _OWN_LINE * float(swing @ swing)

    return any(
        has_line(speed, overtone) and any(has_line(signal, overtone) for signal in motion.u[::3])
        for overtone in _OVERTONES
    )

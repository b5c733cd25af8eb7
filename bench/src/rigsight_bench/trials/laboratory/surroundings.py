"""Imperfections of laboratory records, with sizes drawn for each trial from realistic ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigsight_bench.trials.laboratory.stands import STANDS, Law, Softening, draw_law
from rigsight_bench.trials.laboratory.subjects import LaboratorySubject

LEAST_BESIDE = 1.5
"""Least gap of a further effect in addition to the main one, in units of the floor: less is not visible."""
_NOISE = (3e-4, 3e-3)
"""Sensor noise in units of the reading's size: 70 to 50 dB, a laser head's or a strain gauge's."""
_INPUT_NOISE = (2e-4, 1e-2)
"""Noise of a measured input in units of its size: a current by a shunt at the best, by a clamp at the worst."""
_MOTION_NOISE = (2e-4, 1e-3)
"""Of a prescribed motion: its sensor is the best of the bench, as a force follows from its rate."""
_PUSH = (5e-3, 5e-2)
"""Force from outside in units of the drive's: hoses, cables, bearings, air."""
_PUSH_CORNER = (3.0, 30.0)
"""Angular frequency up to which it is white [rad/s]: what a hand, a hose or a floor does, 0.5 to 5 Hz."""
_FILTER_CORNER = (0.4, 0.8)
"""Of a filter before the sampler, in units of the Nyquist frequency: from a cautious to a usual one."""
_STEPS = (100.0, 2000.0)
"""Steps of an encoder in twice the reading's size: 1024 to 16384 counts per turn, of which a motion uses a tenth."""
_JITTER = 0.2
"""Noise before an encoder, in units of its step: light and shade of the marks."""
_OFFSETS = (3.0, 30.0)
"""Of a sensor from record to record (standard deviation), in units of its noise: an encoder's index, a bridge that warms up."""
_LOST_DAMPING = (0.05, 0.2)
"""Share of a joint's viscous friction that is gone once it is warm: what an hour of warming up beforehand leaves to go."""
_LOST_STIFFNESS = (5e-3, 2e-2)
"""Share of its stiffness: rubber and plastics lose a percent in a few kelvin, steel next to nothing."""
_WARMS_UP = (60.0, 300.0)
"""Time constant of that [s]: of a small gear, below that of a motor."""


@dataclass(frozen=True)
class Surroundings:
    """Imperfections of the measurement in one trial.

    Attributes
    ----------
    noise
        Of each sensor, in units of its reading's size.
    input_noise
        Of the recorded input, in units of its size.
    push, push_corner
        Force from outside on the last joint, in units of the drive's, and the frequency up to which it is white [rad/s].
    filter_corner
        Of the filter before the sampler of all channels, in units of the Nyquist frequency; 0 without one.
    step
        Of the encoders, in units of their reading's size; 0 without one.
    offset
        Of a sensor from record to record, in units of its noise.
    softening, warms_up
        What the last joint loses as it warms up, and the time constant of that [s].
    law
        The control law of a loop; None where the rig runs open loop.
    """

    noise: float
    input_noise: float = 0.0
    push: float = 0.0
    push_corner: float = 1.0
    filter_corner: float = 0.0
    step: float = 0.0
    offset: float = 0.0
    softening: Softening | None = None
    warms_up: float = 0.0
    law: Law | None = None


def draw_surroundings(
    subject: LaboratorySubject, values: dict[str, float], rng: np.random.Generator
) -> Surroundings:
    """Draw the imperfections of a stand under a condition.

    Parameters
    ----------
    subject
        Condition and stand.
    values
        The numbers of the stand.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If the stand's loop is not stable.
    """
    stand, condition = STANDS[subject.stand], subject.condition
    pushed = condition in ("feedback", "repeats", "stiction")
    noisy_input = condition in ("feedback", "repeats")
    # Every number is drawn even if unused, so that one condition does not change the draws of another.
    noise, push, corner, filtered = (
        _any(ends, rng) for ends in (_NOISE, _PUSH, _PUSH_CORNER, _FILTER_CORNER)
    )
    input_noise = _any(_INPUT_NOISE if stand.rig.is_driven else _MOTION_NOISE, rng)
    step, offset, warms_up = 2.0 / _any(_STEPS, rng), _any(_OFFSETS, rng), _any(_WARMS_UP, rng)
    softening = Softening(_any(_LOST_DAMPING, rng), _any(_LOST_STIFFNESS, rng))
    encoder, drifts = condition == "encoder", condition == "drift"
    return Surroundings(
        noise=_JITTER * step if encoder else noise,
        input_noise=input_noise if noisy_input else 0.0,
        push=push if pushed else 0.0,
        push_corner=corner,
        filter_corner=filtered if condition == "antialias_filter" else 0.0,
        step=step if encoder else 0.0,
        offset=offset if condition == "offsets" else 0.0,
        softening=softening if drifts else None,
        warms_up=warms_up if drifts else 0.0,
        law=draw_law(stand, values, rng) if stand.looped or condition == "feedback" else None,
    )


def _any(ends: tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a number whose logarithm lies anywhere between those of the ends."""
    return math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))

"""Plausibility of samples: does the signal change, and is it clipped?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.records.periods import roughness

# A cut leaves plateaus of at least this many samples, at least this often.
SHORTEST_PLATEAU = 3
FEWEST_PLATEAUS = 2
# Of the root mean square step: slower approaches are the rounded top of a peak, not a cut.
SLOWEST_ENTRY = 0.15
LARGEST_SHARE_HELD = 0.1
# Of the noise from sample to sample: the motion then has ten times its power.
_CLEARLY_MOVES = 3.0
# A signal that is nearly always at an extreme switches between two levels.
SMALLEST_SHARE_MOVING = 0.1


def is_constant(samples: NDArray[np.float64]) -> bool:
    """Return True if no sample of shape (n_samples,) differs from the first by more than rounding."""
    return bool(np.ptp(samples) <= 1e-12 * np.max(np.abs(samples)))


def moves_beyond_noise(samples: NDArray[np.float64]) -> bool:
    """Return True if a signal of shape (n_samples,) clearly moves: where a cause is not found in it, noise does not hide it."""
    return float(np.std(samples)) > _CLEARLY_MOVES * roughness(samples)


def clipping(samples: NDArray[np.float64]) -> tuple[tuple[float, int], ...]:
    """Return level and number of samples for each extreme at which a signal of shape (n_samples,) is clipped.

    A clipped signal reaches its extreme at speed and is exactly constant there, repeatedly, while it changes from sample to
    sample elsewhere. Steps, held inputs and coarsely quantized signals are constant elsewhere too; a signal at rest reaches its
    level once, or slowly.
    """
    steps = np.diff(samples)
    typical_step = float(np.sqrt(np.mean(steps**2)))
    moving = np.abs(steps[steps != 0.0])
    if moving.size == 0:
        return ()
    levels = (float(samples.min()), float(samples.max()))
    extreme = (samples == levels[0]) | (samples == levels[1])
    elsewhere = ~(extreme[1:] & extreme[:-1])
    moves = (
        np.mean(~extreme) > SMALLEST_SHARE_MOVING and np.mean(steps[elsewhere] == 0.0) < LARGEST_SHARE_HELD
    )
    found = []
    for level in levels if moves else ():
        at_level = samples == level
        edges = np.diff(at_level.astype(np.int8), prepend=0, append=0)
        starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        inside = (stops - starts >= SHORTEST_PLATEAU) & (starts > 0) & (stops < samples.size)
        if np.count_nonzero(inside) < FEWEST_PLATEAUS:
            continue
        entry = float(np.median(np.abs(steps[starts[inside] - 1])))
        if entry > SLOWEST_ENTRY * typical_step and entry > 2.0 * float(moving.min()):
            found.append((level, int(np.sum((stops - starts)[inside]))))
    return tuple(found)

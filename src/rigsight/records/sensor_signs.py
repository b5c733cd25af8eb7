"""Does a channel show what moves, or signs of its own: codes for no reading, a full turn, a value that is held over several rows?

The one place where these are found, for `inspect`, `init` and every command that reads a record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_CODE_SIZE = 1e30
"""From here on no reading in any unit: 9.9e37 and 9.91e37 (SCPI), 9.97e36 (NetCDF), 9.9e34 (DIAdem), 3.4e38 (end of a type)."""
_CODES = np.array(
    [
        *(sign * (10.0**n - 1.0) for n in (3, 4, 5, 6, 7) for sign in (1.0, -1.0)),
        -999.25,
        *(
            end
            for n in (16, 24, 32)
            for end in (2.0**n - 1, 2.0 ** (n - 1) - 1, 1 - 2.0 ** (n - 1), -(2.0 ** (n - 1)))
        ),
    ]
)
"""Nines, the code of LAS files, and the ends of whole numbers of 16, 24 and 32 bits."""
_MOST_CODES = 0.5
"""Share of the samples: what is there most of the time is a level of the signal."""
FULL_TURNS = (2.0 * math.pi, 360.0)
_COUNTERS = tuple(2.0**n for n in range(8, 33))
_CLEARLY = 0.25
"""Of a period: a step across its end that is longer, once the period is taken off, may as well be one the other way round."""
_OVER_THE_END = 1e-3
"""Of a period: rounding of its end in the file."""
FEWEST_FRESH = 20
"""Changes, and levels, from which the rows between changes are counted."""
_REGULAR = 0.9
"""Share of the changes that must follow the earlier one after the usual number of rows, one more or one less: two clocks beat."""


@dataclass(frozen=True)
class Code:
    """A number that stands for no reading: its value, and the samples that hold it."""

    value: float
    samples: NDArray[np.intp]


def codes(samples: NDArray[np.float64]) -> tuple[Code, ...]:
    """Return the codes for no reading in a signal of shape (n_samples,), all finite.

    A code is a usual number for it, rare, and further from all readings than any two of them that follow each other: a signal
    that reaches such a number by itself passes through what lies between.
    """
    huge = np.abs(samples) >= _CODE_SIZE
    usual = np.isin(samples, _CODES)
    if not huge.any() and not usual.any():
        return ()
    found = []
    for value in np.unique(samples[huge | usual]):
        own = samples == value
        others = ~(own | huge)
        readings = samples[others]
        # A command of two levels steps between them.
        if (
            np.mean(own) >= _MOST_CODES
            or readings.size < 2
            or (np.ptp(readings) == 0.0 and abs(value) < _CODE_SIZE)
        ):
            continue
        steps = np.abs(np.diff(samples))[others[1:] & others[:-1]]
        if np.min(np.abs(readings - value)) > np.max(steps, initial=0.0):
            found.append(Code(float(value), np.flatnonzero(own)))
    return tuple(found)


def is_wrapped(samples: NDArray[np.float64], period: float) -> bool:
    """Return True if a signal of shape (n_samples,) begins again at the end of a period, as an angle does after a full turn.

    It stays within one period, and at each jump it moves on as it does elsewhere if a period is added or taken off.
    """
    if not np.ptp(samples) <= (1.0 + _OVER_THE_END) * period:
        return False
    steps = np.diff(samples)
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * period)
    if jumps.size == 0:
        return False
    on = np.abs(np.abs(steps[jumps]) - period)
    elsewhere = np.delete(steps, jumps)
    # A command that steps by a turn stands still elsewhere.
    return bool(
        np.max(on) <= _CLEARLY * period
        and np.max(on) <= 2.0 * np.max(np.abs(elsewhere), initial=0.0)
        and np.count_nonzero(elsewhere) > jumps.size
    )


def wrapping_counter(samples: NDArray[np.float64]) -> float | None:
    """Return the range of a counter of whole numbers that begins again at its end, a power of two; None if it is none."""
    low, high = float(np.min(samples)), float(np.max(samples))
    for period in _COUNTERS:
        inside = (low >= 0.0 and high < period) or (low >= -0.5 * period and high < 0.5 * period)
        # The first that holds the numbers; in a larger one no step is longer than half of it.
        if inside:
            whole = np.array_equal(samples, np.round(samples))
            return period if whole and is_wrapped(samples, period) else None
    return None


@dataclass(frozen=True)
class Held:
    """A reading that stands still between the samples of a slower device."""

    rows: int  # usual number of rows from one reading to the next
    fresh: NDArray[np.intp]  # rows with a reading of their own


def held(samples: NDArray[np.float64]) -> Held | None:
    """Return how a signal of shape (n_samples,) is held over several rows; None if it is not.

    It then changes after the same number of rows again and again, and never in two rows that follow each other. Rounding and rest
    hold a signal as well, but for as long as the motion takes.
    """
    changes = np.flatnonzero(np.diff(samples)) + 1
    # What steps between a few levels is a switch or a command.
    if changes.size < FEWEST_FRESH or np.unique(samples).size < FEWEST_FRESH:
        return None
    apart = np.diff(changes)
    rows = int(np.median(apart))
    if np.min(apart) < 2:
        return None
    # Two readings may be equal: of a signal that is rounded, or rests.
    times = np.maximum(np.round(apart / rows), 1.0)
    if np.mean(np.abs(apart - rows * times) <= 1.0) < _REGULAR or np.mean(times == 1.0) < _REGULAR:
        return None
    common = int(np.gcd.reduce(apart))
    if common < 2:
        return Held(rows, changes)
    return Held(common, np.arange(changes[0] % common, samples.size, common))

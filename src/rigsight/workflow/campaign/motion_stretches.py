"""Where does a robot move in a log? Its stretches of motion between pauses."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label, maximum_filter1d, minimum_filter1d

from rigsight.records.channel_units import factor
from rigsight.records.formats.channel import Channel, as_floats
from rigsight.records.record import Floats

_STEP = 0.02
"""Time step at which channels are compared [s]."""
_PAUSE, _SHORTEST = 1.0, 1.0
"""Shortest pause and shortest motion [s]."""
_LEAD = 1.0
"""Rest in front of and behind a motion that belongs to its record, up to half a pause [s]: it shows the equilibrium, and motions
begin slowly."""
_HELD, _STILL = 1e-3, 1e-2
"""Shares of their ranges that a command and a reading may change in a pause, beside their noise: a joint creeps to its rest."""
_WIDTH = 7.0
"""Width of a band in standard deviations that noise of a pause stays within."""
_MOST_STEPS = 3_000_000
"""Length of a log that is divided: 17 hours."""


def moving_stretches(commands: Sequence[Channel], readings: Sequence[Channel]) -> list[tuple[float, float]]:
    """Return begin and end of each stretch of motion [s], by the time of the file; empty with fewer than two."""
    each = [(channel, _HELD) for channel in commands] + [(channel, _STILL) for channel in readings]
    series = [(*one, still) for channel, still in each if (one := _series(channel)) is not None]
    if not series:
        return []
    begin = max(float(stamps[0]) for stamps, _, _ in series)
    end = min(float(stamps[-1]) for stamps, _, _ in series)
    if not 2.0 * _SHORTEST + _PAUSE < end - begin < _STEP * _MOST_STEPS:
        return []
    grid = np.arange(begin, end, _STEP)
    resting = np.ones(grid.size, dtype=bool)
    for stamps, samples, still in series:
        band = _WIDTH * _noise(samples) + still * float(np.ptp(samples))
        resting &= _resting(np.interp(grid, stamps, samples), band)
    numbered, count = label(~resting)
    places = [np.flatnonzero(numbered == number + 1) for number in range(count)]
    moved = [(float(grid[own[0]]), float(grid[own[-1]])) for own in places if own.size * _STEP >= _SHORTEST]
    if len(moved) < 2:
        return []
    halfway = [(last + first) / 2.0 for (_, last), (first, _) in pairwise(moved)]
    return [
        (max(first - _LEAD, before), min(last + _LEAD, behind))
        for (first, last), before, behind in zip(moved, [begin, *halfway], [*halfway, end], strict=True)
    ]


def _series(channel: Channel) -> tuple[Floats, Floats] | None:
    """Return time [s] and samples of a channel that has a time of its own; None for any other."""
    if channel.axis is None or channel.n_samples < 2:
        return None
    samples, stamps = as_floats(channel.load()), channel.axis.stamps() * factor(channel.axis.unit, "s")
    usable = np.isfinite(samples) & np.isfinite(stamps)
    samples, stamps = samples[usable], stamps[usable]
    ordered = stamps.size > 1 and bool(np.all(np.diff(stamps) >= 0.0))
    return (stamps, samples) if ordered else None


def _noise(samples: Floats) -> float:
    """Return the standard deviation of white noise, which is all that most second differences show."""
    bends = np.diff(samples, 2)
    return float(np.median(np.abs(bends))) / 0.6745 / np.sqrt(6.0) if bends.size else 0.0


def _resting(samples: Floats, band: float) -> NDArray[np.bool_]:
    """Return where samples stay within a band for the length of a pause, shape (n_samples,)."""
    width = round(_PAUSE / _STEP)
    span = maximum_filter1d(samples, width) - minimum_filter1d(samples, width)
    return np.asarray(maximum_filter1d((span <= band).astype(np.uint8), width), dtype=bool)

"""Time stamps as text and on axes: with as many digits as tell neighbors apart, also where a clock counts from 1970."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_FAR = 1e3
"""Durations of a record by which its stamps may exceed it before an axis counts from the first one."""
_MOST_DIGITS = 17


def digits_for(stamp: float, resolution: float, fewest: int) -> int:
    """Return how many significant digits tell a stamp from others at a distance."""
    stamp, resolution = abs(stamp), abs(resolution)
    if not (math.isfinite(stamp) and math.isfinite(resolution) and stamp > 0.0 and resolution > 0.0):
        return fewest
    needed = math.floor(math.log10(stamp)) - math.floor(math.log10(resolution)) + 1
    return min(max(needed, fewest), _MOST_DIGITS)


def written_stamp(stamp: float, resolution: float, fewest: int = 4) -> str:
    """Return a stamp as text, see `digits_for`."""
    return f"{stamp:.{digits_for(stamp, resolution, fewest)}g}"


def written_span(begin: float, end: float) -> str:
    """Return ``"1.2 s to 3.4 s"`` with enough digits for the length of the span."""
    ends = (written_stamp(stamp, 0.01 * (end - begin)) for stamp in (begin, end))
    return " to ".join(f"{text} s" for text in ends)


def time_origin(t: NDArray[np.float64]) -> float:
    """Return the stamp that an axis counts from: 0, or the first one where stamps are far larger than the record is long."""
    if t.size < 2:
        return 0.0
    first, last = float(t[0]), float(t[-1])
    return first if max(abs(first), abs(last)) > _FAR * (last - first) else 0.0


def time_label(t: NDArray[np.float64]) -> str:
    """Return the label of a time axis that counts from `time_origin`."""
    origin = time_origin(t)
    if not origin:
        return "time [s]"
    return f"time [s] since {written_stamp(origin, float(t[-1] - t[0]) / (t.size - 1))} s"

"""Time stamps as text and on axes, with as many digits as tell neighbors apart, and dates as seconds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Floats

_FAR = 1e3
"""Durations of a record by which its stamps may exceed it before an axis counts from the first one."""
_MOST_DIGITS = 17
# Of the median step: a longer one is a gap.
_GAP = 1.5


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


def time_origin(t: Floats) -> float:
    """Return the stamp that an axis counts from: 0, or the first one where stamps are far larger than the record is long."""
    if t.size < 2:
        return 0.0
    first, last = float(t[0]), float(t[-1])
    return first if max(abs(first), abs(last)) > _FAR * (last - first) else 0.0


def time_label(t: Floats) -> str:
    """Return the label of a time axis that counts from `time_origin`."""
    origin = time_origin(t)
    if not origin:
        return "time [s]"
    return f"time [s] since {written_stamp(origin, float(t[-1] - t[0]) / (t.size - 1))} s"


def step_and_gaps(stamps: Floats) -> tuple[float | None, int | None]:
    """Return the median step of time stamps, shape (n_samples,), and how often they jump; None where they do not rise."""
    steps = np.diff(stamps)
    if steps.size == 0 or not np.all((steps > 0.0) & (steps < np.inf)):
        return None, None
    dt = float(np.median(steps))
    return dt, int(np.count_nonzero(steps > _GAP * dt))


def seconds_since(stamps: NDArray[Any], origin: np.datetime64 | None) -> Floats:
    """Return numpy dates, shape (n_samples,), as seconds [s] from `origin`, durations as seconds; NaN where one is missing."""
    if stamps.dtype.kind == "M":
        stamps = stamps - (stamps[:1] if origin is None else origin)
    unit, step = np.datetime_data(stamps.dtype)
    ticks = stamps.astype(np.int64).astype(np.float64)
    ticks[np.isnat(stamps)] = np.nan
    per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
    if unit not in per_second:
        return seconds_since(stamps.astype("timedelta64[s]"), None)
    # Divided, not multiplied by 1e-9: 5 ms are then the number that 0.005 is.
    return np.asarray(ticks * step / per_second[unit], dtype=np.float64)


def earliest(moments: Iterable[np.datetime64]) -> np.datetime64 | None:
    """Return the first of the moments that are known, in nanoseconds: from it the times of one file count."""
    return min((moment.astype("datetime64[ns]") for moment in moments if not np.isnat(moment)), default=None)

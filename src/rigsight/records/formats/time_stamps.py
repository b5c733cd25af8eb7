"""How do dates and durations become seconds?"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def seconds_since(stamps: NDArray[Any], origin: np.datetime64 | None) -> NDArray[np.float64]:
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

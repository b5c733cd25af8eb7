"""How do dates and durations become seconds?"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def seconds_since_first(stamps: NDArray[Any]) -> NDArray[np.float64]:
    """Return numpy dates or durations, shape (n_samples,), as seconds [s] from the first; NaN where one is missing."""
    if stamps.dtype.kind == "M":
        stamps = stamps - stamps[:1]
    unit, step = np.datetime_data(stamps.dtype)
    ticks = stamps.astype(np.int64).astype(np.float64)
    ticks[np.isnat(stamps)] = np.nan
    per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
    if unit not in per_second:
        return seconds_since_first(stamps.astype("timedelta64[s]"))
    # Divided, not multiplied by 1e-9: 5 ms are then the number that 0.005 is.
    return np.asarray(ticks * step / per_second[unit], dtype=np.float64)

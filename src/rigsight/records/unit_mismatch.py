"""Does one record have a signal in another unit than the others, millimeters among meters?"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Record

_SEGMENTS = 8
"""Non-overlapping segments of a spectrum: enough for a median over frequencies."""
_DRIVEN = 1e-2
"""Share of the largest power of an input from which a frequency counts as driven."""
_LEAST_RATIO = 30.0
"""Ratio of gains from which a unit is asked about: below degrees for radians (57). That no amplitude changes a gain so much is an
assumption; on nine campaigns, and 24 drawn ones of development seeds, ratios reached 6."""


def unit_mismatch(
    records: Sequence[Record], source: str, response: str
) -> tuple[Record, Record, float] | None:
    """Return the two records whose gains differ most, and by what factor; None where no unit explains it.

    Gains are compared at frequencies that drive both, so that it does not matter which band a record sweeps.
    """
    gains = [
        (record, gain)
        for record in records
        if source in record and response in record
        if (gain := _gain(record, source, response)) is not None
    ]
    found: tuple[Record, Record, float] | None = None
    for (one, first), (other, second) in combinations(gains, 2):
        ratio = _ratio(first, second)
        larger, smaller = (one, other) if ratio > 1.0 else (other, one)
        ratio = max(ratio, 1.0 / ratio)
        if ratio >= _LEAST_RATIO and (found is None or ratio > found[2]):
            found = larger, smaller, ratio
    return found


_Gain = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Frequencies at which an input drives, and the gains there."""


def _gain(record: Record, source: str, response: str) -> _Gain | None:
    # Loaded where it is used: the process that reads a file imports this package and needs none of it.
    from scipy.signal import welch

    if np.ptp(record[source]) == 0.0 or np.ptp(record[response]) == 0.0:
        return None
    length = max(record.n_samples // _SEGMENTS, min(record.n_samples, 64))
    f, driving = welch(record[source], 1.0 / record.dt, nperseg=length)
    _, answer = welch(record[response], 1.0 / record.dt, nperseg=length)
    driven = (driving > _DRIVEN * np.max(driving[1:], initial=0.0)) & (f > 0.0) & (answer > 0.0)
    return (f[driven], np.sqrt(answer[driven] / driving[driven])) if driven.any() else None


def _ratio(one: _Gain, other: _Gain) -> float:
    """Return the median ratio of two gains at frequencies that both have; 1 where they have none in common."""
    (f, gain), (g, second) = one, other
    inside = (f >= g[0]) & (f <= g[-1])
    if not inside.any():
        return 1.0
    return float(np.median(gain[inside] / np.interp(f[inside], g, second)))

"""Records with no more samples than their motion needs, for all that follows from the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import resample_poly

from rigsight.identify.fit.windows import shown_by
from rigsight.records import Record
from rigsight.rigs import Rig

_OF_MOTION = 0.99
"""Share of the power of the velocity below the end of the band of a motion."""
_PER_PERIOD = 30.0
"""Samples of a period at the end of this band: forces hold overtones of the motion."""


def coarser_records(rig: Rig, records: Sequence[Record]) -> tuple[Record, ...]:
    """Return records sampled as finely as their motion needs."""
    return tuple(_coarser(r, output) for r, output in zip(records, shown_by(rig, records), strict=True))


def _coarser(record: Record, output: str) -> Record:
    velocity = np.diff(record[output])
    power = np.cumsum(np.abs(np.fft.rfft(velocity - np.mean(velocity))) ** 2)
    highest = float(np.searchsorted(power, _OF_MOTION * power[-1])) / velocity.size
    factor = int(1.0 / max(_PER_PERIOD * highest, 1.0 / record.n_samples))
    if factor < 2 or record.n_samples // factor < 500:
        return record
    signals = {name: resample_poly(s, 1, factor, padtype="line") for name, s in record.signals.items()}
    return replace(record, dt=factor * record.dt, signals=signals, hold="band_limited")

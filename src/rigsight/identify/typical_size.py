"""Typical size of a signal about its center, without its rarest values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.records.record import Floats

_MOST = 98.0
_STILL = 1e-12
"""Range of a signal relative to its size that counts as rounding error."""


def typical_size(signals: Sequence[Floats]) -> float:
    """Return the 98th percentile of the deviations from the median; never zero."""
    deviations = np.concatenate([np.abs(signal - np.median(signal)) for signal in signals])
    size = float(np.percentile(deviations, _MOST)) or float(np.max(deviations))
    return size or 1.0


def size_about_zero(signals: Sequence[Floats]) -> float:
    """Return the 98th percentile of the magnitudes; zero for a signal that is zero."""
    values = np.concatenate([np.abs(signal) for signal in signals])
    return float(np.percentile(values, _MOST)) or float(np.max(values))


def size_of_signal(signals: Sequence[Floats]) -> float:
    """Return the typical size of deviations from the median, or the magnitude of a constant signal (which may be zero)."""
    largest = max(float(np.max(np.abs(signal))) for signal in signals)
    if max(float(np.ptp(signal)) for signal in signals) <= _STILL * largest:
        return largest
    return typical_size(signals)

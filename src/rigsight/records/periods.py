"""Does a signal repeat exactly, and after how many samples?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_SAME = 1e-3
"""Largest difference between two periods of one signal, relative to its standard deviation."""


def repeated_period(samples: NDArray[np.float64]) -> int | None:
    """Return the period of an exactly repeated signal of shape (n_samples,) in samples, None if it does not repeat."""
    centered = samples - np.mean(samples)
    n = centered.size
    size = float(np.std(centered))
    if size == 0.0:
        return None
    padded = np.fft.rfft(centered, 2 * n)
    correlation = np.fft.irfft(np.abs(padded) ** 2)[: n // 2 + 1]
    overlap = n - np.arange(correlation.size)
    normalized = correlation / overlap / size**2
    peaks = np.flatnonzero(normalized > 0.99)
    for lag in peaks[peaks > 30]:
        if np.max(np.abs(samples[lag:] - samples[:-lag])) <= _SAME * size:
            return int(lag)
    return None

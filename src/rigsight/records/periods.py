"""Does a signal repeat itself, or another one, and after how many samples?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

_SAME = 1e-3
"""Largest difference between two periods of one signal, relative to its standard deviation."""
_ALIKE = 0.01
"""Largest RMS difference of two signals that count as the same, relative to the standard deviation: both may be measured."""


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


def same_signal(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Return True if the shorter of two signals is a stretch of the longer one, amplitude and mean included.

    Parameters
    ----------
    first, second
        Samples, shape (n_samples,) each, at the same sample time.
    """
    short, long = sorted((first, second), key=len)
    mean, size = float(np.mean(short)), float(np.std(short))
    if size == 0.0:
        return False
    part, whole = short - mean, long - mean
    energy = np.concatenate([[0.0], np.cumsum(whole**2)])
    squares = energy[part.size :] - energy[: -part.size] + float(part @ part)
    squares -= 2.0 * correlate(whole, part, mode="valid", method="fft")
    return bool(np.min(squares) <= part.size * (_ALIKE * size) ** 2)

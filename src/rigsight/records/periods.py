"""Period of a signal, or repetition of another signal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Record

_SAME = 1e-3
"""Largest difference between two periods of one signal, relative to its standard deviation."""
_ALIKE = 0.01
"""Largest RMS difference of two signals that count as the same, relative to the standard deviation: both may be measured."""
_SHORTEST = 31
"""Samples of the shortest period; a shorter one counts several times."""
_APART = 0.5
"""Correlation below which a signal has left one period for the next: over the lags of a period its mean is zero, so it falls
below, while noise as small as `_ALIKE` crosses it once."""
_ROUGH = 0.5
"""Share of a difference that must be as rough as white noise: a slightly other amplitude or time is smooth."""


def repeated_period(samples: NDArray[np.float64]) -> int | None:
    """Return the period in samples of a signal of shape (n_samples,) that is periodic apart from noise; None if it is not."""
    centered = samples - np.mean(samples)
    n = centered.size
    size = float(np.std(centered))
    if size == 0.0:
        return None
    padded = np.fft.rfft(centered, 2 * n)
    correlation = np.fft.irfft(np.abs(padded) ** 2)[: n // 2 + 1]
    overlap = n - np.arange(correlation.size)
    normalized = correlation / overlap / size**2
    energy = np.concatenate([[0.0], np.cumsum(centered**2)])
    squares = (energy[overlap] + energy[n] - energy[n - overlap] - 2.0 * correlation) / overlap
    # A slow signal resembles itself at all small lags, and around a period: only one lag of each peak can be a period.
    peak_of = np.cumsum(normalized < _APART)
    is_alike = (normalized > 0.99) & (squares <= (_ALIKE * size) ** 2) & (peak_of > 0)
    lags = np.flatnonzero(is_alike)
    lags = lags[lags >= _SHORTEST]
    for peak in np.split(lags, np.flatnonzero(np.diff(peak_of[lags])) + 1) if lags.size else ():
        lag = peak[np.argmin(squares[peak])]
        if differ_by_noise(samples[lag:], samples[:-lag], size):
            return int(lag)
    return None


def mean_period(record: Record, drives: Sequence[str]) -> tuple[Record, int]:
    """Return the mean of all common periods of some inputs but the first, which holds the transient, and their number."""
    period = 1
    for drive in drives:
        own = repeated_period(record[drive])
        if own is None:
            return record, 0
        period = math.lcm(period, own)
    count = record.n_samples // period
    if count < 2:
        return record, 0
    kept = {
        name: samples[period : count * period].reshape(count - 1, period).mean(axis=0)
        for name, samples in record.signals.items()
    }
    return replace(record, signals=kept), count - 1


def differ_by_noise(first: NDArray[np.float64], second: NDArray[np.float64], size: float) -> bool:
    """Return True if two signals of shape (n_samples,) are the same, or measured with small white noise on each."""
    difference = first - second
    if float(np.max(np.abs(difference), initial=0.0)) <= _SAME * size:
        return True
    rms = float(np.sqrt(np.mean(difference**2)))
    return rms <= _ALIKE * size and roughness(difference) >= _ROUGH * rms


def roughness(samples: NDArray[np.float64]) -> float:
    """Return the standard deviation of white noise with the median size of third differences, which rare jumps leave alone."""
    differences = np.diff(samples, 3)
    if differences.size == 0:
        return float("inf")
    # The variance of a third difference is 1 + 9 + 9 + 1 = 20 times that of the noise; 1.4826 is for the median of a normal.
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(20.0))


def same_signal(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Return True if the shorter of two signals is a stretch of the longer one, amplitude and mean included."""
    # Loaded where it is used: the process that reads a file imports this package and needs none of it.
    from scipy.signal import correlate

    short, long = sorted((first, second), key=len)
    mean, size = float(np.mean(short)), float(np.std(short))
    if size == 0.0:
        return False
    part, whole = short - mean, long - mean
    energy = np.concatenate([[0.0], np.cumsum(whole**2)])
    squares = energy[part.size :] - energy[: -part.size] + float(part @ part)
    squares -= 2.0 * correlate(whole, part, mode="valid", method="fft")
    return bool(np.min(squares) <= part.size * (_ALIKE * size) ** 2)

"""What does a signal show: its size, does it change, is it clipped, has it a period, repeats it another, is it a reference?"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from rigsight.records.record import Floats, Record

# A cut leaves plateaus of at least this many samples, at least this often.
SHORTEST_PLATEAU = 3
FEWEST_PLATEAUS = 2
# Of the root mean square step: slower approaches are the rounded top of a peak, not a cut.
SLOWEST_ENTRY = 0.15
LARGEST_SHARE_HELD = 0.1
# Of the noise from sample to sample: the motion then has ten times its power.
_CLEARLY_MOVES = 3.0
# A signal that is nearly always at an extreme switches between two levels.
SMALLEST_SHARE_MOVING = 0.1

_SAME = 1e-3
"""Largest difference between two periods of one signal, relative to its standard deviation."""
_ALIKE = 0.01
"""Largest RMS difference of two signals that count as the same, relative to the standard deviation: both may be measured."""
_SHORTEST = 31
"""Samples of the shortest period; a shorter one counts several times."""
_APART = 0.5
"""Correlation below which a signal has left one period for the next: over the lags of a period its mean is zero, so it falls
below, while noise as small as `_ALIKE` crosses it once."""
_MOST = 98.0
"""Percentile of its deviations that is the size of a signal: without its rarest values."""
_STILL = 1e-12
"""Range of a signal relative to its size that counts as rounding error."""
_ROUGH = 0.5
"""Share of a difference that must be as rough as white noise: a slightly other amplitude or time is smooth."""

REFERENCE = "reference"
"""The signal that a record may hold beside those of its rig; a rig with a signal of this name means its own."""


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


def is_constant(samples: Floats) -> bool:
    """Return True if no sample of shape (n_samples,) differs from the first by more than rounding."""
    return bool(np.ptp(samples) <= _STILL * np.max(np.abs(samples)))


def moves_beyond_noise(samples: Floats) -> bool:
    """Return True if a signal of shape (n_samples,) clearly moves: where a cause is not found in it, noise does not hide it."""
    return float(np.std(samples)) > _CLEARLY_MOVES * roughness(samples)


def clipping(samples: Floats) -> tuple[tuple[float, int], ...]:
    """Return level and number of samples for each extreme at which a signal of shape (n_samples,) is clipped."""
    # A clipped signal reaches its extreme at speed and is exactly constant there, repeatedly, while it changes from sample to
    # sample elsewhere. Steps, held inputs and coarsely quantized signals are constant elsewhere too; a signal at rest reaches its
    # level once, or slowly.
    # The rest before and after a motion says nothing of how the signal changes within it.
    changes = np.flatnonzero(np.diff(samples))
    if changes.size == 0:
        return ()
    samples = samples[changes[0] : changes[-1] + 2]
    steps = np.diff(samples)
    typical_step = float(np.sqrt(np.mean(steps**2)))
    moving = np.abs(steps[steps != 0.0])
    levels = (float(samples.min()), float(samples.max()))
    extreme = (samples == levels[0]) | (samples == levels[1])
    elsewhere = ~(extreme[1:] & extreme[:-1])
    moves = (
        np.mean(~extreme) > SMALLEST_SHARE_MOVING and np.mean(steps[elsewhere] == 0.0) < LARGEST_SHARE_HELD
    )
    found = []
    for level in levels if moves else ():
        at_level = samples == level
        edges = np.diff(at_level.astype(np.int8), prepend=0, append=0)
        starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        inside = (stops - starts >= SHORTEST_PLATEAU) & (starts > 0) & (stops < samples.size)
        if np.count_nonzero(inside) < FEWEST_PLATEAUS:
            continue
        entry = float(np.median(np.abs(steps[starts[inside] - 1])))
        if entry > SLOWEST_ENTRY * typical_step and entry > 2.0 * float(moving.min()):
            found.append((level, int(np.sum((stops - starts)[inside]))))
    return tuple(found)


def repeated_period(samples: Floats) -> int | None:
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


def differ_by_noise(first: Floats, second: Floats, size: float) -> bool:
    """Return True if two signals of shape (n_samples,) are the same, or measured with small white noise on each."""
    difference = first - second
    if float(np.max(np.abs(difference), initial=0.0)) <= _SAME * size:
        return True
    rms = float(np.sqrt(np.mean(difference**2)))
    return rms <= _ALIKE * size and roughness(difference) >= _ROUGH * rms


def roughness(samples: Floats) -> float:
    """Return the standard deviation of white noise with the median size of third differences, which rare jumps leave alone."""
    differences = np.diff(samples, 3)
    if differences.size == 0:
        return float("inf")
    # The variance of a third difference is 1 + 9 + 9 + 1 = 20 times that of the noise; 1.4826 is for the median of a normal.
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(20.0))


def same_signal(first: Floats, second: Floats) -> bool:
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


def signals_beside(own: Collection[str]) -> tuple[str, ...]:
    """Return the signals that a record may contain in addition to those of its rig, whose names are given."""
    return () if REFERENCE in own else (REFERENCE,)


def instrument_of(record: Record, own: Collection[str]) -> str | None:
    """Return the name of the reference signal of a record's control loop; None if there is none, or it never changes."""
    if not signals_beside(own) or REFERENCE not in record or is_constant(record[REFERENCE]):
        return None
    return REFERENCE

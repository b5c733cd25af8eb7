"""At which frequencies does a residual have its power? Welch's spectrum of the whole record, summed over logarithmic bands.

References
----------
P. D. Welch, IEEE Trans. Audio and Electroacoustics 15 (1967) 70.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.signal

from rigsight.diagnose.policy import MAPS
from rigsight.records.record import Floats


def spectrum(samples: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return frequencies [rad/s] and the mean square at each of them, shape (n_lines,); they add up to that of the samples."""
    # The record is reflected at its ends: else the first and last half segment, where many sweeps have their slowest and fastest
    # waves, would weigh less than the rest.
    length = int(min(samples.size, max(MAPS.fewest_band_samples, samples.size // MAPS.segments)))
    padded = np.pad(samples, min(length // 2, samples.size - 1), mode="reflect")
    # scipy's stubs do not know detrend=False.
    frequency, power = scipy.signal.welch(padded, 1.0 / dt, nperseg=length, detrend=False)  # type: ignore[call-overload,unused-ignore]
    mean_square = float(np.mean(samples**2))
    total = float(np.sum(power))
    scale = mean_square / total if total > 0.0 else 0.0
    return 2.0 * np.pi * frequency, np.asarray(power * scale, dtype=np.float64)


def band_edges(records: Sequence[tuple[Floats, Floats, float]], noise: float) -> Floats:
    """Return edges [rad/s] of bands over the excited range and of one above it, shape (n_bands + 2,)."""
    lows, highs = [], []
    for source, response, dt in records:
        omega, drive = spectrum(source - np.mean(source), dt)
        answer = spectrum(response - np.mean(response), dt)[1]
        driven, rings = (np.cumsum(power) / (float(np.sum(power)) or 1.0) for power in (drive, answer))
        answered = answer > MAPS.stands_out * noise**2 / omega.size
        kept = (
            answered
            & (driven >= MAPS.beyond_the_input)
            & ((driven <= 1.0 - MAPS.beyond_the_input) | (rings <= 1.0 - MAPS.beyond_the_answer))
        )
        kept[0] = False
        lines = np.flatnonzero(kept) if np.any(kept) else np.array([1, omega.size - 1])
        lows.append(float(omega[lines[0]]))
        highs.append(float(omega[lines[-1]]))
    low, high = min(lows), max(highs)
    nyquist = float(np.pi / min(dt for _, _, dt in records))
    high = min(max(high, 2.0 * low), nyquist / 1.01)
    inner = np.geomspace(low, high, MAPS.bands + 1)[1:]
    return np.concatenate([[0.0], inner, [nyquist]])


def band_powers(samples: Floats, dt: float, edges: Floats) -> Floats:
    """Return the mean square in each band, shape (n_edges - 1,); a line on the border of two bands is shared."""
    omega, power = spectrum(samples, dt)
    width = omega[1] - omega[0]
    # Each line stands for the frequencies around it: narrow bands at low frequency then have no holes.
    borders = np.clip(np.concatenate([omega - width / 2.0, [omega[-1] + width / 2.0]]), 0.0, omega[-1])
    cumulative = np.concatenate([[0.0], np.cumsum(power)])
    inside = np.interp(np.minimum(edges, omega[-1]), borders, cumulative)
    return np.asarray(np.diff(inside), dtype=np.float64)


def dominant_frequency(samples: Floats, dt: float, size: float) -> float:
    """Return the center frequency of the power of a stretch [rad/s]; NaN where it is constant."""
    centered = samples - np.mean(samples)
    if samples.size < 2 or float(np.ptp(samples)) <= MAPS.rests * size:
        return float("nan")
    power = np.abs(np.fft.rfft(centered * np.hanning(samples.size))) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(samples.size, dt)
    return float(np.sum(power * omega) / np.sum(power))

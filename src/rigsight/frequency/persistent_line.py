"""Periodic disturbances: a line at the same frequency in the residual spectra of all records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.signal import get_window

_NEIGHBORS = 21
"""Number of frequencies whose median is the background of a spectral line."""
_CYCLES = 4
"""Minimum cycles in a record that distinguish a spectral line from a drift."""


def persistent_line(residuals: Sequence[NDArray[np.float64]], dt: Sequence[float]) -> float | None:
    """Return the angular frequency of the most prominent line common to all records [rad/s].

    The residual of a wrong model follows the input, sweeps through the band or is spread over it; a periodic disturbance has the
    same frequency in all records. The mean of the logarithms of the spectra is large only where all of them are.
    """
    duration = min((r.size * step for r, step in zip(residuals, dt, strict=True)), default=0.0)
    least = 2.0 * np.pi * _CYCLES / duration if duration > 0.0 else np.inf
    most = min((np.pi / step for step in dt), default=0.0)
    omega = np.arange(least, most, np.pi / duration) if np.isfinite(least) else np.zeros(0)
    if omega.size < _NEIGHBORS:
        return None
    levels = [_level(r, step, omega) for r, step in zip(residuals, dt, strict=True)]
    level = np.mean(levels, axis=0)
    prominence = level - median_filter(level, _NEIGHBORS, mode="nearest")
    return float(omega[int(np.argmax(prominence))])


def _level(residual: NDArray[np.float64], dt: float, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithm of the spectrum at the frequencies, of the largest line near each where the record is longer."""
    windowed = (residual - np.mean(residual)) * get_window("hann", residual.size)
    n_fft = 4 * residual.size
    spectrum = np.log(np.abs(np.fft.rfft(windowed, n_fft)) + 1e-300)
    own = 2.0 * np.pi * np.fft.rfftfreq(n_fft, dt)
    return np.interp(omega, own, spectrum)


def line_power(signal: NDArray[np.float64], dt: float, omega: float) -> float:
    """Return the sum of squares that a sine of an angular frequency removes from a signal, its mean aside [rad/s]."""
    turns = np.exp(-1j * omega * dt * np.arange(signal.size))
    return float(2.0 * np.abs((signal - np.mean(signal)) @ turns) ** 2 / signal.size)

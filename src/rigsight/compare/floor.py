"""The noise floor of an output, and noise like it: what an error is where a model has no fault."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

_SEGMENT = 256
"""Samples of a segment of Welch's method; a stretch that is shorter is one segment."""


@dataclass(frozen=True)
class Floor:
    """Noise floor of an output."""

    # Name of the output and its unit.
    output: str
    unit: str
    std: float  # standard deviation of what no model can explain
    method: str  # how it was found
    lower_bound: bool = False  # true if only part of the noise was seen
    # Pieces of noise alone, shape (n_samples,) each, with their sample time [s]. They give the spectrum of
    # the noise; without any it is taken for white.
    stretches: tuple[tuple[NDArray[np.float64], float], ...] = field(default=(), compare=False, repr=False)

    def noise(self, n_samples: int, dt: float, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return Gaussian noise of shape (n_samples,) with this standard deviation and the spectrum of the stretches."""
        white = rng.normal(size=n_samples)
        pieces = [(samples, step) for samples, step in self.stretches if np.ptp(samples) > 0.0]
        if not pieces:
            return self.std * white
        frequency = np.fft.rfftfreq(n_samples, dt)
        power = np.zeros_like(frequency)
        for samples, step in pieces:
            known, density = welch(samples, 1.0 / step, nperseg=min(_SEGMENT, samples.size))
            # Welch's method takes the mean away with the first lines; what is slower is as strong as the slowest it tells.
            power += samples.size * np.interp(frequency, known[1:], density[1:])
        colored = np.fft.irfft(np.sqrt(power) * np.fft.rfft(white), n_samples)
        return np.asarray(self.std * colored / np.std(colored))

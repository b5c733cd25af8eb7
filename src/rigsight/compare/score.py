"""A score of a comparison, the kinds of scores, and the noise floor beside them: what an error is where a model has no fault."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

Quantity = Literal["magnitude_rmse", "phase_rmse", "magnitude_db", "step_rmse", "free_run_nrmse"]

QUANTITIES: dict[Quantity, str] = {
    "magnitude_rmse": "RMSE (5.1) of the magnitude of the frequency response",
    "phase_rmse": "RMSE (5.1) of its phase",
    "magnitude_db": "RMS of the ratio of simulated to measured magnitude in dB",
    "step_rmse": "RMSE after the step, with the offset before it removed",
    "free_run_nrmse": "RMS(measured - simulated) / RMS(measured - mean) in free run",
}

_SEGMENT = 256
"""Samples of a segment of Welch's method; a stretch that is shorter is one segment."""


@dataclass(frozen=True)
class Column:
    """What is compared."""

    quantity: Quantity  # a key of `QUANTITIES`
    signal: str  # signal path (``"u -> psi"``) or output
    unit: str  # unit of the error


@dataclass(frozen=True)
class Score:
    """One error of one model on one record."""

    # Their names.
    model: str
    record: str
    column: Column  # what was compared
    value: float  # the error in the column's unit
    # What noise alone makes of it, in the same unit; None where the record does not show it.
    noise_floor: float | None
    n_values: int  # lines or samples that the error is of


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
            # Welch's method takes the mean away with the first lines; what is slower is as strong as the slowest it gives.
            power += samples.size * np.interp(frequency, known[1:], density[1:])
        colored = np.fft.irfft(np.sqrt(power) * np.fft.rfft(white), n_samples)
        return np.asarray(self.std * colored / np.std(colored))

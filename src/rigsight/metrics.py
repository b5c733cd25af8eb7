"""Formulas for errors between measured and simulated signals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

TWO_SIDED = 1.96
"""Standard deviations of a 95 % interval."""


def rms(signal: NDArray[np.float64]) -> float:
    """Return the root mean square of a signal of shape (n_samples,)."""
    return float(np.sqrt(np.mean(np.square(signal))))


def nrmse(residuals: NDArray[np.float64], measured: NDArray[np.float64]) -> float:
    """Return RMS(residuals) / RMS(measured - mean), both of shape (n_samples,).

    A constant measured signal has no scale; the result is then infinite unless the residuals vanish.
    """
    spread = float(np.std(measured))
    error = rms(residuals)
    if spread == 0.0:
        return 0.0 if error == 0.0 else float("inf")
    return error / spread

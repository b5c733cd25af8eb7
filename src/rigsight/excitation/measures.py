"""Measures of how well an input uses its amplitude and its time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError


def crest_factor(signal: NDArray[np.float64]) -> float:
    """Return the peak over the root mean square of a signal of shape (n_samples,); a sine has the square root of 2.

    Raises
    ------
    InputError
        If the signal is zero everywhere.
    """
    effective = math.sqrt(float(np.mean(np.square(signal))))
    if effective == 0.0:
        raise InputError("A signal that is zero everywhere has no crest factor.")
    return float(np.max(np.abs(signal))) / effective


def time_bandwidth_product(duration: float, omega_start: float, omega_stop: float) -> float:
    """Return duration [s] times the swept band, ``T |f_1 - f_0|``, from angular frequencies [rad/s].

    Above some 100 the magnitude of a linear sweep's spectrum is nearly flat within the band and falls off sharply beside it
    (thesis, section 2.1.3).
    """
    return duration * abs(omega_stop - omega_start) / (2.0 * math.pi)

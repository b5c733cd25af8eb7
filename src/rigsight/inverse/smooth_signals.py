"""A smooth signal at other times, and its derivative."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import savgol_filter

from rigsight.records.record import Floats

_DEGREE = 5
"""Of the spline through the samples."""
_NEAR = 9
"""Samples through which a polynomial is laid for a derivative: exact to 1e-4 up to a ninth of the sample rate."""


def shifted(signal: Floats, dt: float, ahead: float) -> Floats:
    """Return a signal, shape (n_samples,), at times that are ahead by so much; beyond its ends it stays as it is."""
    time = np.arange(signal.size) * dt
    smooth = make_interp_spline(time, signal, k=min(_DEGREE, signal.size - 1))
    return np.asarray(smooth(np.clip(time + ahead, 0.0, time[-1])))


def slope(rows: Floats, dt: float) -> Floats:
    """Return the derivative of rows, shape (.., n_samples), with respect to time."""
    n = rows.shape[-1]
    near = min(_NEAR, n - 1 + n % 2)
    return np.asarray(savgol_filter(rows, near, near - 1, deriv=1, delta=dt, axis=-1))

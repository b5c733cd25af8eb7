"""Rows of a regression from a record: integrals with smooth test functions (the weak form), or single points.

In the weak form every row is an integral over a window. Derivatives are moved to the test function by integration by parts, so
that measured signals are not differentiated.

References
----------
D. A. Messenger and D. M. Bortz, "Weak SINDy", Multiscale Model. Simul. 19 (2021) 1474.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rigsight.discover.motion import Motion
from rigsight.records.record import Floats

_POWER = 5
"""Of the test function (1 - s^2)^p; its first four derivatives vanish at the ends of the window."""
_ROWS_PER_WINDOW = 4
_LEAST_WIDTH = 11


@dataclass(frozen=True, eq=False)
class Windows:
    """Test functions for one sample time."""

    # Test function and its first two derivatives with respect to time, integration weights included, shape (3, width).
    weights: Floats
    step: int  # samples from row to row

    def against(self, signal: Floats, order: int) -> Floats:
        """Return the integrals of a signal with the test function or one of its derivatives, shape (n_rows,).

        There are none if the signal is shorter than a window.
        """
        if signal.size < self.weights.shape[1]:
            # numpy would exchange the two, and slide the signal along the test function.
            return np.zeros(0)
        return np.asarray(np.correlate(signal, self.weights[order], "valid")[:: self.step])


@dataclass(frozen=True)
class Rows:
    """How signals of records, each with its own sample time, are turned into rows."""

    width: float | None  # width of the windows [s]; None for point-wise rows
    step: int = 1  # samples from row to row of point-wise rows

    @classmethod
    def weak(cls, width: float) -> Rows:
        """Make windows of `width` [s]."""
        return cls(width)

    @classmethod
    def pointwise(cls, step: int = 1) -> Rows:
        """Make a row of every `step`-th sample."""
        return cls(None, step)

    def of(self, signal: Floats, dt: float) -> Floats:
        """Return the rows of a signal of shape (n_samples,)."""
        return signal[:: self.step] if self.width is None else windows(self.width, dt).against(signal, 0)

    def rate_of(self, signal: Floats, dt: float) -> Floats:
        """Return the rows of the derivative of a signal."""
        if self.width is None:
            return np.asarray(np.gradient(signal, dt)[:: self.step])
        return -windows(self.width, dt).against(signal, 1)

    def velocity(self, motion: Motion) -> Floats:
        """Return the rows of the velocity."""
        if self.width is None:
            return motion.v[:: self.step]
        return -windows(self.width, motion.dt).against(motion.x, 1)

    def acceleration(self, motion: Motion) -> Floats:
        """Return the rows of the acceleration."""
        if self.width is None:
            return motion.acceleration[:: self.step]
        return windows(self.width, motion.dt).against(motion.measured, 2)

    def independent_share(self, order: int, dt: float) -> float:
        """Return the number of independent rows per row, less than 1 if windows overlap."""
        if self.width is None:
            return 1.0
        found = windows(self.width, dt)
        own = found.weights[order]
        products = np.correlate(own, own, "full") / np.sum(own**2)
        lags = products[own.size - 1 :: found.step][1:]
        return float(1.0 / (1.0 + 2.0 * np.sum(lags**2)))


@lru_cache(maxsize=64)
def windows(width: float, dt: float) -> Windows:
    """Return test functions of a width [s] at a sample time."""
    half = max(round(width / dt), _LEAST_WIDTH) // 2
    s = np.arange(-half, half + 1) / (half + 1)
    rate = 1.0 / ((half + 1) * dt)
    inside = 1.0 - s**2
    value = inside**_POWER
    slope = -2.0 * _POWER * s * inside ** (_POWER - 1) * rate
    bend = 2.0 * _POWER * inside ** (_POWER - 2) * (2.0 * (_POWER - 1) * s**2 - inside) * rate**2
    # Rows of unit integral, so that a row is the mean of a signal over its window.
    weights = np.array([value, slope, bend]) / np.sum(value)
    weights.setflags(write=False)
    return Windows(weights, max(1, (2 * half + 1) // _ROWS_PER_WINDOW))

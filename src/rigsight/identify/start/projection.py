"""Informative spectral lines of stretches of a record, and the signals there: windowed Fourier integrals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.rig_equations import RigEquations
from rigsight.identify.start.measured_states import MeasuredStates
from rigsight.records.record import Floats, Record

Complexes = NDArray[np.complex128]

_STRETCHES = 4
"""Length of a record in units of a stretch; stretches overlap by half."""
_SHORTEST = 64
"""Smallest number of samples of a stretch."""
SIGNIFICANT_POWER = 25.0
"""Power over that of the noise above which a line of a sensor is informative."""
_BAND_OF_SUMS = 0.5
"""Share of the band below half the sampling rate in which sums approximate the integrals."""
_LEAST_NOISE = 1e-6
"""Noise assumed for a sensor without visible noise, relative to its size."""


@dataclass(frozen=True)
class Projection:
    """Integrals of signals times a window and ``e^{-j omega t}`` over stretches of a record."""

    omega: Floats  # angular frequencies [rad/s], shape (n_points,)
    # Index of the stretch and of the line of each point, shape (n_points,).
    stretch: NDArray[np.intp]
    line: NDArray[np.intp]
    # First samples of the stretches, and their number of samples.
    starts: NDArray[np.intp]
    length: int
    dt: float  # sample time [s]

    def of(self, signal: Floats) -> Complexes:
        """Return the integrals of a signal."""
        return self._lines(signal, np.sin(np.pi * np.arange(self.length) / self.length) ** 2)

    def of_rate(self, signal: Floats) -> Complexes:
        """Return the integrals of the derivative of a signal, by integration by parts."""
        phase, rate = 2.0 * np.pi * np.arange(self.length) / self.length, np.pi / (self.length * self.dt)
        return 1j * self.omega * self.of(signal) - self._lines(signal, rate * np.sin(phase))

    def _lines(self, signal: Floats, window: Floats) -> Complexes:
        cut = signal[self.starts[:, None] + np.arange(self.length)] * window
        return np.asarray(np.fft.rfft(cut, axis=1)[self.stretch, self.line])


def projected(
    equations: RigEquations, record: Record, measured: MeasuredStates, most: int
) -> tuple[Projection, Floats]:
    """Return the projection on informative lines, and the power of each sensor's noise on a line, shape (n_sensors,)."""
    n_samples = record.n_samples
    length = min(max(n_samples // _STRETCHES, _SHORTEST), n_samples)
    starts = np.unique(np.linspace(0, n_samples - length, max(1, 2 * n_samples // length - 1)).astype(int))
    stretch, line = (a.ravel() for a in np.indices((starts.size, length // 2 + 1)))
    omega: Floats = np.asarray(2.0 * np.pi * line / (length * record.dt), dtype=np.float64)
    every = Projection(omega, stretch, line, starts, length, record.dt)
    floors = np.zeros(len(equations.sensor_names))
    says = np.zeros(omega.size, dtype=bool)
    for i, name in enumerate(equations.sensor_names):
        if name in record:
            power = np.abs(every.of(record[name] - np.mean(record[name]))) ** 2
            quiet = power[line > 0.9 * (length // 2)]
            floors[i] = max(float(np.median(quiet)) / np.log(2.0), (_LEAST_NOISE**2) * float(np.mean(power)))
            says |= power > SIGNIFICANT_POWER * floors[i]
    for source in equations.rig.inputs:
        power = np.abs(every.of(record[source.name] - np.mean(record[source.name]))) ** 2
        says |= power > SIGNIFICANT_POWER * _LEAST_NOISE * np.max(power)
    # The first two lines of a signal that is known only up to a constant are not used; the window spreads the constant over them.
    first = 2 if measured.is_integrated else 0
    kept = np.flatnonzero(says & (line >= first) & (omega < _BAND_OF_SUMS * np.pi / record.dt))
    if kept.size == 0:
        kept = np.flatnonzero((line >= first) & (omega < _BAND_OF_SUMS * np.pi / record.dt))
    kept = kept[:: max(1, kept.size // most)]
    return Projection(omega[kept], stretch[kept], line[kept], starts, length, record.dt), floors

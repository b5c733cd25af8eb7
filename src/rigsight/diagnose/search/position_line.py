"""Position-periodic effects: a line in the residual spectrum over position.

At changing speed a force that is periodic in position has no line in a spectrum over time. The response of an output to a force
``a sin(kappa s) + b cos(kappa s)`` along the measured position s follows from the linear equations: for each wave number, a
regression with coefficients common to all records. Fits start from the wave numbers that explain the largest share.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.policy import SEARCH

Floats = NDArray[np.float64]
Law = Callable[[Floats, float], Sequence[Floats]]
"""Parts of a force (or an error) along a way at a wave number, shape (n_samples,) each, one for each coefficient."""
Answer = Callable[[Floats], NDArray[np.complex128]]
"""Answer of the output to that force over the angular frequency."""


@dataclass(frozen=True)
class Run:
    """Position along a record and the residual of a model there, shape (n_samples,) each; `dt` is its sample time [s]."""

    way: Floats
    remainder: Floats
    dt: float


@dataclass(frozen=True)
class Line:
    """A wave number with the coefficients of the law's parts, and the share of the squared residual that it explains."""

    wave_number: float
    coefficients: tuple[float, ...]
    share: float


def position_lines(law: Law, runs: Sequence[Run], response: Answer, count: int = 2) -> list[Line]:
    """Return the lines that explain most, best first."""
    share = max(SEARCH.most_wave_samples // max(len(runs), 1), 64)
    runs = [_liveliest(run, share) for run in runs]
    spans = [float(np.ptp(run.way)) for run in runs]
    span = max(spans, default=0.0)
    steps = np.concatenate([np.abs(np.diff(run.way)) for run in runs]) if runs else np.zeros(0)
    if span <= 0.0 or not np.any(steps > 0.0):
        return []
    # Two samples tell a wave at the speed that nine tenths of them do not exceed.
    shortest = 2.0 * max(float(np.quantile(steps, 0.9)), span / SEARCH.most_waves / 2.0)
    waves = np.arange(
        1.0, max(span / shortest, 1.0) + 1.0 / SEARCH.waves_per_line, 1.0 / SEARCH.waves_per_line
    )
    spectra = [_Spectrum(run, response) for run in runs]
    lines = [_line(law, spectra, float(wave)) for wave in 2.0 * np.pi * waves / span]
    shares = np.array([line.share for line in lines])
    around = np.pad(shares, 1, constant_values=-1.0)
    peaks = np.flatnonzero((shares >= around[:-2]) & (shares > around[2:]))
    return [lines[i] for i in sorted(peaks, key=lambda i: -shares[i])[:count]]


class _Spectrum:
    """Spectrum of the residual of a run, and that of a force along its position."""

    def __init__(self, run: Run, response: Answer) -> None:
        n = run.way.size
        self._window = np.hanning(n)
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(n, run.dt), dtype=np.float64)
        self._used = slice(SEARCH.lowest_line, None)
        self.way = run.way
        remainder = self._over_frequency(run.remainder)
        # Without weights the few lowest lines, of drift and of forces that are wrong elsewhere, would decide alone.
        size = np.asarray(
            np.sqrt(uniform_filter1d(np.abs(remainder) ** 2, SEARCH.wave_smoothing, mode="nearest"))
        )
        self._weight = 1.0 / np.maximum(size, 1e-12 * np.max(size, initial=1e-300))
        self._response = response(np.asarray(omega[self._used], dtype=np.float64)) * self._weight
        self.remainder = remainder * self._weight

    def _over_frequency(self, samples: Floats) -> NDArray[np.complex128]:
        tapered = self._window * (samples - np.mean(samples))
        return np.asarray(np.fft.rfft(tapered)[self._used] / np.sqrt(samples.size))

    def of(self, force: Floats) -> NDArray[np.complex128]:
        """Return the answer to a force."""
        return np.asarray(self._over_frequency(force) * self._response)


def _line(law: Law, spectra: Sequence[_Spectrum], wave_number: float) -> Line:
    normal, gradient, total = 0.0, 0.0, 0.0
    for spectrum in spectra:
        columns = np.array([spectrum.of(part) for part in law(spectrum.way, wave_number)])
        normal = normal + np.real(columns.conj() @ columns.T)
        gradient = gradient + np.real(columns.conj() @ spectrum.remainder)
        total += float(np.sum(np.abs(spectrum.remainder) ** 2))
    found = np.linalg.lstsq(np.atleast_2d(normal), np.atleast_1d(gradient), rcond=None)[0]
    share = float(found @ np.atleast_1d(gradient)) / total if total > 0.0 else 0.0
    return Line(wave_number, tuple(map(float, found)), share)


def _liveliest(run: Run, n_samples: int) -> Run:
    if run.way.size <= n_samples:
        return run
    energy = np.cumsum(np.r_[0.0, (run.remainder - np.mean(run.remainder)) ** 2])
    start = int(np.argmax(energy[n_samples:] - energy[:-n_samples]))
    stop = start + n_samples
    return Run(run.way[start:stop], run.remainder[start:stop], run.dt)
